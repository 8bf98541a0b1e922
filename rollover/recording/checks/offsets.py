"""Channels that should read nothing before the first contact, and ground that can only push."""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping

import numpy as np

from rollover.recording.checks.finding import Finding, Trace
from rollover.spec.channels import describe

CLEAR = 5.0  # standard errors: a noise level that is a third too small leaves 3.3 of them, 1 in 1000
ONSET = 6.0  # noise levels beyond which something has begun: 1 in 5e8 by chance at each sample
FEWEST = 10  # samples before it that say what is read there
STANDS_OUT = 3.0  # times what is read before, that the load rises to: less may be a weight that rests on it
NEAR = 0.3  # of the weight: what reads so much may carry it
RECTIFIED = 3.0  # deviations: what never falls below 0 and stays within is the size of noise
LEAST = 2.0  # independent samples
MARGIN = 0.2  # of the stretch, at its end: what is filtered begins to rise before the impact

_DROP = re.compile(r"ground/(force_normal|force_tangential|sinkage)")
_ANY = re.compile(r"rops/(force(_[xyz])?|deflection)|device/(force|deflection)")
VEHICLE = ("chassis/", "wheel/", "rops/", "axle/")
PUSHED = re.compile(r"ground/force_normal|wheel/[^/]+/force_normal")


def before_contact(t: Trace) -> slice | None:
    """The stretch from the start on in which a channel stays within its noise, if something follows; else None."""
    sigma = t.floor.sigma
    x = t.values
    level = float(np.median(x[:FEWEST]))
    spread = max(ONSET * sigma, 1e-9 * float(np.abs(x).max()))
    beyond = np.abs(x - level) > spread
    begun = np.flatnonzero(beyond[:-1] & beyond[1:])  # one alone is a spike
    if not begun.size:
        return None
    count = int((1.0 - MARGIN) * begun[0])
    if count < max(FEWEST, LEAST * t.floor.independence):
        return None
    inside = x[:count]
    half = count // 2
    apart = float(inside[half:].mean() - inside[:half].mean())
    if abs(apart) > 3.0 * t.floor.of_mean(half) * np.sqrt(2.0) + 1e-12 * abs(level):
        return None  # it moves
    return slice(0, count)


def zero_offsets(
    traces: Mapping[str, Trace], mass: float | None, gravity: float, stated: set[str]
) -> Iterator[Finding]:
    """Channels that carry nothing before the first contact, and read something there; not those already `stated`.

    In a drop the load cell and the depth, in any test what loads a ROPS or measures how it gives way.
    """
    is_drop = not any(name.startswith(VEHICLE) for name in traces)
    for name, t in traces.items():
        if name in stated or not (_ANY.fullmatch(name) or (is_drop and _DROP.fullmatch(name))):
            continue
        where = before_contact(t)
        if where is None:
            continue
        count = where.stop - where.start
        x = t.values[where]
        mean, error = float(x.mean()), max(t.floor.of_mean(count), float(x.std()) / np.sqrt(count))
        weight = mass * gravity if mass is not None and name == "ground/force_normal" else None
        if abs(mean) <= CLEAR * error or float(np.abs(t.values).max()) < STANDS_OUT * abs(mean):
            continue
        if float(x.min()) >= 0.0 and mean < RECTIFIED * float(x.std()):
            continue
        if weight is not None and abs(mean - weight) < NEAR * weight:
            continue
        unit = describe(name).unit
        yield Finding(
            check="zero-offset",
            channel=name,
            start=float(t.time[0]),
            end=float(t.time[where.stop - 1]),
            value=mean,
            unit=unit,
            error=error,
            sentence=f"reads {mean:.4g} +- {error:.2g} {unit} before the first contact, where it should read 0: "
            "a zero offset, or something touches already",
        )


def polarity(t: Trace, unit: str) -> Iterator[Finding]:
    """A force of the ground that pulls: nothing sticks to the ground with more than it is pushed by."""
    if not PUSHED.fullmatch(t.channel):
        return
    least, most = float(t.values.min()), float(t.values.max())
    if -least > 20.0 * t.floor.sigma and -least > STANDS_OUT * max(most, 0.0):
        i = int(np.argmin(t.values))
        yield Finding(
            check="polarity",
            channel=t.channel,
            start=float(t.time[i]),
            end=float(t.time[i]),
            value=least,
            unit=unit,
            error=t.floor.sigma,
            sentence=f"goes down to {least:.4g} {unit}, and the ground can only push: its polarity is reversed "
            "(scale: -1 turns it)",
        )

"""Recordings made from a simulation as instruments would have made them: sampled, filtered, late, with white noise."""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from rollover.dynamics import simulate
from rollover.dynamics.result import Run
from rollover.recording import Recording
from rollover.recording.filters import filtered
from rollover.scenario import Scenario, given
from rollover.spec import document
from rollover.system.arguments import MOST_LATE, within
from rollover.system.errors import Fault, InputError, hint

DROP = ("ground/force_normal", "ground/sinkage", "striker/acceleration_z")
SIDEWAYS = (
    "chassis/roll",
    "chassis/angular_velocity_x",
    "chassis/acceleration_y",
    "chassis/acceleration_z",
    "rops/force",
)
BACKWARD = (
    "chassis/pitch",
    "chassis/angular_velocity_y",
    "chassis/acceleration_x",
    "chassis/acceleration_z",
    "rops/force",
)


def usual(simulated: Recording) -> tuple[str, ...]:
    """Channels that such a test usually records: of a vehicle those of the axis it turns about, x or y."""
    if DROP[-1] in simulated.channels:
        return DROP
    x, y = (float(np.ptp(simulated[kind[1]])) for kind in (SIDEWAYS, BACKWARD))
    return tuple(c for c in (BACKWARD if y > x else SIDEWAYS) if c in simulated.channels)


def check_clock(rate: float, late: float) -> None:
    """Refuse a clock so late that a double cannot tell its stamps at `rate` Hz apart. Raises `InputError`."""
    if np.spacing(abs(late)) * rate > 0.25:  # of a step: they are also rounded to a ns
        message = f"stamps cannot be distinguished at {rate:g} Hz, got {late:g} s; a lower rate, or a clock less late"
        raise InputError(Fault(path="late", message=f"{message} is needed"))


def synthetic(
    simulated: Recording,
    *,
    channels: Sequence[str],
    rate: float,
    share: float = 0.005,
    sigmas: Mapping[str, float] | None = None,
    cfc: int | None = None,
    late: float = 0.0,
    seed: int = 0,
    conditions: Mapping[str, Any] | None = None,
) -> Recording:
    """Record some channels at `rate` Hz with white Gaussian noise.

    1 sigma is `share` of a channel's range, or what `sigmas` says in SI; it is stated in the recording. `cfc` is
    applied to the signal before the noise comes in; `late` s by which the clock is late. The same `seed` gives the
    same recording. Raises ``ValueError`` for a channel that was not simulated and a rate too low for the class.
    """
    given = dict(sigmas or {})
    for name in (*channels, *given):
        if name not in simulated.channels:
            raise ValueError(f"channel: not simulated, got {name!r}; {hint(name, simulated.channels)}")
    step = float(np.median(np.diff(simulated.time)))
    count = int(np.floor((simulated.time[-1] - simulated.time[0]) * rate + 1e-6)) + 1
    time = simulated.time[0] + np.arange(count) / rate
    made, noise = {}, {}
    for k, name in enumerate(channels):
        values = simulated[name] if cfc is None else filtered(simulated[name], step, cfc)
        noise[name] = given.get(name, share * float(np.ptp(values)))
        random = np.random.default_rng([seed, k]).normal(size=count)
        with np.errstate(over="ignore"):
            made[name] = np.interp(time, simulated.time, values) + noise[name] * random
        if not np.all(np.isfinite(made[name])):
            raise ValueError(f"noise: beyond all numbers, got {noise[name]:g} for {name}; a smaller one is needed")
    return Recording(
        title=f"Synthetic recording of: {simulated.title}",
        source=f"rollover synthesize, seed {seed}",
        time=np.round(time + late, 9),
        channels=made,
        conditions=dict(conditions or {}),
        noise={name: sigma for name, sigma in noise.items() if sigma > 0.0},
        cfc=dict.fromkeys(channels, cfc) if cfc is not None else {},
    )


def instrumented(
    run: Run,
    stated: Collection[str],
    *,
    channels: Sequence[str] | None = None,
    rate: float = 1000.0,
    share: float = 0.005,
    sigmas: Mapping[str, float] | None = None,
    cfc: int | None = None,
    late: float = 0.0,
    seed: int = 0,
    by: str = "synthesize",
) -> Recording:
    """A run as instruments would have recorded it, see `synthetic`; `stated` paths are its conditions.

    `channels` None: the usual ones. Raises `InputError`, of which `by` is the origin.
    """
    try:
        return synthetic(
            run.recording,
            channels=tuple(channels) if channels else usual(run.recording),
            rate=rate,
            share=share,
            sigmas=sigmas,
            cfc=cfc,
            late=late,
            seed=seed,
            conditions={leaf.path: leaf.value for leaf in document.paths(run.scenario) if leaf.path in stated},
        )
    except ValueError as e:
        raise InputError(Fault(file=by, message=str(e))) from None


def synthesize(
    scenario: str | Path | Scenario,
    stated: Mapping[str, object] | None = None,
    *,
    hidden: Mapping[str, object] | None = None,
    channels: Sequence[str] = (),
    rate: float = 1000.0,
    noise: float = 0.005,
    sigmas: Mapping[str, float] | None = None,
    cfc: int | None = None,
    late: float = 0.0,
    seed: int = 0,
) -> Recording:
    """Simulate a scenario, and record what instruments with noise would have recorded of it.

    Parameters
    ----------
    scenario
        Scenario, or the path or name of one.
    stated
        Values by path that are replaced, and stand among the recording's conditions.
    hidden
        Values by path that are replaced, and do not.
    channels
        What is recorded; none: the usual ones.
    rate
        Sampling rate, 1 to 1e6 Hz.
    noise
        White noise, 1 sigma as a share of each channel's range.
    sigmas
        1 sigma (SI) for some channels instead.
    cfc
        Filter class (SAE J211) that the instruments apply.
    late
        How late their clock is, s.
    seed
        Of the noise.

    Returns
    -------
    Recording
        Channels over time (SI).

    Raises
    ------
    InputError
        For wrong input, an unknown channel, a rate too low for the filter class.
    RuntimeError
        Where the simulation failed.
    """
    within("rate", rate, 1.0, 1e6)
    within("seed", seed, 0)
    within("late", late, -MOST_LATE, MOST_LATE)
    check_clock(rate, late)
    for name, sigma in {"noise": noise, **(sigmas or {})}.items():
        within(name, sigma, 0.0)
    base, file = given(scenario)
    chosen = base.replaced(stated or {}, origin="stated").replaced(hidden or {}, origin="hidden")
    with document.named(file):
        done = simulate.run(chosen)
    if done.status == "failed":
        raise RuntimeError(f"the simulation failed: {done.sentence}")
    return instrumented(
        done, stated or {}, channels=channels, rate=rate, share=noise, sigmas=sigmas, cfc=cfc, late=late, seed=seed
    )

"""Foreign forms of what an instrument does: lags of other orders, gains and scales that are not quite constant."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any

import numpy as np
from numpy.typing import NDArray

from rollover.proof.campaign import ACCELERATION, DEPTH, FORCE, PLACE, SPEED, log_uniform
from rollover.proof.forms import Form, uniform
from rollover.proof.instruments import lagged
from rollover.proof.library import MOST_CHANNELS, Change, Random, Setting

Array = NDArray[np.float64]
Drawn = tuple[dict[str, float], dict[str, Any]]
START = -0.09  # s, about where recordings begin


def _form(name: str, source: str, channels: tuple[str, ...], draw: Callable[[Random, Setting, str], Drawn]) -> Form:
    def made(random: Random, s: Setting, id: str) -> Change:
        channel = str(random.choice([c for c in s.channels if c in channels]))
        parameters, fault = draw(random, s, channel)
        return Change(id=id, kind="sensor", parameters=parameters, channel=channel, fault=fault)

    return Form(name=name, source=source, draw=made)


def _lag(random: Random) -> float:
    return log_uniform(random, 6e-4, 1.2e-2)


def _averaging(random: Random, s: Setting, channel: str) -> Drawn:
    """The mean over a time that has passed."""
    lasts = 2.0 * _lag(random)

    def response(x: Array, t: Array) -> Array:
        area = np.concatenate(([0.0], np.cumsum(0.5 * (x[1:] + x[:-1]) * np.diff(t))))
        before = np.where(t - lasts < t[0], area[0] + x[0] * (t - lasts - t[0]), np.interp(t - lasts, t, area))
        return np.asarray((area - before) / lasts)

    return {"window": lasts}, {"lag": 0.5 * lasts, "response": response}


def _dead_time(random: Random, s: Setting, channel: str) -> Drawn:
    """A lag of first order behind a dead time."""
    tau, dead = _lag(random), uniform(random, 0.4, 1.2)

    def response(x: Array, t: Array) -> Array:
        return np.asarray(np.interp(t - dead * tau, t, np.real(lagged(x, t, tau))))

    return {"lag": tau, "dead_time": dead * tau}, {"lag": tau, "response": response}


def _third_order(random: Random, s: Setting, channel: str) -> Drawn:
    """Three lags of first order in series."""
    tau = 0.5 * _lag(random)

    def response(x: Array, t: Array) -> Array:
        for _ in range(3):
            x = np.asarray(np.real(lagged(x, t, tau)))
        return x

    return {"each": tau}, {"lag": tau, "response": response}


def _off(random: Random) -> float:
    """Share by which a gain is off."""
    return log_uniform(random, 0.004, 0.1) * float(random.choice((-1.0, 1.0)))


def _saturating(random: Random, s: Setting, channel: str) -> Drawn:
    """Its gain is off by e for small values, by a part of that at the peak."""
    e, fades, peak = _off(random), uniform(random, 0.3, 0.6), s.peaks[channel]
    return (
        {"off": e, "fading": fades},
        {"bend": lambda x, t: x * (1.0 + e * (1.0 - fades * np.minimum(np.abs(x) / peak, 1.0)))},
    )


def _creeping(random: Random, s: Setting, channel: str) -> Drawn:
    """Its gain goes on to creep after the load has come."""
    e, later, tau = _off(random), uniform(random, 0.3, 0.6), uniform(random, 0.05, 0.2)

    def bend(x: Array, t: Array) -> Array:
        return np.asarray(x * (1.0 + e * (1.0 - later * np.exp(-np.maximum(t, 0.0) / tau))))

    return {"off": e, "later": later, "time": tau}, {"bend": bend}


def _hysteretic(random: Random, s: Setting, channel: str) -> Drawn:
    """Its gain is less on the way up than on the way down, as far as it had been up."""
    e, part, peak = _off(random), uniform(random, 0.3, 0.6), s.peaks[channel]

    def bend(x: Array, t: Array) -> Array:
        highest = np.maximum.accumulate(np.abs(np.nan_to_num(x)))
        back = (highest - np.abs(x)) / peak
        return np.asarray(x * (1.0 + e * (1.0 - part + part * np.tanh(4.0 * back))))

    return {"off": e, "part": part}, {"bend": bend}


def _string(random: Random, s: Setting, channel: str) -> Drawn:
    """A draw wire that does not run along the way: sqrt((h + x)^2 + a^2) - sqrt(h^2 + a^2), and a scale."""
    e, beside = _off(random), uniform(random, 0.08, 0.16)

    def bend(x: Array, t: Array) -> Array:
        return np.asarray((1.0 + e) * (np.hypot(0.5 + x, beside) - math.hypot(0.5, beside)))

    return {"off": e, "beside": beside}, {"bend": bend}


def _bias(random: Random, s: Setting, channel: str) -> float:
    return s.spans[channel] * log_uniform(random, 0.002, 0.06) * float(random.choice((-1.0, 1.0)))


def _warming(random: Random, s: Setting, channel: str) -> Drawn:
    """A zero that is still on its way when the recording begins."""
    b, part, tau = _bias(random, s, channel), uniform(random, 0.3, 0.6), uniform(random, 0.15, 0.5)

    def bend(x: Array, t: Array) -> Array:
        return np.asarray(x + b * (1.0 - part * np.exp(-(t - START) / tau)))

    return {"offset": b, "part": part, "time": tau}, {"bend": bend}


def _running(random: Random, s: Setting, channel: str) -> Drawn:
    """A zero that runs away."""
    b, part = _bias(random, s, channel), uniform(random, 0.3, 0.8)
    return {"offset": b, "part": part}, {"bend": lambda x, t: x + b * (1.0 + part * (t - 0.2) / 0.4)}


def _wandering(random: Random, s: Setting, channel: str) -> Drawn:
    """A zero that wanders."""
    b, part, period = _bias(random, s, channel), uniform(random, 0.2, 0.5), uniform(random, 0.4, 1.2)
    phase = uniform(random, 0.0, 2.0 * math.pi)

    def bend(x: Array, t: Array) -> Array:
        return np.asarray(x + b * (1.0 + part * np.sin(2.0 * math.pi * t / period + phase)))

    return {"offset": b, "part": part, "period": period, "phase": phase}, {"bend": bend}


def _limit(random: Random, s: Setting, channel: str) -> float:
    return s.peaks[channel] * uniform(random, 0.5, 0.9)


def _soft_knee(random: Random, s: Setting, channel: str) -> Drawn:
    """x/(1 + |x/L|^n)^(1/n): an amplifier that runs into its supply."""
    most, n = _limit(random, s, channel), uniform(random, 5.0, 14.0)
    return {"level": most, "knee": n}, {"bend": lambda x, t: x / (1.0 + np.abs(x / most) ** n) ** (1.0 / n)}


def _compressing(random: Random, s: Setting, channel: str) -> Drawn:
    """Beyond the limit a tenth to a quarter of what is."""
    most, slope = _limit(random, s, channel), uniform(random, 0.1, 0.25)

    def bend(x: Array, t: Array) -> Array:
        size = np.abs(x)
        return np.asarray(np.sign(x) * np.where(size > most, most + slope * (size - most), size))

    return {"level": most, "slope": slope}, {"bend": bend}


def _blocking(random: Random, s: Setting, channel: str) -> Drawn:
    """At the limit it stays for some milliseconds after the overload."""
    most, stays = _limit(random, s, channel), uniform(random, 0.004, 0.02)

    def bend(x: Array, t: Array) -> Array:
        over = np.nonzero(np.abs(np.nan_to_num(x)) > most)[0]
        last = np.full(t.size, -math.inf)
        sign = np.zeros(t.size)
        if over.size:
            which = np.searchsorted(over, np.arange(t.size), side="right") - 1
            seen = which >= 0
            last[seen], sign[seen] = t[over[which[seen]]], np.sign(x[over[which[seen]]])
        return np.asarray(np.where(t - last <= stays, sign * most, x))

    return {"level": most, "stays": stays}, {"bend": bend}


AMPLIFIED, LENGTHS = (FORCE, ACCELERATION, SPEED), (DEPTH, PLACE)
LOAD_CELL = "creep and hysteresis of load cells, OIML R 60"
SENSORS: dict[str, tuple[Form, ...]] = {
    "sensor-lag": (
        _form("moving-average", "averaging converters, Smith, DSP 1997, ch. 15", MOST_CHANNELS, _averaging),
        _form("dead-time-and-lag", "first order plus dead time, Ziegler, Nichols 1942", MOST_CHANNELS, _dead_time),
        _form("third-order", "lags in series, Oppenheim, Willsky 1983", MOST_CHANNELS, _third_order),
    ),
    "sensor-gain": (
        _form("saturating", "non-linearity of amplifiers, IEC 60770-1", AMPLIFIED, _saturating),
        _form("creeping", LOAD_CELL, AMPLIFIED, _creeping),
        _form("hysteretic", LOAD_CELL, AMPLIFIED, _hysteretic),
    ),
    "sensor-scale": (
        _form("wire-at-an-angle", "geometry of a draw wire", LENGTHS, _string),
        _form("saturating", "non-linearity of displacement sensors, IEC 60770-1", LENGTHS, _saturating),
        _form("hysteretic", "backlash of a potentiometer's track, softened", LENGTHS, _hysteretic),
    ),
    "sensor-bias": (
        _form("warming-up", "zero of a bridge after switching on, OIML R 60", MOST_CHANNELS, _warming),
        _form("running", "linear drift of the zero, VDI/VDE 2600", MOST_CHANNELS, _running),
        _form("wandering", "slow noise of the zero", MOST_CHANNELS, _wandering),
    ),
    "sensor-clipping": (
        _form("soft-knee", "Rapp, ESA SP-332 (1991) 179: solid state amplifiers", (FORCE, ACCELERATION, DEPTH),
              _soft_knee),
        _form("compressing", "limiter with a slope, piecewise linear", (FORCE, ACCELERATION, DEPTH), _compressing),
        _form("blocking", "recovery of a charge amplifier from overload", (FORCE, ACCELERATION, DEPTH), _blocking),
    ),
}  # fmt: skip

"""What the instruments make of a drop: y = clip(G (h x)((1 - e) t - t_0) + b), and noise with a colour.

Clocks are read off the solution itself, not shifted samples; the lag is solved on a grid much finer than its time.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from rollover.proof.reference_solver import Descent

Array = NDArray[np.float64]
Response = Callable[[Array, Array], Array]  # (x, grid) -> y at the grid's times (n,), s
Frame = Callable[[Array, str], Array]  # (times, channel) -> share by which it is off (n,)
Bend = Callable[[Array, Array], Array]  # (values, times) -> values (n,)
PAD = 0.06  # s before and behind a record that a filter sees, so that the record has no filter's edge in it


@dataclass(frozen=True, kw_only=True)
class Fault:
    """What is wrong with one channel; the defaults: nothing. The second part is in no table of effects."""

    lag: float = 0.0  # s
    second_order: float = 0.0  # beta of y + lag y' + beta lag^2 y'' = x
    gain: float = 1.0
    offset: float = 0.0  # s late
    drift: float = 0.0  # s late per s
    bias: float = 0.0
    limit: float = math.inf
    warming: float = 0.0  # gain 1 + warming/(1 + exp(-(t - middle)/width))
    middle: float = 0.0
    width: float = 1.0
    hum: float = 0.0  # amplitude
    frequency: float = 50.0
    phase: float = 0.0
    quantum: float = 0.0
    curved: float = 0.0  # y = x (1 + curved |x|)
    dropouts: float = 0.0  # per second, of `lasting` s, in which the channel reads nothing
    lasting: float = 0.003
    response: Response | None = None  # in place of the lag's differential equation
    bend: Bend | None = None  # of what is read, before gain and bias


@dataclass(frozen=True, kw_only=True)
class Noise:
    """Gaussian, `sigma` in the channel's unit; x_t = colour x_(t-1) + e_t, or behind a filter class."""

    sigma: float
    colour: float = 0.0
    cfc: int = 0

    def drawn(self, count: int, step: float, random: np.random.Generator) -> Array:
        """`count` values, (count,)."""
        from scipy.signal import lfilter

        lead = 400
        white = random.standard_normal(count + 2 * lead)
        if self.cfc:
            # an estimate of the level from a thousand times as many samples would be no better: the filter's own
            shaped = channel_filter(white, step, self.cfc) / math.sqrt(_power(step, self.cfc))
        elif self.colour:
            shaped = lfilter([math.sqrt(1.0 - self.colour**2)], [1.0, -self.colour], white)
        else:
            shaped = white
        return np.asarray(self.sigma * shaped[lead : lead + count])

    def independence(self, step: float) -> float:
        """Samples that count as one."""
        if self.cfc:
            return max(1.0, 1.0 / _power(step, self.cfc))
        return (1.0 + self.colour) / (1.0 - self.colour)


def channel_filter(values: Array, step: float, cfc: int) -> Array:
    """CFC of SAE J211 (w_d = 2 pi 2.0775 CFC), forward and backward; evenly spaced values (n,), every `step` s."""
    from scipy.signal import butter, sosfiltfilt

    sos = butter(2, 2.0775 * cfc, fs=1.0 / step, output="sos")
    return np.asarray(sosfiltfilt(sos, values, padlen=min(values.size - 1, 300)))


def _power(step: float, cfc: int) -> float:
    """Variance that a filter class leaves of white noise of variance 1."""
    spike = np.zeros(8001)
    spike[4000] = 1.0
    return float(np.sum(channel_filter(spike, step, cfc) ** 2))


@dataclass(frozen=True, kw_only=True)
class Instruments:
    """Faults by channel, and what the frame of the rig adds to all of them."""

    faults: dict[str, Fault] = field(default_factory=dict)
    frame: Frame | None = None

    def _shown(self, descent: Descent, times: Array, channel: str) -> Array:
        """What reaches the sensor: the frame that it stands on gives way."""
        values = descent.channels(times)[channel]
        return values if self.frame is None else values * (1.0 + self.frame(times, channel))

    def read(self, descent: Descent, times: Array, channel: str) -> Array:
        """What a channel's sensor gives at times (n,) of a drop, without noise and range."""
        fault = self.faults.get(channel, Fault())
        at = (1.0 - fault.drift) * times - fault.offset
        if fault.lag > 0.0:
            grid = np.arange(at.min() - PAD, at.max() + 1e-4, min(1e-4, fault.lag / 4.0))
            # the steepest edge is the first contact: a point on either side of it
            grid = np.union1d(grid, [-1e-9, 1e-9])
            x = self._shown(descent, np.clip(grid, descent.stages[0].start, None), channel)
            late = _late(x, grid, fault.lag, fault.second_order) if fault.response is None else fault.response(x, grid)
            values = np.interp(at, grid, late)
        else:
            values = self._shown(descent, at, channel)
        if fault.bend is not None:
            values = fault.bend(values, times)
        warmth = fault.warming / (1.0 + np.exp(-(times - fault.middle) / fault.width)) if fault.warming else 0.0
        values = values * fault.gain * (1.0 + warmth) * (1.0 + fault.curved * np.abs(values)) + fault.bias
        if fault.hum:
            values = values + fault.hum * np.sin(2.0 * math.pi * fault.frequency * times + fault.phase)
        return np.asarray(values)

    def limited(self, values: Array, times: Array, channel: str, random: np.random.Generator) -> Array:
        """Range, resolution and loose contacts of a channel, which come behind the noise."""
        fault = self.faults.get(channel, Fault())
        if fault.quantum:
            values = fault.quantum * np.round(values / fault.quantum)
        if fault.dropouts:
            count = random.poisson(fault.dropouts * (times[-1] - times[0]))
            for start in random.uniform(times[0], times[-1], count):
                values = np.where((times >= start) & (times < start + fault.lasting), 0.0, values)
        return np.clip(values, -fault.limit, fault.limit) if math.isfinite(fault.limit) else values


def _late(x: Array, t: Array, tau: float, beta: float) -> Array:
    """Solve y + tau y' + beta tau^2 y'' = x: partial fractions, two lags of first order at the poles p and q.

    1/(beta tau^2 (s - p)(s - q)) = (q/(1 - s/p) - p/(1 - s/q))/(q - p), as beta tau^2 p q = 1.
    """
    if beta == 0.0:
        return np.asarray(lagged(x, t, tau))
    p, q = np.roots([beta * tau * tau, tau, 1.0]).astype(complex)
    return np.asarray(np.real((q * lagged(x, t, -1.0 / p) - p * lagged(x, t, -1.0 / q)) / (q - p)))


def lagged(x: Array, t: Array, tau: complex) -> NDArray[Any]:
    """Solve tau dy/dt = x - y for x that is straight between its samples; settled at the start."""
    h = np.diff(t)
    fade = np.exp(-h / tau)
    slope = np.diff(x) / h
    y = np.empty(x.size, dtype=np.result_type(x, tau))
    y[0] = x[0] - tau * slope[0]
    value = y[0].item()
    for i, (f, old, new, s) in enumerate(
        zip(fade.tolist(), x[:-1].tolist(), x[1:].tolist(), slope.tolist(), strict=True)
    ):
        # the particular solution is x - tau s
        value = new - tau * s + (value - old + tau * s) * f
        y[i + 1] = value
    return y

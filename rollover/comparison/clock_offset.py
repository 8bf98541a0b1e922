"""By how much a recording's clock would have to be set to agree best with a simulation, and what that would gain."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from rollover.comparison import alignment
from rollover.comparison.alignment import Signal
from rollover.recording import Recording
from rollover.system.numbers import Z95

CLOCK_WINDOW = 0.02  # s, to either side, in which the clock's offset is looked for
CLOCK_SAMPLES = 50_000  # of each channel, by which it is found


@dataclass(frozen=True, kw_only=True)
class Clock:
    """The recording's clock against the simulation's: `offset` s > 0 where the recording is late, with 1 sigma.

    `gain` is the share of the squared residual over noise that setting the clock would remove; `at_limit`: the
    window was too small.
    """

    offset: float
    sigma: float
    gain: float
    at_limit: bool

    @property
    def sentence(self) -> str:
        """What there is to be said of it: how far it is off, or within what it agrees (95 %)."""
        late, sigma = 1e3 * self.offset, 1e3 * self.sigma
        if abs(late) < Z95 * sigma and not self.at_limit:
            return f"its clock agrees with the simulation's within {Z95 * sigma:.2g} ms"
        way = "late" if late >= 0.0 else "early"
        would = f"setting it, which was not done, would remove {self.gain:.0%} of the squared residual"
        return f"its clock is {abs(late):.3g} +- {sigma:.2g} ms {way}; {would}"


def clock(signals: Sequence[tuple[Signal, float]], simulated: Recording) -> Clock | None:
    """Offset of the recording's clock at which its channels agree best with the simulation; scanned, then refined."""
    if not signals:
        return None
    signals = [(_thinned(signal), sigma) for signal, sigma in signals]
    smooth = [alignment.smooth(signal, simulated) for signal, _ in signals]

    def squared(late: float) -> float:
        return sum(
            float(np.sum(((s.values - alignment.at_stamps(s, simulated.time, v, late=late)) / sigma) ** 2))
            for (s, sigma), v in zip(signals, smooth, strict=True)
        )

    now = squared(0.0)
    width, step = CLOCK_WINDOW, CLOCK_WINDOW / 20.0
    centre = 0.0
    while step > 1e-7:
        at = centre + np.arange(-width, width + 0.5 * step, step)
        at = at[np.abs(at) <= CLOCK_WINDOW * (1.0 + 1e-9)]
        cost = np.array([squared(float(late)) for late in at])
        centre, width, step = float(at[int(np.argmin(cost))]), step, step / 5.0
    least = squared(centre)
    count = sum(s.time.size for s, _ in signals)
    near = 2e-4
    bend = (squared(centre + near) - 2.0 * least + squared(centre - near)) / near**2
    sigma = float(np.sqrt(2.0 / bend * max(1.0, least / count))) if bend > 0.0 else CLOCK_WINDOW
    return Clock(
        offset=centre,
        sigma=min(sigma, CLOCK_WINDOW),
        gain=1.0 - least / now if now > 0.0 else 0.0,
        at_limit=abs(centre) > CLOCK_WINDOW * 0.999,
    )


def _thinned(signal: Signal) -> Signal:
    """At most `CLOCK_SAMPLES` of a signal's samples, evenly taken; filtered as before."""
    every = -(-signal.time.size // CLOCK_SAMPLES)
    if every == 1:
        return signal
    return replace(signal, time=signal.time[::every], values=signal.values[::every], stretch=signal.stretch[::every])

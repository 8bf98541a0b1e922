"""Measured and simulated on common ground: the recording's own stamps, the same filter on both, no shift in time."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from rollover.recording import Recording
from rollover.recording.filters import filtered, least_rate
from rollover.spec.channels import describe

Array = NDArray[np.float64]

GAP = 2.5  # times the usual step: a longer one is a gap, over which nothing is interpolated
UNEVEN = 0.01  # of the usual step: where steps differ by more, a filter works on an even grid


@dataclass(frozen=True, kw_only=True)
class Signal:
    """One measured channel made ready: its samples where it has any, filtered, and what the simulation must go through.

    `time`, `values` (n,) s and SI, without NaN; `stretch` (n,) counts the stretches between gaps; `rate` Hz;
    `cfc` class both sides end up with, None for none; `chain` classes for the simulated side in order;
    `quieter` is what the filter did to white noise: 1 sigma after over 1 sigma before.
    """

    channel: str
    time: Array
    values: Array
    stretch: NDArray[np.int64]
    rate: float
    cfc: int | None
    chain: tuple[int, ...]
    quieter: float

    @property
    def unit(self) -> str:
        """SI unit of the values."""
        return describe(self.channel).unit


def ready(
    recording: Recording, channel: str, *, cfc: int | None, start: float, end: float, simulated_rate: float
) -> Signal:
    """Cut a measured channel to what the simulation covers and filter it.

    `cfc` is the class wanted; a filter already applied in the recording is never applied twice, and the simulation
    gets it too. `start`, `end` s of the simulation, whose rows come at `simulated_rate` Hz. Raises ``ValueError`` if
    nothing is left or either side is sampled too slowly for the class.
    """
    known = np.isfinite(recording[channel]) & (recording.time >= start) & (recording.time <= end)
    time, values = recording.time[known], recording[channel][known]
    if time.size < 2:
        raise ValueError(
            f"{channel}: no overlap with the simulation, got {time.size} samples in {start:g} to {end:g} s; at least 2"
        )
    step = float(np.median(np.diff(time)))
    stretch = np.concatenate(([0], np.cumsum(np.diff(time) > GAP * step)))
    own, chain = classes(recording.cfc.get(channel), cfc)
    _fast_enough(channel, own, chain, 1.0 / step, simulated_rate)
    for each in own:
        for k in range(int(stretch[-1]) + 1):
            here = stretch == k
            values[here] = through(time[here], values[here], step, each)
    return Signal(
        channel=channel,
        time=time,
        values=values,
        stretch=stretch,
        rate=1.0 / step,
        cfc=min(chain) if chain else None,
        chain=chain,
        quieter=_quieter(recording.cfc.get(channel), own, step),
    )


def simulated_at(signal: Signal, simulated: Recording, *, late: float = 0.0) -> Array:
    """Simulated values (n,) at a signal's stamps, filtered as the signal is.

    `late` s delays the simulation. Past its ends the simulation keeps its last value, as at rest.
    """
    return at_stamps(signal, simulated.time, smooth(signal, simulated), late=late)


def smooth(signal: Signal, simulated: Recording) -> Array:
    """Simulated channel at its own stamps (m,), through the classes of a signal."""
    values = simulated[signal.channel]
    if signal.chain:
        # cut at the same ends, so that a filter sees the same ends on both sides
        inside = (simulated.time >= signal.time[0] - 1e-9) & (simulated.time <= signal.time[-1] + 1e-9)
        step = float(np.median(np.diff(simulated.time)))
        values = values.copy()
        for each in signal.chain:
            values[inside] = through(simulated.time[inside], values[inside], step, each)
    return values


def at_stamps(signal: Signal, time: Array, values: Array, *, late: float = 0.0) -> Array:
    """Interpolate simulated values at (m,) times linearly to a signal's stamps (n,), `late` s later."""
    return np.interp(signal.time - late, time, values)


def interpolation_error(values: Array) -> Array:
    """How far interpolation between rows of a simulation may be off, (m,): the largest second difference nearby.

    Nothing where it is smooth, the whole jump where it jumps, as an acceleration does when the ground is touched:
    when between two rows it does so is not known.
    """
    bend = np.zeros(values.size + 2)
    bend[2:-2] = np.abs(np.diff(values, 2))
    return np.asarray(np.maximum(np.maximum(bend[:-2], bend[1:-1]), bend[2:]))


def classes(recorded: int | None, wanted: int | None) -> tuple[tuple[int, ...], tuple[int, ...]]:
    """Filter classes still to be applied to the measured and to the simulated side.

    >>> classes(None, 60), classes(180, None), classes(180, 60), classes(60, 180)
    (((60,), (60,)), ((), (180,)), ((60,), (180, 60)), ((), (60,)))
    """
    if recorded is None:
        return ((), ()) if wanted is None else ((wanted,), (wanted,))
    if wanted is None or wanted >= recorded:
        return (), (recorded,)
    return (wanted,), (recorded, wanted)


def _fast_enough(
    channel: str, own: tuple[int, ...], chain: tuple[int, ...], rate: float, simulated_rate: float
) -> None:
    slack = 1.0 + 1e-6
    for each in own:
        if rate * slack < least_rate(each):
            raise ValueError(
                f"{channel}: sampled too slowly for CFC {each}, got {rate:.6g} Hz; at least {least_rate(each):.0f} Hz"
            )
    for each in chain:
        if simulated_rate * slack < least_rate(each):
            raise ValueError(
                f"{channel}: simulated too coarsely for CFC {each}, got {simulated_rate:.6g} rows/s; "
                f"simulation.output_step at most {1.0 / least_rate(each):.3g} s is needed"
            )


def through(time: Array, values: Array, step: float, cfc: int) -> Array:
    """Values (n,) at stamps about `step` s apart through a filter class; uneven ones by way of an even grid."""
    if time.size < 2:
        return values
    if np.max(np.abs(np.diff(time) - step)) <= UNEVEN * step:
        return filtered(values, step, cfc)
    grid = np.linspace(time[0], time[-1], max(round((time[-1] - time[0]) / step) + 1, 2))
    even = min(float(grid[1] - grid[0]), step)  # rounding must not fail the rate that was checked
    return np.interp(time, grid, filtered(np.interp(grid, time, values), even, cfc))


def _quieter(recorded: int | None, own: tuple[int, ...], step: float) -> float:
    """Root of the energy of the filters' answer to an impulse; over that of the filter that was there before."""
    if not own:
        return 1.0
    impulse = np.zeros(2 * round(0.5 / step) + 1)
    impulse[impulse.size // 2] = 1.0
    if recorded is not None and 1.0 / step >= least_rate(recorded):
        impulse = filtered(impulse, step, recorded)
    before = float(np.linalg.norm(impulse))
    for each in own:
        impulse = filtered(impulse, step, each)
    return float(np.linalg.norm(impulse)) / before

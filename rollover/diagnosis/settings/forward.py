"""Simulation of what a recording should have shown."""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple


@dataclass(frozen=True, kw_only=True)
class Effort:
    """Limits of a search; the defaults are those for drops."""

    few: int = 3  # recordings that candidates are looked at on, and first fits are made to
    looked_at: int = 4  # recordings that decide whether there is anything, where each look costs a run
    shortlist: int = 7  # candidates that are looked at on all of these
    scored: int | None = None  # candidates looked at closer; none: as many as for drops, and all of two parameters
    promising: int = 14  # candidates that get a first fit at each step
    short: int = 6  # rounds of a first fit
    leaders: int = 4  # first fits that are followed up, at least
    most_leaders: int = 9  # and at most
    rounds: int = 14  # of a whole fit
    fd_steps: tuple[float, ...] = (2e-2, 5e-3, 1e-3)  # of a coordinate, for differences: wide first
    polishes: int = 2  # fits that are followed along a crooked valley
    wide: float = 0.0  # of a coordinate, to which a central difference may widen; 0: one-sided, as it is
    least: float = 0.0  # gain of a round below which a search narrows
    later: float = 5e-5  # s, by which a clock is moved to see what that does
    clocked: int = 0  # times that a trial's time shifts are moved to where they fit: reading a run again costs little
    is_timed: bool = True  # whether a recording's clock may be off, and edges lie on either side of a sample
    is_ensemble: bool = False  # looks at few recordings, fits no shapes, and stops where nothing but noise is left

    @property
    def fine(self) -> float:
        """Of a coordinate, for differences where a fit has ended."""
        return self.fd_steps[:2][-1]


class Perturbation(NamedTuple):
    """Where the grid lies, of an element; its spacing and that of contact points over their own; parts of a step."""

    grid_offset: tuple[float, float]
    spacing: float = 1.0
    points: float = 1.0
    parts: int = 1


@dataclass(frozen=True, kw_only=True)
class Averaging:
    """Recordings whose rows are means."""

    most_rows: int = 500  # rows of a recording that are compared; chosen
    few_stamps: int = 4  # simulated instants in a mean; with more, two away from the first contact; chosen
    rate_margin: float = 1.05  # ratio to the sampling rate that a filter class needs; chosen
    known_zero_error: float = 4e-3  # s: error of a clock's known zero; chosen
    unknown_zero_error: float = 30e-3  # s: error of a clock without a known zero; chosen


@dataclass(frozen=True, kw_only=True)
class Discontinuities:
    """Jumps of a prediction between samples."""

    sample_ratio: float = 4.0  # ratio to the steps beside it: larger steps between samples are jumps; chosen
    mean_ratio: float = 2.5  # the same within a mean of samples; chosen
    visible_step: float = 3.0  # noise units: from it on a step may be a jump; chosen
    deciding_jump: float = 5.0  # noise units: from it on a known jump between two samples decides a fit; chosen
    large_jump: float = 50.0  # noise units: larger jumps have no instant that is right to the sample; chosen
    samples_to_side: int = 3  # samples to either side, between whose values one beside a jump may lie; chosen


@dataclass(frozen=True, kw_only=True)
class Filtering:
    """Resampling for a filter."""

    same_stamp: float = 1e-3  # share of the sampling interval: an even instant within it is a stamp; chosen
    even_tolerance: float = 0.02  # share of the sampling interval: deviation of even stamps; chosen


@dataclass(frozen=True, kw_only=True)
class Drop:
    """Simulated drops."""

    shortest_step: float = 2e-4  # s: time step with a user's force term, which may jump anywhere; chosen
    longest_step: float = 2e-3  # s: time step of a drop; within 6e-5 of a channel's range
    abrupt_step: float = 1e-3  # s: time step with abrupt effects; within 8e-4 of a channel's range where it oscillates
    track_margin: float = 0.02  # s: a drop is simulated longer by it, since clocks are moved; chosen
    cached_predictions: int = 128  # kept predictions of one recording; chosen
    cached_tracks: int = 16  # kept drops of one recording; chosen
    cached_scenarios: int = 64  # kept scenarios under conditions, of more recordings than are fitted at once; chosen


@dataclass(frozen=True, kw_only=True)
class Run:
    """Simulated full runs."""

    cached_runs: int = 600  # kept runs of one recording; a third of a megabyte each
    filter_ahead: float = 0.06  # s: a filter sees beyond the last stamp where the recording went on; chosen
    slowest_ratio: float = 20.0  # ratio to the first run's wall time: a slower run is stopped; chosen
    least_wall_time: float = 2.0  # s of wall time: no run is stopped before; chosen
    # shares of an element (x, y): offsets of other places of the grid; chosen
    grid_offsets: tuple[tuple[float, float], ...] = ((0.34, 0.28), (-0.41, 0.17), (0.12, -0.37), (-0.22, -0.15))
    end_margin: float = 0.01  # s: a run continues past the last stamp, with a known zero of the clock; chosen
    end_margin_unknown: float = 0.06  # s: the same without a known zero; chosen
    # neighbours of a run, which show how far it scatters; place and refinements chosen
    perturbations: tuple[Perturbation, ...] = (
        Perturbation((0.34, 0.28)),
        Perturbation((-0.41, 0.17), spacing=0.9),
        Perturbation((0.12, -0.37), points=0.8),
        Perturbation((-0.22, -0.15), spacing=0.93, points=0.87),
        Perturbation((0.45, -0.08), parts=2),
        Perturbation((-0.07, 0.43), spacing=0.9, points=0.8, parts=3),
    )


@dataclass(frozen=True, kw_only=True)
class Phases:
    """Phases of a full run."""

    impact_force: float = 2.0  # weights of the vehicle: ground force that is an impact; chosen
    least_sliding: float = 0.03  # s: shortest sliding that is a phase; chosen


@dataclass(frozen=True, kw_only=True)
class Forward:
    """Simulation of what a recording should have shown."""

    averaging: Averaging = Averaging()  # recordings whose rows are means
    discontinuities: Discontinuities = Discontinuities()  # jumps of a prediction between samples
    filtering: Filtering = Filtering()  # resampling for a filter
    drop: Drop = Drop()  # simulated drops
    run: Run = Run()  # simulated full runs
    phases: Phases = Phases()  # phases of a full run
    drops: Effort = Effort()  # limits of a search by drops, which cost two milliseconds each
    # limits of a search by a model that recorded inputs drive: one clock, and longer fits, as its own parameters move
    # along with each effect
    models: Effort = Effort(is_timed=False, short=12, rounds=40)
    # samples of a part of a recording of such a model, in which 12 cosines reach 1/12 of the sampling rate; derived:
    # 12/(2 * 72)
    model_part: int = 72
    # limits of a search by full runs, which cost a hundred times that; runs with many contacts differ by chance
    # beside what a parameter does: over a narrow step that is all of the slope
    runs: Effort = Effort(
        few=2,
        scored=12,
        promising=4,
        short=2,
        leaders=2,
        most_leaders=3,
        rounds=6,
        fd_steps=(6e-2, 3e-2),
        wide=0.13,
        least=4.0,
        polishes=0,
        later=1e-3,  # from one row of a run to the next
        clocked=3,
        is_ensemble=True,
    )

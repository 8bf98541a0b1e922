"""What a scenario that needs a full run predicts for a recording: overturns, tosses, drops of vehicles.

A full run costs a hundred drops, so each is kept by the values that change the motion; a time shift, a filter and
what sensors make of a channel are read off it afterwards. Sensors are read on the run's own rows, at the place and in
the axes that the recording states for them, then through the channel's filter class, and last at the stamps.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, replace
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from rollover.comparison.misfit import as_measured
from rollover.diagnosis.settings import SETTINGS
from rollover.diagnosis.settings.forward import Perturbation
from rollover.dynamics.result import Run
from rollover.effects import read
from rollover.recording import Recording, attitude
from rollover.recording.filters import filtered, least_rate
from rollover.scenario import Scenario
from rollover.spec.document import exchanged
from rollover.spec.vehicle import Striker
from rollover.system.processes import Children, map_cases

Array = NDArray[np.float64]
SENSORS = "sensor-"
CENTRE = "ground.elements.centre"
TUNING = SETTINGS.forward.run
PHASES = SETTINGS.forward.phases
MOTION = ("chassis/", "striker/", "axle/front/angle", "ground/sinkage")  # what an instrument's place is worked out from


class _TooSlowError(Exception):
    """A run takes far longer than the first."""


class Making(NamedTuple):
    """A run to be made: what of the changes moves the vehicle, the scenario, axes that are kept, its longest time."""

    key: tuple[Any, ...]
    scenario: Scenario
    stems: frozenset[str]
    limit: float


class Made(NamedTuple):
    """A run before instruments, with the scenario as its effects made it (None if it failed), phases, wall time (s)."""

    run: tuple[Scenario, Recording] | None
    phases: tuple[tuple[float, str], ...]
    seconds: float


@dataclass
class Tally:
    """Runs that were made, and their wall time (s)."""

    runs: int = 0
    seconds: float = 0.0


def make(making: Making) -> Made:
    """Run a scenario; one that takes too long has failed."""
    from rollover.dynamics import simulate  # slow to import, and drops do without

    def watch(_simulated: float, wall: float) -> None:
        if wall > making.limit:
            raise _TooSlowError

    try:
        run = simulate.run(making.scenario, progress=watch)
    except _TooSlowError:
        return Made(None, (), making.limit)
    if run.status == "failed":
        return Made(None, (), run.wall_time)
    retained = {n: v for n, v in run.recording.channels.items() if n[:-1] in making.stems or n.startswith(MOTION)}
    return Made((making.scenario.applied(), replace(run.recording, channels=retained)), run_phases(run), run.wall_time)


class RunSimulator:
    """Any scenario by full runs."""

    effort = SETTINGS.forward.runs

    def __init__(self, scenario: Scenario, recording: Recording) -> None:
        self.recording = recording
        self.scenario = _covering(scenario.of_many(), recording)
        self._made = Tally()
        self._shorter: dict[int, RunSimulator] = {}
        self._phases: dict[tuple[float, ...], tuple[tuple[float, str], ...]] = {}  # by where the grid lies
        self._centre: tuple[float, ...] = scenario.ground.elements.centre
        self._limit = np.inf
        self.children: Children | None = None  # make runs that are wanted next
        self.reference: Recording | None = None  # beside whose attitude those of all runs are put
        self._known: dict[tuple[Any, ...], tuple[Scenario, Recording] | None] = {}
        self._behind: dict[tuple[Any, ...], tuple[Recording, dict[str, Array]]] = {}

    def __getstate__(self) -> dict[str, Any]:
        """Without the runs: another process makes its own."""
        return {**self.__dict__, "_known": {}, "_behind": {}, "_shorter": {}, "children": None}

    @property
    def runs(self) -> int:
        """Runs that were made, shorter ones too."""
        return self._made.runs

    @property
    def seconds(self) -> float:
        """Their wall time, s."""
        return self._made.seconds

    def predict(self, changes: Mapping[str, Any], shift: float) -> dict[str, Array] | None:
        """Channels (n,) at the recording's stamps less `shift` (s); None if the run fails.

        NaN where the run has no rows: before its start by more than a shift, and after its end unless it came to rest.
        ``ValueError`` for a value out of bounds passes.
        """
        chosen = exchanged(self.scenario, changes) if changes else self.scenario
        known = self._run(chosen, changes)
        if known is None:
            return None
        applied, run = known
        key = _key(changes)
        if key not in self._behind:
            if len(self._behind) >= TUNING.cached_runs:
                self._behind.pop(next(iter(self._behind)))
            seen = as_measured(applied, run, self.recording)
            self._behind[key] = (
                seen,
                {c: self._filtered(seen, c) for c in self.recording.channels if c in seen.channels},
            )
        seen, behind = self._behind[key]
        spoiled = {e.channel for name, e in chosen.effects.items() if name.startswith(SENSORS)}
        misread = read(chosen.effects, seen) if spoiled else seen
        at = self.recording.time - shift
        outside = (at < seen.time[0] - TUNING.end_margin_unknown) | (at > seen.time[-1] + TUNING.end_margin_unknown)
        found = {}
        for name, values in behind.items():
            values = self._filtered(misread, name) if name in spoiled else values
            found[name] = np.where(outside, np.nan, np.interp(at, seen.time, values))
        if self.reference is None:
            return found
        return dict(attitude.beside(replace(self.recording, channels=found), self.reference).channels)

    def attitude(self) -> Recording | None:
        """Attitude of the run as it is, on its own rows; None if the run fails."""
        known = self._run(self.scenario, {})
        return None if known is None else attitude.reference_of(known[1])

    def _filtered(self, run: Recording, channel: str) -> Array:
        """A channel of a run behind the filter class that was applied to it, where the run is fast enough."""
        step, cfc = float(np.median(np.diff(run.time))), self.recording.cfc.get(channel)
        if cfc is None or 1.0 / step < least_rate(cfc) * (1.0 - 1e-9):
            return run[channel]
        return filtered(run[channel], step, cfc)

    def marks(self) -> tuple[tuple[float, str], ...]:
        """Phases of the run as it is; empty if it fails."""
        self.predict({}, 0.0)
        return self._phases.get(self.scenario.ground.elements.centre, ())

    def state(self, shift: float) -> Mapping[str, Array]:
        """Motion of the run as it is, (n,) at the stamps less `shift`; empty if it fails."""
        known = self._run(self.scenario, {})
        if known is None:
            return {}
        run, at = known[1], self.recording.time - shift
        return {name: np.interp(at, run.time, values) for name, values in run.channels.items()}

    def perturbed(
        self, changes: Mapping[str, Any] | None = None, shift: float = 0.0, parts: int = 1
    ) -> list[dict[str, Array]]:
        """What neighbours differ by from the run with `changes`, channels (n,) at the stamps less `shift` (s).

        Neighbours lie elsewhere on the ground's grid, have finer elements, more points of contact, shorter steps:
        nobody could say which of them is right. Those that fail are left out. Each step of theirs is one of at least
        `parts` of the scenario's.
        """
        values = dict(changes or {})
        base = self.predict(values, shift)
        if base is None:
            return []
        found = []
        several = self.perturbations(values, parts)
        made_ahead(self.children, [(self, beside) for beside in several])
        for beside in several:
            there = self.predict(beside, shift)
            if there is not None:
                found.append({name: there[name] - base[name] for name in base})
        return found

    def perturbations(self, changes: Mapping[str, Any], parts: int = 1) -> list[dict[str, Any]]:
        """Changes of all neighbours of a run with `changes`, see `perturbed`."""
        return [{**changes, **self._beside(one, parts)} for one in TUNING.perturbations]

    def choose_medoid(self) -> None:
        """Lay the grid where the run is the most like all others: of two ways that runs go, it takes the common one.

        The medoid: the least sum of the distances to the others and to the neighbours, each the root mean square over
        the channels' ranges.
        """
        centres = self._grid_centres()
        own = [{CENTRE: centre} for centre in centres]
        others = [values for values in map(self._beside, TUNING.perturbations) if values not in own]
        self.predict(own[0], 0.0)  # how long one takes
        made_ahead(self.children, [(self, values) for values in (*own, *others)])
        runs = {centre: self.predict({CENTRE: centre}, 0.0) for centre in centres}
        there = {centre: run for centre, run in runs.items() if run is not None}
        if len(there) < 3:
            return
        beside = [self.predict(values, 0.0) for values in others]
        stacks = {centre: np.concatenate(list(_scaled(run).values())) for centre, run in there.items()}
        every = [*stacks.values(), *(np.concatenate(list(_scaled(run).values())) for run in beside if run is not None)]
        inside = np.all([np.isfinite(y) for y in every], axis=0)
        apart = {
            centre: sum(float(np.sqrt(np.mean((y - other)[inside] ** 2))) for other in every)
            for centre, y in stacks.items()
        }
        best = min(apart, key=lambda centre: apart[centre])
        self.scenario = self.scenario.replaced({CENTRE: best})
        known, behind = self._known.get(_key({CENTRE: best})), self._behind.get(_key({CENTRE: best}))
        if known is not None and behind is not None:
            self._known[()], self._behind[()] = known, behind

    @property
    def contact(self) -> float:
        """See `Simulator`: which contact is the first depends on what is recorded."""
        return float("inf")

    def until(self, n: int) -> RunSimulator:
        """The same for the first n stamps: its runs end soon after them, where their filters no longer look ahead.

        One and the same each time, so that its runs are not made again.
        """
        if n in self._shorter:
            return self._shorter[n]
        found = self._shorter[n] = RunSimulator(self.scenario, self.recording.until(n))
        settings = found.scenario.simulation
        ahead = (
            settings.output_step * np.ceil(TUNING.filter_ahead / settings.output_step) if self.recording.cfc else 0.0
        )
        longer = min(round(settings.duration + float(ahead), 9), self.scenario.simulation.duration)
        found.scenario = replace(found.scenario, simulation=replace(settings, duration=longer))
        found._centre, found.children, found._made = self._centre, self.children, self._made
        found.reference = self.reference
        return found

    def _grid_centres(self) -> list[tuple[float, ...]]:
        """Where the grid may lie as well, where the scenario has it first."""
        return [self._grid_centre(fraction) for fraction in ((0.0, 0.0), *TUNING.grid_offsets)]

    def _beside(self, one: Perturbation, parts: int = 1) -> dict[str, Any]:
        """Values of a neighbour, its step parted in at least so many `parts`."""
        own, ground = self.scenario, self.scenario.ground.elements
        centre = self._grid_centre(one.grid_offset)
        found: dict[str, Any] = {CENTRE: self._centre if centre == ground.centre else centre}
        if one.spacing != 1.0:
            found["ground.elements.spacing"] = tuple(one.spacing * w for w in ground.spacing)
        if one.points != 1.0:
            found["vehicle.contact_spacing"] = one.points * own.vehicle.contact_spacing
        if max(parts, one.parts) > 1:
            found["simulation.step"] = own.simulation.step / max(parts, one.parts)
        return found

    def _grid_centre(self, fraction: tuple[float, float]) -> tuple[float, ...]:
        spacing = self.scenario.ground.elements.spacing
        return tuple(c + f * w for c, f, w in zip(self._centre, fraction, spacing, strict=True))

    def making(self, changes: Mapping[str, Any]) -> Making | None:
        """What a run with changes takes; None for one that is known, or out of bounds."""
        if _key(changes) in self._known:
            return None
        try:
            return self._making(exchanged(self.scenario, changes) if changes else self.scenario, changes)
        except ValueError:
            return None

    def take(self, making: Making, made: Made) -> None:
        """Keep a run that was made."""
        self._made.runs += 1
        self._made.seconds += made.seconds
        if made.run is not None and self._limit == np.inf:
            self._limit = max(TUNING.slowest_ratio * made.seconds, TUNING.least_wall_time)
        if made.run is not None and all(path == CENTRE for path, _ in making.key):
            self._phases[making.scenario.ground.elements.centre] = made.phases
        if len(self._known) >= TUNING.cached_runs:
            self._known.pop(next(iter(self._known)))
        self._known[making.key] = made.run

    def _making(self, chosen: Scenario, changes: Mapping[str, Any]) -> Making:
        physical = {name: e for name, e in chosen.effects.items() if not name.startswith(SENSORS)}
        stems = frozenset(name[:-1] for name in self.recording.channels)  # the axes across, for a sensor that is turned
        return Making(_key(changes), replace(chosen, effects=physical), stems, self._limit)

    def _run(self, chosen: Scenario, changes: Mapping[str, Any]) -> tuple[Scenario, Recording] | None:
        """The run before instruments, with the scenario as its effects made it; None if it failed."""
        if _key(changes) not in self._known:
            making = self._making(chosen, changes)
            self.take(making, make(making))
        return self._known[_key(changes)]


def full_runs(simulator: Any) -> RunSimulator | None:
    """What makes the full runs of a simulator, behind means of neighbouring samples too; None where there are none."""
    own = getattr(simulator, "inner", simulator)
    return own if isinstance(own, RunSimulator) else None


def perturbations_of(
    simulators: Iterable[Any], changes: Mapping[str, Any], parts: int
) -> list[tuple[Any, Mapping[str, Any]]]:
    """(simulator, changes) of a run and its neighbours by each simulator of full runs, the longest ones first."""
    full = [own for own in map(full_runs, simulators) if own is not None]
    each = [(own, one) for own in full for one in (changes, *own.perturbations(changes, parts))]
    return sorted(each, key=lambda pair: float(pair[1].get("simulation.step", np.inf)))


def made_ahead(children: Children | None, wanted: Iterable[tuple[Any, Mapping[str, Any]]]) -> None:
    """Make runs of (simulator, changes) side by side in children, as far as they are full runs that are not known.

    Nothing happens without children; what fails in one is left to be made, or to fail, where it is needed.
    """
    if children is None or children.workers < 2:
        return
    todo: dict[tuple[int, Any], tuple[RunSimulator, Making]] = {}
    for simulator, changes in wanted:
        own = full_runs(simulator)
        making = None if own is None else own.making(changes)
        if own is not None and making is not None:
            todo[id(own), making.key] = (own, making)
    every = list(todo.values())
    if len(every) < 2:
        return
    for outcome in map_cases(make, [making for _, making in every], children=children):
        if outcome.value is not None:
            own, making = every[outcome.index]
            own.take(making, outcome.value)


def _scaled(channels: Mapping[str, Array]) -> dict[str, Array]:
    """Channels over their ranges."""
    ranges = {name: float(np.nanmax(values) - np.nanmin(values)) for name, values in channels.items()}
    return {name: values / max(ranges[name], 1e-300) for name, values in channels.items()}


def _key(changes: Mapping[str, Any]) -> tuple[Any, ...]:
    """What of the changes moves the vehicle."""
    return tuple(sorted((p, v) for p, v in changes.items() if not p.startswith(f"effects.{SENSORS}")))


def _covering(scenario: Scenario, recording: Recording) -> Scenario:
    """The scenario with the shortest duration that covers the recording and its time shifts.

    It does not stop at rest: what rests stays in the rows that later stamps are compared with.
    """
    settings = scenario.simulation
    end = float(recording.time[-1]) + (
        TUNING.end_margin_unknown if recording.clock.zero == "unknown" else TUNING.end_margin
    )
    rows = max(1, int(np.ceil(end / settings.output_step)))
    duration = round(min(rows * settings.output_step, 120.0), 9)
    return replace(scenario, simulation=replace(settings, duration=duration, stop_at_rest=False))


def run_phases(run: Run) -> tuple[tuple[float, str], ...]:
    """(start s, name) of support, tipping, impact, sliding, rest: sliding is what comes after the last impact.

    An impact is a force of the ground beyond `impact_force` times the weight; support ends with the first wheel that
    lifts off, tipping with the first part that hits the ground and is no wheel.
    """
    marks = list(run.phases)
    start = next((at for at, name in marks if name == "impact"), None)
    if start is None:
        return tuple(marks)
    vehicle = run.scenario.vehicle
    mass = vehicle.mass if isinstance(vehicle, Striker) else vehicle.whole.mass
    time, force = run.recording.time, run.recording["ground/force_normal"]
    impacts = time[(force > PHASES.impact_force * mass * run.scenario.gravity) & (time >= start)]
    end = next((at for at, name in marks if name == "rest"), float(time[-1]))
    sliding = float(impacts[-1]) if impacts.size else start
    if start < sliding < end - PHASES.least_sliding:
        marks.append((sliding, "sliding"))
    return tuple(sorted(marks))

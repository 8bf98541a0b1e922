"""What the scenario predicts for a recording, at the recording's own stamps and behind its own filters."""

from __future__ import annotations

from collections import OrderedDict
from collections.abc import Mapping
from dataclasses import fields, replace
from functools import cached_property, lru_cache
from typing import Any, TypeVar

import numpy as np

from rollover.diagnosis.forward.discontinuities import DISCONTINUITY_IN, largest_jumps_nearby
from rollover.diagnosis.forward.filtering import Rows, filtered_like, rows_of
from rollover.diagnosis.forward.full_run import SENSORS, RunSimulator
from rollover.diagnosis.forward.instruments import Instruments
from rollover.diagnosis.forward.interface import EDGES, Array, Simulator
from rollover.diagnosis.settings import SETTINGS
from rollover.dynamics.drop_test import BESIDE, COLUMNS, DropFailedError, DropModel, Track, channels_of, unfit
from rollover.effects import every, read
from rollover.recording import Recording
from rollover.recording.record import with_channels
from rollover.scenario import Scenario, with_effects_at
from rollover.spec.document import Itself, exchanged
from rollover.spec.initiation import Drop

T = TypeVar("T")
Store = OrderedDict[tuple[Any, ...], T]
TUNING = SETTINGS.forward.drop
OF_SENSORS = f"effects.{SENSORS}"


class Exchanged:
    """Values exchanged by path, and the key that they are known by."""

    __slots__ = ("key", "values")

    def __init__(self, values: Mapping[str, Any]) -> None:
        self.values = values
        self.key = tuple(sorted(values.items())) if len(values) > 1 else tuple(values.items())


NOTHING = Exchanged({})


class DropSimulator:
    """A drop test by its own integrator: two milliseconds a run."""

    effort = SETTINGS.forward.drops

    def __init__(self, scenario: Scenario, recording: Recording, *, discontinuities: bool = True) -> None:
        self.model = DropModel(scenario=scenario)
        self.recording = recording
        self.discontinuities = discontinuities  # whether it says how far channels jump
        # a dict's first key is behind all that were let go of before it
        self._raw: Store[Array] = OrderedDict()
        self._models: Store[DropModel] = OrderedDict()
        self._tracks: Store[Track] = OrderedDict()
        self._read_by: Store[Mapping[str, Any]] = OrderedDict()

    def __getstate__(self) -> dict[str, Any]:
        """What is sent to another process: not the runs."""
        no_jacobian = DropModel(scenario=self.model.scenario)
        stores: dict[str, Any] = {name: OrderedDict() for name in ("_raw", "_models", "_tracks", "_read_by")}
        return {"model": no_jacobian, "recording": self.recording, "discontinuities": self.discontinuities, **stores}

    def predict(self, changes: Mapping[str, Any], shift: float) -> dict[str, Array] | None:
        """See `Simulator`; ``ValueError`` for a value out of bounds passes."""
        moves: dict[str, Any] = {}
        reads: dict[str, Any] = {}
        for path, value in changes.items():
            (reads if path.startswith(OF_SENSORS) else moves)[path] = value
        physical, sensors = Exchanged(moves), self._sensors(Exchanged(reads))
        try:
            drop = self._run(physical, self.rows.times, shift)
            found = self._misread(physical, shift, sensors, drop) if sensors else self.instruments.shown(drop)
        except DropFailedError:
            return None
        return found | self._discontinuities(physical, shift, sensors) if self.discontinuities else found

    def perturbed(
        self, changes: Mapping[str, Any] | None = None, shift: float = 0.0, parts: int = 1
    ) -> list[dict[str, Array]]:
        """See `Simulator`: one striker on its guide has no neighbours."""
        del changes, shift, parts
        return []

    def choose_medoid(self) -> None:
        """See `Simulator`."""

    def until(self, n: int) -> DropSimulator:
        """See `Simulator`."""
        return DropSimulator(self.model.scenario, self.recording.until(n), discontinuities=self.discontinuities)

    def marks(self) -> tuple[tuple[float, str], ...]:
        """See `Simulator`."""
        return ()

    def state(self, shift: float) -> Mapping[str, Array]:
        """See `Simulator`."""
        try:
            return self._model(NOTHING).motion(self.recording.time - shift)
        except DropFailedError:
            return {}

    def _sensors(self, reads: Exchanged) -> Mapping[str, Any]:
        """Effects of sensors with values exchanged, by name."""
        if reads.key not in self._read_by:
            effects = self._model(reads).scenario.effects
            found = {name: e for name, e in effects.items() if name.startswith(SENSORS)}
            self._keep(self._read_by, reads.key, found, TUNING.cached_predictions)
        return self._read_by[reads.key]

    def _misread(self, physical: Exchanged, shift: float, sensors: Mapping[str, Any], drop: Array) -> dict[str, Array]:
        """Channels at the stamps as `sensors` read a drop."""
        channels = {**channels_of(drop, self.instruments.names), **self._edges(physical, shift, sensors)}
        run = with_channels(self._unread, channels)
        channels = dict(read({n: e for n, e in sensors.items() if e.id not in EDGES}, run).channels)
        return filtered_like(channels, self.recording, self.rows)

    def _discontinuities(self, physical: Exchanged, shift: float, sensors: Mapping[str, Any]) -> dict[str, Array]:
        """How far channels that nothing smooths jump about each stamp, under `DISCONTINUITY_IN` and their names."""
        time = self.recording.time
        instants, rows = self._track(physical, float(time[-1] - shift) if time.size else 0.0).jumps
        if not instants.size:
            return {}
        lags, *clocks = ({e.channel: e for e in every(sensors, name)} for name in EDGES)
        jumping = set(np.flatnonzero(rows.any(axis=0)).tolist())
        sharp = [name for name in self._sharp if name not in lags and COLUMNS[name][0] in jumping]
        timed = {*clocks[0], *clocks[1]}
        groups = [(time, [name for name in sharp if name not in timed])]
        groups += [(_own(time, name, *clocks), [name]) for name in sharp if name in timed]
        found: dict[str, Array] = {}
        for own, names in groups:
            columns = np.array([COLUMNS[name][0] for name in names], dtype=np.int64)
            sizes = largest_jumps_nearby(own - shift, instants, rows, columns)
            found |= {DISCONTINUITY_IN + name: size for name, size in zip(names, sizes, strict=True)}
        return found

    def _edges(self, physical: Exchanged, shift: float, sensors: Mapping[str, Any]) -> dict[str, Array]:
        """Channels behind a lag or with a clock of their own: what these make of a jump lies between the rows."""
        lags, offsets, drifts = ({e.channel: e for e in every(sensors, name)} for name in EDGES)
        found: dict[str, Array] = {}
        for channel in {*lags, *offsets, *drifts} & set(self.instruments.names):
            own = _own(self.rows.times, channel, offsets, drifts)
            key = channel, offsets.get(channel), drifts.get(channel)
            if channel not in lags:
                found |= channels_of(self._run(physical, own, shift, key), (channel,))
                continue
            beside = self.contact + shift + np.array([-BESIDE, BESIDE])
            fine = np.concatenate([own, 0.5 * (own[1:] + own[:-1]), beside[(beside > own[0]) & (beside < own[-1])]])
            dense, where = np.unique(fine, return_inverse=True)
            raw = channels_of(self._run(physical, dense, shift, (*key, "dense")), (channel,))
            late = lags[channel].read(Recording(title=self.recording.title, time=dense, channels=raw))
            found[channel] = late[channel][where[: own.size]]
        return found

    @cached_property
    def _sharp(self) -> frozenset[str]:
        """Channels that nothing smooths."""
        return frozenset(self.instruments.names).difference(self.recording.cfc)

    @cached_property
    def instruments(self) -> Instruments:
        """What is shown of the drop."""
        return Instruments(self.recording, self.rows)

    @cached_property
    def _unread(self) -> Recording:
        """A recording at the times of the drop, without any channel."""
        return Recording(title=self.recording.title, time=self.rows.times, channels={})

    @cached_property
    def rows(self) -> Rows:
        """Times at which the drop is made."""
        return rows_of(self.recording)

    @cached_property
    def contact(self) -> float:
        """See `Simulator`."""
        start = self.model.scenario.initiation
        if isinstance(start, Drop):
            return 0.0
        times = np.arange(0.0, self.model.scenario.simulation.duration, 1e-4)
        below = self.model.motion(times)["ground/sinkage"] > 0.0
        return float(times[np.argmax(below)]) if below.any() else np.inf

    def _run(self, physical: Exchanged, times: Array, shift: float, key: tuple[Any, ...] = ()) -> Array:
        """`Track.rows` of the drop at `times` less `shift`, which `key` stands for beside it."""
        values = (*physical.key, *key, shift)
        found = self._raw.get(values)
        if found is None:
            at = times - shift
            found = self._track(physical, float(at[-1]) if at.size else 0.0).rows(at)
            self._keep(self._raw, values, found, TUNING.cached_predictions)
        return found

    def _track(self, physical: Exchanged, until: float) -> Track:
        """The fall with values exchanged, at least up to a time (s): neither a clock nor a sensor asks for another."""
        found = self._tracks.pop(physical.key, None)
        if found is None or found.until < until:
            found = self._model(physical).track(until + TUNING.track_margin)
        self._keep(self._tracks, physical.key, found, TUNING.cached_tracks)
        return found

    def _model(self, exchange: Exchanged) -> DropModel:
        """The drop with values exchanged, its steps as short as it asks for."""
        key, changes = exchange.key, exchange.values
        if key not in self._models:
            base = self.model.scenario
            is_of_effects = all(path.startswith("effects.") for path in changes)
            own = base if not changes else with_effects_at(base, changes) if is_of_effects else exchanged(base, changes)
            has_own = own.ground.law.advance is not None  # states of its own are second order in the step
            is_abrupt = has_own or any(effect.is_abrupt for effect in own.effects.values())
            may_jump = any(effect.force_terms() and not effect.is_smooth for effect in own.effects.values())
            step = TUNING.shortest_step if may_jump else TUNING.abrupt_step if is_abrupt else TUNING.longest_step
            self._keep(self._models, key, DropModel(scenario=own, step=step), TUNING.cached_predictions)
        return self._models[key]

    @staticmethod
    def _keep(store: Store[T], key: tuple[Any, ...], value: T, most: int) -> None:
        """Put into a store of the last so many."""
        if len(store) >= most:
            store.popitem(last=False)
        store[key] = value


def _own(time: Array, channel: str, offsets: Mapping[str, Any], drifts: Mapping[str, Any]) -> Array:
    """Times (s) of a channel by its own clock."""
    own = time - offsets[channel].offset if channel in offsets else time
    return (1.0 - drifts[channel].drift) * own if channel in drifts else own


def simulator_of(scenario: Scenario, recording: Recording, *, discontinuities: bool = True) -> Simulator:
    """The quickest simulator that a scenario admits; the recording's conditions are put in by path.

    `discontinuities` as in `DropSimulator`. Raises `InputError` for a condition that the scenario does not know.
    """
    own = set_up(scenario, recording)
    return (
        RunSimulator(own, recording) if unfit(own) else DropSimulator(own, recording, discontinuities=discontinuities)
    )


def set_up(scenario: Scenario, recording: Recording) -> Scenario:
    """The scenario under a recording's conditions; what these leave as it is, is the same. Raises `InputError`.

    Asked again for the same, it is the same object.
    """
    if not recording.conditions:
        return scenario
    conditions = tuple((path, type(value), value) for path, value in recording.conditions.items())
    try:
        hash(conditions)
    except TypeError:  # a value without a hash
        return _under(scenario, recording.conditions, recording.title)
    return _cached_under(Itself(scenario), conditions, recording.title)


@lru_cache(maxsize=TUNING.cached_scenarios)  # each stage of a diagnosis asks for it, and reading values takes 10 ms
def _cached_under(scenario: Itself, conditions: tuple[tuple[str, type, Any], ...], title: str) -> Scenario:
    return _under(scenario.thing, {path: value for path, _, value in conditions}, title)


def _under(scenario: Scenario, conditions: Mapping[str, Any], title: str) -> Scenario:
    found = scenario.replaced(dict(conditions), origin=title)
    own = {f.name: (getattr(scenario, f.name), getattr(found, f.name)) for f in fields(found)}
    return replace(found, **{name: old for name, (old, new) in own.items() if new == old})


__all__ = ["DropSimulator", "RunSimulator", "set_up", "simulator_of"]

"""Drop tests in a millisecond: a striker on level ground, with the kernels and effects of the full run.

`DropModel` is a scenario made ready; parameters are exchanged by path, so that fits and diagnoses can make ten
thousand drops in the time of a hundred full runs. Where both can be asked they agree to the integration error.
"""

from __future__ import annotations

import math
from collections.abc import Collection, Mapping
from dataclasses import dataclass
from functools import cached_property, lru_cache
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ground.law import HIDDEN, REFERENCE_AREA, REFERENCE_MASS
from ground.settings import settings
from ground.surface import gradient, is_flat
from rollover.dynamics.bodies import nose_share
from rollover.effects import acting, read
from rollover.kernels import drop_integrator, striker
from rollover.kernels import drop_trajectory as track
from rollover.recording import Recording
from rollover.scenario import Scenario
from rollover.spec.document import Itself, exchanged
from rollover.spec.initiation import Drop, Release
from rollover.spec.vehicle import Striker

Array = NDArray[np.float64]
LONGEST_STEP = 5e-4  # s, of the integration
ENTRY = 0.02  # longest step over the time in which a cone goes in
ROUNDING = 1e-6  # of the largest force: what changes by less has not jumped
BESIDE = 1e-9  # s: on either side of a jump
CACHED_GROUNDS = 64  # grounds with their effects, of which the kernel's numbers are kept: drops share them
RESOLVED = 0.15  # longest step times the frequency of a compliant striker

COLUMNS = {
    "ground/force_normal": (track.OUT_FORCE, 1.0),
    "ground/impulse_normal": (track.OUT_IMPULSE, 1.0),
    "ground/sinkage": (track.OUT_SINKAGE, 1.0),
    "striker/position_z": (track.OUT_X, -1.0),
    "striker/velocity_z": (track.OUT_V, -1.0),
    "striker/acceleration_z": (track.OUT_A, -1.0),
}


class DropFailedError(Exception):
    """The integration left what can be."""


@dataclass(frozen=True, kw_only=True)
class Track:
    """A fall that was integrated up to `until` (s): step by step, and the element each time that it had changed."""

    law: NDArray[np.int64]
    p: Array
    numbers: Array
    until: float
    steps: Array
    elements: Array

    def rows(self, times: Array) -> Array:
        """Columns of `track` at `times` (s, rising), (n, track.OUT_COLUMNS). Raises ``ValueError`` for one too late."""
        if len(times) and times[-1] > max(self.until, 0.0):
            raise ValueError(f"times: beyond the track, got {times[-1]:g} s; it ends at {self.until:g} s")
        out = np.empty((len(times), track.OUT_COLUMNS))
        track.read_off(self.law, self.p, self.numbers, self.steps, self.elements, times, out)
        return out

    @cached_property
    def jumps(self) -> tuple[Array, Array]:
        """Instants (j,), s, at which the force jumps, and how far the columns do there (j, OUT_COLUMNS)."""
        at, apart, largest = track.turns(self.law, self.p, self.numbers, self.steps, self.elements, self.until, BESIDE)
        shows = np.abs(apart[:, track.OUT_FORCE]) > ROUNDING * largest
        return at[shows], apart[shows]


@dataclass(frozen=True, kw_only=True)
class DropModel:
    """A drop test made ready to be run many times; `step` (s) is the longest step of the integration.

    Near a turn steps are shorter, and of a nose that rings as short as its frequency asks for until that has died out.
    """

    scenario: Scenario
    step: float = LONGEST_STEP

    def __post_init__(self) -> None:
        reason = unfit(self.scenario)
        if reason:
            raise ValueError(reason)

    def with_(self, changes: Mapping[str, Any]) -> DropModel:
        """The same drop with values exchanged by path; an effect is switched on by naming one of its parameters.

        Raises ``ValueError`` for a value out of bounds, ``KeyError`` for a path that does not exist.
        """
        return DropModel(scenario=exchanged(self.scenario, changes), step=self.step)

    @cached_property
    def _applied(self) -> Scenario:
        return self.scenario.applied()

    @cached_property
    def numbers(self) -> Array:
        """What `fall` reads, (nose.NUMBERS,)."""
        s = self._applied
        vehicle, ground, start = s.vehicle, s.ground, s.initiation
        assert isinstance(vehicle, Striker)
        assert isinstance(start, (Drop, Release))
        f = np.zeros(striker.NUMBERS)
        share = nose_share(vehicle, s.effects)
        is_cone = vehicle.nose == "cone"
        face = math.pi * vehicle.nose_radius**2 if is_cone else vehicle.face_length * vehicle.face_width
        f[striker.MASS], f[striker.NOSE], f[striker.FACE] = vehicle.mass, vehicle.mass * share, face
        f[striker.GRAVITY], f[striker.SPEED], f[striker.STEP] = s.gravity, start.speed, self.step
        if is_cone:
            f[striker.CONE] = vehicle.nose_height
            f[striker.STEP] = min(self.step, ENTRY * vehicle.nose_height / max(landing_speed(start, s.gravity), 1e-3))
        if isinstance(start, Release):
            f[striker.HEIGHT] = start.height
        f[striker.FRACTION] = ground.co_moving_mass.share / share  # of the whole striker, though its nose alone hits
        f[striker.LAW_MASS], f[striker.MOMENTUM_MOST] = REFERENCE_MASS, np.inf
        if ground.striker_mass != "reference":
            f[striker.LAW_MASS] = f[striker.NOSE] * REFERENCE_AREA / face
            f[striker.MOMENTUM_MOST] = ground.law.domain.momentum_most if ground.striker_mass == "clamped" else np.inf
        if share < 1.0:
            gives = s.effects["structural-compliance"]
            f[striker.SPRING], f[striker.DASHPOT] = gives.stiffness, gives.damping
            reduced = vehicle.mass * share * (1.0 - share)
            f[striker.STEP] = min(
                f[striker.STEP], RESOLVED / max(math.sqrt(gives.stiffness / reduced), gives.damping / reduced)
            )
        if "guide-friction" in s.effects:
            guide = s.effects["guide-friction"]
            f[striker.GUIDE], f[striker.CREEP] = guide.force, guide.creep
        f[striker.CRISIS], f[striker.THIN] = math.inf, 1.0
        if "air-drag" in s.effects:
            air = s.effects["air-drag"]
            f[striker.AIR], f[striker.CRISIS], f[striker.THIN] = air.factor, air.critical, air.crisis_ratio
        return f

    @cached_property
    def kernel_law(self) -> tuple[NDArray[np.int64], Array]:
        """Settings and numbers of the ground's kernel."""
        s = self._applied
        return _kernel_law(Itself(s.ground.law), Itself(s.effects))

    @property
    def times(self) -> Array:
        """Rows of the full run: from the lead to the end, s."""
        start, settings = self.scenario.initiation, self.scenario.simulation
        lead = start.lead_time if isinstance(start, Drop) else 0.0
        every = max(1, round(settings.output_step / settings.step)) * settings.step
        count = round((settings.duration + lead) / every) + 1
        return np.asarray(np.round(np.arange(count) * every - lead, 9), dtype=np.float64)

    def track(self, until: float) -> Track:
        """The fall up to a time (s), or to rest if that comes first. Raises `DropFailedError`."""
        law, p = self.kernel_law
        memory = HIDDEN + self.scenario.ground.law.hidden
        steps, elements, stayed = drop_integrator.fall(law, p, memory, self.numbers, until)
        if not stayed:
            raise DropFailedError("the drop diverged: a velocity beyond 10 km/s, or steps without end")
        return Track(law=law, p=p, numbers=self.numbers, until=until, steps=steps, elements=elements)

    def rows(self, times: Array) -> Array:
        """Columns of `track` at `times` (s, rising), (n, track.OUT_COLUMNS), without what sensors make of them.

        Raises `DropFailedError`.
        """
        return self.track(float(times[-1]) if len(times) else 0.0).rows(times)

    def motion(self, times: Array) -> dict[str, Array]:
        """Channels of the drop at `times` (s, rising), before its sensors. Raises `DropFailedError`."""
        return channels_of(self.rows(times), COLUMNS)

    def run(self, times: Array | None = None) -> Recording:
        """Channels of the drop at `times` (s, rising; default: rows of the full run), as its sensors read them.

        Raises `DropFailedError`.
        """
        at = self.times if times is None else np.ascontiguousarray(times, dtype=np.float64)
        recording = Recording(title=self.scenario.title, time=at, channels=self.motion(at), source="simulation")
        return read(self.scenario.effects, recording)


@lru_cache(maxsize=CACHED_GROUNDS)
def _kernel_law(law: Itself, effects: Itself) -> tuple[NDArray[np.int64], Array]:
    return settings(law.thing, *acting(effects.thing))


def channels_of(rows: Array, names: Collection[str]) -> dict[str, Array]:
    """Those of the channels `names` that a drop has, from `DropModel.rows`."""
    return {name: sign * rows[:, column] for name, (column, sign) in COLUMNS.items() if name in names}


def landing_speed(start: Drop | Release, gravity: float) -> float:
    """Speed at first contact if nothing but gravity acts before, m/s."""
    return start.speed if isinstance(start, Drop) else math.sqrt(start.speed**2 + 2.0 * gravity * start.height)


def unfit(scenario: Scenario) -> str:
    """Why a scenario is no drop test that can be run by itself, or nothing."""
    if not isinstance(scenario.vehicle, Striker):
        return f"vehicle.kind: not a drop test, got {scenario.vehicle.kind!r}; 'striker' is needed"
    if scenario.inputs:
        return f"inputs: prescribed over time, got {scenario.inputs[0].name!r}; a drop test by itself has none"
    slope = scenario.effects.get("slope")
    if not _is_level(Itself(scenario.ground.surface)) or (slope is not None and slope.angle != 0.0):
        return "ground.surface: not level throughout; a drop test by itself needs level ground"
    return ""


@lru_cache(maxsize=CACHED_GROUNDS)
def _is_level(surface: Itself) -> bool:
    return is_flat(surface.thing) and not any(gradient(surface.thing))


def simulate_drop(scenario: Scenario, times: Array | None = None) -> Recording:
    """Channels of a drop test without the full run. Raises ``ValueError`` if it is none, `DropFailedError`."""
    return DropModel(scenario=scenario).run(times)

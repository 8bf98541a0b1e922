"""A diagnosis by full runs from end to end: tosses of a cube, whose friction is not what the scenario says."""

from __future__ import annotations

import sys
from collections.abc import Mapping
from dataclasses import replace
from itertools import pairwise
from typing import Any

import numpy as np
import pytest

from rollover.diagnosis import diagnose
from rollover.diagnosis.fit.parameterisation import Candidate, physical
from rollover.diagnosis.forward import full_run
from rollover.diagnosis.forward.full_run import RunSimulator
from rollover.diagnosis.overlay import overlays_of
from rollover.diagnosis.selection.candidates import candidates_of
from rollover.diagnosis.settings import SETTINGS
from rollover.dynamics import simulate
from rollover.recording import Recording
from rollover.scenario import Scenario
from rollover.spec.document import value_at
from rollover.system.processes import Children
from tests.physics.scenes import shipped

CHANNELS = ("chassis/position_x", "chassis/position_z", "chassis/angular_velocity_y", "chassis/velocity_x")
SPEEDS = (-1.0, -1.4, -0.7)
FEW = ("ground-friction", "soil-stiffness", "slope", "sensor-gain", "sensor-scale")


@pytest.fixture
def _few_rivals(monkeypatch: pytest.MonkeyPatch) -> None:
    """Five effects compete: all of them would take minutes."""
    module = sys.modules["rollover.diagnosis.conclusion"]

    def few(*given: Any) -> list[Candidate]:
        return [c for c in candidates_of(*given) if c.id in FEW]

    monkeypatch.setattr(module, "candidates_of", few)


def toss() -> Scenario:
    return shipped("cube_toss").replaced({"initiation.position": [0.21, 0.20, 0.08]})


def tosses(changes: Mapping[str, Any], noise: float = 0.01) -> list[tuple[str, Recording]]:
    """Recorded tosses, simulated in shorter steps on a grid that lies elsewhere."""
    found = []
    rng = np.random.default_rng(4)
    for k, speed in enumerate(SPEEDS):
        conditions = {"initiation.velocity": [speed, -0.3, -0.05], "initiation.angular_velocity": [-1.0, -2.0 - k, 1.0]}
        finer = {"simulation.step": 2.5e-4, "ground.elements.centre": (0.011, -0.017), "simulation.duration": 0.25}
        whole = simulate.run(toss().replaced({**conditions, **finer, **changes})).recording
        time = np.arange(0.0, 0.2, 0.002)
        made = {}
        for c in CHANNELS:
            values = np.interp(time, whole.time, whole[c])
            made[c] = values + rng.normal(0.0, noise * np.ptp(values), time.size)
        found.append((f"toss{k}", Recording(title=f"toss{k}", time=time, channels=made, conditions=conditions)))
    return found


@pytest.mark.usefixtures("_few_rivals")
def test_friction_that_was_left_out_is_named_and_fitted(monkeypatch: pytest.MonkeyPatch) -> None:
    given = tosses({"ground.friction.coefficient": 0.30})
    found = diagnose(toss(), given)
    assert found.verdict == "missing-physics", found.sentence
    assert found.effects[0].id == "ground-friction"
    assert found.effects[0].parameters["coefficient"].value == pytest.approx(0.30, rel=0.1)
    assert found.where[0].phase in ("impact", "sliding")
    assert any("full runs" in note for note in found.notes)
    assert found.after["held_out"].nrmse < 0.8 * found.before["held_out"].nrmse
    shown, children = overlays_of(toss(), given, found), Children(2)
    with monkeypatch.context() as patch:
        patch.setattr(RunSimulator, "_run", lambda own, _, changes: own._known[full_run._key(changes)])
        try:
            side_by_side = overlays_of(toss(), given, found, children)  # no run is made here
        finally:
            children.stop()
    for one, other in zip(shown, side_by_side, strict=True):
        assert one.shift == other.shift
        for a, b in zip(one.tracks, other.tracks, strict=True):
            assert a.scatter is not None
            np.testing.assert_array_equal((a.before, a.after, a.scatter), (b.before, b.after, b.scatter))


@pytest.mark.usefixtures("_few_rivals")
def test_nothing_is_named_where_only_the_integration_differs() -> None:
    found = diagnose(toss(), tosses({}))
    assert found.effects == ()
    assert found.verdict in ("no-mismatch", "cannot-tell")


def test_candidates_begin_at_what_the_scenario_has() -> None:
    own = shipped("side_overturn")
    by_id = {c.id: c for c in candidates_of((), {}, "rollover", own)}
    known = {
        "ground-friction": 0.5, "tyre-damping": 3000.0, "rops-plasticity": 34_000.0, "mass": 0.0, "inertia": 1.0,
        "slope": 0.0, "rops-elasticity": 3.7e5,
    }  # fmt: skip
    for id, value in known.items():
        candidate = by_id[id]
        assert candidate.null is not None
        (search,) = candidate.search.values()
        assert candidate.null[0] is not None, id
        assert physical(candidate.null[0], search) == pytest.approx(value, rel=1e-6, abs=1e-9), id
        assert all(0.0 < x < 1.0 and x != candidate.null[0] for (x,) in candidate.starts())
    assert by_id["tyre-lateral-stiffness"].null == (None,)  # front and rear differ: no one value changes nothing
    assert by_id["centre-of-mass"].null == (0.5, 0.5)
    assert by_id["tank-slosh"].null == (None, None)
    assert len(by_id["tank-slosh"].starts()) <= 6
    load = by_id["payload-shift"]  # tells only near its travel: looked at in many, beside little and much friction
    by_friction = {
        mu: [physical(x[1], load.search["travel"]) for x in load.starts() if x[2] == mu] for mu in (0.25, 0.5)
    }
    assert sum(map(len, by_friction.values())) == len(load.starts())
    for travels in by_friction.values():
        assert all(b / a < 1.1 for a, b in pairwise(travels))
        assert (min(travels), max(travels)) == (pytest.approx(0.03, rel=0.1), pytest.approx(0.6, rel=0.1))
    some = replace(load, points=tuple(load.starts()[:3]))
    assert some.scan_points() == load.starts()[:3]
    assert by_id["ground-friction"].scan_points() == by_id["ground-friction"].starts()


def test_values_are_found_by_their_paths() -> None:
    own = shipped("side_overturn")
    assert value_at(own, "vehicle.wheels.rear_left.tyre.friction") == 0.8
    assert value_at(own, "initiation.excess_deg") == 1.0
    with pytest.raises(KeyError, match="no such path"):
        value_at(own, "initiation.sped")


def test_full_runs_are_looked_at_sparingly() -> None:
    assert SETTINGS.forward.runs.is_ensemble
    assert SETTINGS.forward.runs.few < 3
    assert min(SETTINGS.forward.runs.fd_steps) > 0.005  # below, chance decides


def test_a_wrong_speed_is_looked_for_in_what_drops_alone() -> None:
    def ids(name: str) -> set[str]:
        return {c.id for c in candidates_of((), {}, "rollover", shipped(name))}

    assert "impact-speed" in ids("rops_drop")
    assert "impact-speed" not in ids("side_overturn")

"""Uneven ground and soils per patch: what is a plane in disguise behaves like the plane; what is whole adds up."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np
import pytest

from ground.array import Elements
from ground.kernel import CELL
from ground.surface import Bank, Heightmap, Slope, Surface
from ground.ye import Ye2006
from rollover.dynamics import assembly
from rollover.dynamics.result import Run
from rollover.dynamics.setup import set_up
from rollover.dynamics.simulate import run
from rollover.kernels.broad_phase import search
from rollover.kernels.forces import read_poses
from rollover.kernels.tables import handle
from rollover.scenario import load
from rollover.spec.initiation import Drop
from rollover.system.errors import InputError
from tests.physics.scenes import block

ANGLE = 20.0


def done(result: Run) -> Run:
    assert result.status == "done", result.sentence
    return result


def fall(surface: Surface, drop: Drop, mu: float = 0.5) -> Run:
    return done(run(block(drop, surface=surface, mu=mu, duration=0.3)))


# turned, so that no point stands on the border of an element, where rounding would decide
DROP = Drop(speed=2.0, roll_deg=ANGLE + 5.0, pitch_deg=3.0, yaw_deg=7.0)
DROP_LEFT = Drop(speed=2.0, roll_deg=-ANGLE - 5.0, pitch_deg=3.0, yaw_deg=7.0)


def same(a: np.ndarray, b: np.ndarray) -> None:
    """The first 50 ms, dozens of touches, to rounding; later hits at the border of an element multiply it."""
    np.testing.assert_allclose(b[:100], a[:100], rtol=0, atol=1e-9)
    np.testing.assert_allclose(b, a, rtol=0, atol=2e-3)


def test_a_box_on_the_face_of_a_bank_is_a_box_on_a_slope() -> None:
    """The bank's edge lies far uphill and its foot far below: under the box it is the plane z = -tan(a) y."""
    rise = math.tan(math.radians(ANGLE))
    slope = fall(Slope(angle_deg=ANGLE, direction_deg=-90.0), DROP_LEFT)
    bank = fall(Bank(height=40.0, angle_deg=ANGLE, edge=(0.0, -10.0)), DROP_LEFT)
    for name, shift in (("position_y", 0.0), ("position_z", -10.0 * rise), ("roll", 0.0)):
        same(slope.recording[f"chassis/{name}"] + shift, bank.recording[f"chassis/{name}"])
    assert bank.recording["ground/force_normal"].max() == pytest.approx(
        slope.recording["ground/force_normal"].max(), rel=1e-3
    )


def test_a_height_map_sampled_from_a_slope_is_that_slope() -> None:
    rise, x = math.tan(math.radians(ANGLE)), np.linspace(-4.0, 4.0, 33)
    grid = tuple(tuple(float(rise * y) for y in x) for _ in x)
    mapped = fall(Heightmap(heights=grid, spacing=(0.25, 0.25), corner=(-4.0, -4.0)), DROP)
    sloped = fall(Slope(angle_deg=ANGLE, direction_deg=90.0), DROP)
    for name in ("chassis/position_y", "chassis/position_z", "chassis/roll"):
        same(sloped.recording[name], mapped.recording[name])


def test_a_height_map_comes_from_a_file(tmp_path: Path) -> None:
    np.save(tmp_path / "hill.npy", np.array([[0.0, 0.5], [1.0, 2.0]]))
    (tmp_path / "hill.csv").write_text("# heights, m\n0.0, 0.5\n1.0, 2.0\n")
    (tmp_path / "bad.csv").write_text("0.0, high\n1.0, 2.0\n")
    for name in ("hill.npy", "hill.csv"):
        surface = f"{{kind: heightmap, heights: {name}, spacing: [1.0, 1.0]}}"
        (tmp_path / "s.yaml").write_text(f"base: side_overturn.yaml\nground: {{surface: {surface}}}\n")
        assert load(tmp_path / "s.yaml").ground.surface.heights == ((0.0, 0.5), (1.0, 2.0))  # type: ignore[union-attr]
    for name, words in (("no.csv", "no such file"), ("bad.csv", "no grid of numbers")):
        surface = f"{{kind: heightmap, heights: {name}, spacing: [1.0, 1.0]}}"
        (tmp_path / "s.yaml").write_text(f"base: side_overturn.yaml\nground:\n  surface: {surface}\n")
        with pytest.raises(InputError, match=words) as said:
            load(tmp_path / "s.yaml")
        assert [fault.line for fault in said.value.faults] == [3]


def test_a_million_uneven_elements_cost_what_is_touched() -> None:
    """Same cells under the box, array 1 m and 50 m wide: the same motion and the same memory."""
    bank = Bank(height=1.0, angle_deg=30.0, edge=(0.0, 0.2))
    few, many = (
        done(run(block(Drop(speed=2.0), surface=bank, duration=0.2).replaced(
            {"ground.elements": {"length": size, "width": size, "spacing": [0.05, 0.05]}}
        )))
        for size in (2.0, 50.0)
    )  # fmt: skip
    assert many.scenario.ground.elements.count == (1000, 1000)
    assert len(few.track.element) == len(many.track.element) < 400
    # the cells' corners are sums from the array's own corner: equal to rounding, no more
    np.testing.assert_allclose(many.recording["chassis/roll"], few.recording["chassis/roll"], atol=1e-7)


def test_only_shapes_far_from_the_ground_are_skipped(monkeypatch: pytest.MonkeyPatch) -> None:
    """A tractor pushed into a bank in many attitudes: by pieces of its patches as by patches whole."""
    scenario, found = load("bank_overturn").applied(), []
    for piece in (0.2, 100.0):
        monkeypatch.setattr(assembly, "PIECE", piece)
        rig = set_up(scenario)
        q, random, own = rig.start.q.copy(), np.random.default_rng(5), []
        for _ in range(12):
            q[:6] = [*random.uniform(-1.0, 1.0, 2), random.uniform(-1.2, 1.0), *random.uniform(-2.0, 2.0, 3)]
            read_poses(rig.tables.pose, q, np.zeros_like(q))
            t = rig.tables
            slots = t.touched[: search(handle(t))]
            cells = np.argsort(t.state[slots, CELL])
            own.append(np.column_stack([t.state[slots, CELL], t.found[slots][:, [0, 1, 3, 4, 5, 6]]])[cells])
            t.found[slots, 0] = 0.0
        found.append(own)
    assert sum(map(len, found[0])) > 100
    for by_piece, whole in zip(*found, strict=True):
        np.testing.assert_allclose(by_piece, whole, rtol=1e-12, atol=1e-12)


def test_two_soils_side_by_side_are_each_its_own() -> None:
    """A box falls into the left half, a box falls into the right: each as on an array of that soil alone."""
    soft, firm = Ye2006(stiffness_scale=0.5), Ye2006(stiffness_scale=2.0)
    halves = {"low": [0.0, -3.0], "high": [3.0, 3.0], "law": firm, "friction": {"coefficient": 0.7}}
    base = block(Drop(speed=2.0, roll_deg=4.0, position=(-1.0, 0.0)), law=soft, mu=0.3, duration=0.2)
    both = base.replaced({"ground.patches": [halves]})
    left = {"ground.law": soft, "ground.friction.coefficient": 0.3}, (-1.0, 0.0)
    right = {"ground.law": firm, "ground.friction.coefficient": 0.7}, (1.0, 0.0)
    peaks = []
    for changes, where in (left, right):
        there = {"initiation.position": list(where)}
        alone, among = done(run(base.replaced({**changes, **there}))), done(run(both.replaced(there)))
        for name, values in alone.recording.channels.items():
            assert np.array_equal(values, among.recording[name]), name
        peaks.append(float(alone.recording["ground/force_normal"].max()))
    assert peaks[1] > 1.3 * peaks[0]


def test_a_patch_that_lies_over_two_elements() -> None:
    from rollover.dynamics.assembly import tables_of
    from rollover.dynamics.bodies import bodies_of
    from rollover.kernels.broad_phase import law_of
    from rollover.kernels.tables import handle

    patch = {"low": [0.0, 0.0], "high": [0.2, 0.1], "law": Ye2006(stiffness_scale=3.0)}
    scenario = block(Drop(speed=1.0)).replaced(
        {"ground.elements": Elements(length=1.0, width=1.0, spacing=(0.1, 0.1)), "ground.patches": [patch]}
    )
    t = handle(tables_of(scenario, bodies_of(scenario.vehicle, scenario.ground.elements)))
    assert [cell for cell in range(100) if law_of(t, cell)] == [5 * 10 + 5, 6 * 10 + 5]

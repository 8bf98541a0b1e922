"""The array: cost and memory with what is touched, loads that do not depend on its size, fineness or place."""

from __future__ import annotations

from itertools import pairwise
from typing import Any

import numpy as np
import pytest

from ground.kernel import COLUMNS
from rollover.assessment.loads import peak_loads
from rollover.dynamics.assembly import tables_of
from rollover.dynamics.bodies import bodies_of
from rollover.dynamics.result import Run
from rollover.dynamics.simulate import run
from rollover.spec.initiation import Drop
from tests.ground.reference_drop import solve
from tests.physics.scenes import block, drop, shipped


def peak(result: Run, channel: str) -> float:
    """Filtered peak of a load channel, N."""
    assert result.status == "done", result.sentence
    return next(p.filtered for p in peak_loads(result) if p.channel == channel)


def test_a_million_elements_cost_memory_only_where_touched() -> None:
    few, many = (
        block(Drop(speed=2.0), duration=0.3).replaced(
            {"ground.elements": {"length": size, "width": size, "spacing": [0.05, 0.05]}}
        )
        for size in (2.0, 50.0)
    )
    assert many.ground.elements.count == (1000, 1000)
    first, second = run(few), run(many)
    for name, values in first.recording.channels.items():
        assert np.array_equal(values, second.recording[name]), name
    assert len(second.track.element) == len(first.track.element) < 400
    tables = tables_of(many, bodies_of(many.vehicle, many.ground.elements))
    assert tables.slot_of.nbytes == 4_000_000
    assert tables.memory.nbytes < 3 * len(tables.point_a) * COLUMNS * 8 + 1e5


def test_one_element_is_an_array_too() -> None:
    scenario = drop(2.0).replaced({"ground.elements": {"length": 0.14, "width": 0.045, "spacing": [0.14, 0.045]}})
    assert scenario.ground.elements.count == (1, 1)
    assert run(scenario).recording["ground/sinkage"].max() == pytest.approx(solve(2.0).z_max, rel=5e-3)


def test_leaving_the_array_ends_the_run_with_the_cure() -> None:
    scenario = block(Drop(speed=2.0)).replaced({"ground.elements": {"length": 0.5, "width": 6.0}})
    result = run(scenario)
    assert result.status == "failed"
    assert "enlarge ground.elements" in result.sentence
    assert result.recording.time.size >= 1


@pytest.mark.parametrize("roll_deg", [0.0, 20.0])
def test_peak_does_not_depend_on_the_fineness_of_the_array(roll_deg: float) -> None:
    """A block falls flat and on its edge: array 2x and 4x finer, peaks within 3 %, and closer the finer."""
    peaks = [
        peak(
            run(block(Drop(speed=3.0, roll_deg=roll_deg), mu=0.5, spacing=0.08 / n, duration=0.1)),
            "ground/force_normal",
        )
        for n in (1, 2, 4)
    ]
    change = [abs(b / a - 1.0) for a, b in pairwise(peaks)]
    assert max(change) < 0.03, f"peaks {peaks}"
    assert change[1] <= change[0] + 1e-3, f"peaks {peaks}"


def test_rops_peak_converges_with_the_fineness_of_the_array() -> None:
    """The corner of a ROPS with a tractor's mass behind it: array 2x and 4x finer changes the peak by less than 3 %."""
    base = shipped("rops_drop").replaced({"simulation.duration": 0.2})
    peaks = [
        peak(run(base.replaced({"ground.elements.spacing": [0.05 / n, 0.05 / n]})), "rops/force") for n in (1, 2, 4)
    ]
    change = [abs(b / a - 1.0) for a, b in pairwise(peaks)]
    assert max(change) < 0.03, f"peaks {peaks}"


def left_with_a_rut() -> tuple[Any, ...]:
    """An element that a face at 2 m/s went down on by 0.1 m and is on its way back from: law, memory, row, state."""
    from ground.kernel import MODE, STATE_COLUMNS, commit
    from ground.law import touched
    from ground.settings import settings
    from ground.ye import Ye2006

    law, row, state = Ye2006(), np.zeros(COLUMNS), np.zeros(STATE_COLUMNS, dtype=np.int64)
    row[5] = 0.14 * 0.045
    state[MODE] = 1
    s = touched(law, speed=2.0)
    told, p = settings(law)
    for z in np.linspace(0.001, 0.1, 100):
        commit(told, p, s, row, state, z, 1.0, 1e-3, 132.0)
    commit(told, p, s, row, state, 0.0999, -0.1, 1e-3, 132.0)
    return told, p, s, row, state


def test_second_hit_starts_from_the_rut() -> None:
    """An element let go keeps its rut: hit again at the same speed it gives no force before the rut's depth."""
    from ground.kernel import LINE_C, LINE_Z, normal_force, rut_depth

    told, p, s, row, _ = left_with_a_rut()
    assert row[LINE_Z] == pytest.approx(0.1)
    assert rut_depth(row) == pytest.approx(0.098)  # recovery 2 %
    assert normal_force(told, p, s, row, 0.0979, 0.0) == 0.0
    halfway = normal_force(told, p, s, row, 0.099, 0.0)
    top = normal_force(told, p, s, row, 0.1, 0.0)
    assert halfway == pytest.approx(0.5 * top, rel=1e-9)
    row[LINE_C] = 1e5
    assert normal_force(told, p, s, row, 0.099, -1.0) == 0.0  # never a pull, however fast it leaves


@pytest.mark.parametrize("speed", [0.5, 2.0, 3.4])
def test_a_second_hit_reloads_along_the_first_unloading_line(speed: float) -> None:
    """Below, the ground does not know the new speed: K_u (z - z_r) up to where it meets z K'(z, v_s) of this hit."""
    from ground.kernel import LINE_K, LINE_Z, TOUCH_SPEED, begin, normal_force
    from ground.law import touched
    from ground.ye import Ye2006

    told, p, s, row, state = left_with_a_rut()
    slope, first = row[LINE_K], normal_force(told, p, s, row, 0.0985, 0.0)
    row[TOUCH_SPEED] = speed
    begin(told, p, s, row, state, 132.0, 0.098)
    assert row[LINE_K] == slope
    assert normal_force(told, p, s, row, 0.0985, 0.0) == pytest.approx(first, rel=1e-12)
    end, virgin = row[LINE_Z], np.zeros(COLUMNS)
    virgin[5] = row[5]
    own = normal_force(told, p, touched(Ye2006(), speed=speed), virgin, end, 0.0)
    assert slope * (end - 0.098) == pytest.approx(own, rel=1e-9)
    assert (end > 0.1) == (speed < 2.0) or speed == 2.0

"""Kernels that do not count who holds their arrays: what they may not do, and that they give the same numbers."""

from __future__ import annotations

import gc
import weakref
from typing import Any

import numba
import numpy as np
import pytest

from ground.compiled import compiled, leaf
from ground.kernel import AREA, COLUMNS, LINE_C, LINE_F, LINE_K, LINE_Z, STATE_COLUMNS, normal_force
from rollover.dynamics import assembly, setup, simulate
from rollover.dynamics.drop_test import DropModel
from rollover.kernels.striker import accelerate
from rollover.kernels.tables import Tables, handle
from rollover.kernels.vectors import to_world
from rollover.scenario import load


@leaf
def _makes_one(n: int) -> float:
    return float(np.zeros(n)[0])


@leaf
def _reads_leaf(t: Any) -> float:
    return t.pose[1, 2] + t.counts[0] + t.law[0, 1] * t.mass[1, 0]  # type: ignore[no-any-return]


@compiled
def _reads(t: Any) -> Any:
    counted = t.pose[1, 2] + t.counts[0] + t.law[0, 1] * t.mass[1, 0]
    return counted, _reads_leaf(t)


def counted(kernel: Any) -> Any:
    """The same source compiled as usual; not kept on disk, where it would be taken for the kernel itself."""
    return numba.njit(error_model="numpy")(kernel.py_func)


def test_a_leaf_that_makes_an_array_is_refused() -> None:
    """Nobody would ever let go of that array."""
    with pytest.raises(Exception, match=r"np\.zeros"):
        _makes_one(3)


@pytest.mark.parametrize("integrator", ["exudyn", "compiled"])
def test_a_run_that_has_ended_holds_no_tables(integrator: str, monkeypatch: pytest.MonkeyPatch) -> None:
    """Megabytes each, of thousands of runs: what no kernel lets go of is never freed."""
    made = []

    def made_tables(*args: Any) -> Tables:
        made.append(assembly.tables_of(*args))
        return made[-1]

    monkeypatch.setattr(setup, "tables_of", made_tables)
    short = {"simulation.integrator": integrator, "simulation.duration": 0.01}
    simulate.run(load("side_overturn").replaced(short))
    held = [weakref.ref(t.event) for t in made]
    made.clear()
    gc.collect()
    assert [there() for there in held] == [None]


def test_a_compiled_run_leaves_no_garbage_of_tables(monkeypatch: pytest.MonkeyPatch) -> None:
    """What waits for a collection of garbage is held twenty times over in a worker of a study."""
    made = []

    def made_tables(*args: Any) -> Tables:
        tables = assembly.tables_of(*args)
        made.append(weakref.ref(tables.event))
        return tables

    monkeypatch.setattr(setup, "tables_of", made_tables)
    gc.collect()
    gc.disable()
    try:
        short = {"simulation.integrator": "compiled", "simulation.duration": 0.01}
        simulate.run(load("side_overturn").replaced(short))
        assert [there() for there in made] == [None]
    finally:
        gc.enable()


def test_a_leaf_reads_a_bundle_as_a_counting_kernel_does() -> None:
    """By name, whatever stands before it in the bundle: every array is told by its first numbers."""
    integers = {"law", "state", "counts", "active", "touched", "point_body", "member_i", "slot_of"}
    arrays: dict[str, Any] = {}
    for k, name in enumerate(Tables._fields):
        if name in integers or name.endswith("_i"):
            arrays[name] = np.arange(100 * k, 100 * k + 9).reshape(3, 3)
        else:
            arrays[name] = np.arange(100.0 * k, 100.0 * k + 9.0).reshape(3, 3)
    arrays["counts"] = np.arange(7)[3:]
    want = arrays["pose"][1, 2] + 3 + arrays["law"][0, 1] * arrays["mass"][1, 0]
    assert _reads(handle(Tables(**arrays))) == (want, want)


def test_what_does_not_count_gives_the_same_bits() -> None:
    """Kernels laid out in their callers are optimised beside them: not one rounding may differ for that."""
    changes = {
        "effects.soil-layer.depth": 0.05,
        "effects.soil-layer.stiffness_ratio": 2.0,
        "effects.soil-viscous-damping.damping": 300.0,
        "effects.structural-compliance.stiffness": 1e6,
        "effects.air-drag.area": 0.4,
    }
    model = DropModel(scenario=load("drop_test")).with_(changes)
    law, p = model.kernel_law
    counting, force = counted(accelerate), counted(normal_force)
    draw = np.random.default_rng(7)
    s, state, row = np.array([3.0, 132.0, np.inf, 7e4, 3e5]), np.zeros(STATE_COLUMNS, np.int64), np.zeros(COLUMNS)
    for mode in (1, 2):
        state[1], state[2] = 0, mode
        for _ in range(300):
            row[AREA] = 0.0063
            row[LINE_Z], row[LINE_F], row[LINE_K], row[LINE_C] = draw.uniform(0.0, [0.3, 4000.0, 1e6, 300.0])
            y = draw.uniform([0.0, -3.0, 0.0, -3.0], [0.3, 3.0, 0.3, 3.0])
            a, b = np.zeros(2), np.zeros(2)
            assert accelerate(law, p, s, row, state, model.numbers, y, a) == counting(
                law, p, s, row, state, model.numbers, y, b
            )
            assert np.array_equal(a, b)
            assert normal_force(law, p, s, row, y[0], y[1]) == force(law, p, s, row, y[0], y[1])
    pose = draw.normal(size=24)
    assert to_world(pose, 0.1, 0.2, 0.3) == counted(to_world)(pose, 0.1, 0.2, 0.3)


@compiled
def power(x: float, n: int) -> float:
    found = 1.0
    for _ in range(n):
        found *= x
    return found


def sum_of_powers(x: float, counted: Any) -> float:
    n = 0
    for one in counted:
        if one > 0.0:
            n += 1
    return power(x, 2) + power(x, 3) + power(x, n)


def test_constants_of_callers_make_no_further_machine_code() -> None:
    """Else each 2, each 3 and each sum that begins at 0 is compiled by itself, with all that is called below."""
    caller = numba.njit(sum_of_powers)  # one that is kept on disk would not ask for what it calls
    assert caller(2.0, np.array([1.0, -1.0, 1.0, 1.0])) == 4.0 + 8.0 + 8.0
    assert len(power.signatures) == 1  # type: ignore[attr-defined]

"""Contract of every law in the array: never pulls, dissipates, trial is pure, commit once, the ledger closes."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from ground.kernel import AREA, COLUMNS, LOADING, MODE, STATE_COLUMNS, commit, normal_force
from ground.law import REFERENCE_AREA, GroundLaw, touched
from ground.settings import settings as kernel_settings
from rollover.dynamics.simulate import run
from tests.ground.test_laws_contract import EXAMPLES
from tests.physics.scenes import drop

LAWS = pytest.mark.parametrize("law", EXAMPLES.values(), ids=EXAMPLES.keys())


class Element:
    """One element driven by hand."""

    def __init__(self, law: GroundLaw, speed: float) -> None:
        self.row, self.state = np.zeros(COLUMNS), np.zeros(STATE_COLUMNS, dtype=np.int64)
        self.row[AREA], self.state[MODE] = 2.0 * REFERENCE_AREA, LOADING
        self.law, self.p = kernel_settings(law)
        self.s = touched(law, speed=speed)

    def force(self, z: float, v: float) -> float:
        return float(normal_force(self.law, self.p, self.s, self.row, z, v))

    def commit(self, z: float, v: float, h: float) -> None:
        commit(self.law, self.p, self.s, self.row, self.state, z, v, h, 132.0)

    def memory(self) -> bytes:
        return self.row.tobytes() + self.state.tobytes() + self.s.tobytes()


@LAWS
@settings(max_examples=40, deadline=None)
@given(
    turns=st.lists(st.floats(0.0, 0.3), min_size=2, max_size=6), speed=st.floats(0.2, 5.0), rate=st.floats(0.05, 3.0)
)
def test_never_pulls_and_dissipates_over_any_path(
    law: GroundLaw, turns: list[float], speed: float, rate: float
) -> None:
    """Work done on the element from the surface and back is never negative: it gives back no more than it took."""
    element, h, z, work, before = Element(law, speed), 1e-3, 0.0, 0.0, 0.0
    for target in [*turns, 0.0]:
        steps = max(2, int(abs(target - z) / (rate * h)))
        path = np.linspace(z, target, steps + 1)[1:]
        for there in path:
            v = (there - z) / h
            force = element.force(there, v)
            assert force >= 0.0
            work += 0.5 * (before + force) * (there - z)
            element.commit(there, v, h)
            z, before = float(there), element.force(there, v)
    # a step of the trapezoid over the unloading line's end may miss half of that step's elastic energy
    assert work >= -1e-6 - 0.5 * h * rate * before


@LAWS
def test_trial_is_pure_and_one_commit_is_what_counts(law: GroundLaw) -> None:
    asked, quiet = Element(law, 2.0), Element(law, 2.0)
    for k, z in enumerate(np.concatenate([np.linspace(0.001, 0.08, 60), np.linspace(0.08, 0.07, 20)])):
        v = 1.0 if k < 60 else -0.5
        for other in (0.5 * z, 1.5 * z, z):
            memory = asked.memory()
            asked.force(other, v)
            asked.force(other, -v)
            assert asked.memory() == memory
        asked.commit(z, v, 1e-3)
        quiet.commit(z, v, 1e-3)
        assert asked.memory() == quiet.memory()


@LAWS
def test_ledger_closes_on_a_drop(law: GroundLaw) -> None:
    result = run(drop(2.0, law=law, duration=0.4, step=1e-4))
    assert result.status == "done", result.sentence
    residual = np.abs(result.recording["energy/residual"]).max()
    assert residual < 2e-3 * result.released, f"{residual:.3g} J of {result.released:.4g} J"
    assert result.recording["ground/force_normal"].min() >= 0.0
    assert result.ledger["soil"] > 0.0

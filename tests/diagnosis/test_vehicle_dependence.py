"""What the misfit of a motion depends on: functions of one quantity, held against conditions left out."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from rollover.diagnosis.data.dataset import Dataset
from rollover.diagnosis.fit.levenberg_marquardt import Problem
from rollover.diagnosis.fit.linearisation import Fitted
from rollover.diagnosis.inference.vehicle_dependence import dependency
from rollover.diagnosis.noise.ensemble import HeavyTail
from tests.diagnosis.test_chassis import ABOUT, ALONG, thrown

SPEEDS = (0.4, 0.8, 1.2)
FALLING = "np.abs(state['chassis/velocity_z'])"


def told(off: dict[str, str], speeds: tuple[float, ...] = SPEEDS) -> list[tuple[str, float]]:
    """What tosses depend on that were recorded with `off` added."""
    problem, base = judged([thrown(v, off)[1] for v in speeds])
    found = dependency(problem, base)
    assert sum(share for _, share in found) <= 1.0
    return list(found)


def judged(dataset: list[Dataset]) -> tuple[Problem, Fitted]:
    problem = Problem(dataset)
    base = problem.fit((), (), shifts=[0.0] * len(dataset), rounds=0)
    assert base is not None
    return problem, base


def test_a_forces_quantity_predicts_it_in_held_out_conditions() -> None:
    found = told({ALONG[1]: f"4.0 * {FALLING}"})
    assert found[0][0] == "chassis/velocity_z"
    assert found[0][1] > 0.95
    assert len(found) == 1  # another adds nothing to it


def test_a_moment_shows_in_what_the_turn_has_grown_by() -> None:
    """d omega/dt = c v_z: omega is no function of v_z, as it begins at nought in every toss, whatever v_z is then."""
    found = told({ABOUT[2]: f"0.002 * np.cumsum(10.0 * {FALLING})"})
    assert found[0][0] == "chassis/velocity_z"
    assert found[0][1] > 0.95
    rough = told({ALONG[2]: f"0.002 * np.cumsum(100.0 * {FALLING})"})  # what is no rate has not grown by anything
    assert dict(rough).get("chassis/velocity_z", 0.0) < 0.95


def test_a_second_quantity_has_what_it_adds() -> None:
    (first, most), (second, added) = told({ALONG[1]: f"4.0 * {FALLING} + 3.0 * np.sin(30.0 * t)"})
    assert first in ("time", "chassis/roll", "chassis/pitch")  # which all go on alike in every toss
    assert second == "chassis/velocity_z"
    assert 0.05 < added < 0.2
    assert most + added > 0.95


def test_nothing_depends_on_anything_where_there_is_only_noise() -> None:
    found = told({})
    assert not found or found[0][1] < 0.3
    problem, base = judged([thrown(v, {})[1] for v in SPEEDS])
    less = tuple(replace(b, residual=0.5 * b.residual) for b in base.blocks)
    assert dependency(problem, replace(base, blocks=less)) == ()  # less than noise leaves


@pytest.mark.parametrize("weight", [0.0, 1.0])
def test_samples_count_for_what_they_count_in_the_fit(weight: float) -> None:
    """The second half of each recording goes its own way: where it counts nothing the first half tells."""
    gone = f"4.0 * {FALLING} + 6.0 * (t > 0.08) * np.sin(40.0 * t * {{v}} + 3.0 * {{v}})"
    dataset = []
    for v in SPEEDS:
        e = thrown(v, {ALONG[1]: gone.format(v=v)})[1]
        counts = np.where(e.recording.time > 0.08, weight, 1.0)
        dataset.append(replace(e, signals=tuple(replace(s, weight=counts[s.rows]) for s in e.signals)))
    found = dict(dependency(*judged(dataset)))
    assert (found.get("chassis/velocity_z", 0.0) > 0.9) == (weight == 0.0)


def test_columns_of_diverged_runs_count_as_the_misfit_does() -> None:
    problem, base = judged([thrown(v, {ALONG[1]: f"4.0 * {FALLING}"})[1] for v in SPEEDS])
    blocks = []
    for e, b in zip(problem.dataset, base.blocks, strict=True):
        late = np.concatenate([e.recording.time[s.rows] > 0.05 for s in e.signals])
        counts = np.where(late, 0.3, 1.0)
        blocks.append(
            replace(b, residual=counts * b.residual, heavy_tail=HeavyTail(samples=counts, share=0.1, more=0.0))
        )
    found = dependency(problem, replace(base, blocks=tuple(blocks)))
    assert found[0][0] == "chassis/velocity_z"
    assert found[0][1] > 0.95

"""Runs that nobody could tell apart: which one stands for all, slopes among them, and what is fitted to their mean."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from types import SimpleNamespace
from typing import Any, cast

import numpy as np
import pytest

from rollover.diagnosis.data.dataset import Dataset, Signal
from rollover.diagnosis.fit import ensemble_mean
from rollover.diagnosis.fit.ensemble_mean import (
    ensemble_mean_step,
    projected_gradient,
    with_ensemble_scatter,
)
from rollover.diagnosis.fit.levenberg_marquardt import Problem
from rollover.diagnosis.fit.linearisation import Fitted, ResidualBlock
from rollover.diagnosis.fit.parameterisation import Candidate
from rollover.diagnosis.fit.step import Step
from rollover.diagnosis.forward import full_run
from rollover.diagnosis.forward.full_run import CENTRE, Made, Making, RunSimulator
from rollover.diagnosis.inference import intervals as intervals_of
from rollover.diagnosis.inference.intervals import ensemble_variance, intervals, secondary_variance
from rollover.diagnosis.selection.ensemble_validation import refined_under_scatter
from rollover.diagnosis.settings import SETTINGS
from rollover.diagnosis.settings.forward import Effort
from rollover.diagnosis.statements import step_error_note
from rollover.effects import Search
from rollover.recording import Recording
from tests.physics.scenes import shipped

CHANNEL = "chassis/acceleration_y"
N = 60
TIME = 0.004 * np.arange(N)


def a_toss(monkeypatch: pytest.MonkeyPatch, off: Mapping[tuple[float, ...], float]) -> RunSimulator:
    """A toss whose runs are 1 + what is said of the place of their grid."""
    made = Recording(title="toss", time=np.arange(0.0, 0.2, 0.01), channels={CHANNEL: np.zeros(20)})
    simulator = RunSimulator(shipped("cube_toss"), made)

    def run(making: Making) -> Made:
        time = np.arange(0.0, 0.25, 0.005)
        size = 1.0 + off.get(making.scenario.ground.elements.centre, 0.01 * (simulator.runs + 1))
        run = Recording(title="run", time=time, channels={CHANNEL: size * np.sin(40.0 * time) + time})
        return Made((making.scenario, run), (), 0.01)

    monkeypatch.setattr(full_run, "make", run)
    return simulator


def test_the_run_that_is_like_most_others_stands_for_all(monkeypatch: pytest.MonkeyPatch) -> None:
    own = shipped("cube_toss").ground.elements.centre
    simulator = a_toss(monkeypatch, {own: 4.0})  # where the scenario has its grid the run goes the other way
    simulator.choose_medoid()
    chosen = simulator.scenario.ground.elements.centre
    assert chosen != own
    made = simulator.runs
    assert made == len(SETTINGS.forward.run.grid_offsets) + len(
        SETTINGS.forward.run.perturbations
    )  # one neighbour is one of the places
    found = simulator.predict({}, 0.0)
    assert found is not None
    assert np.max(found[CHANNEL]) < 2.0
    assert simulator.runs == made  # it is known already
    assert max(np.max(np.abs(s[CHANNEL])) for s in simulator.perturbed()) > 3.0  # the other way is a neighbour now


def test_a_run_like_the_others_stays(monkeypatch: pytest.MonkeyPatch) -> None:
    own = shipped("cube_toss").ground.elements.centre
    simulator = a_toss(monkeypatch, {own: 0.055})
    simulator.choose_medoid()
    assert simulator.scenario.ground.elements.centre == own


def test_phases_are_those_of_the_run_that_stands_for_all() -> None:
    made = Recording(title="toss", time=np.arange(0.0, 0.4, 0.01), channels={"chassis/position_z": np.zeros(40)})
    simulator = RunSimulator(shipped("cube_toss"), made)
    simulator.choose_medoid()
    runs = simulator.runs
    marks = simulator.marks()
    assert [name for _, name in marks][:2] == ["approach", "impact"]
    assert simulator.runs == runs
    plain = RunSimulator(shipped("cube_toss").replaced({CENTRE: simulator.scenario.ground.elements.centre}), made)
    assert plain.marks() == marks


def test_a_shape_that_is_not_fitted_widens_an_interval(monkeypatch: pytest.MonkeyPatch) -> None:
    """y = 20 (x + f) sin t with f from 0 to 1 unknown: x is known to sqrt(1/12) and no better."""
    problem = Problem([dataset(4, 0.0)])
    alone = replace(SLOPE, secondary={"other": Search(0.0, 1.0)})
    monkeypatch.setattr(Candidate, "with_secondary", lambda self, x: [(*x, 0.5)])
    block = problem.block(0, (SLOPE,), (0.4,), 0.0, problem.effort.fine)
    assert block is not None
    inverse = np.linalg.inv(block.J.T @ block.J)
    found = secondary_variance(problem, Fitted(candidates=(alone,), x=(0.4,), blocks=(block,)), inverse)
    assert found[0] == pytest.approx(1.0 / 12.0, rel=0.05)
    assert secondary_variance(problem, Fitted(candidates=(SLOPE,), x=(0.4,), blocks=(block,)), inverse) == 0.0


def test_no_perturbed_run_is_the_run_itself(monkeypatch: pytest.MonkeyPatch) -> None:
    simulator = a_toss(monkeypatch, {})
    place = simulator._grid_centre(SETTINGS.forward.run.perturbations[0].grid_offset)
    simulator.scenario = simulator.scenario.replaced({CENTRE: place})
    plain = simulator.scenario
    others = [plain.replaced(simulator._beside(one)) for one in SETTINGS.forward.run.perturbations]
    assert all(one != plain for one in others)
    assert len({repr(one) for one in others}) == len(SETTINGS.forward.run.perturbations)
    assert sorted({round(plain.simulation.step / one.simulation.step) for one in others}) == [1, 2, 3]
    assert any(one.vehicle.contact_spacing < plain.vehicle.contact_spacing for one in others)  # type: ignore[union-attr]


class Rough:
    """y = 20 x sin(t) with what chance adds from one x to the next; each neighbour adds its own."""

    effort: Effort = SETTINGS.forward.runs

    def __init__(self, seed: int, size: float) -> None:
        self.seed, self.size = seed, size

    def marks(self) -> tuple[tuple[float, str], ...]:
        return ()

    def predict(self, changes: Mapping[str, Any], shift: float) -> dict[str, np.ndarray]:
        x = changes.get("effects.slope.angle", 0.0) + changes.get("effects.slope.other", 0.0)
        x += changes.get("effects.sensor-gain.gain", 0.0)
        moving = 0.0 if "effects.sensor-gain.gain" in changes else x
        rng = np.random.default_rng([self.seed, round(1e9 * moving), round(changes.get("neighbour", 0))])
        chance = np.convolve(rng.standard_normal(N + 6), np.ones(7) / np.sqrt(7.0), mode="valid")
        return {CHANNEL: 20.0 * x * np.sin(30.0 * (TIME - shift)) + self.size * chance}

    def perturbed(
        self, changes: Mapping[str, Any] | None = None, shift: float = 0.0, parts: int = 1
    ) -> list[dict[str, np.ndarray]]:
        values = dict(changes or {})
        base = self.predict(values, shift)[CHANNEL]
        several = [{**values, "neighbour": k, "parts": parts} for k in range(1, 7)]
        return [{CHANNEL: self.predict(each, shift)[CHANNEL] - base} for each in several]


def dataset(
    seed: int, size: float, values: np.ndarray | None = None, effort: Effort = SETTINGS.forward.runs
) -> Dataset:
    simulator = Rough(seed, size)
    simulator.effort = effort
    signal = Signal(
        channel=CHANNEL, rows=np.arange(N), values=np.zeros(N) if values is None else values, sigma=0.1, noise=0.1,
        ar=(), span=10.0,
    )  # fmt: skip
    recording = Recording(title="r", time=TIME, channels={CHANNEL: signal.values})
    perturbed = tuple(s[CHANNEL] for s in simulator.perturbed()) if size else ()
    return Dataset(
        name="r", recording=recording, simulator=cast(Any, simulator), signals=(signal,), shift_prior=1e-3,
        condition="r", perturbed=perturbed,
    )  # fmt: skip


def candidate(id: str, kind: str, name: str) -> Candidate:
    return Candidate(id=id, kind=kind, family="any", search={name: Search(0.0, 1.0)})


SLOPE, GAIN = candidate("slope", "parameter", "angle"), candidate("sensor-gain", "sensor", "gain")


def gradient(problem: Problem, c: Candidate) -> float:
    """dy/dx along sin, over its true value of 20."""
    block = problem.block(0, (c,), (0.4,), 0.0, problem.effort.fine)
    assert block is not None
    wave = np.sin(30.0 * TIME) / 0.1
    return float(block.J[:, 0] @ wave / (wave @ wave)) / 20.0


def test_a_slope_among_runs_that_scatter_is_that_of_a_wide_step() -> None:
    """Squares of J beyond those of the slope are chance's: 2 N (size/step)^2 one-sided over 0.008, and next to none."""
    problem = Problem([dataset(3, 0.1)])
    assert gradient(problem, SLOPE) == pytest.approx(1.0, abs=0.1)
    block = problem.block(0, (SLOPE,), (0.4,), 0.0, problem.effort.fine)
    assert block is not None
    true = float(np.sum((20.0 * np.sin(30.0 * TIME) / 0.1) ** 2))
    assert float(block.J[:, 0] @ block.J[:, 0]) < 1.3 * true
    narrow = Problem([dataset(3, 0.1, effort=replace(SETTINGS.forward.drops, fd_steps=(8e-3,)))]).block(
        0, (SLOPE,), (0.4,), 0.0, 8e-3
    )
    assert narrow is not None
    assert float(narrow.J[:, 0] @ narrow.J[:, 0]) > 1.5 * true


def test_weak_parameters_have_larger_steps_but_sensors_not() -> None:
    seen: list[float] = []
    problem = Problem([dataset(3, 0.5)])
    predict = problem.dataset[0].simulator.predict

    def watched(changes: Mapping[str, Any], shift: float) -> Any:
        seen.extend(float(v) for k, v in changes.items() if k.startswith("effects."))
        return predict(changes, shift)

    problem.dataset[0].simulator.predict = watched  # type: ignore[method-assign]
    gradient(problem, SLOPE)
    assert max(seen) - min(seen) == pytest.approx(8.0 * SETTINGS.forward.runs.fine)
    seen.clear()
    gradient(problem, GAIN)
    assert max(seen) - min(seen) < 0.02


def test_a_step_to_the_ensembles_mean_holds_what_it_says() -> None:
    """w = J x + d, the model J x + d_0, neighbours J x + d_k: d alike. The step takes d_0 out, intervals hold x."""
    rng = np.random.default_rng(8)
    inside, plain, wide = [], [], []
    for _ in range(300):
        blocks, every = [], []
        for _ in range(4):
            J = rng.standard_normal((N, 1))
            d = rng.standard_normal((8, 1)) @ J.T * 0.4 + 0.3 * rng.standard_normal((8, N))  # along J above all
            slope = np.zeros(N)
            residual = d[0] - d[1] + 0.05 * rng.standard_normal(N)
            blocks.append(ResidualBlock(residual=residual, J=J, slope=slope, shift=0.0, prior=1e-3))
            one = dataset(0, 0.0)
            signal = replace(one.signals[0], sigma=1.0)
            every.append(replace(one, signals=(signal,), perturbed=tuple(d[k] - d[1] for k in range(2, 8))))
        A = sum(b.J.T @ b.J for b in blocks) + SETTINGS.fit.linearisation.weak_prior * np.eye(1)
        dx = ensemble_mean_step(every, blocks)
        sd = np.sqrt(ensemble_variance(every, blocks, np.linalg.inv(A)))
        inside.append(abs(dx[0]) < 1.96 * sd[0])
        plain.append(float(np.linalg.solve(A, sum(b.normal()[1] for b in blocks))[0]))
        wide.append((float(dx[0]), float(sd[0])))
    assert 0.91 < np.mean(inside) < 0.985
    assert np.std([x for x, _ in wide]) < 0.85 * np.std(plain)  # sqrt(1 + 1/6) beside sqrt(2)
    assert np.mean([s for _, s in wide]) < 1.3 * np.std([x for x, _ in wide])


def test_a_time_shift_takes_its_part_of_a_deviation() -> None:
    rng = np.random.default_rng(1)
    J, slope = rng.standard_normal((N, 1)), rng.standard_normal(N)
    block = ResidualBlock(residual=np.zeros(N), J=J, slope=1e3 * slope, shift=0.0, prior=1.0)
    e = dataset(0, 0.0)
    e = replace(e, signals=(replace(e.signals[0], sigma=1.0),))
    assert abs(projected_gradient(block, e, slope)[0]) < 1e-3
    across = J[:, 0] - slope * float(slope @ J[:, 0]) / float(slope @ slope)
    assert projected_gradient(block, e, across)[0] == pytest.approx(float(J[:, 0] @ across), rel=1e-4)


def test_the_scatter_is_that_of_runs_with_the_explanation() -> None:
    """Strays that the scenario's own runs have are replaced by those at the fitted point, and weights with them."""
    problem = Problem([dataset(5, 0.2, 6.0 * np.sin(30.0 * TIME))])
    fitted = problem.fit((SLOPE,), (0.3,), rounds=1)
    assert fitted is not None
    before = problem.dataset[0].perturbed
    with_ensemble_scatter(problem, fitted)
    after = problem.dataset[0].perturbed
    expected = problem.dataset[0].simulator.perturbed(problem.changes((SLOPE,), fitted.x), fitted.blocks[0].shift)
    np.testing.assert_array_equal(np.stack(after), np.stack([s[CHANNEL] for s in expected]))
    assert not np.array_equal(np.stack(before), np.stack(after))
    weight = problem.dataset[0].signals[0].weight
    assert weight is not None
    assert np.all(weight < 0.6)


class Stepped(Rough):
    """y = 20 (x + LAG/parts) sin(t): an integrator of first order, whose steps are the scenario's in one part."""

    def predict(self, changes: Mapping[str, Any], shift: float) -> dict[str, np.ndarray]:
        wave = 20.0 * LAG / changes.get("parts", 1) * np.sin(30.0 * (TIME - shift))
        return {CHANNEL: super().predict(changes, shift)[CHANNEL] + wave}


LAG = 0.06


@pytest.mark.parametrize("size", [0.05, 0.0])
def test_a_value_is_that_of_shorter_steps(size: float, monkeypatch: pytest.MonkeyPatch) -> None:
    """Measured at 0.4: fitted 0.4 - LAG, 0.4 - LAG/4 by steps of a quarter; LAG/4 more is another standard error."""
    every = []
    for r in range(4):
        e = dataset(30 + r, size, 8.0 * np.sin(30.0 * TIME))
        every.append(replace(e, simulator=cast(Any, Stepped(30 + r, size))))
    problem = Problem(every)
    fitted = problem.fit((SLOPE,), (0.3,))
    assert fitted is not None
    assert fitted.x[0] == pytest.approx(0.4 - LAG, abs=3e-3)
    fine = ensemble_mean.refined_by_ensemble_mean(problem, fitted)
    for e in every:  # all others are run in the scenario's own
        assert (
            np.max(np.abs(np.mean([d[CHANNEL] for d in e.simulator.perturbed()], axis=0))) < 0.25 * 20.0 * LAG
        )  # 0.75 in shorter ones
    if not size:  # nothing scatters: nothing is known of what steps do
        assert fine is fitted
        return
    assert fine.x[0] == pytest.approx(0.4 - LAG / SETTINGS.fit.ensemble_mean.finer_parts, abs=3e-3)
    by_itself, whole = intervals(problem, fine, {})[0]["angle"], intervals(problem, fine, {}, fitted)[0]["angle"]
    more = np.sqrt((whole.high - whole.value) ** 2 - (by_itself.high - by_itself.value) ** 2)
    assert more == pytest.approx(
        1.96 * (fine.x[0] - fitted.x[0]) / (SETTINGS.fit.ensemble_mean.finer_parts - 1), rel=1e-6
    )
    assert whole.low < 0.4 < whole.high
    assert (by_itself.as_simulated, whole.as_simulated) == (None, fitted.x[0])
    # how rough the misfit of runs is counts where an interval is stated, not where a side of it is asked for
    monkeypatch.setattr(intervals_of, "quadratic_extents", lambda *_: np.full((1, 2), 50.0))
    assert intervals(problem, fine, {}, fitted)[0]["angle"] == whole
    rough = intervals(problem, fine, None, fitted)[0]["angle"]
    assert rough.high - rough.low > 5.0 * (whole.high - whole.low)
    # what it tells is not asked of means of runs; where slopes are right, nor where it does not tell, it counts not
    asked: list[Any] = []

    def profile_extents(*given: Any) -> np.ndarray:
        asked.append(given[4])
        return np.ones((1, 2))

    monkeypatch.setattr(intervals_of, "profile_extents", profile_extents)
    assert intervals(problem, fine, None, fitted)[0]["angle"] == rough
    for far in (0.0, np.nan):
        monkeypatch.setattr(intervals_of, "quadratic_extents", lambda *_, far=far: np.full((1, 2), far))
        assert intervals(problem, fine, None, fitted)[0]["angle"] == whole
    assert asked == [{}, {}, {0: (-1.0, 1.0)}]
    told = [cast(Any, SimpleNamespace(id="slope", parameters={"angle": i})) for i in (by_itself, whole)]
    assert step_error_note(told) == [
        f"slope angle: {fine.x[0]:.4g} rad in steps of 1/4 of the scenario's, {fitted.x[0]:.4g} in these"
    ]
    hardly = replace(whole, as_simulated=whole.value + 0.01 * (whole.high - whole.low))
    assert step_error_note([cast(Any, SimpleNamespace(id="slope", parameters={"angle": hardly}))]) == []


def test_parameters_hold_though_runs_scatter() -> None:
    """Rough runs measured at x = 0.37: settled fits and their intervals, sixty times."""
    hits, widths = [], []
    for seed in range(60):
        rng = np.random.default_rng([seed, 7])
        every = []
        for r in range(4):
            e = dataset(100 * seed + r, 0.3)
            true = e.simulator.predict({"effects.slope.angle": 0.37, "neighbour": 99}, 0.0)
            assert true is not None
            every.append(dataset(100 * seed + r, 0.3, true[CHANNEL] + 0.1 * rng.standard_normal(N)))
        problem = Problem(every)
        base, fitted = problem.fit((), ()), problem.fit((SLOPE,), (0.3,))
        assert base is not None
        assert fitted is not None
        found = refined_under_scatter(problem, Step(base=base, fitted=fitted, p_value=0.0, rivals=(fitted,)))
        assert found.rivals == (found.fitted,)
        interval = intervals(problem, found.fitted)[0]["angle"]
        hits.append(interval.low <= 0.37 <= interval.high)
        widths.append(interval.high - interval.low)
    assert np.mean(hits) > 0.87
    assert 0.022 < np.median(widths) < 0.03  # 0.020 where recordings could not disagree


def test_a_move_does_not_jump_to_another_trajectory() -> None:
    """Where the whole move goes, from x = 0.365 to 0.385, runs take another course than was measured."""

    class Leaping(Rough):
        def predict(self, changes: Mapping[str, Any], shift: float) -> dict[str, np.ndarray]:
            x = float(changes.get("effects.slope.angle", 0.0))
            return {CHANNEL: super().predict(changes, shift)[CHANNEL] + 8.0 * (0.365 < x < 0.385) * np.cos(20.0 * TIME)}

    every = []
    for r in range(4):
        true = Rough(r, 0.02).predict({"effects.slope.angle": 0.374, "neighbour": 99}, 0.0)[CHANNEL]
        one = dataset(r, 0.02, true)
        every.append(replace(one, simulator=cast(Any, Leaping(r, 0.02))))
    problem = Problem(every)
    blocks = [problem.block(r, (SLOPE,), (0.30,), 0.0, 0.02) for r in range(4)]
    fitted = Fitted(candidates=(SLOPE,), x=(0.30,), blocks=tuple(b for b in blocks if b is not None))
    assert fitted.x[0] + ensemble_mean_step(problem.dataset, fitted.blocks)[0] == pytest.approx(0.374, abs=0.005)
    base = problem.fit((), ())
    assert base is not None
    found = refined_under_scatter(problem, Step(base=base, fitted=fitted, p_value=0.0, rivals=(fitted,)))
    assert not 0.365 < found.fitted.x[0] < 0.385
    assert found.fitted.chi2 < problem.again(fitted).chi2

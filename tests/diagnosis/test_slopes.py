"""Slopes of full runs beside clocks: an impact that comes later is the same impact to a clock."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from typing import Any, cast

import numpy as np
import pytest

from rollover.diagnosis.data.dataset import Dataset, Signal
from rollover.diagnosis.fit.jobs import Executor
from rollover.diagnosis.fit.levenberg_marquardt import Problem
from rollover.diagnosis.fit.linearisation import Fitted
from rollover.diagnosis.fit.local_search import linearised
from rollover.diagnosis.fit.parameterisation import Candidate, coordinate
from rollover.diagnosis.fit.step import Inquiry, Screened
from rollover.diagnosis.fit.tasks import Task
from rollover.diagnosis.selection.forward_step import _first_fits
from rollover.diagnosis.selection.score_test import ScoreTest
from rollover.diagnosis.selection.screening import screen
from rollover.diagnosis.settings import SETTINGS
from rollover.diagnosis.settings.forward import Effort
from rollover.effects import Search
from rollover.recording import Recording

CHANNEL = "chassis/acceleration_y"
TIME = 0.0005 * np.arange(200)
WIDTH, LATER, SIGMA = 0.002, 0.1, 0.01  # s; s per unit of x; of an impact of 1


def first_impact(at: float) -> np.ndarray:
    return np.asarray(np.exp(-(((TIME - 0.05 - at) / WIDTH) ** 2)))


class Late:
    """y = (1 + x + o) g(t - LATER (x + o/2) - tau): x and o make an impact larger and later."""

    effort: Effort = SETTINGS.forward.runs

    def marks(self) -> tuple[tuple[float, str], ...]:
        return ()

    def perturbed(
        self, changes: Mapping[str, Any] | None = None, shift: float = 0.0, parts: int = 1
    ) -> list[dict[str, np.ndarray]]:
        return []

    def predict(self, changes: Mapping[str, Any], shift: float) -> dict[str, np.ndarray]:
        x, o = (float(changes.get(f"effects.{name}", 0.0)) for name in ("slope.angle", "mass.added"))
        return {CHANNEL: (1.0 + x + o) * first_impact(LATER * (x + 0.5 * o) + shift)}


class Scattering(Late):
    """The same with six neighbours that nobody could tell apart."""

    def perturbed(
        self, changes: Mapping[str, Any] | None = None, shift: float = 0.0, parts: int = 1
    ) -> list[dict[str, np.ndarray]]:
        values = dict(changes or {})
        there = self.predict(values, shift)[CHANNEL]
        return [{CHANNEL: self.predict({**values, "neighbour": k}, shift)[CHANNEL] - there} for k in range(1, 7)]


def dataset(values: np.ndarray, simulator: Any, effort: Effort = SETTINGS.forward.runs) -> Dataset:
    simulator.effort = effort
    signal = Signal(
        channel=CHANNEL, rows=np.arange(TIME.size), values=values, sigma=SIGMA, noise=SIGMA, ar=(), span=1.0
    )
    return Dataset(
        name="r", recording=Recording(title="r", time=TIME, channels={CHANNEL: values}),
        simulator=cast(Any, simulator), signals=(signal,), shift_prior=1e-3, condition="r",
        perturbed=tuple(s[CHANNEL] for s in simulator.perturbed()),
    )  # fmt: skip


def candidate(id: str, name: str) -> Candidate:
    return Candidate(id=id, kind="parameter", family="any", search={name: Search(0.0, 1.0)})


SLOPE, MASS = candidate("slope", "angle"), candidate("mass", "added")
TRAVEL = "payload-shift.travel"
WALL = candidate(*TRAVEL.split("."))


def test_what_a_clock_explains_tells_nothing_of_a_parameter() -> None:
    """y = (1 + x) g(t - c x - tau): beside tau dy/dx is g alone, as g'g = 0 over an impact; c x goes to the clock.

    Hence A = sum g^2/sigma^2, and (c/sd)^2 for what is known of the clock. Slopes over two impacts that lie apart,
    (y(h) - y(-h))/(2h), hold sum g^2 twice over (2h)^2.
    """
    x = 0.03  # what it is at 0 comes 3 ms earlier, at 0.06 3 ms later: an impact is 2 ms wide
    expected = float(np.sum((first_impact(0.0) / SIGMA) ** 2)) + (LATER / 1e-3) ** 2
    found = Problem([dataset((1.0 + x) * first_impact(LATER * x), Late())]).block(
        0, (SLOPE,), (x,), 0.0, SETTINGS.forward.runs.fine
    )
    assert found is not None
    assert found.normal()[0][0, 0] == pytest.approx(expected, rel=0.05)
    g = float(found.slope @ found.J[:, 0]) / float(found.slope @ found.slope)
    assert g == pytest.approx(LATER, rel=0.05)  # the clock goes along by as much as the impact comes later
    plain = Problem([dataset(first_impact(LATER * x), Late(), replace(SETTINGS.forward.drops, fd_steps=(x, 1e-3)))])
    apart = plain.block(0, (SLOPE,), (x,), 0.0, x)
    assert apart is not None
    assert apart.normal()[0][0, 0] > 20.0 * expected


@pytest.mark.parametrize(("off", "is_near"), [(0.0, True), (1.0, True), (3.0, False)])
def test_from_afar_slopes_are_those_of_a_wide_step(off: float, is_near: bool) -> None:
    """What misses a recording by three times its noise is far from an explanation: ripples there lead nowhere."""
    x, effort = 0.03, replace(SETTINGS.forward.drops, fd_steps=(2e-2, 5e-3))
    problem = Problem([dataset((1.0 + x) * first_impact(LATER * x) + off * SIGMA, Late(), effort)])
    found = problem.block(0, (SLOPE,), (x,), 0.0, effort.fine)
    assert found is not None
    point = ((SLOPE,), (x,))
    wide, narrow = (problem.moved(0, point, ((SLOPE,), (x + h,)), 0.0) for h in (5e-3, 1e-6))
    assert wide is not None
    assert narrow is not None
    tangent, adaptive_difference = narrow / 1e-6, wide / 5e-3
    apart = float(np.abs(adaptive_difference - tangent).max())
    assert apart > 0.02 * float(np.abs(tangent).max())
    if is_near:
        assert np.abs(found.J[:, 0] - tangent).max() < 0.1 * apart
    else:
        np.testing.assert_allclose(found.J[:, 0], adaptive_difference, rtol=1e-12)


def test_a_rival_is_compared_with_equally_fixed_time_shifts() -> None:
    """A base whose clock has eaten an impact that comes 3 ms late has nothing to gain: beside it none is a rival."""
    rng = np.random.default_rng(3)
    measured = [1.03 * first_impact(LATER * 0.03) + SIGMA * rng.standard_normal(TIME.size) for _ in range(2)]
    problem = Problem([dataset(values, Late()) for values in measured])
    base = problem.fit((), (), shifts=[0.003, 0.003])
    assert base is not None
    assert all(b.shift > 0.002 for b in base.blocks)
    assert leading(problem, base, {SLOPE.key: 9.0, MASS.key: 8.0}) == {SLOPE.key, MASS.key}


def leading(problem: Problem, base: Fitted, scores: Mapping[str, float]) -> set[str]:
    """Keys of what is worth a whole fit after first ones, for some scores."""
    scored = ScoreTest(score=9.0, scores=scores, null=np.zeros(4), detectable={})
    screened = [Screened(candidate=c, starts=((0.02,),), chi2=1.0, potential=1.0) for c in (SLOPE, MASS)]
    with Executor() as executor:
        inquiry = Inquiry(
            problem=problem, candidates=(SLOPE, MASS), groups=[], phases=[], say=lambda _: None, executor=executor
        )
        _, leaders = _first_fits(inquiry, base, screened, (0, 1), (0.0, 0.0), scored)
    return {f.candidates[-1].key for f in leaders}


def test_the_leader_by_score_is_fitted_whatever_others_gain() -> None:
    """The impact is 9 % too strong, of which a mass by its slope has hardly any; only its score may speak for it."""
    rng = np.random.default_rng(4)
    measured = [1.09 * first_impact(LATER * 0.09) + SIGMA * rng.standard_normal(TIME.size) for _ in range(2)]
    problem = Problem([dataset(values, Late()) for values in measured])
    base = problem.fit((), (), shifts=[0.0, 0.0])
    assert base is not None
    assert leading(problem, base, {SLOPE.key: 9.0, MASS.key: 2.0}) == {SLOPE.key}
    assert leading(problem, base, {SLOPE.key: 8.0, MASS.key: 9.0}) == {SLOPE.key, MASS.key}
    problem.effort = replace(problem.effort, most_leaders=1)  # nor however many others are followed
    assert leading(problem, base, {SLOPE.key: 8.0, MASS.key: 9.0}) == {SLOPE.key, MASS.key}


def test_runs_are_announced_before_they_are_needed(monkeypatch: pytest.MonkeyPatch) -> None:
    """So that they can be made side by side; where nothing scatters no slope asks for a wider step than was said."""
    rng, announced, retained = np.random.default_rng(3), set[tuple[int, float, float]](), []
    measured = [1.09 * first_impact(LATER * 0.09) + SIGMA * rng.standard_normal(TIME.size) for _ in range(2)]
    problem = Problem([dataset(values, Late()) for values in measured])
    made = Problem._made

    def point(r: int, changes: Mapping[str, Any]) -> tuple[int, float, float]:
        return r, changes.get("effects.slope.angle", 0.0), changes.get("effects.mass.added", 0.0)

    def made_ahead(own: Problem, wanted: Any) -> None:
        announced.update(point(r, own.changes(c, x)) for r, c, x in wanted)

    def asked(own: Problem, r: int, c: Any, x: Any, shift: float) -> Any:
        if any(x):  # the scenario as it is has been run
            retained.append(point(r, own.changes(c, x)) in announced)
        return made(own, r, c, x, shift)

    monkeypatch.setattr(Problem, "made_ahead", made_ahead)
    monkeypatch.setattr(Problem, "_made", asked)
    base = problem.fit((), (), shifts=[0.0, 0.0])
    assert base is not None
    scored = ScoreTest(score=9.0, scores={SLOPE.key: 9.0, MASS.key: 8.0}, null=np.zeros(4), detectable={})
    with Executor() as executor:
        inquiry = Inquiry(
            problem=problem, candidates=(SLOPE, MASS), groups=[], phases=[], say=lambda _: None, executor=executor
        )
        screened = screen(inquiry, base, (SLOPE, MASS), (0, 1), (0.0, 0.0), scored)
        leaders = _first_fits(inquiry, base, screened, (0, 1), (0.0, 0.0), scored)[1]
        monkeypatch.setattr(Problem, "_fit", lambda *_: None)
        before = len(announced)
        inquiry.fits([Task(candidates=(SLOPE,), start=(at,), shifts=(0.0, 0.0)) for at in (0.311, 0.713)])
    assert len(announced) == before + 2 * 2 * 3  # of two fits and recordings each, a place and both its sides
    problem.again(replace(leaders[0], x=(0.77,)))
    assert all(retained)
    assert len(retained) > 40


class Rough(Scattering):
    """Runs that scatter by far more than a narrow step moves them: slopes ask for wider ones."""

    def predict(self, changes: Mapping[str, Any], shift: float) -> dict[str, np.ndarray]:
        seed = [round(1e9 * float(changes.get("effects.slope.angle", 0.0))), round(changes.get("neighbour", 0))]
        chance = np.random.default_rng(seed).standard_normal(TIME.size)
        return {CHANNEL: super().predict(changes, shift)[CHANNEL] + 0.1 * chance}


@pytest.mark.parametrize("is_helped", [True, False])
def test_runs_over_wider_steps_are_announced_too(is_helped: bool, monkeypatch: pytest.MonkeyPatch) -> None:
    """0.03 and 0.06 to either side where a fit ends, 0.06 and 0.12 where it begins: all are asked for."""
    problem = Problem([dataset(1.3 * first_impact(LATER * 0.3), Rough()) for _ in range(2)])
    announced, alone, batches = set[tuple[int, float]](), list[float](), 0
    made = Problem._made

    def made_ahead(_: Problem, wanted: Any) -> None:
        nonlocal batches
        several = {(r, x[0]) for r, _, x in wanted}
        batches += bool(several - announced)
        announced.update(several)

    def asked(own: Problem, r: int, c: Any, x: Any, shift: float) -> Any:
        alone.extend([x[0]] * ((r, x[0]) not in announced))
        return made(own, r, c, x, shift)

    monkeypatch.setattr(Problem, "made_ahead", made_ahead)
    monkeypatch.setattr(Problem, "_made", asked)
    monkeypatch.setattr(Problem, "is_helped", property(lambda _: is_helped))
    fitted = linearised(problem, (SLOPE,), (0.4,), (0.0, 0.0))
    assert fitted is not None
    assert announced >= {(r, 0.4 + d) for r in range(2) for d in (0.0, -0.03, 0.03)}
    assert ({(r, 0.4 - 0.12) for r in range(2)} <= announced) == is_helped
    assert (alone == []) == is_helped
    assert batches == (3 if is_helped else 1)
    problem.again(replace(fitted, x=(0.37,)))
    for start in (0.24, 0.33, 0.44, 0.52):  # some end before they have narrowed
        assert problem.fit((SLOPE,), (start,), shifts=(0.0, 0.0), rounds=1) is not None
    for width in (0, 1):
        assert problem.fit((SLOPE,), (0.5,), shifts=(0.0, 0.0), width=width) is not None
        with problem.held(fixed_shifts=True):  # these are short: no step is wider than it is said
            linearised(problem, (SLOPE,), (0.61,), (0.0, 0.0))
            assert not announced & {(r, 0.61 + 0.06) for r in range(2)}
    assert (alone == []) == is_helped
    problem.simulate_neighbourhood(
        (0,), (SLOPE, MASS), (0.71, 0.2), (0.0,), 0.03, first=1
    )  # what is held is not looked at
    assert (0, 0.71) in announced
    assert not announced & {(0, 0.71 - 0.03), (0, 0.71 - 0.06)}


def test_a_jump_to_another_trajectory_on_one_side_is_no_slope() -> None:
    """y = a x sin(wt), and for x > 0.52 another course besides: dy/dx = a sin(wt), as the side below tells."""

    class Leaping(Late):
        def predict(self, changes: Mapping[str, Any], shift: float) -> dict[str, np.ndarray]:
            x = float(changes.get("effects.slope.angle", 0.0))
            return {CHANNEL: x * np.sin(90.0 * TIME) + (x > 0.52) * np.sin(210.0 * TIME)}

    problem = Problem([dataset(0.5 * np.sin(90.0 * TIME), Leaping())])
    found = problem.block(0, (SLOPE,), (0.5,), 0.0, SETTINGS.forward.runs.fine)
    assert found is not None
    assert found.J[:, 0] == pytest.approx(np.sin(90.0 * TIME) / SIGMA, abs=0.02 / SIGMA)


def test_where_an_effect_ends_its_slope_is_that_of_both_sides() -> None:
    """y = min(x, 0.5) sin(wt): nothing moves above; a fit that took that side's slope would stay there for ever."""

    class Ends(Late):
        def predict(self, changes: Mapping[str, Any], shift: float) -> dict[str, np.ndarray]:
            return {CHANNEL: min(float(changes.get("effects.slope.angle", 0.0)), 0.5) * np.sin(90.0 * TIME)}

    found = Problem([dataset(0.4 * np.sin(90.0 * TIME), Ends())]).block(
        0, (SLOPE,), (0.5,), 0.0, SETTINGS.forward.runs.fine
    )
    assert found is not None
    assert found.J[:, 0] == pytest.approx(0.5 * np.sin(90.0 * TIME) / SIGMA, abs=0.01 / SIGMA)


def test_a_local_parameter_is_varied_over_less() -> None:
    """y = g(t - c (x - x0)), g = exp(-(t/w)^2) with w = 2 ms, c = 0.1 s: over 0.03 of a coordinate it is gone.

    sum (g(t + ch) - g(t - ch))^2 = 2 (1 - exp(-2 (ch/w)^2)) sum g^2, over (2h sigma)^2: with h a quarter of 0.03 that
    is 0.87 of |dy/dx|^2 = (c/w)^2 sum g^2/sigma^2, with 0.03 itself 0.22 of it.
    """

    class Moving(Late):
        def predict(self, changes: Mapping[str, Any], shift: float) -> dict[str, np.ndarray]:
            x = max(coordinate(float(changes[f"effects.{TRAVEL}"]), WALL.search["travel"]), 0.0)
            return {CHANNEL: first_impact(LATER * (x - 0.5))}

    problem = Problem([dataset(first_impact(0.0), Moving())])
    found = problem.block(0, (WALL,), (0.5,), 0.0, SETTINGS.forward.runs.fine)
    assert found is not None
    h, power = 0.25 * SETTINGS.forward.runs.fine, float(np.sum((first_impact(0.0) / SIGMA) ** 2))
    expected = (1.0 - np.exp(-2.0 * (LATER * h / WIDTH) ** 2)) * power / (2.0 * h**2)
    assert float(found.J[:, 0] @ found.J[:, 0]) == pytest.approx(expected, rel=1e-6)
    assert expected == pytest.approx(0.872 * (LATER / WIDTH) ** 2 * power, rel=1e-3)


LOAD = replace(WALL, search={"travel": Search(0.02, 1.0, "log"), "friction": Search(0.0, 1.0)})


def test_a_slope_is_taken_along_the_ridge_of_equal_contact() -> None:
    """y = g(t - c u), u = ln s - ln(2 - mu): what slides late and not far meets its wall when what slides far does.

    dy/dmu = dy/ds' ds'/du / (2 - mu) with s' the coordinate of ln s. Over 0.06 of mu alone the impact moves by 0.7 of
    its width; along u as it is not at all, but for the bend of the valley, (0.06/1.5)^2/2.
    """

    class Sliding(Late):
        def predict(self, changes: Mapping[str, Any], shift: float) -> dict[str, np.ndarray]:
            s, mu = float(changes[f"effects.{TRAVEL}"]), float(changes["effects.payload-shift.friction"])
            return {CHANNEL: first_impact(0.03 * (np.log(s / 0.15) - np.log((2.0 - mu) / 1.5)))}

    at = (coordinate(0.15, LOAD.search["travel"]), 0.5)
    found = Problem([dataset(first_impact(0.0), Sliding())]).block(
        0, (SLOPE, LOAD), (0.5, *at), 0.0, SETTINGS.forward.runs.fd_steps[0]
    )
    assert found is not None
    by_travel, by_friction = found.J[:, 1], found.J[:, 2]
    expected = by_travel / (1.5 * np.log(50.0))
    # 7e-4 by the bend; 0.26 by friction alone
    assert float(np.linalg.norm(by_friction - expected)) < 0.005 * float(np.linalg.norm(expected))


FLAT = replace(WALL, search={"travel": Search(0.0, 1.0)})


@pytest.mark.parametrize("early", [False, True])
def test_what_two_runs_differ_by_anyway_is_no_slope(early: bool) -> None:
    """y = x sin(wt) + n, n another for each run: over h to either side |y(x+h) - y(x-h)|^2 = (2h)^2|sin|^2 + 2 |n|^2.

    Runs that nobody could tell apart differ by 2 |n|^2 too: what is left of the slope's square, on average over forty
    recordings, is |sin|^2. With |n|^2 = 0.4 (2h)^2|sin|^2 it would come out 1.8 times as large. Before the impact a run
    has no chance in it, and nothing is taken off there.
    """
    h, wave = 0.03, np.sin(90.0 * TIME)  # a quarter of what others are widened to
    size = np.sqrt(0.4 * (2.0 * h) ** 2 * np.mean(wave**2))
    blown = TIME[100] if early else 0.0
    since = np.clip((TIME - blown) / (TIME[-1] - blown), 0.0, 1.0)
    modes = np.sin(np.pi * np.outer(since, np.arange(1, 21))) / np.sqrt(10.0)  # a mean square of 1 after the impact

    class Chancy(Late):
        def predict(self, changes: Mapping[str, Any], shift: float) -> dict[str, np.ndarray]:
            x, seed = float(changes.get(f"effects.{TRAVEL}", 0.0)), round(changes.get("neighbour", 0))
            chance = np.random.default_rng([seed, self.number, round(1e9 * x)]).standard_normal(20)
            return {CHANNEL: x * wave + size * modes @ chance}

        def perturbed(
            self, changes: Mapping[str, Any] | None = None, shift: float = 0.0, parts: int = 1
        ) -> list[dict[str, np.ndarray]]:
            here = self.predict({f"effects.{TRAVEL}": 0.5}, 0.0)[CHANNEL]
            each = [self.predict({f"effects.{TRAVEL}": 0.5, "neighbour": k}, 0.0)[CHANNEL] for k in range(1, 7)]
            return [{CHANNEL: y - here} for y in each]

        def __init__(self, number: int) -> None:
            self.number = number

    problem = Problem([replace(dataset(0.5 * wave, Chancy(number)), first_impact=blown) for number in range(40)])
    found = [problem.block(r, (FLAT,), (0.5,), 0.0, SETTINGS.forward.runs.fine) for r in range(40)]
    J = np.array([b.unweighted_J[:, 0] for b in found if b is not None]) * SIGMA
    late = blown <= TIME
    # twenty waves, six neighbours and one difference tell it to 50 % in a recording, to 8 % in forty
    assert float(np.mean(np.sum(J[:, late] ** 2, axis=1))) == pytest.approx(float(np.sum(wave[late] ** 2)), rel=0.1)
    # before the impact nothing is taken off: y is linear in x, and only rounding is left
    assert J[:, ~late] == pytest.approx(np.tile(wave[~late], (40, 1)), abs=1e-12)

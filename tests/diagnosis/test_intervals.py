"""Stated intervals hold the true value also where something beside the fitted value is not known."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from rollover.diagnosis.data.quantisation import with_quantisation
from rollover.diagnosis.fit.levenberg_marquardt import Problem
from rollover.diagnosis.fit.linearisation import Fitted, ResidualBlock
from rollover.diagnosis.fit.parameterisation import Candidate, coordinate
from rollover.diagnosis.inference import intervals as stated
from rollover.diagnosis.settings import SETTINGS
from rollover.effects import EFFECTS, Search, possible
from rollover.proof.generator import make, plan
from rollover.recording import Recording
from tests.diagnosis.drops import FORCE, recorded
from tests.diagnosis.test_fits import candidate, problem_of
from tests.diagnosis.test_local_search import problem_of_case
from tests.diagnosis.test_slopes import CHANNEL, LOAD, Late, dataset, first_impact


def fit(problem: Problem, c: Candidate) -> Fitted:
    found = problem.fit((c,), c.starts()[0])
    assert found is not None
    return found


def test_an_unfitted_exponent_widens_the_strengths_interval() -> None:
    """c v^0.9 fitted as c v: at 2 m/s, 7 % of the strength goes to the exponent, more than the noise leaves open."""
    changes = {"effects.soil-viscous-damping.damping": 60.0, "effects.soil-viscous-damping.exponent": 0.9}
    problem = problem_of(recorded(changes, speeds=(1.0, 1.5, 2.0), noise=0.01))
    c = candidate(problem, "soil-viscous-damping")
    assert set(c.secondary) == {"exponent"}
    fitted = fit(problem, c)
    no_jacobian = replace(fitted, candidates=(replace(c, secondary={}),))
    wide, narrow = (stated.intervals(problem, f)[0]["damping"] for f in (fitted, no_jacobian))
    assert wide.low <= 60.0 <= wide.high
    assert wide.high - wide.low > 1.5 * (narrow.high - narrow.low)
    assert wide.value == narrow.value


@pytest.mark.parametrize("flatter", [1.0, 4.0])
def test_an_interval_extends_as_far_as_the_misfit_stays_low(flatter: float) -> None:
    """Slopes say |w - J dx|^2 with J = 40, the misfit rises as if J were `flatter` times less: a parabola as wide."""
    J, n = 40.0, 50
    rng = np.random.default_rng(1)
    w = rng.standard_normal(n)
    way = rng.standard_normal(n)
    way -= w * (w @ way) / (w @ w)  # the misfit is least where the fit is
    way /= np.sqrt(way @ way)

    def block(_r: int, _c: object, x: list[float], _s: float, _n: float) -> ResidualBlock:
        there = w - J / flatter * (x[0] - 0.5) * way
        return ResidualBlock(residual=there, J=J * way[:, None], slope=np.zeros(n), shift=0.0, prior=1e-3)

    def clocked(r: int, c: object, x: list[float], s: float, _rounds: int) -> ResidualBlock:
        return block(r, c, x, s, 0.0)

    problem: Any = SimpleNamespace(
        clocked=clocked, block=block, dataset=(), effort=SETTINGS.forward.drops, made_ahead=lambda _: None
    )
    candidate = Candidate(id="mass", kind="parameter", family="", search={"added": Search(0, 1)})
    fitted = Fitted(candidates=(candidate,), x=(0.5,), blocks=(block(0, None, [0.5], 0.0, 0.0),))
    found = stated.profile_extents(problem, fitted, np.array([1.0 / J]), 1.0)
    assert found == pytest.approx(np.full((1, 2), flatter), rel=1e-12)  # rounding: the misfit is a parabola
    for sides, scored in (({0: (1.0,)}, (0.0, 1.0)), ({0: (-1.0,)}, (1.0, 0.0)), ({}, (0.0, 0.0))):
        found = stated.profile_extents(problem, fitted, np.array([1.0 / J]), 1.0, sides)
        assert found == pytest.approx(1.0 + (flatter - 1.0) * np.array([scored]), rel=1e-12)


@pytest.mark.parametrize(("start", "places"), [(0.5, 8), (0.08, 7)])
def test_rough_misfits_give_intervals_by_nearby_points(start: float, places: int) -> None:
    """The same three times flatter than slopes say, but for the fit itself, which stands in a dip.

    One width is 1.96/40 = 0.049: from 0.08 on one place lies below the fit, and of five nothing is told yet.
    """
    J, n, asked = 40.0, 50, []
    w = np.random.default_rng(1).standard_normal(n)
    way = np.random.default_rng(2).standard_normal(n)
    way -= w * (w @ way) / (w @ w)
    way /= np.sqrt(way @ way)

    def clocked(_r: int, _c: object, x: list[float], _s: float, _rounds: int) -> ResidualBlock:
        asked.append(x[0])
        there = (0.5 if x[0] == start else 1.0) * w - J / 3.0 * (x[0] - start) * way
        return ResidualBlock(residual=there, J=J * way[:, None], slope=np.zeros(n), shift=0.0, prior=1e-3)

    problem: Any = SimpleNamespace(clocked=clocked, made_ahead=list)
    candidate = Candidate(id="mass", kind="parameter", family="", search={"added": Search(0, 1)})
    fitted = Fitted(candidates=(candidate,), x=(start,), blocks=(clocked(0, None, [start], 0.0, 0),))
    asked.clear()
    assert stated.quadratic_extents(problem, fitted, np.array([1.0 / J]), 1.0) == pytest.approx(
        np.full((1, 2), 3.0), rel=1e-9
    )
    assert len(asked) == places
    assert all(0.0 <= x <= 1.0 and x != start for x in asked)


@pytest.mark.parametrize(("start", "reached"), [(0.5, 4.0), (0.9, 2.5), (0.99, 1.0)])
def test_an_interval_goes_beyond_local_minima_of_a_threshold(
    start: float, reached: float, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A misfit that rises by 5 at 1 and 2 deviations and comes down to 1 between and behind them, up to 4 of 0.04.

    From 0.9 on the range ends 2.5 deviations off, from 0.99 on a quarter of one; what goes along ends at its own end.
    """
    seen = []

    def misfit(problem: Any, fitted: Fitted, way: np.ndarray) -> float:
        x = np.array(fitted.x) + way
        seen.append(x)
        far = way[0] / 0.04
        return 100.0 + (5.0 if far > 4.5 or min(abs(far - 1.0), abs(far - 2.0)) < 0.1 else 1.0)

    monkeypatch.setattr(stated, "_misfit", misfit)
    fitted: Any = SimpleNamespace(x=(start, 0.95))
    way = np.array([0.04, 0.03])
    assert stated._over_local_minima(SimpleNamespace(), fitted, way, 0, 103.84) == pytest.approx(reached)  # type: ignore[arg-type]
    assert all(np.all((x >= 0.0) & (x <= 1.0 + 1e-12)) for x in seen if x[0] <= 1.0)


def test_profiles_reach_beyond_thresholds_of_shaped_effects() -> None:
    problem = problem_of(recorded({}, speeds=(2.0,)))
    layer, mass = candidate(problem, "soil-layer"), candidate(problem, "mass")
    for candidates, expected in (
        ((layer,), set()),
        ((layer.whole(),), {0, 1, 2}),
        ((mass, layer.whole()), {1, 2, 3}),
        ((layer, mass), set()),
    ):
        x = (0.5,) * sum(len(c.search) for c in candidates)
        assert stated._rippled(Fitted(candidates=candidates, x=x, blocks=())) == expected


def test_an_interval_along_a_curved_ridge_holds(tmp_path: Path) -> None:
    """Stiffness and the share of the nose make up for each other, and not along a straight line."""
    case = make(next(order for order in plan(63, 20263016, ["single"]) if order.index == 25))
    true = case.truth["effects"][0]["parameters"]
    problem = problem_of_case(case, tmp_path)
    c = candidate(problem, "structural-compliance").whole()
    ended = {"stiffness": 3.72118e6, "damping": 75.34, "nose_share": 0.18632}
    fitted = problem.fit((c,), [coordinate(ended[name], s) for name, s in c.search.items()], width=2)
    assert fitted is not None
    found = stated.intervals(problem, fitted)[0]
    for name in ("stiffness", "nose_share"):
        assert found[name].low <= true[name] <= found[name].high


@pytest.mark.parametrize(
    ("profile_extents", "begun", "end"), [(3.0, 1.0, 3.0), (3.0, 2.0, 3.0), (3.0, 3.5, 3.5), (1.0, 1.0, 1.0)]
)
def test_an_interval_follows_a_curved_ridge(profile_extents: float, begun: float, end: float) -> None:
    """With the others fitted anew the misfit is a parabola that rises by what is due `profile_extents` times 0.04 off.

    What a straight way has reached already stays reached.
    """
    due, held_at = 3.84, []

    def fit(candidates: list[Candidate], x: list[float], **_: Any) -> Any:
        at = candidates[0].fixed["stiffness"]
        held_at.append((at, x))
        return SimpleNamespace(chi2=100.0 + due * ((at - 0.5) / (0.04 * profile_extents)) ** 2, x=(0.1,), blocks=())

    c = Candidate(id="a", kind="physics", family="", search={"stiffness": Search(0, 1), "nose_share": Search(0, 1)})
    fitted: Any = SimpleNamespace(candidates=(c,), x=(0.5, 0.2), blocks=())
    problem: Any = SimpleNamespace(fit=fit)
    assert stated._along_ridge(problem, fitted, 0, 0.04, (100.0, due), begun) == pytest.approx(end, rel=1e-9)
    assert held_at[0] == (pytest.approx(0.5 + begun * SETTINGS.inference.intervals.ridge_factor * 0.04), [0.2])
    assert all(x == [0.1] for _, x in held_at[1:])  # each from where the last one ended


def test_disagreeing_recordings_widen_intervals_by_student_t() -> None:
    """w_r = J x_r, x_r normal about the truth: the mean of R over its own scatter is t of R - 1, 95 % of it inside."""
    rng = np.random.default_rng(6)
    J, inside = rng.standard_normal((40, 1)), []
    own: Any = SimpleNamespace(perturbed=())
    for _ in range(4000):
        each = rng.standard_normal(4)
        blocks = [ResidualBlock(residual=x * J[:, 0], J=J, slope=np.zeros(40), shift=0.0, prior=1e-3) for x in each]
        inverse = 1.0 / np.array([[4.0 * float(J[:, 0] @ J[:, 0])]])
        sd = np.sqrt(stated.between_recording_variance([own] * 4, blocks, inverse)[0])
        inside.append(abs(each.mean()) < SETTINGS.inference.local_quadratic.normal_quantile * sd)
    assert np.mean(inside) == pytest.approx(0.95, abs=0.014)  # 4 standard errors
    assert np.all(stated.between_recording_variance([own] * 2, blocks[:2], inverse) == 0.0)  # two are too few


def test_an_unidentified_value_of_full_runs_keeps_its_range() -> None:
    """y = g(t - c ln s) tells no friction: a half, give or take 1.96/sqrt(12) of 0 to 1, and none below 0."""

    class Indifferent(Late):
        def predict(self, changes: Mapping[str, Any], shift: float) -> dict[str, np.ndarray]:
            return {CHANNEL: first_impact(0.01 * np.log(float(changes["effects.payload-shift.travel"]) / 0.15) + shift)}

    problem = Problem(
        [
            dataset(
                first_impact(0.0) + 0.01 * np.random.default_rng(1).standard_normal(first_impact(0.0).size),
                Indifferent(),
            )
        ]
    )
    fitted = problem.fit((LOAD,), (np.log(0.15 / 0.02) / np.log(50.0), 0.5), rounds=0)
    assert fitted is not None
    (found,) = stated.intervals(problem, fitted)
    assert found["friction"].low == 0.0
    assert found["friction"].high == pytest.approx(0.5 + 1.96 * 12.0**-0.5, rel=0.01)
    assert found["travel"].low < 0.15 < found["travel"].high


def test_an_unidentified_depth_has_an_open_interval() -> None:
    """y = g(t - c ln ratio) tells no depth: 1.96 times a deviation of 100 ranges would be no number."""

    class Deep(Late):
        def predict(self, changes: Mapping[str, Any], shift: float) -> dict[str, np.ndarray]:
            return {
                CHANNEL: first_impact(
                    0.01 * np.log(float(changes.get("effects.soil-layer.stiffness_ratio", 1.0))) + shift
                )
            }

    layer = candidate(Problem([dataset(first_impact(0.0), Deep())]), "soil-layer")
    problem = Problem([dataset(first_impact(0.01 * np.log(2.0)), Deep())])
    begun = [coordinate(v, s) for v, s in zip((0.1, 2.0), layer.search.values(), strict=True)]
    fitted = problem.fit((layer,), begun, rounds=0)
    assert fitted is not None
    (found,) = stated.intervals(problem, fitted)
    search = layer.search["depth"]
    assert found["depth"].low == pytest.approx(search.low**2 / search.high)
    assert found["depth"].high == pytest.approx(search.high**2 / search.low)
    assert found["stiffness_ratio"].low < 2.0 < found["stiffness_ratio"].high < 2.0**1.5


def test_a_number_of_an_effect_stays_where_it_can_be() -> None:
    load = EFFECTS["payload-shift"]
    assert [possible(load, "friction", v) for v in (-0.5, 0.3, 2.5)] == [0.0, 0.3, 2.0]
    assert possible(EFFECTS["rops-plasticity"], "yield_force", -3.0) == 0.0
    assert possible(EFFECTS["slope"], "angle", -0.1) == -0.1


def read(recordings: list[tuple[str, Recording]]) -> Problem:
    """Recordings made ready as a diagnosis does: many samples averaged, what the recorder makes of each kept."""
    made = problem_of(recordings).dataset
    return Problem(with_quantisation(made, [r for _, r in recordings]))


@pytest.mark.parametrize("rate", [300.0, 9000.0])  # of the faster several samples are averaged into one
@pytest.mark.parametrize("limit", [1500.0, 2000.0])
def test_an_end_of_a_range_is_read_off_where_samples_pile_up(limit: float, rate: float) -> None:
    """Noise goes in before the range ends: tops lie below the limit on the average, and a fit ends up below it."""
    recordings = []
    for name, r in recorded({}, noise=0.02, rate=rate, until=0.25):
        channels = {**r.channels, FORCE: np.clip(r[FORCE], -limit, limit)}
        recordings.append((name, replace(r, channels=channels)))
    problem = read(recordings)
    assert (problem.dataset[0].averaged > 1) == (rate > 5000.0)
    fitted = fit(problem, candidate(problem, f"sensor-clipping:{FORCE}"))
    found = stated.intervals(problem, fitted)[0]["limit"]
    assert found.value == limit
    assert found.low < limit < found.high < 1.002 * limit


def test_a_peak_that_is_met_once_is_no_end_of_a_range() -> None:
    problem = read(recorded({}, noise=0.02))
    assert stated.full_scale_of(problem.dataset, FORCE) is None


def test_without_slopes_an_interval_ends_by_the_misfit() -> None:
    """A pull that holds up to 0.3 of its range and more pulls no further above it: below, it lets go."""
    asked: list[float] = []

    def fit(candidates: list[Candidate], x: list[float], **_: Any) -> Any:
        assert x == [0.2], "the other one is free"
        assert [list(c.search) for c in candidates] == [["b"], []]
        asked.append(candidates[1].fixed["a"])
        return SimpleNamespace(chi2=1000.0 if asked[-1] < 0.3 else 5.0)

    other = Candidate(id="mass", kind="parameter", family="", search={"b": Search(0, 1)})
    pull = Candidate(id="soil-adhesion", kind="physics", family="", search={"a": Search(0, 1)})
    zero = np.zeros(4)
    block = ResidualBlock(residual=np.ones(4), J=np.zeros((4, 2)), slope=zero, shift=0.0, prior=1.0)
    fitted = Fitted(candidates=(other, pull), x=(0.2, 0.6), blocks=(block,))
    wide = np.array([[0.01, 0.01], [10.0, 10.0]])
    found = stated._within_range(SimpleNamespace(fit=fit), fitted, wide, 1.0)  # type: ignore[arg-type]
    assert asked[0] == 0.0
    assert (
        0.3 - 0.61 / 2**SETTINGS.inference.intervals.halvings
        < 0.6 - SETTINGS.inference.local_quadratic.normal_quantile * found[1, 0]
        < 0.3
    )
    assert found[1, 1] == 10.0, "up to the end of the range as little is left"
    np.testing.assert_array_equal(found[0], wide[0])

"""What a planned test promises holds: in closed form, in simulated campaigns, and beside a diagnosis' own fits."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from scipy.optimize import lsq_linear
from scipy.stats import binomtest, chi2, norm

from rollover.diagnosis.data.dataset import Dataset, Signal
from rollover.diagnosis.data.whitening import Whitening
from rollover.diagnosis.fit.jobs import Executor
from rollover.diagnosis.fit.levenberg_marquardt import Problem
from rollover.diagnosis.fit.parameterisation import Candidate, coordinates
from rollover.diagnosis.planning import separation as chances
from rollover.diagnosis.planning.choosing import Tangent, choice, right_choice
from rollover.diagnosis.planning.next_test import next_test
from rollover.diagnosis.planning.plan import plan, usual_noise
from rollover.diagnosis.planning.planned import Instruments, autoregressive, only, planned, showing
from rollover.diagnosis.planning.separation import Tests as PlannedTests
from rollover.diagnosis.planning.separation import point_where_it_acts, strength_with
from rollover.diagnosis.prepared import prepared, weighted_datasets
from rollover.diagnosis.selection.candidates import candidates_of, size_of
from rollover.diagnosis.settings import SETTINGS
from rollover.effects import Search
from rollover.recording import Recording
from rollover.system.errors import InputError
from tests.benchmarks.promises import chosen_rightly
from tests.diagnosis.drops import ACCELERATION, DEPTH, FORCE, recorded, scenario

CHANNELS = (FORCE, DEPTH, ACCELERATION)
DAMPING, DRAG = "soil-viscous-damping", "soil-inertial-drag"


class Linear:
    """A simulator whose channel is linear in the strengths of two effects, and that no clock moves."""

    effort = SETTINGS.forward.drops
    contact = math.inf

    def __init__(self, columns: np.ndarray) -> None:
        self.columns = columns

    def predict(self, changes: Mapping[str, Any], shift: float) -> dict[str, np.ndarray]:
        strengths = [changes.get("effects.mass.added", 0.0), changes.get("effects.sensor-bias.bias", 0.0)]
        return {FORCE: self.columns @ np.array(strengths)}


MASS = Candidate(id="mass", kind="parameter", family="", search={"added": Search(-100.0, 300.0)})
BIAS = Candidate(id="sensor-bias", kind="sensor", family="", search={"bias": Search(-500.0, 500.0)}, channel=FORCE)


def linear(cosine: float, sigma: float = 2.0, n: int = 400) -> PlannedTests:
    """Two effects whose traces have this cosine and unit length, under white noise."""
    rng = np.random.default_rng(5)
    u, v = np.linalg.qr(rng.standard_normal((n, 2)))[0].T
    columns = np.column_stack([u, cosine * u + math.sqrt(1.0 - cosine**2) * v])
    recording = Recording(title="linear", time=np.arange(n) * 1e-3, channels={FORCE: np.zeros(n)})
    signal = Signal(channel=FORCE, rows=np.arange(n), values=np.zeros(n), sigma=sigma, noise=sigma, ar=(), span=1.0)
    simulator: Any = Linear(columns)
    e = Dataset(
        name="linear", recording=recording, simulator=simulator, signals=(signal,), shift_prior=1e-3, condition=""
    )
    return PlannedTests([e])


def drops(*speeds: float, noise: float = 0.005, rate: float = 300.0, **more: Any) -> list[Dataset]:
    known = usual_noise(scenario(), CHANNELS, noise)
    made = [planned(scenario(), {"initiation.speed": v}, Instruments(noise=known, rate=rate, **more)) for v in speeds]
    return [e for e in made if e is not None]


def effects_of(dataset: list[Dataset]) -> dict[str, Candidate]:
    return {c.key: c for c in candidates_of(dataset, (), "drop", scenario(), size_of(scenario()))}


def at(c: Candidate, **values: float) -> tuple[float, ...]:
    return coordinates(values, c.search)


def test_probabilities_in_closed_form() -> None:
    assert choice(9.0) == pytest.approx(norm.cdf(1.5), rel=1e-12)
    assert choice(0.0) == 0.5
    # one number: the normal test to both sides
    quantile = norm.isf(0.025)
    assert chances.detection(4.0, 0.05) == pytest.approx(norm.sf(quantile - 2.0) + norm.cdf(-quantile - 2.0), rel=1e-9)
    assert chances.required_noncentrality(0.9, 0.05) == pytest.approx(10.507, abs=1e-3)
    assert chances.of_one(0.05, 10) == pytest.approx(1.0 - 0.95**0.1, rel=1e-12)


@pytest.mark.parametrize(("cosine", "strength"), [(0.0, 1.5), (0.0, 3.0), (0.8, 3.0), (0.97, 8.0)])
def test_a_choice_between_fits_is_right_as_often_as_said(cosine: float, strength: float) -> None:
    rng = np.random.default_rng(3)
    own, other = np.array([1.0, 0.0]), np.array([cosine, math.sqrt(1.0 - cosine**2)])
    noisy = strength * own + rng.standard_normal((40_000, 2))
    right = np.mean((noisy @ own) ** 2 > (noisy @ other) ** 2)
    assert right == pytest.approx(choice(strength**2 * (1.0 - cosine**2), strength**2), abs=0.008)


def tangents(seed: int, own: int, rival: int, alike: float = 0.6) -> tuple[Tangent, Tangent, np.ndarray]:
    """Slopes of two effects in 12 samples, nearly alike in their first numbers, and a misfit that no rival meets."""
    rng = np.random.default_rng(seed)
    A = 3.0 * rng.standard_normal((12, own))
    B = 3.0 * rng.standard_normal((12, rival))
    B[:, 0] = alike * A[:, 0] + math.sqrt(1.0 - alike**2) * B[:, 0]
    d = rng.standard_normal(12)
    d -= B @ np.linalg.lstsq(B, d)[0]
    return *(Tangent(slopes=J, inwards=(0,) * J.shape[1]) for J in (A, B)), 1.3 * d / np.linalg.norm(d)


@pytest.mark.parametrize(("cosine", "strength"), [(0.0, 3.0), (0.8, 3.0), (0.97, 8.0)])
def test_one_number_each_is_the_closed_form(cosine: float, strength: float) -> None:
    """s_A lies along its own slope: lambda = L (1 - c^2), d what the projection on B leaves of it."""
    long = 40.0  # beside which the width of a range is nothing
    a, b = np.array([1.0, 0.0]), np.array([cosine, math.sqrt(1.0 - cosine**2)])
    d = strength * (a - cosine * b)
    own, rival = (Tangent(slopes=long * v[:, None], inwards=(0,)) for v in (a, b))
    left = strength**2 * (1.0 - cosine**2)
    # what is linear about two places is so about nothing only where the two pull one way: P of both turned round
    both_turned = norm.cdf(-strength * math.sqrt((1.0 + cosine) / 2.0))
    assert right_choice(left, d, own, rival) == pytest.approx(choice(left, strength**2), abs=0.004 + both_turned)


@pytest.mark.parametrize(("own", "rival"), [(1, 1), (1, 2), (2, 1), (2, 2)])
def test_more_numbers_ask_for_more(own: int, rival: int) -> None:
    """Against least squares of 40,000 draws, in units in which ranges are wide: misfits with two for each number."""
    A, B, d = tangents(3, own, rival)
    n = np.random.default_rng(11).standard_normal((40_000, 12))
    left = [np.sum((y - y @ np.linalg.pinv(T.slopes).T @ T.slopes.T) ** 2, axis=1) for y, T in ((n, A), (n + d, B))]
    reached = np.mean(left[0] + 2 * own < left[1] + 2 * rival)
    wide = [replace(T, slopes=100.0 * T.slopes) for T in (A, B)]
    assert right_choice(float(d @ d), d, *wide) == pytest.approx(reached, abs=0.01)


def test_a_rival_that_holds_the_truth_is_seldom_chosen() -> None:
    """A number more gains chi^2(1) by chance, 84 % of which are below two; a coordinate without slope gains none."""
    A, B, _ = tangents(3, 1, 2)
    within = replace(B, slopes=100.0 * np.column_stack([A.slopes, B.slopes[:, 1]]))
    one = replace(A, slopes=100.0 * A.slopes)
    assert right_choice(0.0, np.zeros(12), one, within) == pytest.approx(chi2.cdf(2.0, 1), abs=0.003)
    idle = replace(within, slopes=within.slopes * np.array([1.0, 0.0]))
    assert right_choice(0.0, np.zeros(12), one, idle) == 1.0


def test_a_rival_at_an_end_of_its_range_goes_in_only() -> None:
    """Against bounded least squares: where the end itself holds the rival back, and where noise alone does."""
    A, B, d = tangents(5, 1, 2)
    n = np.random.default_rng(4).standard_normal((1500, 12))
    for push in (0.0, 2.0):
        held = d - push * np.linalg.pinv(B.slopes).T[:, 0] * np.linalg.norm(B.slopes[:, 0])  # it wants out
        ends = (np.array([0.0, -np.inf]), np.array([np.inf, np.inf]))
        b = [2.0 * lsq_linear(B.slopes, y + held, ends).cost for y in n]
        a = np.sum((n - n @ np.linalg.pinv(A.slopes).T @ A.slopes.T) ** 2, axis=1)
        reached = np.mean(a + 2.0 < np.array(b) + 4.0)
        wide = [replace(T, slopes=100.0 * T.slopes) for T in (A, B)]
        bound = replace(wide[1], inwards=(1, 0))
        said = right_choice(float(held @ held), held, wide[0], bound)
        assert said == pytest.approx(reached, abs=0.03), "three standard errors of 1,500 draws"


@pytest.mark.parametrize("cosine", [0.0, 0.6, 0.97])
def test_a_linear_model_has_the_noncentrality_of_its_projection(cosine: float) -> None:
    tests = linear(cosine)
    strength = 16.0
    assert tests.unexplained(MASS, at(MASS, added=strength)) == pytest.approx((strength / 2.0) ** 2, rel=1e-6)
    found = tests.apart(MASS, at(MASS, added=strength), BIAS)
    assert found is not None
    expected = (strength / 2.0) ** 2 * (1.0 - cosine**2)
    assert found.noncentrality == pytest.approx(expected, rel=1e-4)
    assert found.probability == pytest.approx(choice(expected, (strength / 2.0) ** 2), abs=0.002), "quasi-random draws"


def test_the_least_strength_shows_as_often_as_asked_for() -> None:
    tests = linear(0.0)

    def shows(x: tuple[float, ...]) -> float:
        return tests.unexplained(MASS, x)

    place = point_where_it_acts(MASS, shows)
    assert place is not None
    found = strength_with(MASS, place, shows, 10.507)
    assert found is not None
    assert MASS.values(found)["added"] == pytest.approx(2.0 * math.sqrt(10.507), rel=0.015)
    assert strength_with(MASS, place, shows, 1e6) is None, "its range ends at 300"


def test_less_noise_and_more_drops_distinguish_more() -> None:
    c = effects_of(drops(2.0))[DAMPING]
    usual, strong = at(c, damping=5.0), at(c, damping=10.0)
    plain = PlannedTests(drops(2.0)).unexplained(c, usual)
    assert plain > 10.0
    assert PlannedTests(drops(2.0, noise=0.01)).unexplained(c, usual) < 0.3 * plain
    assert PlannedTests(drops(2.0)).unexplained(c, strong) == pytest.approx(4.0 * plain, rel=0.1)
    assert PlannedTests(drops(2.0, 3.0)).unexplained(c, usual) > 1.5 * plain
    # four times the samples of white noise; at the low rate a jump within one sample hides some of them
    assert PlannedTests(drops(2.0, rate=1200.0)).unexplained(c, usual) == pytest.approx(4.0 * plain, rel=0.25)
    assert PlannedTests(drops(2.0, tolerance=0.02)).unexplained(c, usual) < 0.2 * plain
    some = [only(e, [DEPTH]) for e in drops(2.0)]
    assert PlannedTests(some).unexplained(c, usual) < plain


def test_nuisance_parameters_hide_an_effect_like_them() -> None:
    known = effects_of(drops(2.0))
    gain = known[f"sensor-gain:{FORCE}"]
    exact, open_ = (PlannedTests(drops(2.0, gain=g)).unexplained(gain, at(gain, gain=1.02)) for g in (0.0, 0.02))
    assert exact > 100.0
    assert open_ == pytest.approx(1.0, abs=0.05), "one standard deviation of the gain"
    speed = known["impact-speed"]
    told, unsure = (
        PlannedTests(drops(2.0, gain=0.0, uncertain=u)).unexplained(speed, at(speed, scale=1.01))
        for u in ({}, {"initiation.speed": 0.02})
    )
    assert told > 100.0
    assert unsure == pytest.approx(1.0, abs=0.1)


def test_noise_beside_a_discrepancy_is_whitened() -> None:
    rng = np.random.default_rng(2)
    n, white, miss, memory = 60_000, 1.0, 3.0, 40.0
    keep = math.exp(-1.0 / memory)
    from scipy.signal import lfilter

    drift = lfilter([miss * math.sqrt(1.0 - keep**2)], [1.0, -keep], rng.standard_normal(n))
    signal = Signal(
        channel=FORCE, rows=np.arange(n), values=np.zeros(n), sigma=math.hypot(white, miss), noise=white,
        ar=autoregressive(white, miss, memory, SETTINGS.planning.order), span=1.0,
    )  # fmt: skip
    w = Whitening([signal.spread])(drift + white * rng.standard_normal(n))[SETTINGS.planning.order :]
    assert np.std(w) == pytest.approx(1.0, abs=0.02)
    assert abs(np.mean(w[1:] * w[:-1])) < 0.03


def test_a_promise_is_kept_in_simulated_campaigns() -> None:
    """Noise, clocks, gains drawn anew; both effects fitted to it; the smaller misfit chooses."""
    dataset = drops(1.0, 3.5)
    known = effects_of(dataset)
    a, b = known[DAMPING], known[DRAG]
    tests = PlannedTests(dataset)

    def shows(x: tuple[float, ...]) -> float:
        return tests.unexplained(a, x)

    place = point_where_it_acts(a, shows)
    assert place is not None
    x = strength_with(a, place, shows, 45.0)
    assert x is not None
    promised = tests.apart(a, x, b)
    assert promised is not None
    assert 0.7 < promised.probability < 0.95, "a promise that can be broken"
    count = 100
    right = chosen_rightly(dataset, a, x, b, promised.x, count, np.random.default_rng(4))
    interval = binomtest(right, count).proportion_ci(0.99)
    assert interval.low <= promised.probability <= interval.high


def test_a_promise_does_not_hang_on_where_samples_lie() -> None:
    """Stamps a quarter of a step later each: nobody knows before a test where the contact falls between two."""
    known, promised = Instruments(noise=usual_noise(scenario(), CHANNELS), rate=300.0), []
    for quarter in range(4):
        own = scenario().replaced({"initiation.lead_time": 0.03 + quarter / 1200.0})
        made = [planned(own, {"initiation.speed": v}, known) for v in (1.0, 3.5)]
        tests = PlannedTests([e for e in made if e is not None])
        effects = effects_of(list(tests.dataset))
        found = tests.apart(
            effects["impact-speed"], at(effects["impact-speed"], scale=1.0027), effects["soil-stiffness"]
        )
        assert found is not None
        promised.append(found.probability)
    assert np.ptp(promised) < 0.02, "at one phase alone they spread over 0.05"


def test_another_speed_is_what_tells_damping_from_drag() -> None:
    """At one speed they are nearly alike, over a range of speeds they are not."""
    known = Instruments(noise=usual_noise(scenario(), (FORCE, DEPTH)), rate=300.0)
    found = plan(scenario(), instruments=known, between=[(DAMPING, DRAG)])
    (advice,) = found.next_tests
    assert advice.probability < 0.8
    assert advice.best is not None
    assert advice.best.probability > advice.probability + 0.1
    again = next(t for t in advice.tried if t.value == 3.0 and t.rate == 300.0)
    assert advice.best.probability > again.probability, "another speed tells more than the same once more"
    assert advice.known.startswith("drops over a range of speeds")
    drawn = {e.effect: e for e in found.effects}
    assert drawn[DAMPING].least is not None
    assert drawn[DAMPING].power == pytest.approx(1.0, abs=1e-6)
    over = plan(
        scenario(),
        conditions=[{"initiation.speed": v} for v in (1.0, 2.0, 3.5)],
        instruments=known,
        between=[(DAMPING, DRAG)],
    )
    one, several = found.of(DAMPING, DRAG), over.of(DAMPING, DRAG)
    assert one is not None
    assert several is not None
    assert several > one


def test_an_effect_that_never_acts_is_said_never_to_show() -> None:
    """A striker that stays in the ground is not held back as it lifts off."""
    names = [("soil-adhesion", "soil-stiffness")]
    found = plan(
        scenario(), instruments=Instruments(noise=usual_noise(scenario(), (FORCE,)), rate=300.0), between=names
    )
    adhesion = next(e for e in found.effects if e.effect == "soil-adhesion")
    assert adhesion.least is None
    assert adhesion.judged is None
    assert adhesion.least_in_words == "never within its range"
    assert found.of("soil-adhesion", "soil-stiffness") is None


def test_what_cannot_be_planned_is_refused() -> None:
    with pytest.raises(InputError, match="no effect that this test can have, got 'sensor-gain'; one of sensor-gain:"):
        plan(scenario(), between=[("sensor-gain", DAMPING)])
    with pytest.raises(InputError, match="did you mean 'ground/force_normal'"):
        usual_noise(scenario(), ("ground/force_norma",))


def test_a_diagnosis_asks_for_the_drop_where_its_fits_differ() -> None:
    """Hardening beside stiffness after drops at 2 and 3 m/s: a drop far slower tells, and a repeat does not."""
    changes = {"effects.soil-rate-hardening.per_decade": 0.02}
    made = recorded(changes, 1, speeds=(2.0, 3.0))
    dataset = weighted_datasets(scenario(), prepared(scenario(), made, Executor())[0])
    known, problem = effects_of(dataset), Problem(dataset)
    hardening, stiffness = known["soil-rate-hardening"], known["soil-stiffness"]
    one = problem.fit((hardening,), at(hardening, per_decade=0.02))
    other = problem.fit((stiffness,), at(stiffness, scale=1.05))
    assert one is not None
    assert other is not None
    counted = problem.simulations
    found = next_test(scenario(), dataset, one, other)
    assert problem.simulations == counted, "the account of a diagnosis is not touched"
    assert found is not None
    assert found.path == "initiation.speed"
    assert found.value < 2.0
    assert found.probability > 0.9
    assert found.channels == (FORCE, DEPTH)
    assert found.rate == pytest.approx(300.0)
    assert found.message().endswith(f"would distinguish them with a probability of {found.probability:.0%}")
    loud = [replace(e, signals=tuple(replace(s, noise=10.0 * s.noise) for s in e.signals)) for e in dataset]
    less = next_test(scenario(), loud, one, other)
    assert less is not None
    assert (less.value, -less.probability) > (found.value, -found.probability), "louder instruments ask for more"


def test_a_rival_is_refitted_to_the_end() -> None:
    """What a rival leaves is a minimum: no search from there finds less, of friction through damping."""
    dataset = drops(1.0, 3.5)
    known = effects_of(dataset)
    a, b = known["guide-friction"], known[DAMPING]
    tests = PlannedTests(dataset)
    place = point_where_it_acts(a, lambda x: tests.unexplained(a, x))
    assert place is not None
    x = strength_with(a, place, lambda x: tests.unexplained(a, x), 12.0)
    assert x is not None
    found, least = tests.apart(a, x, b), []
    assert found is not None
    for phase in range(SETTINGS.planning.phases):
        shown = tests.recorded_at(phase, a, x)
        assert shown is not None
        problem, own = shown
        others = [problem.fit((b,), s, rounds=20, finely=True) for s in (found.x, (0.02,), (0.03,), (0.1,))]
        least.append(min(f.total for f in others if f is not None) - own.total)
    assert found.noncentrality < np.mean(least) + 0.05, "of 9: a twentieth moves the probability by 0.001"


def test_errors_of_gains_leave_no_more_than_themselves() -> None:
    """Gains alone are off, by what is stated of them: beside the true effect that leaves less than their squares."""
    dataset = drops(1.0, 3.5)
    one, x, rng = effects_of(dataset)["soil-stiffness"], (0.525,), np.random.default_rng(7)
    for _ in range(6):
        for e in dataset:
            assert e.nuisance is not None
            z = rng.standard_normal(e.nuisance.shape[1])
            raw = e.raw(e.simulator.predict(Problem.changes([one], x), 0.0) or {}) + e.nuisance @ z
            block = Problem([showing(e, raw)]).block(0, (one,), x, 0.0, 0.0)
            assert block is not None
            assert block.total < float(z @ z)

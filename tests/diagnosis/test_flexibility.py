"""A sensor that reads a curve is no gain with an offset, and a layer whose top is the ground's is stiffness."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from rollover.diagnosis import diagnose
from rollover.diagnosis.fit.parameterisation import coordinate
from rollover.diagnosis.selection import decision
from rollover.diagnosis.selection.simplification import curvature_gain, drift, is_a_curve, is_straight_line, square
from rollover.diagnosis.settings import SETTINGS
from tests.diagnosis.drops import ACCELERATION, DEPTH, FORCE, recorded, scenario
from tests.diagnosis.test_fits import GAIN, candidate, problem_of

CHANNELS = (FORCE, DEPTH, ACCELERATION)
SPEEDS = (1.1, 1.5, 1.9, 2.3, 2.7, 3.1)


def curved(curvature: float, seed: int, noise: float, rate: float) -> list:  # type: ignore[type-arg]
    """Force F (1 + curvature F/F_max) instead of F, noise on it."""
    made = []
    for name, r in recorded({}, seed, speeds=SPEEDS, channels=CHANNELS, noise=noise, rate=rate):
        force = r.channels[FORCE]
        distorted = force + curvature * force**2 / np.max(force)
        made.append((name, replace(r, channels={**r.channels, FORCE: distorted})))
    return made


@pytest.mark.parametrize("seed", range(4))
def test_of_a_true_gain_nothing_curved_is_left(seed: int) -> None:
    """Chi-square of one degree of freedom: above 11 in one of a thousand."""
    problem = problem_of(recorded(GAIN, seed, speeds=SPEEDS, noise=0.02, rate=1500.0))
    c = candidate(problem, f"sensor-gain:{FORCE}")
    fitted = problem.fit((c,), (coordinate(1.05, c.search["gain"]),))
    assert fitted is not None
    assert max(curvature_gain(problem, fitted, FORCE, term) for term in (square, drift)) < 11.0


def test_a_curve_is_seen_beside_the_gain_that_meets_it_best() -> None:
    """z^2 of a least-squares fit of one column more is what the sum of squares falls by."""
    problem = problem_of(curved(-0.08, 5, 0.02, 1500.0))
    c = candidate(problem, f"sensor-gain:{FORCE}")
    fitted = problem.fit((c,), (coordinate(0.93, c.search["gain"]),))
    assert fitted is not None
    assert curvature_gain(problem, fitted, FORCE) > 3.0 * SETTINGS.selection.flexibility.curve_gain


@pytest.mark.parametrize("is_ensemble", [False, True])
def test_a_gain_that_changes_as_it_warms_is_none(is_ensemble: bool) -> None:
    """By 10 % of itself in the middle of each drop; where runs are dear and scatter too."""
    made = []
    for name, r in recorded(GAIN, 5, speeds=SPEEDS, channels=CHANNELS, noise=0.02, rate=1500.0):
        warm = 1.0 + 0.1 * (r.time > 0.1)
        made.append((name, replace(r, channels={**r.channels, FORCE: warm * r.channels[FORCE]})))
    problem = problem_of(made)
    problem.effort = replace(problem.effort, is_ensemble=is_ensemble)
    c = candidate(problem, f"sensor-gain:{FORCE}")
    fitted = problem.fit((c,), (coordinate(1.1, c.search["gain"]),))
    assert fitted is not None
    assert curvature_gain(problem, fitted, FORCE, drift) > 3.0 * SETTINGS.selection.flexibility.curve_gain
    assert is_a_curve(problem, fitted)


def test_gain_and_offset_that_meet_a_curved_sensor_are_refused(monkeypatch: pytest.MonkeyPatch) -> None:
    problem = problem_of(curved(-0.12, 6, 0.02, 1500.0))
    both = [candidate(problem, f"{id}:{FORCE}") for id in ("sensor-gain", "sensor-bias")]
    fitted = problem.fit(both, [coordinate(1.0, both[0].search["gain"]), coordinate(1.0, both[1].search["bias"])])
    assert fitted is not None
    assert is_a_curve(problem, fitted)
    assert is_straight_line(both)
    mass = candidate(problem, "mass")
    beside = problem.fit((both[0], mass), (fitted.x[0], 0.6))
    assert beside is not None
    assert is_a_curve(problem, beside), "whatever stands beside its gain"
    assert not is_straight_line(beside.candidates)
    assert not is_straight_line([both[0], candidate(problem, f"sensor-bias:{DEPTH}")])
    assert not is_a_curve(problem, replace(beside, candidates=(mass, mass))), "of no line"
    monkeypatch.setattr(decision, "is_a_curve", lambda *_: True)
    found = diagnose(scenario(), recorded(GAIN, speeds=(1.2, 2.2, 3.2)), estimate=False)  # held against noise alone
    assert (found.verdict, found.effects) == ("unexplained", ())


def test_stiffer_ground_is_no_layer_from_the_top_on() -> None:
    """A layer whose depth ends at the least it may be is that ground, by more numbers."""
    found = diagnose(
        scenario(),
        recorded({"effects.soil-stiffness.scale": 1.03}, 7, speeds=SPEEDS, channels=CHANNELS, noise=0.004, rate=2500.0),
    )
    (named,) = found.effects
    assert named.id == "soil-stiffness"
    assert named.indistinguishable_from == ()

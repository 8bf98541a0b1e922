"""An effect beside a discrepancy that changes slowly: its covariance, and what shows because it is quicker."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from scipy.signal import lfilter

from rollover.diagnosis import diagnose
from rollover.diagnosis.data.dataset import Dataset
from rollover.diagnosis.fit.levenberg_marquardt import Problem
from rollover.diagnosis.fit.linearisation import Fitted
from rollover.diagnosis.inference.slow_discrepancy import gram, left_by, shown_beside
from rollover.diagnosis.selection.candidates import candidates_of
from rollover.recording import Recording
from tests.diagnosis.drops import DEPTH, FORCE, recorded, scenario
from tests.diagnosis.test_discrepancy import curved, judged

SCALE, MEMORY = {FORCE: 0.04, DEPTH: 0.02}, {FORCE: 0.05, DEPTH: 0.08}


def dense(e: Dataset, contact: float) -> np.ndarray:
    """The covariance of a stack as it is written down, (n, n), SI^2."""
    S = np.zeros((e.count, e.count))
    for s, part in e.spans():
        time, (noise, ar) = e.recording.time[s.rows], s.quiet
        n = time.size
        C = np.eye(n) - sum((a * np.eye(n, k=-k) for k, a in enumerate(ar, 1)), np.zeros((n, n)))
        response = np.linalg.inv(C)
        of_one = response @ response.T
        white = np.hypot(noise, e.model_error * s.span) * s.heteroscedasticity * np.ones(n)
        g = (time >= contact) * e.discrepancy[s.channel] * s.span
        K = np.exp(-np.abs(time[:, None] - time) / e.memory[s.channel])
        # far from its start a sample of an autoregression has the stated noise
        S[part, part] = of_one / of_one[-1, -1] * np.outer(white, white) + np.outer(g, g) * K
    return S


@pytest.mark.parametrize("ar", [(), (0.6,), (0.5, -0.3)])
def test_products_are_those_of_the_dense_covariance(ar: tuple[float, ...]) -> None:
    e = judged(curved(0.02), SCALE, MEMORY).dataset[0]
    level = np.linspace(1.0, 2.0, e.signals[0].rows.size)
    one = replace(e.signals[0], at_rest=(e.signals[0].noise, ar), level=level)
    e = replace(e, signals=(one, *e.signals[1:]))
    size = np.concatenate([np.full(s.rows.size, s.span) for s in e.signals])
    X = np.random.default_rng(1).normal(size=(e.count, 3)) * size[:, None]
    assert gram(e, X, 0.004) == pytest.approx(X.T @ np.linalg.solve(dense(e, 0.004), X), rel=1e-6)


def lagging(r: Recording) -> Recording:
    """The force behind a first-order lag of 5 ms."""
    step = float(np.median(np.diff(r.time)))
    fade = np.exp(-step / 0.005)
    late = lfilter([1.0 - fade], [1.0, -fade], r.channels[FORCE])
    return replace(r, channels={**r.channels, FORCE: late})


def fits_beside(problem: Problem) -> tuple[Fitted, list[Fitted]]:
    base = problem.fit((), ())
    assert base is not None
    some = [c for c in candidates_of(problem.dataset, (), "drop") if c.id in ("sensor-lag", "soil-stiffness")]
    found = [problem.fit((c,), (0.5,)) for c in some]
    return base, [f for f in found if f is not None]


def test_a_lag_of_less_than_the_background_shows() -> None:
    late = [(name, lagging(r)) for name, r in curved(0.04, 5)]
    problem = judged(late, SCALE, MEMORY)
    base, fits = fits_beside(problem)
    shown = shown_beside(problem, base, fits, 40)
    assert shown is not None
    assert shown.label == f"sensor-lag:{FORCE}"


@pytest.mark.parametrize("seed", range(4))
def test_a_slow_wave_alone_shows_no_effect(seed: int) -> None:
    problem = judged(curved(0.04, seed), SCALE, MEMORY)
    assert shown_beside(problem, *fits_beside(problem), 40) is None


def test_what_the_model_misses_is_no_sensor() -> None:
    problem = judged(curved(0.02, 5, changes={"effects.soil-stiffness.scale": 1.3}), SCALE, MEMORY)
    base, fits = fits_beside(problem)
    gains = {f.label: left_by(problem, base) - left_by(problem, f) for f in fits}
    assert max(gains, key=lambda label: gains[label]) == "soil-stiffness"
    assert gains["soil-stiffness"] > 100.0
    assert shown_beside(problem, base, fits, 40) is None


def test_nothing_is_said_where_no_correlation_time_is_known() -> None:
    problem = judged(recorded({}, 1), SCALE)
    assert shown_beside(problem, *fits_beside(problem), 40) is None


def test_a_diagnosis_names_a_lag_beside_a_wave() -> None:
    late = diagnose(scenario(), [(name, lagging(r)) for name, r in curved(0.02, 5)])
    (one,) = late.effects
    assert (late.verdict, one.id, one.channel) == ("sensor", "sensor-lag", FORCE)
    assert one.parameters["time"].low < 0.005 < one.parameters["time"].high

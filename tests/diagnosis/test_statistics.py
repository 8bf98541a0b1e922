"""The statistics behind a diagnosis, against brute force and simulation."""

from __future__ import annotations

from dataclasses import replace
from functools import partial
from types import SimpleNamespace
from typing import Any, cast

import numpy as np
import pytest
from scipy.signal import lfilter
from scipy.stats import kstest

from rollover.diagnosis.data.dataset import Dataset
from rollover.diagnosis.fit.cross_validation import held_out
from rollover.diagnosis.fit.levenberg_marquardt import Problem
from rollover.diagnosis.fit.linearisation import Fitted, ResidualBlock, without_shift_direction
from rollover.diagnosis.fit.parameterisation import Candidate, coordinate
from rollover.diagnosis.forward.averaging import block_averaged
from rollover.diagnosis.inference.intervals import intervals
from rollover.diagnosis.inference.lack_of_fit import mismatch_of
from rollover.diagnosis.selection.score_test import null_from_gram, p_value
from rollover.diagnosis.settings import SETTINGS
from rollover.effects import Search
from rollover.recording import Recording
from tests.diagnosis.drops import FORCE, linear_blocks, recorded, signal


def pretend(values: np.ndarray, sigma: float, ar: tuple[float, ...] = ()) -> Dataset:
    time = np.arange(values.size) * 1e-3
    recording = Recording(title="r", time=time, channels={FORCE: values})
    return Dataset(
        name="r", recording=recording, simulator=cast(Any, None), signals=(signal(values, sigma, ar),),
        shift_prior=1e-3, condition="",
    )  # fmt: skip


@pytest.mark.parametrize("ar", [(), (0.6,), (0.5, 0.2)])
def test_whitened_noise_is_white_and_of_unit_size(ar: tuple[float, ...]) -> None:
    e = np.random.default_rng(3).standard_normal(40_000)
    x = lfilter([1.0], [1.0, *(-a for a in ar)], e)
    sigma = float(np.std(x))
    w = pretend(x, sigma, ar).stacked({FORCE: x})[len(ar) :]
    assert np.std(w) == pytest.approx(1.0, abs=0.015)
    assert abs(np.mean(w[1:] * w[:-1])) < 0.015


@pytest.mark.parametrize("ar", [(), (0.6,)])
def test_p_values_of_the_mismatch_are_uniform_on_noise(ar: tuple[float, ...]) -> None:
    rng = np.random.default_rng(5)
    found, phases = [], [((0.0, "one"), (0.1, "two"))]
    for _ in range(300):
        x = lfilter([1.0], [1.0, *(-a for a in ar)], rng.standard_normal(440))[200:]
        sigma = 1.0 / np.sqrt(1.0 - sum(a * a for a in ar))
        e = pretend(x, sigma, ar)
        slope = np.sin(np.arange(x.size) / 20.0)
        w = e.stacked({FORCE: x})
        block = ResidualBlock(residual=w, J=np.zeros((w.size, 0)), slope=slope, shift=0.0, prior=1e-3)
        found.append(mismatch_of([e], [block], phases).p_value)
    assert kstest(found, "uniform").pvalue > 0.01


def test_a_slow_wave_in_one_phase_is_found_there() -> None:
    x = np.random.default_rng(6).standard_normal(240)
    x[120:] += 1.5 * np.sin(np.arange(120) / 25.0)
    e = pretend(x, 1.0)
    block = ResidualBlock(residual=x, J=np.zeros((240, 0)), slope=np.zeros(240), shift=0.0, prior=1e-3)
    found = mismatch_of([e], [block], [((0.0, "calm"), (0.12, "wavy"))])
    assert found.p_value < 1e-6
    assert found.shares()[0][0].phase == "wavy"
    assert found.adjusted[0] > 0.05 > found.adjusted[1]


def candidate() -> Candidate:
    search = {"depth": Search(0.0, 1.0), "stiffness_ratio": Search(0.0, 1.0)}
    return Candidate(id="soil-layer", kind="physics", family="", search=search)


def test_linearised_cross_validation_equals_a_refit() -> None:
    blocks = linear_blocks(np.random.default_rng(1), 4, 30, np.array([0.05, -0.04]))
    fitted = Fitted(candidates=(candidate(),), x=(0.5, 0.5), blocks=tuple(blocks))
    held = held_out(fitted, [[0], [1, 2], [3]])
    for group in ([0], [1, 2], [3]):
        rest = [r for r in range(4) if r not in group]
        # least squares for dx and all time shifts at once, priors as rows of their own
        rows, right = [], []
        for k, r in enumerate(rest):
            b = blocks[r]
            shifts = np.zeros((30, len(rest)))
            shifts[:, k] = b.slope
            rows.append(np.hstack([b.J, shifts]))
            right.append(b.residual)
        rows.append(np.hstack([np.zeros((len(rest), 2)), np.eye(len(rest)) / 0.3]))
        rows.append(np.hstack([np.sqrt(SETTINGS.fit.linearisation.weak_prior) * np.eye(2), np.zeros((2, len(rest)))]))
        right.append(np.zeros(len(rest) + 2))
        dx = np.linalg.lstsq(np.vstack(rows), np.concatenate(right), rcond=None)[0][:2]
        for r in group:
            b = blocks[r]
            w = b.residual - b.J @ dx
            both = np.append(b.slope, 1.0 / 0.3)
            tau = float(both[:-1] @ w) / float(both @ both)
            assert held.chi2[r] == pytest.approx(float(np.sum((w - b.slope * tau) ** 2)) + (tau / 0.3) ** 2, rel=1e-9)


def test_null_of_the_best_is_that_of_simulated_noise() -> None:
    rng = np.random.default_rng(2)
    d = [rng.standard_normal((50, 4)), rng.standard_normal((40, 4))]
    for part in d:
        part[:, 3] = part[:, 2] + 0.1 * rng.standard_normal(part.shape[0])  # two that are nearly one
    D = np.vstack(d)
    null = null_from_gram(D.T @ D)
    z = rng.standard_normal((20_000, 90)) @ (D / np.linalg.norm(D, axis=0))
    best = np.max(z * z, axis=1)
    for q in (0.5, 0.9, 0.99):
        assert np.quantile(null, q) == pytest.approx(np.quantile(best, q), rel=0.08)
    assert p_value(float(np.quantile(best, 0.95)), null) == pytest.approx(0.05, abs=0.012)
    assert p_value(60.0, null) < 1e-10


def test_free_directions_are_measured_as_the_shift_leaves_them() -> None:
    rng = np.random.default_rng(4)
    b = linear_blocks(rng, 1, 30, np.array([0.0]))[0]
    v = rng.standard_normal((30, 1))
    # |v|^2 less what a time shift with its prior takes: v'(1 + sd^2 s s')^-1 v
    expected = float(v[:, 0] @ np.linalg.solve(np.eye(30) + 0.09 * np.outer(b.slope, b.slope), v[:, 0]))
    assert float(np.sum(without_shift_direction(v, b) ** 2)) == pytest.approx(expected, rel=1e-9)


def test_intervals_cover_the_truth_as_often_as_they_say() -> None:
    rng = np.random.default_rng(8)
    inside = []
    no_jacobian = SimpleNamespace(signals=(), perturbed=())
    problem = cast(
        Any,
        SimpleNamespace(
            dataset=(no_jacobian, no_jacobian, no_jacobian), measured=(), samples_per_error=1.0,
            effort=SETTINGS.forward.drops,
            made_ahead=lambda _: None,
            _fixed_shifts=False,
        ),
    )  # fmt: skip
    problem.clocked = partial(Problem.clocked, problem)
    truth = np.array([0.02, -0.03])
    for _ in range(250):
        blocks = linear_blocks(rng, 3, 40, truth)
        A = sum(b.normal()[0] for b in blocks)
        dx = np.linalg.solve(A, sum(b.normal()[1] for b in blocks))
        moved = tuple(replace(b, residual=b.residual - b.J @ dx) for b in blocks)
        fitted = Fitted(candidates=(candidate(),), x=tuple(0.5 + dx), blocks=moved)

        def block(
            r: int, _c: object, x: list[float], shift: float, _n: float, fitted: Fitted = fitted
        ) -> ResidualBlock:  # as linear as it was made
            b = fitted.blocks[r]
            off = b.J @ (np.array(x) - np.array(fitted.x)) + b.slope * (shift - b.shift)
            return replace(b, residual=b.residual - off, shift=shift)

        def fit(
            held: list[Candidate], _x: object, fitted: Fitted = fitted, curved: Any = A, **_: object
        ) -> Any:  # one held, all others anew: it rises by d^2/(A^-1)_kk
            ((name, value),) = held[0].fixed.items()
            k = list(candidate().search).index(name)
            d = coordinate(value, candidate().search[name]) - fitted.x[k]
            return SimpleNamespace(chi2=fitted.chi2 + d * d / np.linalg.inv(curved)[k, k])

        problem.block, problem.fit = block, fit
        found = intervals(problem, fitted)[0]
        for i, t in zip(found.values(), 0.5 + truth, strict=True):
            inside.append(i.low <= t <= i.high)
    assert 0.92 < np.mean(inside) < 0.98


def test_binning_keeps_means_and_averages_across_no_gap() -> None:
    time = np.concatenate([np.arange(1001), np.arange(2000, 3001)]) * 1e-4
    recording = Recording(
        title="r", time=time, channels={FORCE: 3.0 + 2.0 * time}, noise={FORCE: 2.0}
    )  # fmt: skip
    found, _ = block_averaged(recording)
    assert found.time.size < 1002
    assert np.allclose(found.channels[FORCE], 3.0 + 2.0 * found.time)
    assert not np.any((found.time > 0.1001) & (found.time < 0.1999))
    assert found.noise[FORCE] == pytest.approx(2.0 / np.sqrt(4.0))
    name, short = recorded({}, speeds=(2.0,))[0]
    assert block_averaged(short)[0] is short, name

"""What a model misses beside what it lacks: its prior, its estimate from what explanations leave, where it counts."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from scipy.stats import norm

from rollover.diagnosis import diagnose, json_of
from rollover.diagnosis.alone import repeats_its_course
from rollover.diagnosis.data.dataset import Dataset, dataset_of, left_out
from rollover.diagnosis.fit.levenberg_marquardt import Problem
from rollover.diagnosis.fit.time_shift import estimate_time_shifts
from rollover.diagnosis.forward.forward_model import simulator_of
from rollover.diagnosis.grades import jackknifed
from rollover.diagnosis.inference.discrepancy import (
    MEDIAN,
    SPREAD,
    Discrepancy,
    correlation_times,
    estimated,
    learned_from_references,
    posterior,
    residual_rms,
    with_discrepancy,
)
from rollover.diagnosis.inference.lack_of_fit import is_tolerated, mismatch_of
from rollover.diagnosis.inference.repeated_course import predicted_by_others, quick_channels
from rollover.diagnosis.noise import autoregression
from rollover.diagnosis.settings import SETTINGS
from rollover.recording import Recording
from tests.diagnosis.drops import DEPTH, FORCE, recorded, scenario


def curved(
    share: float, seed: int = 0, noise: float = 0.003, changes: dict[str, float] | None = None
) -> list[tuple[str, Recording]]:
    """Drops with a slow wave after the contact, of `share` of each channel's range (rms), other in each by some."""
    rng, found = np.random.default_rng(seed), []
    for name, r in recorded(changes or {}, seed, speeds=(1.5, 2.2, 3.0), noise=noise):
        channels = {}
        for c, v in r.channels.items():
            wave = np.where(r.time > 0.0, np.sin(2.0 * np.pi * r.time / 0.23) * np.minimum(r.time / 0.02, 1.0), 0.0)
            wave *= rng.normal(1.0, 0.2) / np.sqrt(np.mean(wave[r.time > 0.0] ** 2))
            channels[c] = v + share * np.ptp(v) * wave
        found.append((name, replace(r, channels=channels)))
    return found


def judged(
    recordings: list[tuple[str, Recording]],
    shares: dict[str, float] | None = None,
    times: dict[str, float] | None = None,
) -> Problem:
    found: list[Dataset] = []
    for name, r in recordings:
        one = dataset_of(name, r, simulator_of(scenario(), r))
        assert one is not None
        found.append(one)
    found = with_discrepancy(found, Discrepancy(scales=shares, times=times or {})) if shares is not None else found
    problem = Problem(found)
    estimate_time_shifts(problem)
    base = problem.fit((), ())
    assert base is not None
    problem.with_noise_model(autoregression.with_noise_of_quiet_stretches(problem.dataset, problem.residuals(base)))
    return problem


def test_model_error_is_rarely_below_1_or_above_10_percent() -> None:
    below = norm.cdf(np.log(np.array(SETTINGS.inference.discrepancy.usual_range) / MEDIAN) / SPREAD)
    assert below == pytest.approx([0.05, 0.95], abs=1e-3)


def test_a_scale_lies_between_the_residual_and_the_usual() -> None:
    for left in (0.003, 0.2):
        few, many = (posterior(left, draws)[0] for draws in (1.0, 30.0))
        assert abs(np.log(many / left)) < abs(np.log(few / left))
        assert min(left, MEDIAN) < few < max(left, MEDIAN)
    assert posterior(MEDIAN)[0] == pytest.approx(MEDIAN, rel=0.02)
    assert posterior(0.02)[1] > posterior(0.2)[1] + 3.0  # what leaves less is the better explanation


def test_what_is_left_beyond_noise_is_the_wave_that_was_added() -> None:
    problem = judged(curved(0.02))
    base = problem.fit((), ())
    assert base is not None
    left = residual_rms(problem, base)
    assert left == {FORCE: pytest.approx(0.02, rel=0.35), DEPTH: pytest.approx(0.02, rel=0.35)}
    nothing = judged(recorded({}, 3, noise=0.003))
    base = nothing.fit((), ())
    assert base is not None
    assert max(residual_rms(nothing, base).values()) < 0.002


def test_a_wave_of_the_estimated_scale_is_no_mismatch() -> None:
    problem = judged(curved(0.02))
    base = problem.fit((), ())
    assert base is not None
    phases = [((-1.0, "all"),)] * 3
    assert mismatch_of(problem.dataset, base.blocks, phases).p_value < 1e-9
    learned = estimated(problem, base, [])
    assert all(0.012 < s < 0.03 for s in learned.scales.values())
    for share, holds in ((0.02, True), (0.1, False)):
        beside_it = judged(curved(share), dict(learned.scales))
        base = beside_it.fit((), ())
        assert base is not None
        assert is_tolerated(beside_it, base) is holds


def test_an_error_of_half_a_wave_is_one_for_as_long() -> None:
    problem = judged(curved(0.05))
    base = problem.fit((), ())
    assert base is not None
    times = correlation_times(problem, base)
    # a sine of 0.23 s has lost half its correlation after a sixth of that, and an exponential of the same after t ln 2
    assert times[DEPTH] == pytest.approx(0.23 / 6.0 / np.log(2.0), rel=0.35)


@pytest.mark.parametrize(("turn", "repeats"), [(0.0, True), (2.0, False)])
def test_a_ringing_alike_in_all_drops_is_no_background(turn: float, repeats: bool) -> None:
    """At 45 Hz for 0.1 s; and where each drop begins at another phase of it."""
    rung = []
    for k, (name, r) in enumerate(recorded({}, 3, speeds=(1.5, 2.0, 2.5, 3.0), noise=0.003)):
        after = np.maximum(r.time, 0.0)
        wave = np.sin(2.0 * np.pi * 45.0 * after + turn * k) * np.exp(-after / 0.1) * (r.time > 0.0)
        rung.append((name, replace(r, channels={c: v + 0.05 * np.ptp(v) * wave for c, v in r.channels.items()})))
    problem = judged(rung)
    base = problem.fit((), ())
    assert base is not None
    assert quick_channels(problem, base) == {FORCE, DEPTH}
    assert repeats_its_course(problem, base, left_out(problem.dataset)) is repeats


def test_a_slow_wave_alike_in_all_drops_may_be_a_background() -> None:
    problem = judged(curved(0.02))
    base = problem.fit((), ())
    assert base is not None
    assert quick_channels(problem, base) == set()
    groups = left_out(problem.dataset)
    gained, due = predicted_by_others(problem, base, groups, (FORCE, DEPTH))
    assert jackknifed(gained, due, groups).share > 0.8  # though it is the same in all
    assert not repeats_its_course(problem, base, groups)


def test_references_teach_the_scale_unless_noise_hides_it() -> None:
    problem = judged(curved(0.02))
    base = problem.fit((), ())
    assert base is not None
    learned = learned_from_references(problem, base)
    assert learned is not None
    assert learned.scales[DEPTH] == pytest.approx(0.02, rel=0.35)
    loud = judged(recorded({}, 3, noise=0.05))
    base = loud.fit((), ())
    assert base is not None
    assert learned_from_references(loud, base) is None


def test_samples_of_two_correlation_times_share_one_error() -> None:
    shares = {FORCE: 0.1, DEPTH: 0.1}
    whole, some = (judged(recorded({}, 3, noise=0.01), shares, t) for t in (None, {FORCE: 0.02, DEPTH: 0.04}))
    sizes = [s.rows.size for e in whole.dataset for s in e.signals]
    assert whole.samples_per_error == pytest.approx(np.mean(sizes))
    assert some.samples_per_error == pytest.approx(2.0 * 0.03 * 300.0, rel=0.01)  # 300 Hz
    # which a rig repeats in each of the three drops
    assert some.samples_per_draw == pytest.approx(3.0 * some.samples_per_error)
    tolerated = Problem([replace(e, discrepancy={}, memory={}, model_error=0.1) for e in some.dataset])
    assert tolerated.samples_per_draw == tolerated.samples_per_error > 1.0
    noise = judged(recorded({}, 3, noise=0.01))
    assert (noise.samples_per_error, noise.samples_per_draw) == (1.0, 1.0)


def test_a_discrepancy_is_of_its_channel_and_above_the_noise() -> None:
    problem = judged(recorded({}, 3, noise=0.01), {DEPTH: 0.05})
    for e in problem.dataset:
        sizes = {s.channel: e.model_error_of(s) * s.span / s.noise for s in e.signals}
        assert sizes[DEPTH] == pytest.approx(5.0, rel=0.25)
        assert sizes[FORCE] == pytest.approx(SETTINGS.data.dataset.other_error_share, rel=0.03)
        assert all(e.model_error_dominates(s) for s in e.signals)


def test_a_slow_wave_alone_is_usual_model_error() -> None:
    found = diagnose(scenario(), curved(0.012), estimate=True)
    assert (found.verdict, found.answer, found.effects, found.broken) == ("no-mismatch", "nothing", (), ())
    assert "models usually miss" in found.sentence
    scale = json_of(found)["discrepancy"][FORCE]
    assert scale["unit"] == "N"
    assert 10.0 < scale["scale"] < 150.0  # of a range of 3 kN
    assert 0.01 < scale["correlation_time"] < 0.2


def test_an_effect_is_named_beside_a_slow_wave() -> None:
    layer = {"effects.soil-layer.depth": 0.1, "effects.soil-layer.stiffness_ratio": 1.8}
    found = diagnose(scenario(), curved(0.01, changes=layer), estimate=True)
    assert [e.id for e in found.effects] == ["soil-layer"]
    assert (found.verdict, found.broken) == ("missing-physics", ())
    assert found.answer in ("whole", "likeness")
    assert found.discrepancy  # it was held against more than noise
    (one,) = found.effects
    assert one.explains is not None
    assert one.explains.share > 0.9
    assert one.moves is not None
    assert one.moves > 0.1
    assert one.parameters["depth"].low < 0.1 < one.parameters["depth"].high
    assert one.parameters["stiffness_ratio"].low < 1.8 < one.parameters["stiffness_ratio"].high


def test_noise_alone_is_held_against_noise_alone() -> None:
    found = diagnose(scenario(), recorded({}, 3, noise=0.003), estimate=True)
    assert (found.answer, dict(found.discrepancy)) == ("nothing", {})

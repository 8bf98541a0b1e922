"""Coefficients of Ye (2006) back from recordings made by an independent solution: values, coverage, honest gaps."""

from __future__ import annotations

from collections import Counter
from dataclasses import replace

import numpy as np
import pytest

from ground.branches import fit_branches
from ground.drops import Drop, UnusableDrop, correlated, loading
from ground.identify import Identified, identify, rest_stiffness, stiffness
from ground.law import evaluate
from ground.regression import NAMES
from tests.ground.recorded_drops import SPEEDS, TRUTH, recorded
from tests.ground.reference_drop import solve


def test_drops_that_all_reach_a_hard_layer_are_refused() -> None:
    import rollover as ro

    drops = {
        f"d{speed}": ro.synthesize(
            "drop_test", {"initiation.speed": speed}, hidden={"effects.soil-layer.depth": 0.1}, seed=1
        )
        for speed in (1.5, 2.0, 3.0)
    }
    with pytest.raises(
        ro.InputError, match=r"d1.5: K' rises .* m, where the law has it fall: a harder layer; to-depth 0.0992 takes"
    ):
        ro.identify(drops)


def values(found: Identified) -> dict[str, float]:
    return {c.name: c.value for c in found.coefficients}


def inside(found: Identified) -> list[str]:
    """Names of the coefficients whose interval holds the truth."""
    return [
        c.name
        for c in found.coefficients
        if (c.low is None or c.low <= TRUTH[c.name]) and (c.high is None or c.high >= TRUTH[c.name])
    ]


def test_clean_recordings_give_the_coefficients_back() -> None:
    found = identify(recorded(0))
    got = values(found)
    # p from two rises of 4141 and 74 081 N/m that 2 kHz rows resolve to a few N/m
    for name, rel in {
        "speed_exponent": 5e-3,
        "first_stiffness": 1e-3,
        "second_stiffness": 2e-3,
        "sinkage_exponent": 1e-3,
        "momentum_base": 1e-3,
    }.items():
        assert got[name] == pytest.approx(TRUTH[name], rel=rel), name
    assert got["speed_coefficient"] == pytest.approx(TRUTH["speed_coefficient"], rel=0.1)
    assert found.correlation > 0.999
    assert all(c.origin == "data" for c in found.coefficients)


@pytest.mark.parametrize(("mass", "area_ratio", "noise"), [(132.0, 1.0, 0.005), (200.0, 1.5, 0.01)])
def test_intervals_hold_the_truth_in_95_of_100_draws(mass: float, area_ratio: float, noise: float) -> None:
    draws = 32
    hits: Counter[str] = Counter()
    for seed in range(draws):
        found = identify(recorded(seed, noise=noise, mass=mass, area_ratio=area_ratio))
        hits.update(inside(found))
    # 32 draws of a 95 % interval: 27 or more hits with a probability of 0.99 for each coefficient
    assert min(hits[name] for name in NAMES) >= 27, hits
    share = sum(hits.values()) / (draws * len(NAMES))
    assert 0.90 <= share <= 0.99, (share, hits)


def test_intervals_are_narrow_enough_to_be_of_use() -> None:
    by_name = {c.name: c for c in identify(recorded(1, noise=0.005)).coefficients}
    for name, most in {"second_stiffness": 0.03, "momentum_base": 0.02, "sinkage_exponent": 0.02}.items():
        c = by_name[name]
        assert c.low is not None
        assert c.high is not None
        assert c.high - c.low < most * abs(c.value), name


def test_branch_change_and_first_stiffness_of_each_drop() -> None:
    branches = fit_branches([loading(drop, 0.1) for drop in recorded(0)])
    for speed, first, change in zip(SPEEDS, branches.first, branches.change, strict=True):
        expected = solve(speed)
        assert change == pytest.approx(expected.branch_sinkage, rel=5e-3)
        assert first == pytest.approx(expected.branch_force / expected.branch_sinkage, rel=3e-3)


def test_secant_stiffness_over_depth_and_at_rest() -> None:
    drop = recorded(0, speeds=(2.0,))[0]
    load = loading(drop, 0.1)
    z, K, sd = stiffness(load)
    expected = solve(2.0)
    use = z > 0.005
    assert np.abs(K[use] * z[use] / expected.spring(z[use]) - 1.0).max() < 0.01
    assert np.all(np.diff(sd) <= 0.0) or sd[0] > 10.0 * sd[-1]  # no bound at the surface
    # (6): 9.81 * 132 / 0.16308
    assert rest_stiffness(load) == pytest.approx(7941, rel=5e-3)


def test_noise_at_the_surface_does_not_bend_the_first_stiffness() -> None:
    """F/z of single rows scatters without bound there; the mean over draws must stay at the truth."""
    firsts = [
        fit_branches([loading(d, 0.1) for d in recorded(s, noise=0.01, speeds=(2.0,))]).first[0] for s in range(12)
    ]
    assert np.mean(firsts) == pytest.approx(75_002, rel=0.02)


@pytest.mark.parametrize("missing", ["force", "acceleration", "sinkage"])
def test_a_missing_channel_is_derived_from_others_and_noted(missing: str) -> None:
    drops = [replace(drop, **{missing: None}) for drop in recorded(0)]
    found = identify(drops)
    for name, rel in {"second_stiffness": 0.02, "sinkage_exponent": 0.02, "momentum_base": 0.02}.items():
        assert values(found)[name] == pytest.approx(TRUTH[name], rel=rel), name
    said = " ".join(found.branches.loads[0].assumed)
    assert {"force": "no load cell", "acceleration": "no accelerometer", "sinkage": "double integral"}[missing] in said


def test_slow_drops_cannot_tell_the_rise_with_speed() -> None:
    found = identify(recorded(3, noise=0.007, speeds=(1.0, 1.5, 2.0, 2.5)))
    by_name = {c.name: c for c in found.coefficients}
    assert {by_name["speed_coefficient"].origin, by_name["speed_exponent"].origin} == {"neutral"}
    assert "does not show" in by_name["speed_exponent"].why
    assert by_name["speed_coefficient"].value == 0.0
    assert by_name["momentum_base"].origin == "data"
    kept = {c.name: c for c in identify(recorded(3, noise=0.007, speeds=(1.0, 1.5, 2.0, 2.5)), keep=True).coefficients}
    assert (kept["speed_exponent"].value, kept["speed_exponent"].origin) == (18.71, "kept")
    assert kept["speed_coefficient"].value == pytest.approx(4.9e-6, rel=1e-9)
    assert kept["first_stiffness"].value == pytest.approx(75_000, rel=0.03)


def test_one_speed_cannot_tell_the_momentum_term() -> None:
    drops = [d for s in range(3) for d in (replace(recorded(s, noise=0.005, speeds=(2.0,))[0], name=f"drop {s}"),)]
    found = identify(drops)
    base = {c.name: c for c in found.coefficients}["momentum_base"]
    assert (base.origin, base.value, base.low, base.high) == ("neutral", 1.0, None, None)
    # what it cannot split it still predicts: the force at that speed
    assert evaluate(found.law, 0.1, speed=2.0) == pytest.approx(float(solve(2.0).spring(0.1)), rel=0.01)


def test_masses_are_told_apart_only_if_the_law_takes_them() -> None:
    """Two masses at one speed: m v differs in eq (5) if m is the striker's, not if it is the reference."""
    drops = [replace(recorded(0, speeds=(2.0,), mass=m, law_mass=m)[0], name=f"{m:g} kg") for m in (80.0, 132.0, 200.0)]
    found = identify(drops, law_mass="effective")
    assert values(found)["momentum_base"] == pytest.approx(0.89, rel=2e-3)
    reference = {c.name: c for c in identify(drops).coefficients}
    assert reference["momentum_base"].origin == "neutral"


def test_drops_that_differ_beyond_noise_widen_intervals() -> None:
    def of(scatter: float) -> Identified:
        drops = recorded(5, noise=0.005, speeds=(1.0, 1.0, 2.0, 2.0, 3.0, 3.0, 3.5, 3.5))
        rng = np.random.default_rng(1)
        scaled = []
        for k, drop in enumerate(drops):
            factor = np.exp(scatter * rng.standard_normal())
            # a stiffer spot: force over depth scales as a whole if the area does, and the motion with it
            s = recorded(100 + k, noise=0.005, speeds=(drop.speed,), area_ratio=factor)[0]
            scaled.append(replace(s, area=0.0063, name=f"{k}"))
        return identify(scaled)

    calm, rough = of(0.0), of(0.15)
    assert calm.between_drops < 0.02
    assert 0.06 < rough.between_drops < 0.4
    assert rough.log_scatter > 2.0 * calm.log_scatter
    width = [next(c for c in f.coefficients if c.name == "second_stiffness") for f in (calm, rough)]
    assert width[1].high - width[1].low > 4.0 * (width[0].high - width[0].low)  # type: ignore[operator]


def test_the_law_carries_where_it_was_calibrated() -> None:
    found = identify(recorded(0, noise=0.005), source="made up", recordings=("a sha256:0",))
    domain = found.law.domain
    assert (domain.speed_least, domain.speed_most, domain.momentum_most) == (1.0, 3.5, 132.0 * 3.5)
    calibration = found.law.calibration
    assert calibration is not None
    assert (calibration.source, calibration.recordings) == ("made up", ("a sha256:0",))
    assert calibration.sinkage_most == pytest.approx(0.4364, rel=5e-3)
    assert {i.of for i in calibration.intervals} == set(NAMES)


def broken(drop: Drop, what: str) -> Drop:
    if what == "short":
        use = drop.time < 0.03
        parts = {k: getattr(drop, k)[use] for k in ("time", "force", "sinkage", "acceleration")}
        return replace(drop, **parts)
    if what == "empty":
        return replace(drop, time=drop.time - 100.0)
    return replace(drop, force=None, acceleration=None)


@pytest.mark.parametrize(
    ("what", "said"),
    [
        ("short", "ends before the deepest point"),
        ("empty", "too few rows after first contact"),
        ("blind", "neither force nor acceleration"),
    ],
)
def test_what_is_no_drop_is_refused_with_its_name(what: str, said: str) -> None:
    with pytest.raises(UnusableDrop, match=f"^2 m/s: {said}"):
        identify([broken(recorded(0, speeds=(2.0,))[0], what)])


def test_correlated_rows_count_less() -> None:
    rng = np.random.default_rng(0)
    white = rng.standard_normal(4000)
    red = np.zeros(4000)
    for k in range(1, 4000):
        red[k] = 0.8 * red[k - 1] + white[k]
    assert correlated(white) < 1.3
    # (1 + 0.8)/(1 - 0.8) = 9
    assert correlated(red) == pytest.approx(9.0, rel=0.25)

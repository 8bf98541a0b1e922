"""What a misfit depends on: forces that were left out, sensors that go their own way, lines that are no noise."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from rollover.diagnosis.data.dataset import Dataset, dataset_of
from rollover.diagnosis.data.phases import drop_phases
from rollover.diagnosis.fit.levenberg_marquardt import Problem
from rollover.diagnosis.fit.linearisation import Fitted
from rollover.diagnosis.fit.parameterisation import Candidate
from rollover.diagnosis.fit.time_shift import estimate_time_shifts
from rollover.diagnosis.forward.averaging import simulated
from rollover.diagnosis.forward.forward_model import set_up
from rollover.diagnosis.inference import drop_dependence as dependence_of
from rollover.diagnosis.inference.bases import ACCELERATION, DEPTH, SPEED, TIME
from rollover.diagnosis.inference.drop_dependence import (
    IMPACT,
    VALUE,
    Dependence,
    dependence,
    dependence_of_one,
    loading_paths,
)
from rollover.diagnosis.inference.lack_of_fit import mismatch_of
from rollover.diagnosis.inference.newmark import newmark_response
from rollover.diagnosis.inference.residual_force import channels_of
from rollover.diagnosis.noise import autoregression
from rollover.diagnosis.noise.spectral_lines import lines, without
from rollover.diagnosis.selection.simplification import is_flexible_soil, is_over_flexible
from rollover.effects import Search
from rollover.proof.generator import Order, make
from rollover.recording import Clock, Recording
from rollover.scenario import Scenario, load
from tests.diagnosis import drops
from tests.diagnosis.drops import recorded, scenario
from tests.diagnosis.test_nulls import noise

THREE = (drops.FORCE, drops.DEPTH, drops.ACCELERATION)


def base_of(own: Scenario, recordings: Sequence[tuple[str, Recording]]) -> tuple[Problem, Fitted]:
    """The scenario as it is beside recordings, their noise from quiet stretches."""
    found = [dataset_of(name, *simulated(own, r)) for name, r in recordings]
    dataset: list[Dataset] = [e for e in found if e is not None]
    problem = Problem(dataset)
    estimate_time_shifts(problem)
    first = problem.fit((), (), rounds=2)
    assert first is not None
    problem.with_noise_model(autoregression.with_noise_of_quiet_stretches(dataset, problem.residuals(first)))
    base = problem.fit((), ())
    assert base is not None
    return problem, base


def told(own: Scenario, recordings: Sequence[tuple[str, Recording]]) -> Dependence:
    problem, base = base_of(own, recordings)
    return dependence(problem, [set_up(own, e.recording) for e in problem.dataset], base)


def test_a_spring_under_constant_force_swings_about_its_rest() -> None:
    """z'' = p - w^2 z from z = 0, z' = u: z = p/w^2 (1 - cos wt) + u/w sin wt, by Newmark's rule to (w h)^2/12."""
    h, w, many = 5e-4, np.array([40.0]), 400
    p, u, t = np.array([3.0, -1.0]), 0.2, 5e-4 * np.arange(many)[:, None]
    z, v, a = (np.zeros((many, 2)) for _ in range(3))
    v[0] = u
    newmark_response(np.tile(p, (many, 1)), np.full(many, w**2), h, z, v, a)
    right = p / w**2 * (1.0 - np.cos(w * t)) + u / w * np.sin(w * t)
    assert np.max(np.abs(z - right)) < 1.5 * (w * h) ** 2 / 12.0 * (w * t[-1]) * np.max(np.abs(right))
    assert np.allclose(a, p - w**2 * z, rtol=0.0, atol=1e-9)


def test_a_force_does_to_every_channel_what_the_simulation_says() -> None:
    """(D6) against the integrator: viscous damping of 400 N s/m."""
    own, damping = scenario(), 400.0
    made = recorded({"effects.soil-viscous-damping.damping": damping}, channels=THREE, rate=2000.0, noise=1e-3)
    problem, base = base_of(own, made)
    for d in loading_paths(problem, [set_up(own, r) for _, r in made], base)[1]:
        moved = channels_of(d.way, d.way.moved(damping * d.way.speed[:, None], "ground"), d.dataset, d.shift)[d.rows]
        s, w = d.slope[d.rows], d.residual[d.rows]
        left = w - moved[:, 0]
        left = left - s * float(s @ left) / float(s @ s + d.prior**-2)
        at = np.flatnonzero(d.rows)
        for signal, part in d.dataset.spans():
            # the force leaps at the contact: on which side a sample lies there is the clock's
            late = d.dataset.recording.time[signal.rows] - d.shift > 0.003
            rows = np.isin(at, part.start + np.flatnonzero(late))
            assert rows.sum() > 20
            most = 0.03 * np.linalg.norm(moved[rows]) + 1.3 * np.sqrt(rows.sum())
            assert np.linalg.norm(left[rows]) < most, signal.channel


@pytest.mark.parametrize(
    ("kind", "seed", "wanted", "channel"),
    [
        ("memory", 22, TIME, None),
        ("stone", 24, DEPTH, None),
        ("side-load", 28, ACCELERATION, None),
        ("stiffness-by-impact-speed", 29, IMPACT, None),
        ("hum", 32, TIME, "own"),
        ("coarse", 31, VALUE, "own"),
    ],
)
def test_a_residual_law_is_stated_in_its_own_quantities(
    kind: str, seed: int, wanted: str, channel: str | None, tmp_path: Path
) -> None:
    case = make(Order(index=seed, seed=5102, kind="outside", ids=(f"outside:{kind}",)))
    path = tmp_path / "scenario.yaml"
    path.write_text(case.scenario, encoding="utf-8")
    found = told(load(path), [(f"r{k}", r) for k, r in enumerate(case.recordings, start=1)])
    assert found.on == wanted
    assert found.channel == (case.truth["effects"][0]["channel"] if channel else None)
    assert found.shares[0][1] > 0.5
    assert sum(share for _, share in found.shares) <= 1.0 + 1e-9


def test_loading_starts_at_onset_where_shifts_absorbed_it(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """Nobody timed these drops, and a base is 30 ms late: from there no slope leads over the edge of the contact."""
    hidden = {f"effects.soil-layer.{n}": v for n, v in {"stiffness_ratio": 0.6, "depth": 0.05, "width": 0.02}.items()}
    made = recorded(hidden, 5, speeds=(1.2, 1.8, 2.6, 3.2), channels=THREE, rate=1000.0, noise=0.005)
    problem, _ = base_of(scenario(), [(n, replace(r, clock=Clock(zero="unknown"))) for n, r in made])
    blocks = [problem.block(r, (), (), 0.03, 0.0) for r in range(len(made))]
    base = Fitted(candidates=(), x=(), blocks=tuple(b for b in blocks if b is not None))
    scenarios = [set_up(scenario(), e.recording) for e in problem.dataset]

    def worst() -> float:
        return max(d.score / d.rows.sum() for d in loading_paths(problem, scenarios, base)[1])

    assert all(abs(d.shift) < 1.5e-3 for d in loading_paths(problem, scenarios, base)[1])
    assert worst() < 0.3  # of what noise leaves, beyond it
    monkeypatch.setattr(dependence_of, "shifts_from_contact", lambda *_: [None] * len(made))
    assert worst() > 3.0


def test_a_sensor_dropout_differs_from_a_force_by_its_timing() -> None:
    rng, made = np.random.default_rng(3), []
    for name, r in recorded({}, channels=THREE, rate=1000.0, noise=0.005):
        y = r.channels[drops.FORCE].copy()
        for start in rng.uniform(-0.02, 0.3, 6):
            y[(r.time >= start) & (r.time < start + 0.005)] = 0.0
        made.append((name, replace(r, channels={**r.channels, drops.FORCE: y})))
    found = told(scenario(), made)
    assert found.channel == drops.FORCE
    assert found.on == TIME


def test_a_deviating_channel_is_found_by_the_others_residuals() -> None:
    """y = x (1 + 0.3 x/x_max) of one channel; the same that drops out; and a force, which moves them all."""

    def of_one(made: Sequence[tuple[str, Recording]]) -> Dependence | None:
        problem, base = base_of(scenario(), made)
        phases = [drop_phases(e) for e in problem.dataset]
        return dependence_of_one(problem, base, mismatch_of(problem.dataset, base.blocks, phases))

    rng, curved, loose = np.random.default_rng(3), [], []
    for name, r in recorded({}, channels=THREE, rate=1000.0, noise=0.005):
        x = r.channels[drops.FORCE]
        distorted = x * (1.0 + 0.3 * x / x.max())
        gone = np.where(np.repeat(rng.random(x.size // 5 + 1) < 0.1, 5)[: x.size], 0.0, x)
        curved.append((name, replace(r, channels={**r.channels, drops.FORCE: distorted})))
        loose.append((name, replace(r, channels={**r.channels, drops.FORCE: gone})))
    for made, on in ((curved, VALUE), (loose, TIME)):
        found = of_one(made)
        assert found is not None
        assert (found.channel, found.on) == (drops.FORCE, on)
    damped = {"effects.soil-viscous-damping.damping": 400.0}
    assert of_one(recorded(damped, channels=THREE, rate=1000.0, noise=0.005)) is None


@pytest.mark.parametrize("memory", [0.0, 0.9])
def test_a_spectral_line_is_found_only_where_there_is_one(memory: float) -> None:
    rng, alarms = np.random.default_rng(4), 0
    for _ in range(40):
        times = [np.arange(n) / 900.0 for n in (300, 420, 500)]
        still = [noise(rng, t.size, memory) for t in times]
        alarms += bool(lines(times, still))
        # each recorder starts at its own place of the wave
        found = lines(
            times, [w + np.sin(2.0 * np.pi * 50.0 * t + k) for k, (t, w) in enumerate(zip(times, still, strict=True))]
        )
        assert len(found) == 1
        # a sixth of what 0.33 s, the shortest of them, can resolve
        assert found[0] == pytest.approx(50.0, abs=0.5)
        left = without(times[2], still[2] + np.sin(2.0 * np.pi * 50.0 * times[2] + 2.0), found)
        assert np.mean((left - still[2]) ** 2) < 0.15
    assert alarms <= 1


def held(misfit: np.ndarray, quiet: float, ar: tuple[float, ...], count: int = 3) -> list[Dataset]:
    """Recordings of one channel whose noise was said to be `quiet` with a memory of `ar`."""
    name, r = recorded({}, speeds=(2.0,), rate=1000.0, channels=(drops.FORCE,))[0]
    n = misfit.size // count
    one = dataset_of(name, *simulated(scenario(), r))
    assert one is not None
    s = replace(one.signals[0], rows=np.arange(n), values=np.zeros(n), noise=quiet, sigma=quiet, ar=ar)
    recording = replace(r, time=np.arange(n) * 1e-3, channels={drops.FORCE: np.zeros(n)})
    return [replace(one, recording=recording, signals=(s,)) for _ in range(count)]


def test_autocorrelated_noise_uses_all_residuals_drift_not() -> None:
    rng, n = np.random.default_rng(5), 400
    white = rng.standard_normal(3 * n)
    slow = noise(rng, 3 * n, 0.6)
    drift = white + 4.0 * np.tile(1.0 / (1.0 + np.exp(-(np.arange(n) - 200.0) / 15.0)), 3)
    for misfit, ar, kept in ((slow, (0.5,), False), (white, (), False), (drift, (), True)):
        before = held(misfit, 1.0, ar)
        after = autoregression.with_noise_of_residuals(before, list(misfit.reshape(3, n)))
        assert (after[0].signals[0] is before[0].signals[0]) == kept
    assert sum(
        autoregression.with_noise_of_residuals(held(slow, 1.0, (0.5,)), list(slow.reshape(3, n)))[0].signals[0].ar
    ) == pytest.approx(0.6, abs=0.08)


def test_offsets_are_no_autocorrelation_of_the_noise() -> None:
    """What two effects of one sensor leave of a curved one: 1.4 sigma too little at first, 0.8 too much later on."""
    rng, n = np.random.default_rng(6), 800
    still = noise(rng, 3 * n, 0.6)
    off = still + np.tile(np.where(np.arange(n) < 200, -1.4, 0.8), 3)
    for misfit, kept in ((still, False), (off, True)):
        before = [
            replace(e, signals=(replace(e.signals[0], at_rest=(1.0, (0.6,))),)) for e in held(misfit, 1.0, (0.6,))
        ]
        # weighed once before, by what one effect had left
        again = [replace(e, signals=(replace(e.signals[0], noise=1.4, ar=(0.85,)),)) for e in before]
        for dataset in (before, again):
            after = autoregression.with_noise_of_residuals(dataset, list(misfit.reshape(3, n)))
            assert (after[0].signals[0] is dataset[0].signals[0]) == kept


def test_a_line_of_any_frequency_is_a_mismatch_of_its_channel() -> None:
    """At 130 Hz it is beyond the slow waves of every phase."""
    made = []
    for name, r in recorded({}, channels=THREE, rate=1000.0, noise=0.005):
        size = 0.01 * float(np.ptp(r.channels[drops.DEPTH]))
        line_spectrum = size * np.sin(2.0 * np.pi * 130.0 * r.time)
        made.append((name, replace(r, channels={**r.channels, drops.DEPTH: r.channels[drops.DEPTH] + line_spectrum})))
    problem, base = base_of(scenario(), made)
    found = mismatch_of(problem.dataset, base.blocks, [drop_phases(e) for e in problem.dataset])
    assert found.p_value < 1e-6
    assert found.shares()[0][0].channel == drops.DEPTH
    for s in (s for e in problem.dataset for s in e.signals if s.channel == drops.DEPTH):
        assert s.noise < 0.007 * s.span  # what hums was left out of it


def test_three_effects_of_one_kind_are_over_flexible_two_not() -> None:
    def on(id: str, channel: str | None) -> Candidate:
        return Candidate(id=id, kind="sensor", family="", search={}, channel=channel)

    three = [on(id, drops.DEPTH) for id in ("sensor-scale", "sensor-clipping", "sensor-bias")]
    assert is_over_flexible(three)
    assert not is_over_flexible(three[:2])
    assert not is_over_flexible([*three[:2], on("sensor-bias", drops.FORCE)])
    soil = [on("soil-layer", None), on("soil-rate-hardening", None), on("soil-stiffness", None)]
    assert is_over_flexible(soil)
    assert not is_over_flexible([*soil[:2], on("mass", None)])
    back = [on("soil-elastic-rebound", None), on("soil-adhesion", None)]
    assert not is_over_flexible([soil[0], *back]), "the way back is another curve than the way down"
    assert not is_over_flexible([*soil[:2], back[0]])
    shaped = replace(soil[1], search={"per_decade": Search(0.01, 0.5), "reference_speed": Search(0.01, 1.0)})
    assert not is_over_flexible([soil[0], shaped])
    curved = [replace(soil[0], variant={"onset": 1.0}), shaped]
    assert is_over_flexible(curved)
    assert is_over_flexible([*curved, on("sensor-clipping", drops.FORCE)])
    assert not is_over_flexible([shaped])
    assert is_flexible_soil([soil[0], shaped])
    assert not is_flexible_soil(soil)
    assert not is_flexible_soil([shaped, on("mass", None)])


def test_a_small_gain_is_not_named_and_a_sensor_goes_by_time() -> None:
    assert Dependence(shares=((SPEED, 0.2),)).on is None
    assert Dependence(shares=((SPEED, 0.4),)).on == SPEED
    assert Dependence(shares=((VALUE, 0.4),), channel=drops.FORCE).on == TIME
    assert Dependence(shares=((VALUE, 0.9),), channel=drops.FORCE).on == VALUE


@pytest.mark.parametrize(
    ("one", "motion", "yields"),
    [
        ("time", ("chassis/roll", 0.9), True),
        ("time", ("chassis/roll", 0.3), False),  # a hum goes with no attitude
        ("time", ("time", 0.9), False),
        (VALUE, ("chassis/roll", 0.9), False),  # of what tips over a rate goes with the angle: so does its error
    ],
)
def test_vehicle_residuals_go_by_time_where_tests_begin_alike(
    one: str, motion: tuple[str, float], yields: bool
) -> None:
    of_one = Dependence(shares=((one, 0.99),), channel="chassis/angular_velocity_x")
    assert of_one.yields_to(Dependence(shares=(motion,))) is yields
    assert not of_one.yields_to(Dependence())

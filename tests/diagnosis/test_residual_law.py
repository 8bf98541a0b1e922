"""The law without a name: its terms, the weak form it is found in, and when it is offered."""

from __future__ import annotations

import sys

import numpy as np
import pytest

import rollover.diagnosis.pipeline  # noqa: F401  (the module, behind the function of its name)
from ground.empirical import TERMS, shape
from ground.law import REFERENCE_AREA
from rollover.diagnosis import diagnose, diagnosed_text, json_of
from rollover.diagnosis.data.dataset import dataset_of, left_out
from rollover.diagnosis.fit.levenberg_marquardt import Problem
from rollover.diagnosis.fit.time_shift import estimate_time_shifts
from rollover.diagnosis.forward.forward_model import set_up, simulator_of
from rollover.diagnosis.inference.residual_law import Balance, _tests, balances, best_subsets, proposed
from rollover.diagnosis.io import diagnosed_scenario
from rollover.diagnosis.selection.candidates import candidates_of
from rollover.dynamics.drop_test import DropModel
from rollover.effects.empirical import Empirical
from rollover.recording import Recording
from rollover.scenario import load
from tests.diagnosis.drops import ACCELERATION, DEPTH, FORCE, recorded, scenario

asked = sys.modules["rollover.diagnosis.conclusion"]


@pytest.mark.parametrize(
    ("name", "wanted"),
    [
        ("z^(1/2) v^2", lambda x, u, w: np.sqrt(x) * u**2),
        ("z v_s", lambda x, u, w: x * w),
        ("(z - 0.4)+", lambda x, u, w: np.maximum(x - 0.4, 0.0)),
        ("bump(v at 0.55)", lambda x, u, w: np.exp(-(((u - 0.55) / 0.15) ** 2))),
        ("bump(z at 0.0)", lambda x, u, w: np.exp(-((x / 0.15) ** 2))),
    ],
)
def test_a_term_is_what_it_is_called(name: str, wanted: object) -> None:
    x, u, w = np.random.default_rng(1).uniform(0.01, 1.2, (3, 50))
    assert shape(name, x, u, w) == pytest.approx(wanted(x, u, w))  # type: ignore[operator]
    assert np.all(shape(name, -x, u, w) == 0.0)
    assert len(TERMS) == len({t.text for t in TERMS.values()})


@pytest.mark.parametrize(
    ("law", "same"),
    [
        ({"first": "v", "first_force": 1600.0, "speed": 2.0}, {"soil-viscous-damping": {"damping": 800.0}}),
        (
            {"first": "1", "first_force": 0.0, "third": "v^2", "third_force": 4.0 * 0.5 * 9.0 * 1800.0 * REFERENCE_AREA,
             "speed": 2.0},
            {"soil-inertial-drag": {"coefficient": 9.0}},
        ),
    ],
)  # fmt: skip
def test_a_law_of_one_term_is_the_effect_of_that_form(law: dict[str, object], same: dict[str, object]) -> None:
    t = np.linspace(-0.01, 0.3, 80)
    a, b = (
        DropModel(scenario=scenario().replaced({f"effects.{id}": p for id, p in e.items()})).run(t)
        for e in ({"empirical": law}, same)
    )
    for channel in (FORCE, DEPTH, ACCELERATION):
        assert a[channel] == pytest.approx(b[channel], rel=1e-9, abs=1e-9)


def test_an_unknown_term_is_one_line() -> None:
    with pytest.raises(ValueError, match="second: unknown term, got 'w'"):
        Empirical(second="w")
    text = Empirical(first="v^2", first_force=-120.0, third="z", third_force=4.0).law
    assert text == "F = -120 N * v^2 +4 N * z, z over 0.1 m, v over 1 m/s"


def test_windows_take_means_and_derivatives_by_parts() -> None:
    t = np.linspace(0.0, 0.2, 400)
    dispersion, curved = _tests(t)
    dt = np.gradient(t)
    assert len(dispersion) > 10
    assert dispersion @ dt == pytest.approx(np.ones(len(dispersion)), rel=2e-3)
    z = 0.3 * np.sin(9.0 * t)
    assert curved @ (dt * z) == pytest.approx((dispersion * dt) @ (-81.0 * z), abs=0.02 * 24.3)


def fallen(name: str, force: float, noise: float) -> list[Balance]:
    """Made-up motions under a law of one term, forces in windows with noise."""
    rng = np.random.default_rng(8)
    found = []
    for touch in (1.5, 2.0, 2.6, 3.2):
        t = np.linspace(0.0, 0.3 / touch, 200)
        v = touch * np.cos(0.5 * np.pi * t / t[-1])
        z = np.concatenate([[1e-6], np.cumsum(0.5 * (v[1:] + v[:-1]) * np.diff(t))])
        weights = _tests(t)[0] * np.gradient(t)
        x, u, w = z / 0.2, v / 3.0, np.full(t.size, touch / 3.0)
        mean = weights @ (force * shape(name, x, u, w))
        found.append(
            Balance(
                condition=f"{touch}",
                force=mean + rng.normal(0.0, noise, mean.size),
                depth=z,
                speed=v,
                touch=np.full(t.size, touch),
                weights=weights,
            )
        )
    return found


@pytest.mark.parametrize("name", ["v^2", "z v_s", "bump(z at 0.4)", "bump(v at 0.55)", "z^(1/2) v"])
def test_the_terms_that_made_a_force_are_found_and_no_more(name: str) -> None:
    best = best_subsets(fallen(name, 400.0, 8.0), 0.2, 3.0)[0]
    assert [list(TERMS)[t] for t in best.terms] == [name]
    assert best.forces[0] == pytest.approx(400.0, rel=0.1)


def test_residual_forces_in_windows_are_the_force_that_was_added() -> None:
    own = scenario()
    for channels in ((FORCE, DEPTH, ACCELERATION), (DEPTH, ACCELERATION), (DEPTH,)):
        made = recorded(
            {"effects.soil-viscous-damping.damping": 800.0},
            channels=channels,
            rate=2000.0,
            noise=2e-4,
            speeds=(2.0, 3.0),
        )
        found = [dataset_of(name, r, simulator_of(own, r)) for name, r in made]
        kept = [e for e in found if e is not None]
        for b in balances([set_up(own, e.recording) for e in kept], kept):
            off = b.force - b.weights @ (800.0 * b.speed)
            inner = slice(3, -2)  # clocks are half a millisecond off, which the first contact shows
            assert np.sqrt(np.mean(off[inner] ** 2)) < (60.0 if FORCE in channels else 200.0), channels


def resonant(v: np.ndarray) -> np.ndarray:
    """A resistance with a peak at one speed, of another form than any term."""
    return np.asarray(900.0 / (1.0 + ((v - 1.1) / 0.25) ** 4))


@pytest.fixture(scope="module")
def unlisted() -> list[tuple[str, Recording]]:
    """Drops against a resistance that peaks at a speed, integrated here."""
    rng, found, m = np.random.default_rng(4), [], 132.0
    law = load("drop_test").ground.law
    from ground.law import evaluate

    for speed in (1.6, 2.1, 2.6, 3.1):
        h, t, z, v = 2e-4, 0.0, 0.0, speed / 1.1
        rows = []

        def acceleration(z: float, v: float, touch: float = speed) -> float:
            return (m * 9.81 - evaluate(law, z, v, speed=touch) - float(resonant(np.array(v)))) / (1.1 * m)

        while v > 0.0:
            rows.append((t, z, v, acceleration(z, v)))
            a = acceleration(z, v)
            zm, vm = z + 0.5 * h * v, v + 0.5 * h * a
            z, v, t = z + h * vm, v + h * acceleration(zm, vm), t + h
        table = np.array(rows)[::5]
        channels = {
            FORCE: m * (9.81 - table[:, 3]) + rng.normal(0.0, 25.0, len(table)),
            DEPTH: table[:, 1] + rng.normal(0.0, 4e-4, len(table)),
            ACCELERATION: -table[:, 3] + rng.normal(0.0, 0.2, len(table)),
        }
        told = {"initiation.speed": speed}
        found.append((f"v{speed}", Recording(title="r", time=table[:, 0], channels=channels, conditions=told)))
    return found


def test_unlisted_physics_is_given_as_a_law_that_predicts(
    unlisted: list[tuple[str, Recording]], monkeypatch: pytest.MonkeyPatch
) -> None:
    few = ("soil-viscous-damping", "soil-crust", "mass")  # that the law is asked for at all, not who competes
    monkeypatch.setattr(asked, "candidates_of", lambda *a: [c for c in candidates_of(*a) if c.id in few])
    found = diagnose(scenario(), unlisted)
    assert found.verdict == "unexplained"
    assert not found.effects
    law = found.empirical
    assert law is not None
    assert law.held_out_gain > 2.0 * law.standard_error
    assert law.after < 0.5 * law.before
    assert any("speed" in t.depends_on for t in law.terms)
    answer = json_of(found)
    assert answer["empirical"]["law"] == law.law
    assert len(answer["empirical"]["terms"]) == len(law.terms) <= 3
    again = diagnosed_scenario(scenario(), found)
    assert again.effects["empirical"].law == law.law
    assert "empirical" in diagnosed_text(scenario(), found)
    # the scenario with it switched on follows a drop that it was not fitted to by name
    name, r = unlisted[1]
    for one, most in ((scenario(), np.inf), (again, 0.5)):
        run = DropModel(scenario=set_up(one, r)).run(r.time)
        off = float(np.sqrt(np.mean((run[FORCE] - r[FORCE])[3:] ** 2)))
        if most is np.inf:
            before = off
    assert off < 0.5 * before, name


def test_no_law_is_made_of_noise() -> None:
    made = recorded({}, 7, speeds=(1.5, 2.0, 2.5, 3.0), channels=(FORCE, DEPTH, ACCELERATION), rate=1000.0)
    found = [e for e in (dataset_of(n, r, simulator_of(scenario(), r)) for n, r in made) if e is not None]
    problem = Problem(found)
    estimate_time_shifts(problem)
    base = problem.fit((), ())
    assert base is not None
    sets = [set_up(scenario(), e.recording) for e in found]
    assert len(balances(sets, found)) == 4
    assert proposed(problem, base, sets, found, left_out(found)) is None

"""The compaction model against closed forms: one half-oscillation down, one line back."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.integrate import solve_ivp

from ground.compaction import Compaction
from ground.law import evaluate

MASS, FRACTION, SPEED = 132.0, 0.107, 2.0  # kg, share by Pietzsch 1991, m/s
TOTAL = MASS * (1.0 + FRACTION)
AFTER = SPEED / (1.0 + FRACTION)  # restitution 0
ELASTIC, PLASTIC = 900e3, 60e3
SERIES = 56_250.0  # 900 * 60/960 kN/m


def strike(law: Compaction, gravity: float) -> tuple[float, float, float, float]:
    """Deepest sinkage (m), its time (s), force there (N) and energy in the dashpot (J), by the compiled force."""

    def rhs(t: float, y: np.ndarray) -> tuple[float, float, float]:
        force = evaluate(law, y[0], y[1], speed=SPEED)
        return y[1], (MASS * gravity - force) / TOTAL, law.damping * y[1] ** 2

    def stopped(t: float, y: np.ndarray) -> float:
        return float(y[1])

    stopped.terminal, stopped.direction = True, -1.0  # type: ignore[attr-defined]
    result = solve_ivp(rhs, (0.0, 5.0), (0.0, AFTER, 0.0), method="DOP853", rtol=1e-11, atol=1e-13, events=stopped)
    assert result.status == 1
    z = float(result.y[0, -1])
    return z, float(result.t[-1]), evaluate(law, z, 0.0, speed=SPEED), float(result.y[2, -1])


def test_the_series_stiffness_and_the_recovery() -> None:
    law = Compaction(elastic_stiffness=ELASTIC, plastic_stiffness=PLASTIC)
    assert law.stiffness == pytest.approx(SERIES, rel=1e-15)
    assert law.recovery == law.p[0] == pytest.approx(0.0625, rel=1e-15)  # 60/960
    assert evaluate(law, 0.1, speed=1.0) == pytest.approx(5625.0, rel=1e-14)


def test_undamped_without_gravity_is_a_quarter_of_a_sine() -> None:
    omega = math.sqrt(SERIES / TOTAL)
    z, t, force, _ = strike(Compaction(elastic_stiffness=ELASTIC, plastic_stiffness=PLASTIC), gravity=0.0)
    assert z == pytest.approx(AFTER / omega, rel=1e-9)
    assert t == pytest.approx(0.5 * math.pi / omega, rel=1e-9)
    assert force == pytest.approx(AFTER * math.sqrt(SERIES * TOTAL), rel=1e-9)


@pytest.mark.parametrize("ratio", [0.0, 0.05, 0.4, 0.9])
@pytest.mark.parametrize("gravity", [0.0, 9.81])
def test_the_damped_half_oscillation(ratio: float, gravity: float) -> None:
    """z = z_s + exp(-d t) (A cos w t + B sin w t) with A = -z_s, B = (v+ - d z_s)/w; v = 0 at the first root."""
    omega0 = math.sqrt(SERIES / TOTAL)
    law = Compaction(elastic_stiffness=ELASTIC, plastic_stiffness=PLASTIC, damping=2.0 * ratio * omega0 * TOTAL)
    decay, omega = ratio * omega0, omega0 * math.sqrt(1.0 - ratio**2)
    static = MASS * gravity / SERIES
    a, b = -static, (AFTER - decay * static) / omega
    # v exp(d t) = (w B - d A) cos w t - (w A + d B) sin w t
    t_max = math.atan2(omega * b - decay * a, omega * a + decay * b) % math.pi / omega
    z_max = static + math.exp(-decay * t_max) * (a * math.cos(omega * t_max) + b * math.sin(omega * t_max))
    z, t, force, in_dashpot = strike(law, gravity)
    assert t == pytest.approx(t_max, rel=1e-8)
    assert z == pytest.approx(z_max, rel=1e-9)
    assert force == pytest.approx(SERIES * z_max, rel=1e-9)
    assert 0.5 * TOTAL * AFTER**2 + MASS * gravity * z == pytest.approx(0.5 * SERIES * z**2 + in_dashpot, rel=1e-9)


def test_what_stays_and_what_comes_back() -> None:
    """The unloading line of the array, F_max/(recovery z_max), is the elastic spring; the rut is the plastic one."""
    law = Compaction(elastic_stiffness=ELASTIC, plastic_stiffness=PLASTIC)
    z, _, force, _ = strike(law, gravity=0.0)
    assert force / (law.recovery * z) == pytest.approx(ELASTIC, rel=1e-12)
    assert (1.0 - law.recovery) * z == pytest.approx(force / PLASTIC, rel=1e-12)
    work = 0.5 * TOTAL * AFTER**2
    back, kept = 0.5 * force**2 / ELASTIC, 0.5 * force**2 / PLASTIC
    assert back == pytest.approx(law.recovery * work, rel=1e-9)
    assert back + kept == pytest.approx(work, rel=1e-9)


def test_two_springs_and_a_ratchet_give_the_same_force() -> None:
    """An elastic spring on a plastic one that only ever shortens, moved down, up and down again past its depth."""
    law = Compaction(elastic_stiffness=ELASTIC, plastic_stiffness=PLASTIC)
    path = np.concatenate([np.linspace(0.0, 0.1, 50), np.linspace(0.1, 0.095, 20), np.linspace(0.095, 0.2, 50)])
    plastic, deepest = 0.0, 0.0
    for z in path:
        # equilibrium K_e (z - z_p) = K_p z_p, if that shortens the plastic spring
        plastic = max(plastic, ELASTIC * z / (ELASTIC + PLASTIC))
        deepest = max(deepest, z)
        unloading = law.stiffness / law.recovery
        element = evaluate(law, deepest, speed=1.0) - unloading * (deepest - z)
        assert element == pytest.approx(ELASTIC * (z - plastic), rel=1e-9, abs=1e-6)


@settings(max_examples=200, deadline=None)
@given(elastic=st.floats(1e2, 1e9), plastic=st.floats(1e2, 1e9))
def test_the_recovery_follows_from_any_springs(elastic: float, plastic: float) -> None:
    law = Compaction(elastic_stiffness=elastic, plastic_stiffness=plastic)
    assert law.recovery == pytest.approx(1.0 / (1.0 + elastic / plastic), rel=1e-12)
    assert 1.0 / law.stiffness == pytest.approx(1.0 / elastic + 1.0 / plastic, rel=1e-12)


def test_a_recovery_cannot_be_given() -> None:
    with pytest.raises(TypeError, match="recovery"):
        Compaction(elastic_stiffness=1e6, plastic_stiffness=1e5, recovery=0.02)  # type: ignore[call-arg]


@pytest.mark.parametrize(("elastic", "plastic"), [(1e-9, 1e9), (1e300, 1e-300)])
def test_springs_too_far_apart_are_refused(elastic: float, plastic: float) -> None:
    with pytest.raises(ValueError, match="plastic_stiffness: too far from elastic_stiffness"):
        Compaction(elastic_stiffness=elastic, plastic_stiffness=plastic)

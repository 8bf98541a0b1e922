"""Hard ground: the restitution that is asked for is the one that comes out, for any mass."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest
from scipy.integrate import quad, solve_ivp

from ground.hard import Hard
from ground.law import HIDDEN, evaluate, touched
from rollover.dynamics.simulate import run
from rollover.spec.vehicle import Striker
from tests.physics.scenes import drop


@pytest.mark.parametrize("e", [0.1, 0.125, 0.5, 0.9])
def test_the_damping_solves_the_integral_of_the_motion(e: float) -> None:
    """m v dv/dz = -k z (1 + d v) from v_s to -e v_s: the integral of v/(1 + d v) dv vanishes."""
    speed = 1.7
    d = float(touched(Hard(restitution=e), speed=speed)[HIDDEN])
    whole, _ = quad(lambda v: v / (1.0 + d * v), -e * speed, speed, limit=200)
    assert d > 0.0
    assert abs(whole) < 2e-6 * speed**2


@pytest.mark.parametrize("mass", [0.1, 30.0])
@pytest.mark.parametrize("e", [0.2, 0.6, 1.0])
def test_it_rebounds_with_e_times_the_speed_for_any_mass(e: float, mass: float) -> None:
    law, speed = Hard(restitution=e, stiffness=4e4), 1.3

    def rhs(_t: float, y: np.ndarray) -> list[float]:
        return [y[1], -evaluate(law, max(y[0], 0.0), y[1], speed=speed) / mass]

    def out(_t: float, y: np.ndarray) -> float:
        return float(y[0])

    out.terminal, out.direction = True, -1.0  # type: ignore[attr-defined]
    period = 2.0 * math.pi * math.sqrt(mass / 4e4)
    done = solve_ivp(rhs, (0.0, 20.0 * period), [1e-9, speed], events=out, rtol=1e-8, atol=1e-12, max_step=period / 200)
    assert done.status == 1
    assert -done.y[1, -1] == pytest.approx(e * speed, rel=1e-3)


@pytest.mark.parametrize("e", [0.25, 0.7])
def test_a_dropped_body_rebounds_so_in_the_array(e: float) -> None:
    law = Hard(restitution=e, stiffness=2e6)
    scenario = drop(2.0, law=law, fraction=0.0, duration=0.15, step=1e-4, striker=Striker(mass=20.0))
    result = run(replace(scenario, gravity=0.0))
    v = result.recording["striker/velocity_z"]
    assert v.min() == pytest.approx(-2.0, rel=1e-6)
    assert v[-1] == pytest.approx(e * 2.0, rel=0.01)
    assert result.recording["ground/force_normal"].min() >= 0.0
    # what the ground keeps is 1 - e^2 of the kinetic energy
    assert result.ledger["soil"] == pytest.approx(0.5 * 20.0 * 4.0 * (1.0 - e**2), rel=0.01)


def test_slow_contacts_are_damped_as_at_the_slow_speed() -> None:
    law = Hard(restitution=0.5, slow_speed=0.1)
    assert touched(law, speed=0.0)[HIDDEN] == touched(law, speed=0.1)[HIDDEN]
    assert touched(law, speed=0.2)[HIDDEN] == pytest.approx(0.5 * touched(law, speed=0.1)[HIDDEN], rel=1e-12)


def test_it_never_pulls_however_fast_it_is_left() -> None:
    assert evaluate(Hard(restitution=0.3), 0.001, -50.0, speed=1.0) == 0.0

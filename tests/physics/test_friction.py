"""Coulomb friction: none slides, enough does not, and what slides does so as the closed form says."""

from __future__ import annotations

import math

import numpy as np
import pytest

from ground.kernel import commit_friction, friction_force
from ground.surface import Slope
from rollover.dynamics.simulate import run
from rollover.spec.initiation import Drop
from tests.physics.scenes import block

ANGLE = 20.0


def slide(mu: float, duration: float = 1.0) -> tuple[np.ndarray, np.ndarray, float]:
    """Times, way down the slope and the friction's energy of a block put down gently on a slope of 20 deg."""
    scenario = block(
        Drop(speed=0.05, roll_deg=ANGLE), mu=mu, surface=Slope(angle_deg=ANGLE, direction_deg=90.0), duration=duration
    )
    result = run(scenario)
    assert result.status == "done", result.sentence
    y = result.recording["chassis/position_y"]
    return result.recording.time, (y[0] - y) / math.cos(math.radians(ANGLE)), result.ledger["friction"]


def test_without_friction_it_slides_as_a_point_mass() -> None:
    """s = g sin(a) t^2/2."""
    time, way, work = slide(0.0)
    assert way[-1] == pytest.approx(0.5 * 9.81 * math.sin(math.radians(ANGLE)) * time[-1] ** 2, rel=0.03)
    assert work == 0.0


def test_enough_friction_holds_without_creep() -> None:
    time, way, _ = slide(0.6, duration=2.0)
    assert way[-1] < 0.01
    late = time > 1.0
    assert np.ptp(way[late]) < 1e-5  # a law regularised by speed would creep millimetres here


def test_too_little_friction_slides_by_the_difference() -> None:
    """s = g (sin a - mu cos a) t^2/2 and the friction takes mu m g cos(a) s."""
    time, way, work = slide(0.2)
    a = math.radians(ANGLE)
    assert way[-1] == pytest.approx(0.5 * 9.81 * (math.sin(a) - 0.2 * math.cos(a)) * time[-1] ** 2, rel=0.06)
    assert work == pytest.approx(0.2 * 500.0 * 9.81 * math.cos(a) * way[-1], rel=0.06)


def test_slip_is_forgotten_when_the_motion_turns_round() -> None:
    """After a long slide the stick spring is strained by d_s, no more: 2 d_s back and it pulls the other way."""
    mu, stick, force = 0.5, 0.002, 1000.0
    n, shear, still = np.array([0.0, 0.0, 1.0]), np.zeros(3), np.zeros(3)

    def move(dx: float) -> float:
        moved = np.array([dx, 0.0, 0.3])  # the part along the normal does not count
        pull = friction_force(mu, stick, 0.0, force, shear, moved, still, n)
        commit_friction(stick, shear, moved, n)
        assert np.linalg.norm(shear) <= stick * (1 + 1e-12)
        return float(pull[0])

    assert [move(0.01) for _ in range(10)] == pytest.approx([-mu * force] * 10)
    assert move(-stick) == pytest.approx(0.0, abs=1e-9)
    assert move(-stick) == pytest.approx(mu * force)
    assert move(-0.05) == pytest.approx(mu * force)

"""The energy ledger where contacts begin, end and slip: closed forms of each work, and closure of the whole."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest

from rollover.assessment.ledger import LIMIT, closure
from rollover.dynamics import recorder
from rollover.dynamics.result import Run
from rollover.dynamics.simulate import run
from rollover.kernels.step import end_of_step
from tests.physics.scenes import shipped
from tests.physics.throws import overturn, throw

MASS, RADIUS = 0.37, 0.05
CLOSED = 2e-4  # of the energy released: what Newton's tolerance of 1e-5 in each of some ten steps of a contact leaves


def ball(changes: dict[str, object], *, inertia: float = 2.0 / 5.0 * MASS * RADIUS**2) -> Run:
    """A body that touches hard ground with one point, a radius below its centre of mass."""
    point = {"kind": "points", "name": "tip", "area": 0.0063, "at": [[0.0, 0.0, -RADIUS]]}
    base: dict[str, object] = {
        "vehicle.outline": [point],
        "vehicle.whole.inertia": [inertia] * 3,
        "initiation.quaternion": [1.0, 0.0, 0.0, 0.0],
        "initiation.angular_velocity": [0.0, 0.0, 0.0],
        "ground.law.stiffness": 2e4,
    }
    return run(shipped("cube_toss").replaced(base | changes))


def hit(
    *,
    e: float,
    mu: float,
    step: float = 5e-4,
    phase: float = 0.5,
    vx: float = 1.5,
    vz: float = 1.5,
    inertia: float = 1e3,
    k: float = 2e4,
    relaxation: float = 0.002,
) -> Run:
    """One oblique hit without gravity; `phase` is where in a step of half a millisecond the touch lies."""
    return ball(
        {
            "gravity": 0.0,
            "initiation.position": [0.0, 0.0, RADIUS + vz * (0.005 + 5e-4 * phase)],
            "initiation.velocity": [vx, 0.0, -vz],
            "simulation.duration": 0.05,
            "simulation.step": step,
            "simulation.output_step": step,
            "ground.law.restitution": e,
            "ground.law.stiffness": k,
            "ground.friction.coefficient": mu,
            "ground.friction.stick_relaxation": relaxation,
        },
        inertia=inertia,
    )


@pytest.mark.parametrize("e", [0.05, 0.5, 0.8])
@pytest.mark.parametrize("phase", [0.1, 0.6])
def test_an_oblique_hit_that_slips(e: float, phase: float) -> None:
    """It slips to the end: the tangential impulse is mu (1 + e) m v, the normal one (1 + e) m v.

    What the ground takes is m v^2 (1 - e^2)/2, what friction takes m (v_x^2 - v_x'^2)/2; nothing turns.
    """
    mu, v, vx = 0.3, 1.5, 1.5
    done = hit(e=e, mu=mu, phase=phase, vx=vx)
    after = vx - mu * (1.0 + e) * v
    assert done.recording["chassis/velocity_z"][-1] == pytest.approx(e * v, rel=5e-3)
    assert done.recording["chassis/velocity_x"][-1] == pytest.approx(after, rel=5e-3)
    assert done.ledger["soil"] == pytest.approx(0.5 * MASS * v**2 * (1.0 - e**2), rel=0.01)
    assert done.ledger["friction"] == pytest.approx(0.5 * MASS * (vx**2 - after**2), rel=5e-3)
    assert closure(done).largest < CLOSED


def test_an_oblique_hit_that_sticks() -> None:
    """A solid ball, r^2 m/J = 5/2, whose contact point is at rest when it leaves: v_x' = 5/7 v_x.

    Friction takes the kinetic energy of the mass m/(1 + 5/2) that the contact point feels: m v_x^2/7.
    """
    vx = 0.2  # and a short contact: the point, which is no ball, must hardly turn out of the line meanwhile
    # a stick spring that relaxes slowly: what strains it while it stops the point would send it back by d/tau
    inertia = 2.0 / 5.0 * MASS * RADIUS**2
    done = hit(e=0.5, mu=1.0, vx=vx, vz=0.3, step=2e-5, k=2e7, relaxation=0.05, inertia=inertia)
    assert done.recording["chassis/velocity_x"][-1] == pytest.approx(5.0 / 7.0 * vx, rel=0.01)
    assert done.recording["chassis/angular_velocity_y"][-1] == pytest.approx(5.0 / 7.0 * vx / RADIUS, rel=0.01)
    assert done.ledger["friction"] == pytest.approx(MASS * vx**2 / 7.0, rel=0.01)
    assert closure(done).largest < CLOSED


def test_restitution_is_of_second_order_in_the_step() -> None:
    """The force begins with nothing at the surface, within the step: half the step leaves a quarter of the error."""
    wrong = [
        max(abs(hit(e=0.5, mu=0.0, step=h, phase=p).recording["chassis/velocity_z"][-1] / 0.75 - 1.0) for p in PHASES)
        for h in (5e-4, 2.5e-4)
    ]
    assert wrong[0] < 5e-3
    assert wrong[1] < wrong[0] / 3.0


PHASES = (0.05, 0.3, 0.55, 0.8)


def test_a_bouncing_ball_loses_its_share_at_each_bounce() -> None:
    """From one bounce to the next the energy is e^2 of what it was, and the ground has the rest.

    The weight adds m g to the contact's force, up to 1 % of m v sqrt(k/m) here.
    """
    e = 0.7
    done = ball(
        {
            "initiation.position": [0.0, 0.0, RADIUS + 0.2],
            "initiation.velocity": [0.0, 0.0, 0.0],
            "ground.law.restitution": e,
            "ground.law.stiffness": 5e5,
            "simulation.duration": 0.95,
            "simulation.step": 1e-4,
            "simulation.output_step": 1e-4,
        }
    )
    found = done.recording
    held = found["energy/kinetic"] + MASS * 9.81 * (found["chassis/position_z"] - RADIUS)
    flying = found["ground/force_normal"] == 0.0
    starts = np.flatnonzero(np.diff(flying.astype(int)) == 1) + 5
    levels, taken = [held[0], *held[starts]], [0.0, *found["energy/soil"][starts]]
    assert len(levels) >= 4
    for before, after, was, now in zip(levels[:3], levels[1:4], taken[:3], taken[1:4], strict=True):
        assert after / before == pytest.approx(e**2, rel=0.015)
        assert now - was == pytest.approx((1.0 - e**2) * before, rel=0.015)
    assert closure(done).largest < CLOSED


def test_friction_stops_a_spinning_disc_and_takes_its_energy() -> None:
    """Eight points at r under the weight: mu m g r slows J, it stops at J w/(mu m g r), and J w^2/2 has gone."""
    mu, r, spin, inertia = 0.2, 0.04, 12.0, 5e-4
    angles = 2.0 * math.pi * np.arange(8) / 8.0
    at = [[float(r * np.cos(a)), float(r * np.sin(a)), -0.01] for a in angles]
    sunk = MASS * 9.81 / (8.0 * 5e4 * 0.001 / 0.0063)
    done = ball(
        {
            "vehicle.outline": [{"kind": "points", "name": "rim", "area": 0.001, "at": at}],
            "vehicle.whole.inertia": [inertia, inertia, inertia],
            "ground.law.stiffness": 5e4,
            "ground.friction.coefficient": mu,
            "initiation.position": [0.013, 0.007, 0.01 - sunk],
            "initiation.velocity": [0.0, 0.0, 0.0],
            "initiation.angular_velocity": [0.0, 0.0, spin],
        }
    )
    rate, time = done.recording["chassis/angular_velocity_z"], done.recording.time
    stop = inertia * spin / (mu * MASS * 9.81 * r)
    half = int(np.searchsorted(-rate, -0.5 * spin))
    assert time[half] == pytest.approx(0.5 * stop, rel=0.01)
    assert abs(rate[-1]) < 1e-3 * spin
    assert done.ledger["friction"] == pytest.approx(0.5 * inertia * spin**2, rel=5e-3)
    assert closure(done).largest < CLOSED


def test_a_sliding_block_gives_its_kinetic_energy_to_friction() -> None:
    """Flat on a face, across seven elements: the work is m v^2/2, and the way v^2/(2 mu g)."""
    sunk = MASS * 9.81 / (5e4 * 4.0 * 0.00274576 / 0.0063)
    changes: dict[str, object] = {
        "initiation.position": [-0.3, 0.013, 0.0524 - sunk],
        "initiation.velocity": [1.2, 0.0, 0.0],
        "initiation.quaternion": [1.0, 0.0, 0.0, 0.0],
        "initiation.angular_velocity": [0.0, 0.0, 0.0],
    }
    done = run(shipped("cube_toss").replaced(changes))
    assert done.ledger["friction"] == pytest.approx(0.5 * MASS * 1.2**2, rel=2e-3)
    assert done.recording["chassis/position_x"][-1] + 0.3 == pytest.approx(1.2**2 / (2.0 * 0.17 * 9.81), rel=5e-3)
    assert closure(done).largest < CLOSED


def test_hard_ground_is_the_same_wherever_its_elements_begin() -> None:
    """A contact goes along with its point: no border between elements cuts it, however the throw lies to the grid."""
    scenario = shipped("cube_toss")
    x, y, z = scenario.initiation.position  # type: ignore[union-attr]
    moved = scenario.replaced({"initiation.position": [x + 0.023, y - 0.031, z]})
    a, b = run(scenario).recording, run(moved).recording
    early = a.time < 0.4
    for name, by in (("chassis/position_x", 0.023), ("chassis/position_y", -0.031), ("chassis/position_z", 0.0)):
        assert np.abs(b[name] - a[name] - by)[early].max() < 1e-6


def test_random_throws_close() -> None:
    rng = np.random.default_rng(11)
    for _ in range(12):
        done = run(throw(rng))
        assert done.status == "done", done.sentence
        assert closure(done).largest < 1e-3


@pytest.mark.parametrize("fraction", [0.0, 0.1])
@pytest.mark.parametrize("kind", ["ye-2006", "hard"])
def test_throws_on_soil_and_with_soil_that_moves_along_close(kind: str, fraction: float) -> None:
    """Contacts that begin and end between steps are booked alike on all grounds."""
    rng = np.random.default_rng(7)
    for _ in range(6):
        scenario = throw(rng).replaced({"ground.law": {"kind": kind}, "ground.co_moving_mass.fraction": fraction})
        assert closure(run(scenario)).largest < 0.5 * LIMIT


def test_random_overturns_close() -> None:
    rng = np.random.default_rng(3)
    for _ in range(3):
        done = run(overturn(rng))
        assert closure(done).largest < LIMIT, done.scenario.title


def test_a_step_that_the_solver_halves_is_booked_as_it_was_taken(monkeypatch: pytest.MonkeyPatch) -> None:
    """Stiff restitution and much friction: Newton fails in some steps of 1.5 ms, and half of them are taken instead."""
    scenario = shipped("cube_toss").replaced(
        {
            "ground.friction.coefficient": 0.95,
            "ground.law.restitution": 0.02,
            "simulation.step": 0.0015,
            "simulation.output_step": 0.0015,
        }
    )
    shortest: list[float] = []

    def watched(t: Any, q: Any, qd: Any, qdd: Any, h: float, *rest: Any) -> None:
        shortest.append(h)
        end_of_step(t, q, qd, qdd, h, *rest)

    monkeypatch.setattr(recorder, "end_of_step", watched)
    assert closure(run(scenario)).largest < 0.2 * LIMIT
    assert min(shortest[1:]) < 0.0008  # otherwise this shows nothing

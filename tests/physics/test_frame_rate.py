"""The rate of strain in a frame alone: Cowper and Symonds along the axis, in torsion, in a mount, in a frame."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from rollover.dynamics.frame.equilibrium import Frame, Support
from rollover.dynamics.frame.fibres import Law
from rollover.dynamics.frame.mesh import mesh
from rollover.dynamics.frame.push import State, at_rest, let_go
from rollover.spec.connector import Connector, RateFactor
from rollover.spec.steel import CowperSymonds
from tests.physics.frames import MILD, TUBE, bar, portal, pushed

QUICK = replace(MILD, rate_factor=CowperSymonds(rate=40.4, exponent=5.0))
LENGTH = 1.5


def test_a_law_yields_higher_the_faster_it_is_strained() -> None:
    """|F - H p| = F_y (1 + (p'/D)^(1/q)), step after step; at no speed at all it is the plain law, to the last bit."""
    law = Law.of(200e9, 235e6, 0.01, (3,), [0.0, 40.4, 3200.0], [1.0, 5.0, 5.0])
    plain = Law.of(200e9, 235e6, 0.01, (3,))
    h, k, H = 1e-3, 200e9, law.hardening
    for strain in (0.0005, 0.002, 0.004, 0.003, -0.004):
        F, slope, p = law.tried(np.full(3, strain), h)
        rate = np.abs(p - law.plastic) / h
        over = np.abs(F - H * p) / 235e6 - 1.0
        flows = rate > 0.0
        assert pytest.approx(k * (strain - p)) == F
        assert over[flows][1:] == pytest.approx((rate[1:] / [40.4, 3200.0])[flows[1:]] ** 0.2, rel=1e-9)
        near = (law.tried(np.full(3, strain + 1e-9), h)[0] - law.tried(np.full(3, strain - 1e-9), h)[0]) / 2e-9
        assert slope == pytest.approx(near, rel=1e-5)
        for a, b in zip(law.tried(np.full(3, strain)), plain.tried(np.full(3, strain)), strict=True):
            assert a.tobytes() == b.tobytes()
        law, plain = law.left(p), plain.left(p)
    assert law.plastic[2] != law.plastic[1]


@pytest.mark.parametrize("speed", [0.005, 0.5])
def test_a_bar_is_pulled_as_fast_as_its_end(speed) -> None:
    """All of it is strained at V/L: F = A (f_y (1 + (e_p'/D)^(1/q)) + H p), e_p' = e'/(1 + H/E) once it flows."""
    post = bar("post", (0.0, 0.0, 0.0), (0.0, 0.0, LENGTH), TUBE, QUICK)
    _, _, curve = pushed([post], {post.end: (0.0, 0.0, 1.0)}, feet=[post.start], most=0.015, step=0.0005, speed=speed)
    last, E = curve[-1], QUICK.youngs_modulus
    a = QUICK.tangent / E
    H = E * a / (1.0 - a)
    rate = speed / LENGTH / (1.0 + H / E)
    strain = last.deflection / LENGTH
    strength = 235e6 * (1.0 + (rate / 40.4) ** 0.2)
    p = (E * strain - strength) / (E + H)
    assert last.force == pytest.approx(TUBE.properties.area * (strength + H * p), rel=1e-4)


def test_a_tube_twists_by_the_rate_of_the_same_work() -> None:
    """T = T_pl (1 + (e'/D)^(1/q)) with f_y A e' = T_pl t', t' the rate of plastic twist a metre."""
    post = bar("post", (0.0, 0.0, 0.0), (0.0, 0.0, LENGTH), TUBE, QUICK)
    meshed = mesh([post], {"foot": post.start}, 4)
    frame = Frame(meshed, [Support(name="foot", node=meshed.at["foot"])])
    tip = int(np.argmax(meshed.nodes[:, 2]))
    u = np.zeros(6 * len(meshed.nodes))
    u[5::6] = 0.3 * meshed.nodes[:, 2] / LENGTH
    h = 0.05
    found = frame.tried(u, frame.start, h)
    plastic = float(found.memory.torsion.plastic[0])
    T = post.plastic_resistance[3]
    rate = T * plastic / h / (235e6 * TUBE.properties.area)
    H = float(frame.start.torsion.hardening[0])
    assert found.force[6 * tip + 5] == pytest.approx(T * (1.0 + (rate / 40.4) ** 0.2) + H * plastic, rel=1e-9)
    assert found.force[6 * tip + 5] > 1.2 * frame.tried(u, frame.start).force[6 * tip + 5]


def test_a_mount_yields_as_its_own_rate_factor_says() -> None:
    """A stiff post on a mount that yields: F = F_y (1 + (v/(D l))^(1/q)) at the speed v of its end."""
    mount = Connector(
        name="foot",
        position=(0.0, 0.0, 0.0),
        stiffness=(1e7, 1e7, 1e7),
        damping=(0.0, 0.0, 0.0),
        rotational_stiffness=(1e8, 1e8, 1e8),
        yield_force=(None, None, 5e3),
        rate_factor=RateFactor(gauge_length=0.1),
    )
    post = bar("post", (0.0, 0.0, 0.0), (0.0, 0.0, LENGTH))
    _, _, curve = pushed(
        [post], {post.end: (0.0, 0.0, 1.0)}, feet=[post.start], most=0.05, step=0.001, mount=mount, speed=0.2
    )
    assert curve[-1].force == pytest.approx(5e3 * (1.0 + (0.2 / (40.4 * 0.1)) ** 0.2), rel=0.01)


def test_a_frame_carries_more_the_faster_it_is_pushed() -> None:
    """A speed ten times as large raises what the rate adds by 10^(1/5); finer steps change no more than 0.5 %."""
    beams = portal(1.6, 1.1, steel=QUICK)
    call = {"loads": {beams[0].end: (0.0, -1.0, 0.0)}, "feet": [b.start for b in beams[:2]], "segments": 12}
    force = {
        (speed, step): pushed(beams, most=0.12, step=step, speed=speed, **call)[2][-1].force
        for speed, step in ((0.0, 0.004), (0.05, 0.004), (0.5, 0.004), (0.5, 0.001))
    }
    more = {speed: force[speed, 0.004] / force[0.0, 0.004] - 1.0 for speed in (0.05, 0.5)}
    assert more[0.5] / more[0.05] == pytest.approx(10.0**0.2, rel=0.05)
    assert 0.2 < more[0.5] < (0.5 / 1.6 / 40.4 * 3.0) ** 0.2  # no fibre is strained faster than thrice the drift's rate
    assert force[0.5, 0.001] == pytest.approx(force[0.5, 0.004], rel=0.005)


def test_a_frame_that_is_let_go_at_once_keeps_its_set() -> None:
    """Taken off within the time of a blow nothing flows back; without end it creeps by what the rate had held."""
    post = bar("post", (0.0, 0.0, 0.0), (0.0, 0.0, LENGTH), TUBE, QUICK)
    frame, c, curve = pushed([post], {post.end: (0.0, 0.0, 1.0)}, feet=[post.start], most=0.01, speed=5.0)
    last = curve[-1]

    def left(state: State) -> float:
        return float(c @ state.u)

    spring = QUICK.youngs_modulus * TUBE.properties.area / LENGTH
    quick = left(let_go(frame, last.state, c, last.force, last.force / spring / 5.0))
    assert quick == pytest.approx(last.deflection - last.force / spring, rel=0.01)
    assert left(at_rest(frame)) == 0.0

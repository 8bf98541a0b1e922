"""The pendulum: speed of the fall, action and reaction at the face, where the block's energy goes."""

from __future__ import annotations

import functools
import math
from dataclasses import replace

import numpy as np
import pytest

from rollover.dynamics.result import Run
from rollover.dynamics.setup import set_up
from rollover.dynamics.simulate import run
from rollover.kernels import stand_devices as d
from rollover.kernels.forces import generalised_forces
from rollover.kernels.tables import handle
from rollover.spec.stand import PendulumBlow
from tests.physics.scenes import shipped


@functools.cache
def side() -> Run:
    return run(shipped("pendulum").replaced({"simulation.duration": 1.6}))


@pytest.mark.parametrize(("side_", "angle", "height"), [("left", 0.0, 0.575), ("rear", 20.0, 0.329)])
def test_block_falls_as_a_pendulum(side_: str, angle: float, height: float) -> None:
    """At first contact, H below the release, 1/2 (I + m R^2) w^2 = m g H: v = w R = sqrt(2 g H/(1 + I/(m R^2))).

    I/(m R^2) = (0.68^2 + 0.6^2)/12/3.55^2 = 0.5 percent; without it v is sqrt(2 g H). The chains stand at the asked
    angle there: the face's middle is at the struck point, half a tube's thickness early.
    """
    point = [-0.10, 0.60, 2.46] if side_ == "left" else [-0.14, 0.0, 2.46]
    blow = {"kind": "pendulum-blow", "come_from": side_, "height": height, "chain_angle_deg": angle, "point": point}
    scenario = shipped("pendulum").replaced({"initiation": blow, "simulation.duration": 1.1})
    test = scenario.initiation
    assert isinstance(test, PendulumBlow)
    rig = set_up(scenario)
    R = rig.hinges[0].point[2]
    inertia = 2000.0 * (0.68**2 + 0.60**2) / 12.0
    speed = math.sqrt(2 * 9.81 * height / (1 + inertia / (2000.0 * R * R)))
    found = run(scenario).tests[0]
    assert found["block_speed"] / math.cos(math.radians(angle)) == pytest.approx(speed, rel=5e-3)
    assert speed == pytest.approx(math.sqrt(2 * 9.81 * height), rel=5e-3)


def test_a_free_swing_through_the_lowest_point() -> None:
    """sqrt(2 g H) at the lowest point, and the energy of the block kept all the way."""
    scenario = shipped("pendulum").replaced({"initiation.point": [-0.10, 6.0, 2.46], "simulation.duration": 1.6})
    result = run(scenario)
    assert result.tests[0]["status"] == "not struck"
    block = result.motion["pendulum"].origin
    lowest = int(np.argmin(block[:, 2]))
    speed = np.linalg.norm(block[lowest + 1] - block[lowest - 1]) / np.ptp(result.frame_time[[lowest - 1, lowest + 1]])
    assert np.ptp(block[: lowest + 1, 2]) == pytest.approx(0.575, rel=2e-3)
    assert speed == pytest.approx(math.sqrt(2 * 9.81 * 0.575), rel=5e-3)
    assert np.abs(result.recording["energy/residual"]).max() < 1e-4 * 2000 * 9.81 * 0.575


def test_face_pushes_both_bodies_alike() -> None:
    """Momentum: force and moment about the origin that the face gives the block are those it takes from the ROPS."""
    scenario = replace(shipped("pendulum"), initiation=replace(_blow(), lashings=()))
    rig = set_up(scenario)
    t, q = rig.tables, rig.start.q.copy()
    block, rops = len(rig.bodies) - 1, 2
    q[6 * block : 6 * block + 3] = q[6 * rops : 6 * rops + 3] + np.array([0.1, 0.87, 1.0])
    q[6 * block + 3 : 6 * block + 6] = 0.02, -0.05, 0.03
    generalised_forces(handle(t), q, np.zeros_like(q), np.zeros_like(q))
    Q = t.device_q[d.BY_DEVICE].reshape(-1, 6)
    assert np.linalg.norm(Q[block, :3]) > 1e3
    assert Q[block, :3] + Q[rops, :3] == pytest.approx(0.0, abs=1e-6)
    moment = np.zeros(3)
    for b in (block, rops):
        R = t.pose[b, 3:12].reshape(3, 3)
        moment += np.cross(q[6 * b : 6 * b + 3], Q[b, :3]) + R @ Q[b, 3:]
    assert moment == pytest.approx(0.0, abs=1e-6 * np.abs(Q).max())
    # it is pressed on: the block's push is against its own way, -y for a block from the left
    assert Q[block, 1] > 0.0


def _blow() -> PendulumBlow:
    blow = shipped("pendulum").initiation
    assert isinstance(blow, PendulumBlow)
    return blow


def test_energy_of_the_block_goes_where_the_report_says() -> None:
    """Block's loss = ROPS + tyres + lashings + friction + contact + what the tractor then has in motion and height."""
    result = side()
    found, rec = result.tests[0], result.recording
    assert np.abs(rec["energy/residual"]).max() < 5e-3 * found["block_energy"]
    for moment, key in (("turned_at", "at_turning_point"), ("contact_ended_at", "at_end_of_contact")):
        k = int(np.argmin(np.abs(rec.time - found[moment])))
        start = int(np.argmin(np.abs(rec.time - found["struck_at"])))
        moving = sum(rec[f"energy/{n}"][k] - rec[f"energy/{n}"][start] for n in ("kinetic", "potential"))
        assert sum(found[key].values()) == pytest.approx(-moving, rel=5e-3)
    turned = found["at_turning_point"]
    assert all(turned[name] > 100.0 for name in ("rops", "tyres", "lashings", "friction"))
    # a lashed tractor on its tyres takes a good part of the block's energy off the frame
    assert 0.3 < turned["rops"] / found["given_most"] < 0.7
    assert found["block_energy_after"] < 0.6 * found["block_energy"]


def test_the_block_is_caught_after_its_blow() -> None:
    """It swings back after a pendulum's period of 3.8 s and does not strike twice: 0.1 s apart ends the test."""
    found = side().tests[0]
    assert found["status"] == "done"
    assert found["contact_ended_at"] < side().stop_time - 0.2


def test_lashings_hold_one_way() -> None:
    """Ropes pull and never push: without them and the strut the tractor is shoved further."""
    held = side().recording["chassis/position_y"]
    free = run(
        replace(shipped("pendulum").replaced({"simulation.duration": 1.4}), initiation=replace(_blow(), lashings=()))
    )
    assert free.ledger["lashing"] == 0.0
    assert free.recording["chassis/position_y"].min() < 1.5 * held.min()


def test_preload_is_there_before_the_blow() -> None:
    """Two ropes straight down with 5 kN each press the rear tyres together by 10 kN."""
    rope = _blow().lashings[0]
    ropes = tuple(
        replace(rope, name=f"r{k}", point=(0.0, y, 0.6), anchor=(0.0, y, 0.0), preload=5e3, stiffness=1e5)
        for k, y in enumerate((0.4, -0.4))
    )
    scenario = replace(
        shipped("pendulum").replaced({"simulation.duration": 0.1}), initiation=replace(_blow(), lashings=ropes)
    )
    loose = replace(scenario, initiation=replace(_blow(), lashings=()))
    rear = [
        sum(float(run(s).recording[f"wheel/rear_{side_}/force_normal"][0]) for side_ in ("left", "right"))
        for s in (scenario, loose)
    ]
    # the ropes give a little as the tyres go down: k_rope/(k_rope + k_tyre) of 10 kN
    assert rear[0] - rear[1] == pytest.approx(1e4 * (1 - 2e5 / (2e5 + 7e5)), rel=0.1)

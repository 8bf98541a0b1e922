"""Exciter and hammer: a linear steady state, settlement that slows down, the energy balance of a blow."""

from __future__ import annotations

import functools
import math
from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest

from ground.compaction import Compaction
from ground.press import Press
from rollover.dynamics.result import Run
from rollover.dynamics.simulate import run
from rollover.spec.excitation import Blows, Harmonic
from tests.physics.scenes import drop, shipped


@pytest.mark.parametrize("frequency", [12.0, 30.0])
def test_steady_state_on_elastic_ground(frequency: float) -> None:
    """m z'' + Z z = F_0 e^(iwt) with Z = K + i w C + i w C1 (i w M1)/(C1 + i w M1): |z| = F_0/|Z - m w^2|.

    Linear as long as the plate stays on the ground. The work of a turn is pi F_0 |z| sin(phase).
    """
    K, C, C1, M1, m = 5e6, 2e4, 1e4, 50.0, 132.0
    w = 2 * math.pi * frequency
    exciter = Harmonic(eccentric_moment=400.0 / w**2, frequency=frequency, start=0.4)
    law = Press(stiffness=K, damping=C, side_damping=C1, side_mass=M1)
    scenario = replace(drop(0.01, law=law, fraction=0.0, duration=1.4, step=1e-4), excitation=exciter)
    result = run(scenario)
    Z = K + 1j * w * C + 1j * w * C1 * 1j * w * M1 / (C1 + 1j * w * M1)
    z = 400.0 / (Z - m * w**2)
    found = result.tests[0]
    assert result.recording["ground/force_normal"][7000:].min() > 0.0
    assert found["force_amplitude"] == pytest.approx(400.0)
    assert found["deflection_amplitude"] == pytest.approx(abs(z), rel=5e-3)
    time, energy = result.recording.time, result.recording["device/energy"]
    last = [np.interp(time[-1] - n / frequency, time, energy) for n in (0, 5)]
    assert (last[0] - last[1]) / 5 == pytest.approx(-math.pi * 400.0 * z.imag, rel=0.01)
    assert np.abs(result.recording["energy/residual"]).max() < 5e-3 * result.released


def test_settlement_grows_and_slows_down() -> None:
    """The shipped plate: every count of turns deeper than the one before, and less so for each turn."""
    result = run(shipped("vibrating_plate"))
    assert result.status == "done"
    told = [s for s in result.tests[0]["settlement"] if s["turns"] <= 50]
    depth = [s["settlement"] for s in told]
    rates = [(b["settlement"] - a["settlement"]) / (b["turns"] - a["turns"]) for a, b in pairwise(told)]
    assert all(b > a for a, b in pairwise(depth))
    assert rates[-1] < 0.02 * rates[0]
    assert np.abs(result.recording["energy/residual"]).max() < 5e-3 * result.released
    # it stays: what is left at the end is a rut
    assert result.track.sinkage.max() > 0.9 * depth[-1]


def test_no_settlement_below_the_earlier_force() -> None:
    """One turn of a weak exciter sets the plate; the others run on the elastic line: F_max rules the rut."""
    law = Compaction(elastic_stiffness=2e6, plastic_stiffness=2e5, damping=200.0)
    exciter = Harmonic(eccentric_moment=300.0 / (2 * math.pi * 20) ** 2, frequency=20.0, start=0.4)
    scenario = replace(drop(0.01, law=law, fraction=0.0, duration=1.5, step=2.5e-4), excitation=exciter)
    told = run(scenario).tests[0]["settlement"]
    assert told[-1]["settlement"] == pytest.approx(told[1]["settlement"], rel=0.01)


@functools.cache
def pile() -> Run:
    return run(shipped("driven_pile"))


def test_blow_is_an_exchange_of_momentum() -> None:
    """v = (1 + e) m_h v_h/(m_h + m) for a pile at rest; (1 - e^2) m m_h/(m + m_h) v_h^2/2 is lost in the cushion."""
    m_h, m, e = 500.0, 300.0, 0.4
    fall = math.sqrt(2 * 9.81 * 0.8 * 0.8)
    first = pile().tests[0]
    v = (1 + e) * m_h * fall / (m_h + m)
    assert first["blow_energy"] == pytest.approx(m_h * 9.81 * 0.8 * 0.8, rel=1e-9)
    assert first["impulse"] == pytest.approx(m * v, rel=1e-6)
    assert first["into_striker"] == pytest.approx(0.5 * m * v * v, rel=1e-6)
    assert first["lost_in_cushion"] == pytest.approx(0.5 * (1 - e * e) * m * m_h / (m + m_h) * fall**2, rel=1e-6)
    parts = first["into_striker"] + first["lost_in_cushion"] + first["kept_by_hammer"]
    assert parts == pytest.approx(first["blow_energy"], rel=1e-9)


def test_energy_of_a_blow_is_work_along_the_set() -> None:
    """T + m g s = integral of F dz. Up to the deepest point, with K = K_e K_p/(K_e + K_p) and k the area's share:

    T + m g (z2 - z0) = F1 (z1 - z0) + K (z2^2 - z1^2)/2, F1 = K z1: the unloading line's dashpot carries the whole
    F1 on the way back to the old depth z1 = z0 + (F1 - m g)/K_e. Then the elastic part comes back: the pile stands
    at z2 - (K z2 - m g)/K_e, which gives the set. Every blow, from the depth that the one before left.
    """
    fine = {"excitation.count": 3, "simulation.duration": 2.0, "simulation.step": 5e-5}
    result = run(shipped("driven_pile").replaced(fine))
    share = 0.20 * 0.20 / (0.140 * 0.045)
    Ke, Kp, m = 2.0e6 * share, 2.0e4 * share, 300.0
    K, W = Ke * Kp / (Ke + Kp), m * 9.81
    for blow in result.tests:
        assert blow["into_striker"] + blow["work_of_weight"] == pytest.approx(blow["work_on_soil"], rel=5e-3)
        T, z0 = blow["into_striker"], blow["from"]
        # z0 = z1 - (K z1 - W)/K_e
        z1 = (z0 - W / Ke) / (1 - K / Ke)
        c = T - W * z0 - K * z1 * (z1 - z0) + K * z1 * z1 / 2  # K z2^2/2 - W z2 - c = 0
        z2 = (W + math.sqrt(W * W + 2 * K * c)) / K
        assert blow["deepest"] == pytest.approx(z2, rel=1e-3)
        assert blow["set"] == pytest.approx(z2 - (K * z2 - W) / Ke - z0, rel=0.01)


def test_set_per_blow_falls_as_the_ground_gets_stiffer() -> None:
    sets = [blow["set"] for blow in pile().tests]
    assert len(sets) == 10
    assert all(b < a for a, b in pairwise(sets))
    assert sum(sets) == pytest.approx(pile().tests[-1]["from"] + sets[-1] - pile().tests[0]["from"], rel=1e-6)
    result = pile()
    assert np.abs(result.recording["energy/residual"]).max() < 5e-3 * result.released


def test_blow_on_ground_that_moves_along_takes_its_mass() -> None:
    """A pile that is still going down carries m_b1: momentum of both, (m + m_b) dv, is what the hammer gives."""
    law = Compaction(elastic_stiffness=2e6, plastic_stiffness=1e4)
    blows = Blows(hammer_mass=100.0, height=0.5, restitution=0.0, count=1, start=0.02)
    result = run(replace(drop(0.5, law=law, fraction=0.2, duration=0.05, step=1e-4), excitation=blows))
    blow, time = result.tests[0], result.recording.time
    v = -result.recording["striker/velocity_z"]
    k = int(np.argmax(time >= 0.02 - 1e-9))
    assert blow["impulse"] == pytest.approx(132.0 * 1.2 * (v[k] - v[k - 1]), rel=0.01)
    assert np.abs(result.recording["energy/residual"]).max() < 5e-3 * result.released


def test_nothing_drives_a_striker_that_was_not_asked_to() -> None:
    result = run(drop(2.0, duration=0.02))
    assert result.tests == ()
    assert not any(name.startswith("device/") or name == "energy/device" for name in result.recording.channels)

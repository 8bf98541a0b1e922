"""The press model against its own transfer function, and the disk against what is exact about it."""

from __future__ import annotations

import ctypes
import itertools
import math

import numpy as np
import pytest
from numpy.typing import NDArray

from ground.law import HIDDEN, REFERENCE_AREA, evaluate, touched
from ground.press import Disk, DiskCoefficients, Press, dynamic_stiffness

LAW = Press(stiffness=2.0e5, damping=900.0, side_damping=600.0, side_mass=12.0)
TAU = 12.0 / 600.0  # s, of the side branch
CLAY = Disk(radius=0.3, shear_modulus=20e6, poisson=0.3, density=1800.0)


def exact(omega: float) -> complex:
    """K + i w C + i w C1 (1 - 1/(1 + i w tau)): the dashpot C1 sees the node's velocity less the mass's."""
    return 2.0e5 + 1j * omega * 900.0 + 1j * omega * 600.0 * (1.0 - 1.0 / (1.0 + 1j * omega * TAU))


def address(array: NDArray[np.float64]) -> object:
    return array.ctypes.data_as(ctypes.POINTER(ctypes.c_double))


def measured(omega: float, steps: int, rate_at: float) -> complex:
    """First harmonic of the force under z = sin(w t), by the law's own force and advance.

    `advance` gets the sinkage rate at the share `rate_at` of the step: 1 its end, 1/2 its middle.
    """
    p, s = LAW.p, touched(LAW, speed=1.0)
    force, advance = LAW.force.ctypes, LAW.advance.ctypes
    h = 2.0 * math.pi / omega / steps
    settle = math.ceil(35.0 * TAU / (h * steps)) * steps  # e^-35 of the start is left
    total = 0.0 + 0.0j
    for n in range(1, settle + steps + 1):
        at = omega * (n - 1 + rate_at) * h
        advance(address(p), address(s), math.sin(at), omega * math.cos(at), h)
        if n > settle:
            phase = omega * n * h
            # the law takes no pull; 1 m of offset keeps z positive and leaves only a constant in the force
            value = force(address(p), address(s), 1.0 + math.sin(phase), omega * math.cos(phase))
            total += value * np.exp(-1j * phase)
    # sin(w t) = Im exp(i w t): the coefficient of exp(i w t) in the force is S/(2 i)
    return complex(2j * total / steps)


@pytest.mark.parametrize("omega", [0.2 / TAU, 1.0 / TAU, 5.0 / TAU])
@pytest.mark.parametrize(("rate_at", "order"), [(1.0, 1.0), (0.5, 2.0)])
def test_the_stepped_law_converges_to_the_dynamic_stiffness(omega: float, rate_at: float, order: float) -> None:
    """The step holds v constant: first order with the rate at its end, second with the rate in its middle."""
    errors = [abs(measured(omega, steps, rate_at) / exact(omega) - 1.0) for steps in (64, 128, 256)]
    rates = [math.log2(a / b) for a, b in itertools.pairwise(errors)]
    assert rates == pytest.approx([order, order], abs=0.1), f"observed orders {rates}, errors {errors}"
    assert errors[-1] < (1e-2 if order == 1.0 else 1e-4)


def test_dynamic_stiffness_is_spring_dashpot_and_side_branch() -> None:
    omega = np.array([0.0, 0.1, 7.0, 50.0, 400.0])
    assert dynamic_stiffness(LAW, omega) == pytest.approx(np.array([exact(w) for w in omega]), rel=1e-13)
    bare = Press(stiffness=2.0e5, damping=900.0, side_damping=0.0, side_mass=12.0)
    assert dynamic_stiffness(bare, 50.0) == pytest.approx(2.0e5 + 45_000j, rel=1e-13)
    # far above 1/tau the internal mass stands still and both dashpots carry; far below it is dragged along whole
    assert dynamic_stiffness(LAW, 1e6).imag / 1e6 == pytest.approx(1500.0, rel=1e-4)
    assert dynamic_stiffness(LAW, 0.1).real == pytest.approx(2.0e5 - 0.01 * 12.0, rel=1e-9)


@pytest.mark.parametrize("steps", [1, 7, 1000])
def test_the_internal_mass_follows_a_constant_rate_exactly(steps: int) -> None:
    """w = v (1 - exp(-t/tau)) however the time is cut; a step of many tau stays stable."""
    p, s = LAW.p, touched(LAW, speed=1.0)
    for _ in range(steps):
        LAW.advance.ctypes(address(p), address(s), 0.01, 1.5, 0.05 / steps)
    assert s[HIDDEN] == pytest.approx(1.5 * (1.0 - math.exp(-0.05 / TAU)), rel=1e-12)
    LAW.advance.ctypes(address(p), address(s), 0.01, -2.0, 1e4)
    assert s[HIDDEN] == -2.0


def test_a_touch_finds_the_internal_mass_at_rest() -> None:
    assert touched(LAW, speed=3.0)[HIDDEN] == 0.0
    # K z + (C + C1) v while it is
    assert evaluate(LAW, 0.01, 2.0, speed=2.0) == pytest.approx(2000.0 + 1800.0 + 1200.0, rel=1e-14)
    s = np.array([3.0, 132.0, math.inf, 99.0])  # memory of an earlier touch
    LAW.begin.ctypes(address(LAW.p), address(s))
    assert s[HIDDEN] == 0.0
    assert not LAW.plastic


def test_the_side_branch_only_takes_energy() -> None:
    """Over one cycle the work is pi |Z|^2 Im S, positive at every frequency."""
    assert np.all(dynamic_stiffness(LAW, np.logspace(-2, 5, 200)).imag > 0.0)


def test_the_disk_by_hand() -> None:
    # c_s = sqrt(20e6/1800) = 105.409 m/s; K = 4 * 20e6 * 0.3/0.7; r/c_s = 2.846 05 ms
    assert CLAY.shear_speed == pytest.approx(105.409, rel=1e-5)
    assert CLAY.stiffness == pytest.approx(34.285_714e6, rel=1e-7)
    time = 0.3 / 105.409_255
    # nu^4 = 0.0081: gamma1 = 0.34 - 0.034 83, mu1 = 0.4 - 0.0324
    assert CLAY.damping == pytest.approx(0.8 * 34.285_714e6 * time, rel=1e-6)
    assert CLAY.side_damping == pytest.approx(0.305_17 * 34.285_714e6 * time, rel=1e-6)
    assert CLAY.side_mass == pytest.approx(0.3676 * 34.285_714e6 * time**2, rel=1e-6)
    assert CLAY.trapped_mass == 0.0
    wet = Disk(radius=0.3, shear_modulus=20e6, poisson=0.5, density=1800.0)
    # mu0 = 0.9/6; K (r/c_s)^2 = 4 rho r^3/(1 - nu)
    assert wet.trapped_mass == pytest.approx(0.15 * 8.0 * 1800.0 * 0.027, rel=1e-12)


def test_coefficients_are_parameters_marked_as_recalled() -> None:
    assert CLAY.coefficients.confidence == "recalled"
    assert "memory" in CLAY.coefficients.source
    other = Disk(
        radius=0.3, shear_modulus=20e6, poisson=0.3, density=1800.0, coefficients=DiskCoefficients(gamma0=0.85)
    )
    assert other.damping == pytest.approx(CLAY.damping * 0.85 / 0.8, rel=1e-12)


@pytest.mark.parametrize("poisson", [0.0, 0.1, 0.2, 0.25, 0.3, 1.0 / 3.0])
def test_at_high_frequency_the_disk_radiates_plane_waves(poisson: float) -> None:
    """C + C1 must come near rho c_p A, exact for an infinite frequency, which no recalled number enters.

    The lumped model is fitted to the frequencies of foundations, not to that limit: 12 % is what it leaves.
    """
    disk = Disk(radius=0.4, shear_modulus=30e6, poisson=poisson, density=1900.0)
    pressure_speed = disk.shear_speed * math.sqrt(2.0 * (1.0 - poisson) / (1.0 - 2.0 * poisson))
    plane = disk.density * pressure_speed * math.pi * 0.4**2
    assert disk.damping + disk.side_damping == pytest.approx(plane, rel=0.12)


def test_elements_that_cover_the_disk_add_up_to_it() -> None:
    law = CLAY.law()
    covering = math.pi * 0.3**2 / REFERENCE_AREA
    assert covering * law.stiffness == pytest.approx(CLAY.stiffness, rel=1e-12)
    assert covering * law.damping == pytest.approx(CLAY.damping, rel=1e-12)
    assert covering * law.side_damping == pytest.approx(CLAY.side_damping, rel=1e-12)
    assert covering * law.side_mass == pytest.approx(CLAY.side_mass, rel=1e-12)


@pytest.mark.parametrize("poisson", [0.0, 0.25, 0.4, 0.5])
def test_every_poisson_ratio_gives_a_legal_law(poisson: float) -> None:
    law = Disk(radius=0.1, shear_modulus=5e6, poisson=poisson, density=1700.0).law()
    assert min(law.p[1:]) > 0.0

"""Laws of soft ground back from decelerations alone: contact, drag, cone, forms judged on drops left out."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.integrate import solve_ivp

from ground.drops import Drop, UnusableDrop, covered_area, found_contact, loading, mean_depth, with_terminal_drag
from ground.penetration import FORMS, chosen, fit_forms, law, predicted

MASS, RADIUS, HEIGHT, GRAVITY = 7.71, 0.04375, 0.0755, 9.81
AREA = math.pi * RADIUS**2
BUOYANCY = 24.87
Q0, Q1, N, BETA, V0 = 2e3, 6.3e3, 1.2, 0.3, 0.02


def ground_force(z: float, v: float) -> float:
    """Written out again: cone area, depth of its middle, pressure with a share for each decade of rate."""
    if z <= 0.0:
        return 0.0
    covered = min(z, HEIGHT)
    middle = z - 2.0 / 3.0 * covered
    rate = 1.0 + BETA * math.asinh(max(v, 0.0) / (2.0 * V0)) / math.log(10.0)
    return AREA * (covered / HEIGHT) ** 2 * (Q0 + Q1 * (middle / 0.1) ** N) * rate


def recorded(speed: float, seed: int = 0, noise: float = 0.03) -> Drop:
    """An accelerometer in a body that falls at terminal speed, enters at t = 10 s and stays there."""
    drag = (MASS * GRAVITY - BUOYANCY) / speed**2

    def rhs(_t: float, y: NDArray[np.float64]) -> list[float]:
        z, v = y
        return [v, GRAVITY - (BUOYANCY + drag * v * abs(v) + ground_force(z, v)) / MASS]

    def stop(_t: float, y: NDArray[np.float64]) -> float:
        return float(y[1])

    stop.terminal, stop.direction = True, -1.0  # type: ignore[attr-defined]
    s = solve_ivp(
        rhs, (0.0, 3.0), [-1.0 * speed, speed], events=stop, rtol=1e-9, atol=1e-12, dense_output=True, max_step=1e-3
    )
    t = np.arange(0.0, s.t[-1] + 1.0, 5e-4)
    falls = t <= s.t[-1]
    y = s.sol(np.minimum(t, s.t[-1]))
    a = np.where(falls, [rhs(0.0, p)[1] for p in y.T], 0.0)
    a = a + noise * np.random.default_rng(seed).standard_normal(t.size) + 0.05  # and an offset
    return Drop(
        name=f"{speed:g} m/s",
        time=t + 9.0,
        mass=MASS,
        speed=math.nan,
        area=AREA,
        acceleration=a,
        cone_height=HEIGHT,
        buoyancy=BUOYANCY,
    )


def prepared(speed: float, seed: int = 0) -> Drop:
    return with_terminal_drag(found_contact(recorded(speed, seed)))


def test_contact_and_speed_are_found_and_the_offset_is_gone() -> None:
    drop = prepared(4.3)
    assert drop.speed == pytest.approx(4.3, rel=5e-3)
    # first contact is at 10 s; a cone enters softly
    assert recorded(4.3).time[0] - drop.time[0] == pytest.approx(10.0, abs=0.015)
    assert drop.acceleration is not None
    assert abs(drop.acceleration[-500:].mean()) < 0.005  # of 0.05 m/s2
    assert drop.drag == pytest.approx((MASS * GRAVITY - BUOYANCY) / 4.3**2, rel=0.02)


def test_force_without_a_load_cell_is_that_of_the_ground() -> None:
    load = loading(prepared(4.3), 0.0)
    expected = np.array([ground_force(z, v) for z, v in zip(load.depth + 0.0, load.rate, strict=True)])
    late = load.depth > 0.15
    shift = np.median((load.force - expected)[late]) / expected.max()
    assert abs(shift) < 0.05  # contact is known to a hundredth of a metre or two
    assert np.std((load.force - expected)[late]) < 0.02 * expected.max()
    assert load.rest_force == pytest.approx(MASS * GRAVITY - BUOYANCY, rel=0.01)
    assert "no load cell" in load.assumed[0]


def test_the_cone_covers_its_area_with_the_square_of_the_depth() -> None:
    drop = recorded(4.0)
    z = np.array([0.0, 0.5 * HEIGHT, HEIGHT, 0.3])
    assert covered_area(drop, z) == pytest.approx(AREA * np.array([0.0, 0.25, 1.0, 1.0]))
    # middle of a cone's section: integral of (h - x) 2 x dx over h^2 = h/3 below the surface
    assert mean_depth(drop, z) == pytest.approx([0.0, HEIGHT / 6.0, HEIGHT / 3.0, 0.3 - 2.0 * HEIGHT / 3.0])
    face = replace(drop, cone_height=0.0)
    assert np.all(covered_area(face, z) == AREA)
    assert np.all(mean_depth(face, z) == z)


def test_the_rate_dependent_form_predicts_held_out_drops() -> None:
    drops = [prepared(v, k) for k, v in enumerate((3.0, 4.5, 6.0))]
    found = fit_forms(drops)
    best = chosen(found)
    assert best.form.name == "bearing-rate"
    assert best.deceleration_error < 0.03
    assert best.depth_error < 0.05
    assert best.error < 0.5 * found["bearing"].error
    assert best.residual < 0.5 * found["ye-2006"].residual
    soil = law(best, drops, source="made up", recordings=["a", "b"])
    # what first contact and the drag are known to leaves half a percent
    assert soil.rate_per_decade == pytest.approx(BETA, rel=0.02)
    assert soil.depth_exponent == pytest.approx(N, rel=0.02)
    low, high = next((i.low, i.high) for i in soil.calibration.intervals if i.of == "rate_per_decade")  # type: ignore[union-attr]
    assert low < soil.rate_per_decade < high  # type: ignore[operator]
    assert soil.domain.speed_most == pytest.approx(6.0, rel=0.01)


def test_prediction_of_a_drop_agrees_with_its_record() -> None:
    truth = np.array([Q0 / 1e3, Q1 / 1e3, N, BETA])
    drop = replace(prepared(4.3), speed=4.3, drag=(MASS * GRAVITY - BUOYANCY) / 4.3**2)
    deceleration, depth = predicted(FORMS["bearing-rate"], truth, drop)
    a = recorded(4.3, noise=0.0).acceleration
    assert a is not None
    assert deceleration == pytest.approx(-(a.min() - 0.05), rel=2e-3)
    assert depth == pytest.approx(loading(drop, 0.0).deepest, abs=0.03)


def test_handling_on_deck_is_no_drop() -> None:
    t = np.arange(0.0, 4.0, 5e-4)
    rng = np.random.default_rng(0)
    shaken = 2.0 * np.sin(9.0 * t) + 0.1 * rng.standard_normal(t.size)
    drop = replace(recorded(4.0), time=t, acceleration=shaken)
    with pytest.raises(UnusableDrop, match="not at rest at the end"):
        found_contact(drop)
    shaken = np.where(np.abs(t - 2.0) < 0.02, -30.0, 0.0) + 0.02 * rng.standard_normal(t.size)
    with pytest.raises(UnusableDrop, match=r"no fall of 0\.5 m/s"):
        found_contact(replace(drop, acceleration=shaken + np.where(np.abs(t - 2.1) < 0.02, 30.0, 0.0)))


def test_drag_needs_terminal_speed_holding_out_three_drops() -> None:
    falling = recorded(4.0)
    assert falling.acceleration is not None
    accelerating = replace(falling, time=falling.time - 10.0, speed=4.0, acceleration=falling.acceleration + 5.0)
    with pytest.raises(UnusableDrop, match="not at terminal speed"):
        with_terminal_drag(accelerating)
    with pytest.raises(UnusableDrop, match="at least 3"):
        fit_forms([prepared(4.0), prepared(5.0)])

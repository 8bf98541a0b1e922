"""Continuous or interrupted rolling: closed forms of impact and fall, an independent integration, limits."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.integrate import solve_ivp
from scipy.spatial.transform import Rotation

from rollover.assessment.rolling import (
    G,
    NarrowTractor,
    after_impact,
    calculate,
    slope_across,
    turn,
)

# a narrow tractor whose ROPS of 2.2 m stands close to its centre of gravity
NARROW = NarrowTractor(
    H1=0.7, L3=0.8, L2=0.9, D3=1.04, D2=0.66, H6=2.2, L6=-0.04, B6=0.9, H7=1.15, B7=0.48, L7=1.25, H0=0.45,
    S=0.95, B0=0.28, D0=0.209, Mc=1500.0, Q=350.0,
)  # fmt: skip
# the same with tyres of one size, and the ROPS beside the centre of gravity: all in one plane
PLANE = replace(NARROW, D2=1.04, L6=0.0, D0=0.0, H0=0.3, T=0.0)
lengths = st.floats(-3.0, 3.0)


@pytest.mark.parametrize("alpha", [0.1, 0.5, 1.0])
def test_a_block_that_rocks_onto_its_other_edge(alpha: float) -> None:
    """Housner (1963): w'/w = 1 - 3/2 sin^2 alpha for a homogeneous block, alpha between side and diagonal."""
    b, h, m = math.sin(alpha), math.cos(alpha), 7.0
    found = after_impact(m / 3.0, m, (b, h), (-b, h), 0.0)
    assert found == pytest.approx(1.0 - 1.5 * math.sin(alpha) ** 2, rel=1e-12)


def test_a_rod_that_lands_on_its_other_end() -> None:
    """About its end m l^2/3; about the other (1/12 - 1/4) m l^2 are left: it turns back at half the rate."""
    m, length = 3.0, 1.4
    inertia = m * length**2 / 12.0
    ends = (0.5 * length, 0.0), (-0.5 * length, 0.0)
    assert after_impact(inertia, m, *ends, 0.0) == pytest.approx(-0.5, rel=1e-12)
    assert after_impact(inertia, m, *ends, 1.0) == pytest.approx(-2.0, rel=1e-12)


@given(lengths, lengths, lengths, st.floats(0.0, 1.0), st.floats(0.1, 10.0))
def test_no_impact_gives_energy(x: float, z: float, moved: float, e: float, gyration: float) -> None:
    """The struck point leaves with e times its normal speed: 1/2 I w^2 + 1/2 m v^2 never grows, and stays for e = 1."""
    m, inertia = 2.0, 2.0 * gyration**2
    after = after_impact(inertia, m, (x, z), (x - moved, z), e)
    before = inertia + m * (x * x + z * z)
    # v of the centre: that of the struck point, e w moved off the ground, and the turning about it
    vx, vz = after * z, e * moved - after * (x - moved)
    left = inertia * after**2 + m * (vx * vx + vz * vz)
    assert left <= before * (1.0 + 1e-9)
    if e == 1.0:
        assert left == pytest.approx(before, rel=1e-9)


def test_a_turn_keeps_energy_and_stops_below_the_top() -> None:
    inertia, m, r = 20.0, 30.0, 0.8
    lift = m * G * r * (1.0 - math.cos(0.6))
    least = math.sqrt(2.0 * lift / (inertia + m * r * r))
    centre = (r * math.sin(-0.6), r * math.cos(0.6))
    assert turn(inertia, m, centre, 0.0, 0.999 * least).rate is None
    over = turn(inertia, m, centre, 0.0, 1.001 * least)
    assert over.needed == pytest.approx(lift)
    assert over.rate == pytest.approx(least * math.sqrt(1.001**2 - 1.0), rel=1e-9)
    # down again on the other side as far as it was up: the same rate
    assert turn(inertia, m, centre, 0.0, 1.2 * least, 1.2).rate == pytest.approx(1.2 * least, rel=1e-9)
    # a slope tilts the whole: 0.6 rad of it and nothing is to be lifted
    assert turn(inertia, m, centre, 0.6, 0.1).needed == pytest.approx(0.0, abs=1e-9)
    assert turn(inertia, m, centre, 0.3, -0.1).rate is None
    # what ends beyond the top has to get over it
    assert turn(inertia, m, centre, 0.0, 0.999 * least, 1.3).rate is None


@pytest.mark.parametrize("angle", [0.0, 0.3, -0.8, 1.5])
def test_slope_across_a_line_is_that_of_the_plane(angle: float) -> None:
    """Of gravity in a plane tilted by A, the part across a line turned by f from its contour: sin A cos f."""
    slope = 0.588
    down = np.array([math.sin(slope), 0.0, -math.cos(slope)])  # x down the slope, z its normal
    across = np.array([math.cos(angle), math.sin(angle), 0.0])
    assert math.sin(slope_across(slope, angle)) == pytest.approx(float(down @ across), abs=1e-12)


def impulses(
    inertia: float, mass: float, centre: np.ndarray, struck: np.ndarray, v: np.ndarray, e: float
) -> np.ndarray:
    """(vx, vz, w) after a blow at a point that leaves with e times its normal speed: two impulses solved for."""
    rx, rz = struck - centre  # the point's velocity is (vx + w rz, vz - w rx)
    point = np.array([v[0] + v[2] * rz, v[1] - v[2] * rx])
    J = np.array([[1.0, 0.0, rz], [0.0, 1.0, -rx]])
    inverse = np.diag([1.0 / mass, 1.0 / mass, 1.0 / inertia])
    wanted = np.array([0.0, -e * point[1]])
    return v + inverse @ J.T @ np.linalg.solve(J @ inverse @ J.T, wanted - point)


def test_all_in_one_plane_is_what_integration_and_impulses_give() -> None:
    """The equation of motion integrated between the blows, each blow by a system of two impulses."""
    t = replace(PLANE, H6=1.5)
    found = calculate(t)
    assert found.version == "B2"
    assert found["F2"] == 0.0
    side = 0.5 * (t.S + t.B0)

    def turned(rate: float, centre: np.ndarray, angle: float) -> tuple[float, np.ndarray]:
        r, start = math.hypot(*centre), math.atan2(*centre)
        about = t.Q + t.Mc * r * r

        def motion(_: float, y: np.ndarray) -> list[float]:
            return [y[1], t.Mc * G * r * math.sin(y[0] + t.A0) / about]

        def reached(_: float, y: np.ndarray) -> float:
            return float(y[0] - start - angle)

        reached.terminal = True  # type: ignore[attr-defined]
        way = solve_ivp(motion, (0.0, 20.0), [start, rate], events=reached, rtol=1e-10, atol=1e-12)
        assert way.status == 1
        end = start + angle
        return float(way.y[1, -1]), r * np.array([math.sin(end), math.cos(end)])

    def blow(rate: float, centre: np.ndarray, struck: np.ndarray) -> float:
        v = np.array([rate * centre[1], -rate * centre[0], rate])
        return float(impulses(t.Q, t.Mc, centre, struck, v, t.U)[2])

    # lying on its side, the lower edge of the tyres at the origin; their upper edge strikes
    o1 = blow(found["O0"], np.array([t.H1, side]), np.array([t.D3, 0.0]))
    assert o1 == pytest.approx(found["O1"], rel=1e-9)
    rops = np.array([t.H6 - t.D3, side - 0.5 * t.B6])
    o3, centre = turned(o1, np.array([t.H1 - t.D3, side]), math.atan2(rops[1], rops[0]))
    assert o3 == pytest.approx(found["O3"], rel=1e-7)
    o4 = blow(o3, centre, np.array([math.hypot(*rops), 0.0]))
    assert o4 == pytest.approx(found["O4"], rel=1e-7)
    over = centre - np.array([math.hypot(*rops), 0.0])
    o9, _ = turned(o4, over, -math.atan2(*over) - t.A0)
    assert found.verdict == "continuous"
    assert o9 == pytest.approx(found["O9"], rel=1e-6)


def test_first_velocity_without_swing_and_with_thin_tyres() -> None:
    """No swing: the centre of gravity goes up to sqrt(H1^2 + (S/2)^2) over the tyres' line."""
    t = replace(NARROW, D0=0.0, B0=1e-9, B6=0.9)
    r = math.hypot(t.H1, 0.5 * t.S)
    fall = r - (0.5 * t.S * math.cos(t.A0) - t.H1 * math.sin(t.A0))
    found = calculate(t)
    assert found["W0"] == pytest.approx(r, rel=1e-9)
    assert found["O0"] == pytest.approx(math.sqrt(2.0 * t.Mc * G * fall / (t.Q + t.Mc * r * r)), rel=1e-9)


def test_the_axle_swings_the_chassis_down() -> None:
    """The centre of gravity turned by D0 about the line from the lower rear wheel to the pivot, as a vector."""
    t = NARROW
    wheel, pivot = np.array([0.0, 0.5 * t.S, 0.0]), np.array([t.L2 + t.L3, 0.0, t.H0])  # forward, to the side, up
    axis = Rotation.from_rotvec(-t.D0 * (pivot - wheel) / np.linalg.norm(pivot - wheel))
    centre = wheel + axis.apply(np.array([t.L3, 0.0, t.H1]) - wheel)
    assert 0.0 < centre[1] < 0.5 * t.S
    assert calculate(t)["W0"] == pytest.approx(math.hypot(centre[2], 0.5 * t.S - centre[1]), rel=1e-12)


@pytest.mark.parametrize(("back", "wheel"), [(0.0, "front"), (-0.6, "rear")])
def test_the_impact_turns_the_vehicle_about_the_new_line(back: float, wheel: str) -> None:
    """In the section of the centre of gravity the line from wheel to ROPS stands where the two are interpolated."""
    t = replace(NARROW, L6=back)
    found = calculate(t)
    ends, centre = [found.positions[3][name] for name in (wheel, "rops")], found.positions[3]["G"]
    share = (centre[1] - ends[0][1]) / (ends[1][1] - ends[0][1])
    x = ends[0][0] + share * (ends[1][0] - ends[0][0])
    after = after_impact(found["Q3"], t.Mc, (centre[0], centre[2]), (centre[0] - x, centre[2] + share * t.T), t.U)
    assert found["O4"] == pytest.approx(found["O3"] * after, rel=1e-9)
    # of an angular velocity, the part along a line: by the angle between this line and the one before
    way = ends[1] - ends[0]
    assert found["O5"] == pytest.approx(found["O4"] * abs(way[1]) / math.hypot(way[0], way[1]), rel=1e-9)
    first = found.positions[1]["front"] - found.positions[1]["rear"]
    assert found["O2"] == pytest.approx(found["O1"] * first[1] / math.hypot(first[0], first[1]), rel=1e-9)


def test_low_and_round_rolls_on_high_and_wide_is_stopped() -> None:
    verdicts = [calculate(replace(NARROW, H6=float(h), B6=1.2)).verdict for h in np.arange(1.3, 2.7, 0.05)]
    change = verdicts.index("interrupted")
    assert 0 < change < len(verdicts) - 1
    assert set(verdicts[:change]) == {"continuous"}
    assert set(verdicts[change:]) == {"interrupted"}
    # the wider of two of a height that is decided by it
    assert calculate(replace(NARROW, H6=1.75, L6=-0.4, B6=0.5)).verdict == "continuous"
    assert calculate(replace(NARROW, H6=1.75, L6=-0.4, B6=1.2)).verdict == "interrupted"
    # so heavy in itself that no blow slows it
    assert calculate(replace(NARROW, Q=5000.0)).verdict == "continuous"


@pytest.mark.parametrize(
    ("back", "version", "line"), [(0.0, "B1", "front"), (-0.33, "B2", "the ROPS"), (-0.6, "B3", "rear")]
)
def test_where_the_rops_stands_says_about_which_line_it_goes(back: float, version: str, line: str) -> None:
    """It lands level with the centre of gravity where L6 = -tan(F2)(H6 - H1)."""
    found = calculate(replace(NARROW, L6=back))
    assert found.version == version
    assert line in found.sentence
    level = -math.tan(found["F2"]) * (NARROW.H6 - NARROW.H1)
    assert found["y6"] == pytest.approx((level - back) * math.cos(found["F2"]), abs=1e-12)


def test_the_bonnet_lands_after_the_rops_and_takes_the_impact() -> None:
    found = calculate(replace(NARROW, H6=1.6, L6=0.0, B6=0.5))
    assert found.version == "B1"
    assert "from ROPS to bonnet" in found.sentence
    for name in ("bonnet", "rops"):
        assert found.positions[5][name][2] == pytest.approx(0.0, abs=1e-12)
    assert 0.0 < found["O7"] < found["O6"]


def test_points_of_a_line_lie_in_the_slope() -> None:
    found = calculate(NARROW)
    for position, names in ((2, ("front", "rear")), (3, ("front", "rear", "rops")), (4, ("front", "rops"))):
        for name in names:
            assert found.positions[position][name][2] == pytest.approx(0.0, abs=1e-12)
    assert [found.positions[2][n][0] for n in ("front", "rear")] == pytest.approx([0.0, 0.0], abs=1e-12)
    assert [found.positions[4][n][0] for n in ("front", "rops")] == pytest.approx([0.0, 0.0], abs=1e-12)
    # a rigid body: distances stay
    for a, b in (("G", "rops"), ("rops", "bonnet"), ("front", "bonnet")):
        apart = [float(np.linalg.norm(p[a] - p[b])) for p in found.positions.values()]
        assert apart == pytest.approx([apart[0]] * len(apart), rel=1e-12)


@pytest.mark.parametrize("scale", [0.5, 3.0])
def test_size_and_weight_scale(scale: float) -> None:
    """Lengths by k, inertia by k^2: rates go by 1/sqrt(k); mass and inertia by c: nothing changes."""
    sizes = ("H1", "L3", "L2", "D3", "D2", "H6", "L6", "B6", "H7", "B7", "L7", "H0", "S", "B0", "T")
    small = calculate(NARROW)
    large = replace(NARROW, **{n: scale * getattr(NARROW, n) for n in sizes}, Q=scale**2 * NARROW.Q)
    found = calculate(large)
    assert found.sentence == small.sentence
    for symbol in ("O0", "O1", "O4", "O5"):
        assert found[symbol] == pytest.approx(small[symbol] / math.sqrt(scale), rel=1e-9)
    heavy = calculate(replace(NARROW, Mc=scale * NARROW.Mc, Q=scale * NARROW.Q))
    assert heavy["O5"] == pytest.approx(small["O5"], rel=1e-9)


@pytest.mark.parametrize(
    ("changes", "said"),
    [
        ({"B6": 1.3}, "B6: wider than the rear tyres, got 1.3 m; at most S + B0 = 1.23 m"),
        ({"B7": 1.3}, "B7: wider than the rear tyres"),
        ({"H6": 1.1}, "H6: the ROPS does not land before the bonnet"),
        ({"H6": 0.6, "H7": 0.5, "B6": 0.5}, "H6: the ROPS does not land before the bonnet"),
        ({"H0": 1.6}, "H0: the pivot's line passes above the centre of gravity"),
        ({"Mc": 0.0}, "Mc: out of bounds, got 0.0; greater than 0 kg is allowed"),
        ({"H1": 0.2, "S": 2.0, "B0": 1.5, "H0": 0.1}, "H1: does not go over by itself"),
    ],
)
def test_what_it_does_not_cover(changes: dict[str, float], said: str) -> None:
    with pytest.raises(ValueError) as refused:  # noqa: PT011  the sentence is what is tested
        calculate(replace(NARROW, **changes))
    assert said in str(refused.value)

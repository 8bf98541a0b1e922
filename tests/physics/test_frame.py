"""A frame alone against the theory of beams and of plastic collapse, and against its own refinement."""

from __future__ import annotations

from dataclasses import replace
from itertools import pairwise, permutations

import numpy as np
import pytest
from scipy.optimize import brentq

from rollover.dynamics.frame.equilibrium import Frame, Support
from rollover.dynamics.frame.fibres import fibres
from rollover.dynamics.frame.mesh import mesh
from rollover.dynamics.frame.push import at_rest, let_go
from rollover.dynamics.frame.yielding import yielding
from rollover.spec.connector import Connector
from rollover.spec.sections import Section
from rollover.spec.steel import Steel
from tests.physics.frames import MILD, STIFF, TUBE, bar, portal, pushed

M_P = TUBE.properties.plastic_h * STIFF.yield_strength
FLAT = Section(solid=(30.0, 50.0))  # depth 50 along x


@pytest.mark.parametrize(
    "section",
    [
        TUBE,
        Section(tube=(50.0, 100.0, 5.0), corners="hot-finished"),
        Section(round_tube=(60.3, 4.0)),
        Section(round_tube=(60.0, 25.0)),
        FLAT,
        Section(plate=(120.0, 10.0)),
        Section(round_bar=40.0),
    ],
    ids=lambda s: s.text,
)
def test_fibres_are_the_section(section) -> None:
    p, r, area = fibres(section)
    want = section.properties
    found = (area.sum(), (area * p * p).sum(), (area * r * r).sum(), (area * abs(p)).sum(), (area * abs(r)).sum())
    assert found == pytest.approx((want.area, want.second_h, want.second_b, want.plastic_h, want.plastic_b), rel=1e-9)
    assert max(abs(p)) < 0.5 * section.depth
    assert max(abs(r)) < 0.5 * section.width


@pytest.mark.parametrize(("way", "second", "elastic"), [((1.0, 0.0, 0.0), "h", 50.0), ((0.0, 1.0, 0.0), "b", 30.0)])
def test_a_cantilever_bends_and_yields_as_a_beam(way, second, elastic) -> None:
    length, p = 1.5, FLAT.properties
    post = bar("post", (0.0, 0.0, 0.0), (0.0, 0.0, length), FLAT, MILD)
    inertia = getattr(p, f"second_{second}")
    frame, _, curve = pushed([post], {post.end: way}, feet=[post.start], most=0.06, step=0.0005, segments=12)
    stiffness = 3.0 * 210e9 * inertia / length**3  # F = 3 E I w/L^3
    assert curve[1].force / curve[1].deflection == pytest.approx(stiffness, rel=1e-5)
    found = yielding(frame, curve)
    first = found["first_yield"]["force"]
    # M = W_el f_y at the foot; told at the first point beyond it
    assert first == pytest.approx(getattr(p, f"elastic_{second}") * 235e6 / length, abs=stiffness * 0.0005)
    assert inertia / (0.5e-3 * elastic) == pytest.approx(getattr(p, f"elastic_{second}"))
    assert found["first_yield"]["member"] == "post"
    assert found["stiffness"] == pytest.approx(stiffness, rel=1e-5)


def test_a_portal_sways_as_slope_deflection_says() -> None:
    high, wide = 1.6, 1.1
    beams = portal(high, wide)
    _, _, curve = pushed(beams, {beams[0].end: (0.0, -1.0, 0.0)}, feet=[b.start for b in beams[:2]], most=0.001)
    k = high / wide  # (I_across / wide) / (I_post / high)
    EI = 2.1e12 * TUBE.properties.second_h
    # what the posts lengthen and shorten by takes 0.4 % of it
    assert curve[1].force / curve[1].deflection == pytest.approx(
        24.0 * EI / high**3 * (1.0 + 6.0 * k) / (4.0 + 6.0 * k), rel=0.005
    )


def _greatest(curve) -> float:
    return max(p.force for p in curve)


def test_a_clamped_beam_collapses_by_three_hinges() -> None:
    # to three times the elastic deflection only: clamped ends begin to hang the span like a rope
    length = 2.0
    span = bar("span", (0.0, 0.0, 1.0), (0.0, length, 1.0))
    middle = (0.0, 0.5 * length, 1.0)
    frame, _, curve = pushed([span], {middle: (0.0, 0.0, -1.0)}, feet=[span.start, span.end], most=0.003, step=0.0002)
    assert _greatest(curve) == pytest.approx(8.0 * M_P / length, rel=0.01)
    hinges = yielding(frame, curve)["hinges"]
    # the moments are equal in all three from the beginning
    assert sorted(round(h["place"], 2) for h in hinges) == [0.0, 1.0, 2.0]


def test_a_portal_collapses_sideways_by_four_hinges() -> None:
    high, wide = 1.6, 1.1
    beams = portal(high, wide)
    frame, _, curve = pushed(
        beams, {beams[0].end: (0.0, -1.0, 0.0)}, feet=[b.start for b in beams[:2]], most=0.01, step=0.0005
    )
    assert _greatest(curve) == pytest.approx(4.0 * M_P / high, rel=0.01)
    found = yielding(frame, curve)
    # feet first: they carry more than the knees; a knee's hinge is in post and beam, which are equal
    assert {(h["member"], round(h["place"], 2)) for h in found["hinges"][:2]} == {("left", 0.0), ("right", 0.0)}
    assert {h["member"] for h in found["hinges"][2:]} >= {"left", "right"}
    assert found["mechanism_force"] == pytest.approx(4.0 * M_P / high, rel=0.01)


def test_both_loads_collapse_a_portal_combined() -> None:
    high = 1.0
    wide = 2.0 * high
    beams = portal(high, wide)
    loads = {beams[0].end: (0.0, -1.0, 0.0), (0.0, 0.0, high): (0.0, 0.0, -1.0)}
    frame, _, curve = pushed(beams, loads, feet=[b.start for b in beams[:2]], most=0.03, step=0.0005)
    # P (high + wide/2) turn = 6 M_p turn, below both the beam's and the sway's 4 M_p/high
    assert _greatest(curve) == pytest.approx(6.0 * M_P / (high + 0.5 * wide), rel=0.01)
    places = {(h["member"], round(h["place"], 1)) for h in yielding(frame, curve)["hinges"]}
    assert ("across", 1.0) in places  # under the load
    assert ("left", 1.0) not in places  # the knee that stays closed


def test_weaker_posts_hinge_below_a_strong_beam() -> None:
    """Posts of another section than the beam: the hinge at a knee is in the weaker of the two."""
    high, wide, strong = 1.5, 1.0, Section(tube=(80.0, 80.0, 6.0))
    y = 0.5 * wide
    beams = (*portal(high, wide)[:2], bar("across", (0.0, y, high), (0.0, -y, high), strong))
    frame, _, curve = pushed(
        beams, {beams[0].end: (0.0, -1.0, 0.0)}, feet=[b.start for b in beams[:2]], most=0.01, step=0.0005
    )
    assert _greatest(curve) == pytest.approx(4.0 * M_P / high, rel=0.01)
    assert {h["member"] for h in yielding(frame, curve)["hinges"]} == {"left", "right"}


@pytest.mark.parametrize("ratio", [5.0, 20.0, 40.0])
def test_an_axial_force_leaves_less_moment(ratio) -> None:
    """A bar of rectangular section under P sideways and ratio P along it: M/M_p + (N/N_p)^2 = 1 at its foot."""
    length, p = 1.0, FLAT.properties
    post = bar("post", (0.0, 0.0, 0.0), (0.0, 0.0, length), FLAT)
    frame, _, curve = pushed([post], {post.end: (1.0, 0.0, ratio)}, feet=[post.start], most=0.008, step=0.0005)
    # pulled, not pressed, so that the bar stays put; the pull at the leaning tip turns back
    last = curve[-1]
    moment = last.force * (length - ratio * last.state.u[6 * frame.mesh.at["load0"]])
    share = ratio * last.force / (p.area * 355e6)
    assert share > 0.01 * ratio  # of N_p: 0.06 to 0.48
    assert moment / (p.plastic_h * 355e6) + share**2 == pytest.approx(1.0, rel=0.01)


def test_hardening_carries_a_cantilever_on() -> None:
    """Deflection by the curvature of each cross-section, integrated: an independent calculation of the same bar."""
    length, b, h = 1.2, 0.03, 0.05
    post = bar("post", (0.0, 0.0, 0.0), (0.0, 0.0, length), FLAT, MILD)
    y = (np.arange(4000) + 0.5) / 4000 * h - 0.5 * h

    def moment(curvature: float) -> float:
        strain = curvature * y
        over = np.abs(strain) - 235e6 / 210e9
        stress = np.where(over > 0.0, np.sign(strain) * (235e6 + MILD.tangent * over), 210e9 * strain)
        return float(np.sum(stress * y) * b * h / 4000)

    force = 1.08 * FLAT.properties.plastic_h * 235e6 / length
    x = (np.arange(400) + 0.5) / 400 * length
    curvature = [brentq(lambda k, M=force * (length - z): moment(k) - M, 0.0, 2.0) for z in x]
    expected = float(np.sum(np.array(curvature) * (length - x))) * length / 400
    _, _, curve = pushed([post], {post.end: (1.0, 0.0, 0.0)}, feet=[post.start], most=2.0 * expected, segments=24)
    found = np.interp(force, [p.force for p in curve], [p.deflection for p in curve])
    assert found == pytest.approx(expected, rel=0.01)
    energy = np.trapezoid([p.force for p in curve], [p.deflection for p in curve])
    assert curve[-1].energy == pytest.approx(energy)


def test_what_is_let_go_springs_back_as_it_was_bent() -> None:
    length = 1.2
    post = bar("post", (0.0, 0.0, 0.0), (0.0, 0.0, length), FLAT, MILD)
    frame, c, curve = pushed([post], {post.end: (1.0, 0.0, 0.0)}, feet=[post.start], most=0.05)
    last = curve[-1]
    left = let_go(frame, last.state, c, last.force)
    stiffness = 3.0 * 210e9 * FLAT.properties.second_h / length**3
    assert float(c @ left.u) == pytest.approx(last.deflection - last.force / stiffness, rel=2e-3)
    assert np.abs(left.tried.force[frame.free]).max() < 1e-6 * last.force


def test_a_twisted_bar_yields_at_its_torque() -> None:
    post = bar("post", (0.0, 0.0, 0.0), (0.0, 0.0, 1.0), TUBE, STIFF)
    meshed = mesh([post], {"foot": post.start, "tip": post.end}, 4)
    frame = Frame(meshed, [Support(name="foot", node=meshed.at["foot"])])
    tip = meshed.at["tip"]
    stiffness, limit = STIFF.shear_modulus * TUBE.properties.torsion, post.plastic_resistance[3]
    for turn, torque in ((1e-3, 1e-3 * stiffness), (0.1, limit)):
        u = np.zeros(6 * len(meshed.nodes))
        for node, z in enumerate(meshed.nodes[:, 2]):
            u[6 * node + 5] = turn * z
        # a ten-thousandth of the stiffness stays beyond the yield
        assert frame.tried(u, frame.start).force[6 * tip + 5] == pytest.approx(torque, rel=0.01)


def test_mounts_give_way_in_series_with_the_post() -> None:
    length = 1.5
    post = bar("post", (0.0, 0.0, 0.0), (0.0, 0.0, length))
    mount = Connector(
        name="foot0",
        position=(0.0, 0.0, 0.0),
        stiffness=(2e5, 3e5, 1e7),
        damping=(0.0, 0.0, 0.0),
        rotational_stiffness=(4e5, 5e5, 6e5),
        yield_force=(3000.0, None, None),
        hardening=(0.02, 0.0, 0.0),
    )
    frame, _, curve = pushed([post], {post.end: (1.0, 0.0, 0.0)}, feet=[post.start], most=0.06, mount=mount)
    bend = length**3 / (3.0 * 2.1e12 * TUBE.properties.second_h)
    assert curve[1].deflection / curve[1].force == pytest.approx(1.0 / 2e5 + length**2 / 5e5 + bend, rel=1e-5)
    assert [m["name"] for m in yielding(frame, curve)["mounts"]] == ["foot0"]
    (x0, y0), (x1, y1) = ((p.deflection, p.force) for p in curve[-2:])
    assert (x1 - x0) / (y1 - y0) == pytest.approx(1.0 / (0.02 * 2e5) + length**2 / 5e5 + bend, rel=1e-4)


def test_members_meet_where_they_touch() -> None:
    """Posts end below the beam's axis, by half its depth, and within its length: joined all the same."""
    beams = (
        bar("left", (0.0, 0.5, 0.0), (0.0, 0.5, 1.57)),
        bar("right", (0.0, -0.5, 0.0), (0.0, -0.5, 1.57)),
        bar("across", (0.0, 0.6, 1.6), (0.0, -0.6, 1.6)),
    )
    meshed = mesh(beams, {"end": (0.0, 0.6, 1.6), "middle": (0.0, 0.0, 1.6)}, 8)
    assert len(meshed.joints) == 2
    assert len({*meshed.ends.ravel()}) == len(meshed.nodes)  # nothing hangs loose
    ends = [meshed.nodes[meshed.at[name]] for name in ("end", "middle")]
    assert np.array(ends) == pytest.approx(np.array([(0.0, 0.6, 1.6), (0.0, 0.0, 1.6)]))
    apart = mesh((beams[0], bar("across", (0.0, 0.6, 1.7), (0.0, -0.6, 1.7))), {}, 4)
    assert apart.joints == ()


def test_the_number_of_segments_converges() -> None:
    """Force and energy at a given way, side and rear: the default of 12 lies within 0.5 % of 48."""
    from rollover.system.arguments import SEGMENTS

    high, wide = 1.6, 1.1
    beams = portal(high, wide, TUBE, MILD)
    feet = [b.start for b in beams[:2]]
    for load, most in (((0.0, 0.55, high), 0.15), ((0.0, 0.2, high), 0.2)):
        way = (0.0, -1.0, 0.0) if load[1] > 0.5 else (1.0, 0.0, 0.0)
        found = []
        for segments in (4, SEGMENTS, 48):
            _, _, curve = pushed(beams, {load: way}, feet=feet, most=most, step=0.004, segments=segments)
            # at the way itself: a step that was halved on the way ends elsewhere
            ways = [p.deflection for p in curve]
            found.append(
                np.array([np.interp(most, ways, [getattr(p, of) for p in curve]) for of in ("force", "energy")])
            )
        off = [np.abs(a / found[-1] - 1.0).max() for a in found[:-1]]
        assert off[1] < 0.005
        assert off[1] < off[0]


def test_nothing_stands_on_a_foot_that_turns_freely() -> None:
    post = bar("post", (0.0, 0.0, 0.0), (0.0, 0.0, 1.0))
    loose = Connector(name="foot0", position=(0.0, 0.0, 0.0), stiffness=(1e6, 1e6, 1e6), damping=(0.0, 0.0, 0.0))
    meshed = mesh([post], {"foot0": post.start, "tip": post.end}, 4)
    frame = Frame(meshed, [Support(name="foot0", node=meshed.at["foot0"], connector=loose)])
    c = frame.pattern({meshed.at["tip"]: 1.0}, (1.0, 0.0, 0.0))
    from rollover.dynamics.frame.push import push
    from tests.physics.frames import Way

    points, how = push(frame, at_rest(frame), c, step=0.002, most=0.1, goal=Way())
    assert how.startswith("given up: ")
    assert max(p.force for p in points) < 1.0


def test_hinges_are_told_as_they_form() -> None:
    beams = portal(1.6, 1.1)
    frame, _, curve = pushed(
        beams, {(0.0, 0.2, 1.6): (1.0, 0.0, 0.0)}, feet=[b.start for b in beams[:2]], most=0.06, step=0.0005
    )
    hinges = yielding(frame, curve)["hinges"]
    assert [h["member"] for h in hinges][:2] == ["left", "right"]  # the nearer post first
    assert all(a["deflection"] <= b["deflection"] for a, b in pairwise(hinges))


def test_a_thin_span_hangs_like_a_rope() -> None:
    """Two halves a with slope t between stiff ends: w = t (a - 2 l), N = E A t^2 (a - 3 l)/(2 a), F = 2 N t.

    l = sqrt(E I/N): v' = t (1 - e^(-x/l) - e^(-(a-x)/l)).
    """
    a = 1.0
    strong = Steel(name="wire", yield_strength=2e9, tensile_strength=2e9, uniform_strain=0.2)
    strip = Section(plate=(100.0, 1.0))
    span = replace(bar("span", (0.0, 0.0, 0.0), (0.0, 2.0 * a, 0.0), strip, strong), depth_towards=(0.0, 0.0, 1.0))
    _, _, curve = pushed(
        [span],
        {(0.0, a, 0.0): (0.0, 0.0, -1.0)},
        feet=[span.start, span.end],
        most=0.04,
        step=0.002,
        segments=40,
    )
    area, inertia, w = strip.properties.area, strip.properties.second_h, curve[-1].deflection
    stiff = 0.0
    for _ in range(20):
        slope = w / (a - 2.0 * stiff)
        pull = 210e9 * area * slope**2 * (a - 3.0 * stiff) / (2.0 * a)
        stiff = float(np.sqrt(210e9 * inertia / pull))
    assert curve[-1].force == pytest.approx(2.0 * pull * slope, rel=0.02)


def test_a_thrust_adds_to_the_moment() -> None:
    """A beam column: w = H/(N k) (tan kL - kL), k^2 = N/(E I), at a third of the buckling load."""
    length = 2.0
    EI = 210e9 * TUBE.properties.second_h
    thrust = np.pi**2 * EI / (4.0 * length**2) / 3.0
    ratio = 400.0
    k = np.sqrt(thrust / EI)
    expected = (thrust / ratio) / (thrust * k) * (np.tan(k * length) - k * length)
    elastic = Steel(name="elastic", yield_strength=2e9, tensile_strength=2e9, uniform_strain=0.2)
    post = bar("post", (0.0, 0.0, 0.0), (0.0, 0.0, length), TUBE, elastic)
    frame, _, curve = pushed([post], {post.end: (1.0, 0.0, -ratio)}, feet=[post.start], most=0.3, step=0.005)
    tip = 6 * frame.mesh.at["load0"]
    sway = [p.state.u[tip] for p in curve]
    found = float(np.interp(thrust / ratio, [p.force for p in curve], sway))
    assert found == pytest.approx(expected, rel=0.01)


@pytest.mark.parametrize("order", list(permutations(range(3))))
@pytest.mark.parametrize("beyond", [0.0, 0.05, 0.3])
def test_members_meet_once_and_keep_their_axes(order: tuple[int, ...], beyond: float) -> None:
    """A beam that ends beyond its posts (m), within what touches and out of it: two joints, whoever is named first."""
    left, right, _ = portal(1.5, 1.0)
    across = bar("across", (0.0, 0.5 + beyond, 1.5), (0.0, -0.5 - beyond, 1.5))
    made = mesh([(left, right, across)[k] for k in order], {}, 8)
    assert sorted(round(float(made.nodes[k, 1]), 9) for k in made.joints) == [-0.5, 0.5]
    for ends, k in zip(made.ends, made.beam, strict=True):
        b = made.beams[k]
        off = np.cross(made.nodes[ends] - np.array(b.start), b.axes[0])
        assert np.abs(off).max() < 1e-9, b.name
    total = sum(float(made.length[made.beam == k].sum()) for k in range(3))
    assert total == pytest.approx(2 * 1.5 + 1.0 + 2.0 * beyond, rel=1e-12)

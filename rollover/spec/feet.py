"""Feet of a frame of beams: the springs that stand for its posts where the frame moves as one piece.

A direction in which rails tie the posts' tops sways as a portal: k = 12 E I/H^3 (1 + 6 r)/(4 + 6 r) for each post, with
r = (I_rail/L)/(I_post/H), and gives way at F_y = (M_post + min(M_post, M_rail))/H, hinges at foot and knee. In any
other direction a post is a cantilever: it turns about its foot with 3 E I/H and gives way at M_post. What is stated of
a foot takes the place of what sections and steel say: its stiffness to the side, with all others of its post in
proportion, its yield to the side, its play.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Annotated

import numpy as np
from numpy.typing import NDArray

from ground.quantity import Label, Later, Quantity, parameters
from rollover.spec.beam import ALONG, Beam
from rollover.spec.connector import Connector, RateFactor
from rollover.spec.inertia import MassProperties
from rollover.spec.shapes import Point

Array = NDArray[np.float64]
REACH = 0.15  # m from a foot, or a mount, to the member that it holds
# where a foot hardly gives: N/m and N m/rad, as the upright springs and the turning ones of frames described by mounts
STIFF, STIFF_TURN = 1.0e7, 1.0e6
# rise of the moment beyond M_p up to which the slope after yield is taken as straight: with a bending stiffness of
# a E I there, a triangle of plastic curvature over H m/(1 + m) turns by m^2 M_p H/(2 a E I (1 + m))
RISE = 0.1
SIDE = np.array([0.0, 1.0, 0.0])


@parameters
class Foot:
    """Where a post is welded or bolted to the chassis, without give of its own: `mounts` are for what gives."""

    name: Annotated[str, Label("in channels: rops/mount/NAME/force_x")]
    position: Annotated[Point, Quantity("m", "vehicle axes")]
    damping_ratio: Annotated[float, Quantity("1", "of critical, of the frame on its feet", least=0, most=1)] = 0.05
    side_stiffness: Annotated[
        float | None, Later(), Quantity("N/m", "of its post to a side load at its top; null: by its section", above=0)
    ] = None
    side_yield: Annotated[
        float | None, Later(), Quantity("N", "of a side load at its top; null: by section and steel", above=0)
    ] = None
    play: Annotated[float, Later(), Quantity("m", "of a loose flange, to either side along x, y, z", least=0)] = 0.0


def springs(feet: Sequence[Foot], beams: Sequence[Beam], body: MassProperties) -> tuple[Connector, ...]:
    """The feet as connectors. Raises ``ValueError``, path first, for a foot without a member."""
    posts = posts_of(feet, beams)
    return tuple(_spring(foot, k, posts, beams, body) for k, foot in enumerate(feet))


def side_stiffnesses(feet: Sequence[Foot], beams: Sequence[Beam], body: MassProperties) -> dict[str, float]:
    """Of each foot's post against a side load at its top, by the foot's name, N/m."""
    posts = posts_of(feet, beams)
    found = {}
    for k, (foot, spring) in enumerate(zip(feet, springs(feet, beams, body), strict=True)):
        sways = rail_of(k, posts, beams, SIDE) is not None
        found[foot.name] = spring.stiffness[1] if sways else spring.rotational_stiffness[0] / posts[k][0].length ** 2
    return found


def posts_of(feet: Sequence[Foot], beams: Sequence[Beam]) -> list[tuple[Beam, Array]]:
    """The member that stands on each foot, and its head. Raises ``ValueError``, path first, for one without."""
    return [_post(foot, beams) for foot in feet]


def _post(foot: Foot, beams: Sequence[Beam]) -> tuple[Beam, Array]:
    """The member that stands on a foot, and its other end."""
    ends = [(math.dist(foot.position, a), k, b) for k, beam in enumerate(beams) for a, b in _ends(beam)]
    off, k, top = min(ends, default=(math.inf, 0, (0.0, 0.0, 0.0)))
    if off > REACH:
        raise ValueError(
            f"feet.{foot.name}.position: no member with a section ends there, got {list(foot.position)}; the end of "
            f"one within {1e3 * REACH:.0f} mm"
        )
    return beams[k], np.array(top)


def _ends(beam: Beam) -> tuple[tuple[Point, Point], tuple[Point, Point]]:
    return (beam.start, beam.end), (beam.end, beam.start)


def bending(beam: Beam, way: Array) -> tuple[float, float]:
    """E I and M_p of bending that moves a member along a direction."""
    _, depth, width = beam.axes
    c, s = float(depth @ way), float(width @ way)
    size = math.hypot(c, s)
    c, s = c / size, s / size
    p, (_, m_h, m_b, _) = beam.section.properties, beam.plastic_resistance
    moment = 1.0 / beam.section.utilisation(0.0, c / m_h, s / m_b)
    return beam.material.youngs_modulus * (p.second_h * c * c + p.second_b * s * s), moment


def rail_of(
    k: int, posts: Sequence[tuple[Beam, Array]], beams: Sequence[Beam], way: Array
) -> tuple[Beam, float] | None:
    """A member along a direction that ties the top of a post to another's, and how far the tops are apart."""
    post, top = posts[k]
    for beam in beams:
        if abs(float(beam.axes[0] @ way)) < ALONG:
            continue
        tied = [
            float(np.linalg.norm(other - top))
            for j, (p, other) in enumerate(posts)
            if j != k and _off(beam, other) <= 0.5 * (beam.section.depth + p.section.depth)
        ]
        if tied and _off(beam, top) <= 0.5 * (beam.section.depth + post.section.depth):
            return beam, min(tied)
    return None


def _off(beam: Beam, p: Array) -> float:
    """How far a place is from a member's axis, m."""
    way = p - np.array(beam.start)
    s = min(max(float(beam.axes[0] @ way), 0.0), beam.length)
    return float(np.linalg.norm(way - s * beam.axes[0]))


def _spring(
    foot: Foot, k: int, posts: Sequence[tuple[Beam, Array]], beams: Sequence[Beam], body: MassProperties
) -> Connector:
    post, _ = posts[k]
    high, steel = post.length, post.material
    rise = 2.0 / 3.0 * steel.tangent / steel.youngs_modulus * (1.0 + RISE) / RISE
    rise = min(rise, 0.5)
    shift, turn = [STIFF, STIFF, STIFF], [STIFF_TURN] * 3
    force: list[float | None] = [None] * 3
    moment: list[float | None] = [None] * 3
    zone = high * RISE / (1.0 + RISE)  # of a cantilever; a post with two hinges has half of it at each
    angle = 2.0 * zone / min(post.section.depth, post.section.width)
    length = 0.5 * angle * high
    for d in (0, 1):
        way = np.eye(3)[d]
        EI, plastic = bending(post, way)
        rail = rail_of(k, posts, beams, way)
        if rail is None:
            turn[1 - d], moment[1 - d] = 3.0 * EI / high, plastic
            continue
        beam, wide = rail
        across, knee = bending(beam, post.axes[0])
        r = across / wide / (EI / high)
        shift[d] = 12.0 * EI / high**3 * (1.0 + 6.0 * r) / (4.0 + 6.0 * r)
        force[d] = (plastic + min(plastic, knee)) / high
    sways = force[1] is not None
    if foot.side_stiffness is not None:  # of all that follows from the post
        ratio = foot.side_stiffness / (shift[1] if sways else turn[0] / high**2)
        shift = [ratio * x if limit is not None else x for x, limit in zip(shift, force, strict=True)]
        turn = [ratio * x if limit is not None else x for x, limit in zip(turn, moment, strict=True)]
    if foot.side_yield is not None and sways:
        force[1] = foot.side_yield
    elif foot.side_yield is not None:
        moment[0] = foot.side_yield * high
    mass = body.mass / len(posts)
    return Connector(
        name=foot.name,
        position=foot.position,
        stiffness=_three(shift),
        damping=_three([2.0 * foot.damping_ratio * math.sqrt(x * mass) for x in shift]),
        rotational_stiffness=_three(turn),
        rotational_damping=_three([2.0 * foot.damping_ratio * math.sqrt(x * mass * high**2 / 3.0) for x in turn]),
        yield_force=(force[0], force[1], force[2]),
        yield_moment=(moment[0], moment[1], moment[2]),
        hardening=(rise, rise, rise),
        rotational_hardening=(rise, rise, rise),
        play=(foot.play, foot.play, foot.play),
        rate_factor=None
        if steel.rate_factor is None
        else RateFactor(
            rate=steel.rate_factor.rate, exponent=steel.rate_factor.exponent, gauge_length=length, gauge_angle=angle
        ),
    )


def _three(values: Sequence[float]) -> Point:
    return values[0], values[1], values[2]

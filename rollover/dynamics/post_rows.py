"""Rows of the kernels' tables for posts that bend in a run: their sections along the way, and half of each rail."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from rollover.dynamics.frame.fibres import PERFECT
from rollover.kernels import posts as k
from rollover.spec.beam import Beam
from rollover.spec.feet import Foot, bending, posts_of, rail_of, side_stiffnesses, springs
from rollover.spec.rops import Rops

Array = NDArray[np.float64]
SIMPSON = (1.0, 4.0, 1.0)  # sixths of a segment
WAYS = np.eye(3)[:2]  # in which rails tie posts: along x, along y
TURNS = slice(3, 6)


def heads(rops: Rops) -> list[tuple[float, float, float]]:
    """Places of the posts' heads, vehicle axes, in the order of the feet; none where posts do not bend."""
    if rops.segments is None:
        return []
    return [(float(x), float(y), float(z)) for _, (x, y, z) in posts_of(rops.feet, rops.beams)]


def post_rows(rops: Rops | None) -> tuple[NDArray[np.int64], Array, Array]:
    """Rows of `post_i`, `post_f` and `section_f`."""
    whole: list[list[int]] = []
    rows, sections = list[Array](), list[Array]()
    if rops is not None and rops.segments is not None:
        posts = posts_of(rops.feet, rops.beams)
        for n, foot in enumerate(rops.feet):
            own, compliance, axes = _post(rops, posts, n)
            own, compliance = _as_stated(foot, rops, own, compliance)
            whole.append([len(sections), len(sections) + len(own)])
            sections += own
            stiff = np.asarray(np.linalg.inv(compliance), dtype=float)
            row = np.zeros(k.POST_COLUMNS)
            row[k.P_AXES : k.P_AXES + 9] = axes.ravel()
            row[k.P_HIGH] = posts[n][0].length
            row[k.P_LAG : k.P_LAG + 6] = _lags(foot, rops, stiff)
            row[k.P_K : k.P_K + 36], row[k.P_C : k.P_C + 36] = stiff.ravel(), compliance.ravel()
            rows.append(row)
    return (
        np.array(whole, dtype=np.int64).reshape(-1, 2),
        np.array(rows).reshape(-1, k.POST_COLUMNS),
        np.array(sections).reshape(-1, k.SECTION_COLUMNS),
    )


def _post(rops: Rops, posts: list[tuple[Beam, Array]], n: int) -> tuple[list[Array], Array, Array]:
    """Sections of a post and its rails, compliance of its head (6, 6), its axes (3, 3)."""
    assert rops.segments is not None
    beam, head = posts[n]
    along = head - np.array(rops.feet[n].position)
    along = beam.axes[0] * math.copysign(1.0, float(beam.axes[0] @ along))
    axes = np.array([along, beam.axes[1], np.cross(along, beam.axes[1])])
    p, E = beam.section.properties, beam.material.youngs_modulus
    strength = beam.plastic_resistance
    stiff = np.array([E * p.area, E * p.second_h, E * p.second_b, beam.material.shear_modulus * p.torsion])
    sections, compliance = [], np.zeros((6, 6))
    for x, w in _stations(beam.length, rops.segments, both=True):
        arm = beam.length - x
        B = np.zeros((4, 6))
        B[0, 0] = B[1, 5] = B[2, 4] = B[3, 3] = 1.0
        B[1, 1], B[2, 2] = arm, -arm
        sections.append(_section(beam, w, B, np.array(strength)))
        compliance += w * B.T @ (B / stiff[:, None])
    rails = [tied for way in WAYS if (tied := rail_of(n, posts, rops.beams, way)) is not None]
    for j, (rail, wide) in enumerate(rails):
        own, more = _half_rail(rail, wide, axes, math.ceil(0.5 * rops.segments), is_first=j == 0, alone=len(rails) == 1)
        sections += own
        compliance += more
    return sections, compliance, axes


def _half_rail(
    rail: Beam, wide: float, axes: Array, segments: int, *, is_first: bool, alone: bool
) -> tuple[list[Array], Array]:
    """Sections of a rail from the knee to its middle, and what it adds to the head's compliance.

    Posts that sway alike bend it by a moment that falls from the knee's to none at its middle, L/(6 E I) of turn for
    each knee; heads that turn against each other twist it, L/(2 G J). Where two rails meet, each bends about its own
    axis of sway, twists nowhere, for there the other one bends, and the first of them holds the post's turn.
    """
    own = axes @ rail.axes[0]
    sway = np.cross([1.0, 0.0, 0.0], own)
    sway /= np.linalg.norm(sway)
    flat = np.cross(own, sway)
    (EI, M), (EI_flat, M_flat) = (bending(rail, axes.T @ np.cross(e, own)) for e in (sway, flat))
    stiff = np.array([1.0, EI, EI_flat, rail.material.shear_modulus * rail.section.properties.torsion])
    N, _, _, T = rail.plastic_resistance
    sections, compliance, half = [], np.zeros((6, 6)), 0.5 * wide
    for x, w in _stations(half, segments, both=False):
        B = np.zeros((4, 6))
        B[1, TURNS] = sway * (1.0 - x / half)
        if is_first:
            B[2, TURNS] = flat * (1.0 - x / half)
        if alone:
            B[3, TURNS] = own
        sections.append(_section(rail, w, B, np.array([N, M, M_flat, T])))
        compliance += w * B.T @ (B / stiff[:, None])
    return sections, compliance


def _stations(length: float, segments: int, *, both: bool) -> list[tuple[float, float]]:
    """Places along a piece and their lengths, Simpson's rule in segments that are shorter towards one end or both."""
    turn = np.linspace(0.0, math.pi if both else 0.5 * math.pi, segments + 1)
    ends = length * (1.0 - np.cos(turn)) * (0.5 if both else 1.0)
    x, w = np.zeros(2 * segments + 1), np.zeros(2 * segments + 1)
    x[::2], x[1::2] = ends, 0.5 * (ends[1:] + ends[:-1])
    for j, size in enumerate(np.diff(ends)):
        w[2 * j : 2 * j + 3] += size / 6.0 * np.array(SIMPSON)
    return list(zip(x.tolist(), w.tolist(), strict=True))


def _section(beam: Beam, length: float, B: Array, strength: Array) -> Array:
    """A row of `section_f`: B over the plastic resistances.

    Hardening H = E I a/(1 - a) of moment over plastic curvature, a the steel's tangent over E, is g = H/M_pl^2 of the
    moment over M_pl by work; the mean of both axes', which for tubes and bars is that of the axial force within 30 %.
    """
    steel, p = beam.material, beam.section.properties
    a = max(steel.tangent / steel.youngs_modulus, PERFECT)
    _, M_h, M_b, _ = beam.plastic_resistance
    g = 0.5 * steel.youngs_modulus * a / (1.0 - a) * (p.second_h / M_h**2 + p.second_b / M_b**2)
    rate = steel.rate_factor
    speed = 0.0 if rate is None else rate.rate * steel.yield_strength * p.area
    return np.array([length, g, speed, 1.0 if rate is None else rate.exponent, *(B / strength[:, None]).ravel()])


def _as_stated(foot: Foot, rops: Rops, sections: list[Array], compliance: Array) -> tuple[list[Array], Array]:
    """With what is stated of a foot: its stiffness to the side, all others in proportion; its yield to the side."""
    plain = replace(foot, side_stiffness=None, side_yield=None)
    n = rops.feet.index(foot)
    feet = (*rops.feet[:n], plain, *rops.feet[n + 1 :])
    if foot.side_stiffness is not None:
        compliance = compliance * (side_stiffnesses(feet, rops.beams, rops.body)[foot.name] / foot.side_stiffness)
    if foot.side_yield is not None:
        spring = springs(feet, rops.beams, rops.body)[n]
        force, moment = spring.yield_force[1], spring.yield_moment[0]
        own = force if force is not None else (moment or 0.0) / posts_of(feet, rops.beams)[n][0].length
        ratio = foot.side_yield / own
        for row in sections:
            row[k.C_B :] /= ratio
            row[k.C_HARD] /= ratio * ratio
            row[k.C_SPEED] *= ratio
    return sections, compliance


def _lags(foot: Foot, rops: Rops, stiff: Array) -> Array:
    """Retardations of the dashpots, s: 2 zeta/omega at the sway of the frame's mass on its posts.

    Along the post, where nothing else is coupled, at its own omega: with the sway's a blow along it would be carried by
    its dashpot.
    """
    share = rops.body.mass / len(rops.feet)
    sway, own = (2.0 * foot.damping_ratio * math.sqrt(share / x) for x in (min(stiff[1, 1], stiff[2, 2]), stiff[0, 0]))
    return np.array([own, *[sway] * 5])

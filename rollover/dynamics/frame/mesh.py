"""Members to nodes and elements: who meets whom, where loads and mounts are, finer towards both ends of a piece."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from rollover.spec.beam import Beam

Array = NDArray[np.float64]
Index = NDArray[np.int64]
SAME = 1e-6  # m
LEAST_PIECE = 4  # elements in the shortest piece between two joints


@dataclass(frozen=True, kw_only=True)
class Mesh:
    """`nodes` (n, 3) in vehicle axes; `ends` (m, 2) nodes of the elements, `beam` (m,) their members.

    `place` (m, 2) is where an element begins and ends along its member, m; `at` tells the node of each named point,
    `joints` are nodes in which members meet.
    """

    beams: tuple[Beam, ...]
    nodes: Array
    ends: Index
    beam: Index
    place: Array
    at: Mapping[str, int]
    joints: tuple[int, ...]

    @property
    def length(self) -> Array:
        """Of each element, m, (m,)."""
        return np.asarray(np.linalg.norm(self.nodes[self.ends[:, 1]] - self.nodes[self.ends[:, 0]], axis=1))

    @property
    def axes(self) -> Array:
        """Rows along, depth, width of each element, (m, 3, 3): those of its member, turned onto the element."""
        along = (self.nodes[self.ends[:, 1]] - self.nodes[self.ends[:, 0]]) / self.length[:, None]
        depth = np.array([b.axes[1] for b in self.beams])[self.beam]
        depth = depth - along * np.sum(along * depth, axis=1)[:, None]
        depth /= np.linalg.norm(depth, axis=1)[:, None]
        return np.stack([along, depth, np.cross(along, depth)], axis=1)


def mesh(beams: Sequence[Beam], points: Mapping[str, Sequence[float]], segments: int, reach: float = math.inf) -> Mesh:
    """Nodes and elements of a frame, `segments` to a member, cosine spaced between its joints.

    A member's end is joined to what it touches: another axis no further away than half of both sections. A named point
    becomes a node of the nearest member, a joint or an end if that is near; no more than `reach` (m) away. Raises
    ``ValueError``, the point's name first, for one that is further off.
    """
    places: list[Array] = []
    breaks: list[dict[int, float]] = [{} for _ in beams]

    def node(p: Array, tolerance: float = SAME) -> int:
        for k, q in enumerate(places):
            if np.linalg.norm(p - q) <= tolerance:
                return k
        places.append(p)
        return len(places) - 1

    sizes = [0.5 * max(b.section.width, b.section.depth) for b in beams]
    for i, b in enumerate(beams):
        for s, end in ((0.0, b.start), (b.length, b.end)):
            breaks[i][node(np.array(end), sizes[i])] = s
    _join(beams, breaks, places, sizes)
    found: dict[str, int] = {}
    for name, point in points.items():
        p = np.array(point, dtype=float)
        feet = [_foot(b, p) for b in beams]
        j = int(np.argmin([off for _, off in feet]))
        s, off = feet[j]
        if off > reach:
            raise ValueError(
                f"{name}: no member with a section is near, got {[round(float(x), 3) for x in p]}, {1e3 * off:.0f} mm "
                f"from {beams[j].name!r}; at most {1e3 * reach:.0f} mm"
            )
        way, near = min((abs(place - s), k) for k, place in breaks[j].items())
        if way <= sizes[j]:  # what is nearer to a joint than half a section meets the joint
            found[name] = near
        else:
            found[name] = node(np.array(beams[j].start) + beams[j].axes[0] * s)
            breaks[j][found[name]] = s
    return _divided(tuple(beams), places, breaks, segments, found)


def _touches(
    beams: Sequence[Beam], breaks: Sequence[Mapping[int, float]], places: Sequence[Array], sizes: Sequence[float]
) -> Iterator[tuple[float, float, int, int, int]]:
    """Ends `k` of members `i` at the axes of others `j`: how far off (m), place along the axis (m), `i`, `k`, `j`."""
    for i, of in enumerate(breaks):
        for k in of:
            for j, other in enumerate(beams):
                s, off = _foot(other, places[k])
                if j != i and off <= sizes[i] + sizes[j]:
                    yield off, s, i, k, j


def _foot(b: Beam, p: Array) -> tuple[float, float]:
    """Place along a member nearest to a point, and how far that is off, m."""
    way = p - np.array(b.start)
    s = min(max(float(b.axes[0] @ way), 0.0), b.length)
    return s, float(np.linalg.norm(way - s * b.axes[0]))


def _join(
    beams: Sequence[Beam], breaks: list[dict[int, float]], places: Sequence[Array], sizes: Sequence[float]
) -> None:
    """Joints where ends touch others: within a member a node more, at its end one node for both.

    Who meets an axis comes before who is beside it, and two members meet once, be it through a third: the end of a beam
    beyond its post is free.
    """
    now = {k: k for of in breaks for k in of}  # nodes that became one with another
    for _, s, i, end, j in sorted(_touches(beams, breaks, places, sizes)):
        k = now[end]
        if _is_joined(breaks, places, i, j, k, sizes[i] + sizes[j]):
            continue
        ends = [m for m, place in breaks[j].items() if abs(place - s) <= SAME]
        for old in ends:
            for of in breaks:
                if old in of:
                    of[k] = of.pop(old)
            now = {name: k if at == old else at for name, at in now.items()}
        breaks[j][k] = s


def _is_joined(
    breaks: Sequence[Mapping[int, float]], places: Sequence[Array], i: int, j: int, k: int, near: float
) -> bool:
    """Whether members `i` and `j` hang together by nodes that are near a node `k` (m)."""
    around = {m for m, p in enumerate(places) if np.linalg.norm(p - places[k]) <= near}
    group, rest = set(breaks[i]) & around, [set(of) & around for of in breaks]
    while more := [of for of in rest if of & group and not of <= group]:
        group = group.union(*more)
    return bool(group & set(breaks[j]))


def _divided(
    beams: tuple[Beam, ...], places: list[Array], breaks: list[dict[int, float]], segments: int, at: dict[str, int]
) -> Mesh:
    nodes = [*places]
    ends, owner, where = [], [], []
    for i, b in enumerate(beams):
        stops = sorted(breaks[i].items(), key=lambda item: item[1])
        for (k, s), (m, e) in pairwise(stops):
            if e - s <= SAME:
                continue
            count = min(segments, max(LEAST_PIECE, round(2.0 * segments * (e - s) / b.length)))
            share = 0.5 * (1.0 - np.cos(np.pi * np.arange(count + 1) / count))
            chain = [k]
            for x in share[1:-1]:
                nodes.append(nodes[k] + x * (nodes[m] - nodes[k]))
                chain.append(len(nodes) - 1)
            chain.append(m)
            ends += list(pairwise(chain))
            owner += [i] * count
            where += [(s + (e - s) * share[n], s + (e - s) * share[n + 1]) for n in range(count)]
    return Mesh(
        beams=beams,
        nodes=np.array(nodes),
        ends=np.array(ends, dtype=np.int64),
        beam=np.array(owner, dtype=np.int64),
        place=np.array(where),
        at=at,
        joints=tuple(k for k in range(len(places)) if sum(k in b for b in breaks) > 1),
    )

"""Compiled: which elements lie under the vehicle's points; an element's memory is made at its first touch."""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from ground.compiled import compiled, inlined, leaf
from ground.kernel import (
    CELL,
    IDLE,
    MODE,
    NORMAL,
    ROW,
    rut_depth,
)
from ground.relief import element_plane, height_and_gradient, highest
from rollover.kernels.tables import BLOCK, L_BASE, L_DOWN, L_FAR, L_WAY, MEMORYLESS, OMEGA, OUTSIDE, ROT, SLOTS
from rollover.kernels.vectors import depth_acceleration, place, to_body, velocity

AHEAD = 2.0  # steps that a point may be away from memoryless ground: the next may be twice as long, and faster
GUARD = 1e-9  # m: far beyond the rounding of what a body's points have sunk by, so that none is passed over too long
FOUND = 1e-300  # m: depth that marks as found what is not yet in the ground


@compiled
def search(t: Any) -> int:
    """Find what lies under the vehicle's points; returns the number of elements, their slots in `touched`.

    `found` then holds for each: the deepest point and its sinkage; projected area, mean sinkage and centroid of the
    points of the same body.
    """
    if t.relief.shape[0] > 0:
        candidates, count = on_relief(t, np.empty(4))
    else:
        candidates, count = on_plane(t)
    gather(t, candidates, count)
    return count  # type: ignore[no-any-return]


@leaf
def gather(t: Any, candidates: int, count: int) -> None:
    """Area, mean sinkage and centroid of the points of one body over each element, from the candidates."""
    for c in range(candidates):
        slot, i = t.candidate_i[c, 0], t.candidate_i[c, 1]
        f = t.found[slot]
        if t.point_body[i] == t.point_body[int(f[2])]:
            area = t.candidate_f[c, 0]
            f[1] += area
            f[3] += area * t.candidate_f[c, 1]
            for k in range(3):
                f[4 + k] += area * t.point_r[i, k]
    for c in range(count):
        f = t.found[t.touched[c]]
        for k in range(3, 7):
            f[k] /= f[1]


@leaf
def follow(t: Any) -> None:
    """Add to each body's `L_WAY` what any of its points may have sunk by since the last search.

    depth(r) = base - down . r, so that it grows by |base' - base| + |down' - down| |r| at most.
    """
    n, offset = t.plane[:3], t.plane[3]
    for b in range(t.pose.shape[0]):
        row, s = t.pose[b], t.approach[b]
        d0, d1, d2 = to_body(row, n[0], n[1], n[2])
        base = offset - n[0] * row[0] - n[1] * row[1] - n[2] * row[2]
        e0, e1, e2 = d0 - s[L_DOWN], d1 - s[L_DOWN + 1], d2 - s[L_DOWN + 2]
        s[L_WAY] += abs(base - s[L_BASE]) + s[L_FAR] * math.sqrt(e0 * e0 + e1 * e1 + e2 * e2)
        s[L_BASE], s[L_DOWN], s[L_DOWN + 1], s[L_DOWN + 2] = base, d0, d1, d2


@leaf
def on_plane(t: Any) -> Any:
    """Points below a flat surface, as candidates; returns how many, and of how many elements."""
    n, offset = t.plane[:3], t.plane[3]
    candidates, count = 0, 0
    follow(t)
    for member in range(t.member_i.shape[0]):
        m, row, s = t.member_f[member], t.pose[t.member_i[member, 0]], t.approach[t.member_i[member, 0]]
        way, base, down = s[L_WAY], s[L_BASE], s[L_DOWN:]
        near = nearing(t, row, m)
        if way + near < t.member_wake[member]:
            continue
        if down[0] * m[6] + down[1] * m[7] + down[2] * m[8] > -1e-6 and m[6] * m[6] + m[7] * m[7] + m[8] * m[8] > 0.0:
            continue  # a flat patch that does not face the ground
        x, y, z = place(row, m[0], m[1], m[2])
        reach = abs(down[0]) * m[3] + abs(down[1]) * m[4] + abs(down[2]) * m[5]
        if n[0] * x + n[1] * y + n[2] * z - offset > reach + near:
            continue
        facing = -(down[0] * m[6] + down[1] * m[7] + down[2] * m[8])
        is_flat = m[6] * m[6] + m[7] * m[7] + m[8] * m[8] > 0.0
        d0, d1, d2 = down[0], down[1], down[2]
        first, end, soonest = t.member_i[member, 1], t.member_i[member, 2], math.inf
        for block in range(-(-(end - first) // BLOCK)):
            at, k = first + block * BLOCK, t.member_i[member, 4] + block
            if way + near >= t.block_wake[k]:
                deepest = depth_of(t.block_f[k], down, base)
                t.block_wake[k] = way - deepest - GUARD
                is_clear = deepest <= -near
            else:
                is_clear = True
            soonest = min(soonest, t.block_wake[k])
            if is_clear:
                continue
            for i in range(at, min(at + BLOCK, end)):
                a, b, c = t.point_r[i, 0], t.point_r[i, 1], t.point_r[i, 2]
                depth = base - (d0 * a + d1 * b + d2 * c)
                if depth <= -near:
                    continue
                if not is_flat:
                    nx, ny, nz = t.point_n[i, 0], t.point_n[i, 1], t.point_n[i, 2]
                    # a listed point has no normal: it stands for its area whichever way the body is turned
                    facing = -(d0 * nx + d1 * ny + d2 * nz) if nx != 0.0 or ny != 0.0 or nz != 0.0 else 1.0
                    if facing <= 1e-6:
                        continue
                x, y, z = place(row, a, b, c)
                ix = math.floor((x - t.grid_f[0]) / t.grid_f[2])
                iy = math.floor((y - t.grid_f[1]) / t.grid_f[3])
                if ix < 0 or iy < 0 or ix >= t.grid_i[0] or iy >= t.grid_i[1]:
                    t.counts[OUTSIDE] += 1
                    continue
                cell = ix * t.grid_i[1] + iy
                key = key_of(t, cell, i)
                if depth <= 0.0 and (key == cell or not arrives(t, row, i, n, depth)):
                    continue
                slot = slot_at(t, cell, key)
                # an element at rest keeps its rut: it is touched only beyond it
                if t.state[slot, MODE] == IDLE and depth <= rut_depth(t.memory[slot]) and key == cell:
                    continue
                count += note_candidate(t, candidates, count, slot, i, facing, depth)
                candidates += 1
        t.member_wake[member] = soonest
    return candidates, count


@inlined
def depth_of(box: Any, down: Any, base: float) -> float:
    """Depth of the lowest corner of a box, m: none of its points lies deeper."""
    reach = abs(down[0]) * box[3] + abs(down[1]) * box[4] + abs(down[2]) * box[5]
    return base - (down[0] * box[0] + down[1] * box[1] + down[2] * box[2]) + reach  # type: ignore[no-any-return]


@leaf
def note_candidate(t: Any, candidates: int, count: int, slot: int, i: int, facing: float, depth: float) -> int:
    """Keep a point that is deep enough; returns 1 where it is the first of its element."""
    t.candidate_i[candidates, 0], t.candidate_i[candidates, 1] = slot, i
    t.candidate_f[candidates, 0], t.candidate_f[candidates, 1] = facing * t.point_a[i], depth
    first = 0
    if t.found[slot, 0] <= 0.0:
        t.touched[count] = slot
        first = 1
        for k in range(1, 7):
            t.found[slot, k] = 0.0
    deep = max(depth, FOUND)
    if deep > t.found[slot, 0]:
        t.found[slot, 0], t.found[slot, 2] = deep, i
    return first


@leaf
def on_relief(t: Any, plane: Any) -> Any:
    """Points below the planes of their elements on an uneven surface; returns as `on_plane` does."""
    candidates, count = 0, 0
    member, following = 0, 0
    while following < t.member_i.shape[0]:
        member, following = following, following + 1
        row, m = t.pose[t.member_i[member, 0]], t.member_f[member]
        x, y, z = place(row, m[0], m[1], m[2])
        a, b, c = m[3], m[4], m[5]
        wide = abs(row[ROT]) * a + abs(row[ROT + 1]) * b + abs(row[ROT + 2]) * c
        long = abs(row[ROT + 3]) * a + abs(row[ROT + 4]) * b + abs(row[ROT + 5]) * c
        tall = abs(row[ROT + 6]) * a + abs(row[ROT + 7]) * b + abs(row[ROT + 8]) * c
        # what lies under the box, and the elements that it looks into
        reach = math.hypot(wide, long) + t.grid_f[2] + t.grid_f[3]
        near = nearing(t, row, m)
        top = highest(t.relief, t.nodes, x, y, reach) + near
        if z - tall > top:
            following = t.member_i[member, 3]  # past its pieces
            continue
        for i in range(t.member_i[member, 1], t.member_i[member, 2]):
            x, y, z = place(row, t.point_r[i, 0], t.point_r[i, 1], t.point_r[i, 2])
            if z > top:
                continue
            ix = math.floor((x - t.grid_f[0]) / t.grid_f[2])
            iy = math.floor((y - t.grid_f[1]) / t.grid_f[3])
            if ix < 0 or iy < 0 or ix >= t.grid_i[0] or iy >= t.grid_i[1]:
                ground, _, _ = height_and_gradient(t.relief, t.nodes, x, y)
                if z < ground:
                    t.counts[OUTSIDE] += 1
                continue
            cell = ix * t.grid_i[1] + iy
            key = key_of(t, cell, i)
            slot = t.slot_of[key]
            ground, _, _ = height_and_gradient(t.relief, t.nodes, x, y)
            if z > ground + 2.0 * (t.grid_f[2] + t.grid_f[3]):
                continue  # higher than a plane of 75 degrees stands over the surface within its element
            if slot < 0 or t.state[slot, CELL] != cell:
                plane_of(t, cell, plane)
            else:
                for k in range(4):
                    plane[k] = t.memory[slot, NORMAL + k]
            depth = plane[3] - (plane[0] * x + plane[1] * y + plane[2] * z)
            if depth <= 0.0 and (key == cell or not arrives(t, row, i, plane[:3], depth)):
                continue
            d0, d1, d2 = to_body(row, plane[0], plane[1], plane[2])
            facing = -(d0 * t.point_n[i, 0] + d1 * t.point_n[i, 1] + d2 * t.point_n[i, 2])
            if facing <= 1e-6:
                continue
            slot = slot_at(t, cell, key)
            if t.state[slot, MODE] == IDLE and depth <= rut_depth(t.memory[slot]) and key == cell:
                continue
            count += note_candidate(t, candidates, count, slot, i, facing, depth)
            candidates += 1
    return candidates, count


@inlined
def plane_of(t: Any, cell: int, plane: Any) -> None:
    """Normal and offset of an untouched element into `plane` (4,)."""
    if t.relief.shape[0] == 0:
        for k in range(4):
            plane[k] = t.plane[k]
        return
    ix, iy = cell // t.grid_i[1], cell % t.grid_i[1]
    dx, dy = t.grid_f[2], t.grid_f[3]
    element_plane(t.relief, t.nodes, t.grid_f[0] + ix * dx, t.grid_f[1] + iy * dy, dx, dy, plane)


@inlined
def law_of(t: Any, cell: int) -> int:
    """Row of an element's law and friction: that of the last patch over its centre, or 0."""
    x = t.grid_f[0] + (cell // t.grid_i[1] + 0.5) * t.grid_f[2]
    y = t.grid_f[1] + (cell % t.grid_i[1] + 0.5) * t.grid_f[3]
    found = 0
    for k in range(t.patch_f.shape[0]):
        f = t.patch_f[k]
        if f[0] <= x < f[1] and f[2] <= y < f[3]:
            found = k + 1
    return found


@leaf
def nearing(t: Any, row: Any, m: Any) -> float:
    """How far above memoryless ground a point of a box may be and yet reach it within the step, m; else 0."""
    if t.scheme[3] == 0.0:
        return 0.0
    x, y, z = velocity(row, m[0], m[1], m[2])
    turning = math.sqrt(row[OMEGA] ** 2 + row[OMEGA + 1] ** 2 + row[OMEGA + 2] ** 2)
    size = math.sqrt(m[3] * m[3] + m[4] * m[4] + m[5] * m[5])
    return AHEAD * t.clock[0] * (math.sqrt(x * x + y * y + z * z) + turning * size)  # type: ignore[no-any-return]


@leaf
def arrives(t: Any, row: Any, i: int, n: Any, depth: float) -> bool:
    """Whether a point above a surface should reach it within the step."""
    r, h = t.point_r[i], AHEAD * t.clock[0]
    x, y, z = velocity(row, r[0], r[1], r[2])
    rate = -(n[0] * x + n[1] * y + n[2] * z)
    return depth + h * (rate + max(0.5 * h * depth_acceleration(row, r, n), 0.0)) > 0.0  # type: ignore[no-any-return]


@inlined
def key_of(t: Any, cell: int, i: int) -> int:
    """Place in `slot_of` of the contact of point i over an element: the element's, or the point's own."""
    if t.scheme[3] > 0.0:
        law = law_of(t, cell)
        if t.soil[law, MEMORYLESS] > 0.0:
            return t.grid_i[0] * t.grid_i[1] + law * t.point_a.size + i  # type: ignore[no-any-return]
    return cell


@inlined
def slot_at(t: Any, cell: int, key: int) -> int:
    """Memory row of a contact; made at its first touch, so that untouched elements cost nothing."""
    slot = t.slot_of[key]
    if slot >= 0 and t.state[slot, CELL] != cell:  # a point has moved on
        t.state[slot, CELL] = cell
        plane_of(t, cell, t.memory[slot, NORMAL : NORMAL + 4])
    if slot < 0:
        slot = t.counts[SLOTS]
        t.slot_of[key] = slot
        t.counts[SLOTS] = slot + 1
        t.memory[slot, :] = 0.0
        t.state[slot, :] = 0
        t.state[slot, CELL] = cell
        t.state[slot, ROW] = law_of(t, cell)
        plane_of(t, cell, t.memory[slot, NORMAL : NORMAL + 4])
        t.found[slot, 0] = 0.0
    return slot  # type: ignore[no-any-return]

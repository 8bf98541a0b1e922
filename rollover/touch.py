"""Compiled: which elements the vehicle touches, and how each contact begins and ends."""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from ground.compiled import compiled
from ground.kernel import (
    AREA,
    BODY,
    CELL,
    FLAGS,
    FORCE,
    GROWING,
    HITS,
    IDLE,
    LINE_Z,
    LOADING,
    MASS_B,
    MODE,
    NORMAL,
    OWNER_R,
    PLACE,
    PLASTIC,
    REST_STIFFNESS,
    ROW,
    SHEAR,
    SINKAGE,
    SPREAD,
    TOUCH_SPEED,
    UNLOADING,
    begin,
    enter_from_the_side,
    rut_depth,
)
from ground.law import REFERENCE_AREA
from ground.relief import element_plane, height_and_gradient, highest
from rollover.impact import exchange, share_mass
from rollover.tables import (
    ACTIVE,
    EVENTS,
    MASS_GIVEN,
    MASS_RULE,
    MOMENTUM_MOST,
    NOT_VIRGIN,
    OBLIQUE,
    OUT_OF_MOMENTUM,
    OUT_OF_SPEED,
    OUTSIDE,
    ROT,
    RULE_CLAMPED,
    RULE_REFERENCE,
    SLOTS,
    SOIL,
    TOUCH,
)
from rollover.vectors import depth_acceleration, place, to_body, velocity


@compiled
def note_event(t: Any, kind: int, subject: int, x: Any, value: float) -> None:
    """Append to the events of this step; a full list drops the rest (the caller empties it every step)."""
    e = t.counts[EVENTS]
    if e < t.event.shape[0]:
        t.event[e, 0], t.event[e, 1] = kind, subject
        for k in range(3):
            t.event[e, 2 + k] = x[k]
        t.event[e, 5] = value
        t.counts[EVENTS] = e + 1


@compiled
def search(t: Any) -> int:
    """Find what lies under the vehicle's points; returns the number of elements, their slots in `touched`.

    `found` then holds for each: the deepest point and its sinkage; projected area, mean sinkage and centroid of the
    points of the same body.
    """
    if t.relief.shape[0] > 0:
        candidates, count = on_relief(t)
    else:
        candidates, count = on_plane(t)
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
    return count  # type: ignore[no-any-return]


@compiled
def on_plane(t: Any) -> Any:
    """Points below a flat surface, as candidates; returns how many, and of how many elements."""
    n, offset = t.plane[:3], t.plane[3]
    candidates, count = 0, 0
    for member in range(t.member_i.shape[0]):
        row = t.pose[t.member_i[member, 0]]
        m = t.member_f[member]
        down = to_body(row, n[0], n[1], n[2])
        if down[0] * m[6] + down[1] * m[7] + down[2] * m[8] > -1e-6 and m[6] * m[6] + m[7] * m[7] + m[8] * m[8] > 0.0:
            continue  # a flat patch that does not face the ground
        x, y, z = place(row, m[0], m[1], m[2])
        reach = abs(down[0]) * m[3] + abs(down[1]) * m[4] + abs(down[2]) * m[5]
        if n[0] * x + n[1] * y + n[2] * z - offset > reach:
            continue
        base = offset - n[0] * row[0] - n[1] * row[1] - n[2] * row[2]
        facing = -(down[0] * m[6] + down[1] * m[7] + down[2] * m[8])
        is_flat = m[6] * m[6] + m[7] * m[7] + m[8] * m[8] > 0.0
        d0, d1, d2 = down
        for i in range(t.member_i[member, 1], t.member_i[member, 2]):
            a, b, c = t.point_r[i, 0], t.point_r[i, 1], t.point_r[i, 2]
            depth = base - (d0 * a + d1 * b + d2 * c)
            if depth <= 0.0:
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
            slot = slot_at(t, ix * t.grid_i[1] + iy)
            # an element at rest keeps its rut: it is touched only beyond it
            if t.state[slot, MODE] == IDLE and depth <= rut_depth(t.memory[slot]):
                continue
            count += note_candidate(t, candidates, count, slot, i, facing, depth)
            candidates += 1
    return candidates, count


@compiled
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
    if depth > t.found[slot, 0]:
        t.found[slot, 0], t.found[slot, 2] = depth, i
    return first


@compiled
def on_relief(t: Any) -> Any:
    """Points below the planes of their elements on an uneven surface; returns as `on_plane` does."""
    candidates, count = 0, 0
    plane = np.empty(4)
    for member in range(t.member_i.shape[0]):
        row, m = t.pose[t.member_i[member, 0]], t.member_f[member]
        x, y, z = place(row, m[0], m[1], m[2])
        a, b, c = m[3], m[4], m[5]
        wide = abs(row[ROT]) * a + abs(row[ROT + 1]) * b + abs(row[ROT + 2]) * c
        long = abs(row[ROT + 3]) * a + abs(row[ROT + 4]) * b + abs(row[ROT + 5]) * c
        tall = abs(row[ROT + 6]) * a + abs(row[ROT + 7]) * b + abs(row[ROT + 8]) * c
        # what lies under the box, and the elements that it looks into
        reach = math.hypot(wide, long) + t.grid_f[2] + t.grid_f[3]
        top = highest(t.relief, t.nodes, x, y, reach)
        if z - tall > top:
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
            slot = t.slot_of[cell]
            ground, _, _ = height_and_gradient(t.relief, t.nodes, x, y)
            if z > ground + 2.0 * (t.grid_f[2] + t.grid_f[3]):
                continue  # higher than a plane of 75 degrees stands over the surface within its element
            if slot < 0:
                plane_of(t, cell, plane)
            else:
                plane[:] = t.memory[slot, NORMAL : NORMAL + 4]
            depth = plane[3] - (plane[0] * x + plane[1] * y + plane[2] * z)
            if depth <= 0.0:
                continue
            d0, d1, d2 = to_body(row, plane[0], plane[1], plane[2])
            facing = -(d0 * t.point_n[i, 0] + d1 * t.point_n[i, 1] + d2 * t.point_n[i, 2])
            if facing <= 1e-6:
                continue
            slot = slot_at(t, cell)
            if t.state[slot, MODE] == IDLE and depth <= rut_depth(t.memory[slot]):
                continue
            count += note_candidate(t, candidates, count, slot, i, facing, depth)
            candidates += 1
    return candidates, count


@compiled
def plane_of(t: Any, cell: int, plane: Any) -> None:
    """Normal and offset of an untouched element into `plane` (4,)."""
    if t.relief.shape[0] == 0:
        plane[:] = t.plane
        return
    ix, iy = cell // t.grid_i[1], cell % t.grid_i[1]
    dx, dy = t.grid_f[2], t.grid_f[3]
    element_plane(t.relief, t.nodes, t.grid_f[0] + ix * dx, t.grid_f[1] + iy * dy, dx, dy, plane)


@compiled
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


@compiled
def slot_at(t: Any, cell: int) -> int:
    """Memory row of an element; made at its first touch, so that untouched elements cost nothing."""
    slot = t.slot_of[cell]
    if slot < 0:
        slot = t.counts[SLOTS]
        t.slot_of[cell] = slot
        t.counts[SLOTS] = slot + 1
        t.memory[slot, :] = 0.0
        t.state[slot, :] = 0
        t.state[slot, CELL] = cell
        t.state[slot, ROW] = law_of(t, cell)
        plane_of(t, cell, t.memory[slot, NORMAL : NORMAL + 4])
        t.found[slot, 0] = 0.0
    return slot  # type: ignore[no-any-return]


@compiled
def drop_mass(t: Any, slot: int) -> None:
    """Let an element's co-moving mass go; its kinetic energy stays in the soil."""
    m, b = t.memory[slot], t.state[slot, BODY]
    if m[MASS_B] > 0.0:
        v = velocity(t.pose[b], m[OWNER_R], m[OWNER_R + 1], m[OWNER_R + 2])
        speed = m[NORMAL] * v[0] + m[NORMAL + 1] * v[1] + m[NORMAL + 2] * v[2]
        t.work[SOIL] += 0.5 * m[MASS_B] * speed * speed
        m[MASS_B] = 0.0
    m[GROWING] = 0.0


@compiled
def change_owner(t: Any, slot: int, b: int, r: Any, speed: float) -> None:
    """Move an element's contact to the centroid r of body b; the co-moving mass stays with its body.

    Its kinetic energy changes with the point that it follows: the soil gives or takes the difference.
    """
    m = t.memory[slot]
    if t.state[slot, BODY] != b:
        drop_mass(t, slot)
        t.state[slot, BODY] = b
    elif m[MASS_B] > 0.0:
        v = velocity(t.pose[b], m[OWNER_R], m[OWNER_R + 1], m[OWNER_R + 2])
        before = m[NORMAL] * v[0] + m[NORMAL + 1] * v[1] + m[NORMAL + 2] * v[2]
        t.work[SOIL] += 0.5 * m[MASS_B] * (before * before - speed * speed)
    for k in range(3):
        m[OWNER_R + k] = r[k]


@compiled
def let_go(t: Any) -> None:
    """End the contacts that are released or that no point covers any more; the rut stays."""
    kept = 0
    for a in range(t.counts[ACTIVE]):
        slot = t.active[a]
        if t.state[slot, MODE] == IDLE or t.found[slot, 0] <= 0.0:
            drop_mass(t, slot)
            t.state[slot, MODE] = IDLE
            t.memory[slot, FORCE] = 0.0
            if t.law[t.state[slot, ROW], PLASTIC] == 0:
                t.memory[slot, SINKAGE] = 0.0  # no rut stays
        else:
            t.active[kept] = slot
            kept += 1
    t.counts[ACTIVE] = kept


@compiled
def domain_flags(domain: Any, speed: float, mass: float, obliquity: float, hits: int) -> int:
    """Bits of `tables.FLAG_NAMES` for one touch; the contact area is judged for the whole footprint elsewhere."""
    flags = 0
    # a touch is latched within a step: what lies on the bound lies within
    if speed < domain[0] * (1.0 - 1e-3) or speed > domain[1] * (1.0 + 1e-3):
        flags |= OUT_OF_SPEED
    if mass * speed > domain[2] * (1.0 + 1e-3):
        flags |= OUT_OF_MOMENTUM
    if domain[4] > 0.0 and hits > 1:
        flags |= NOT_VIRGIN
    if obliquity > domain[5]:
        flags |= OBLIQUE
    return flags


@compiled
def touch(t: Any, qd: Any, h: float) -> float:
    """Renew the contact set from the search; latch, share masses, exchange momentum. Returns the energy lost, J.

    Elements that no point covers any more are let go, owners and areas are renewed, new contacts begin.
    """
    count = search(t)
    let_go(t)
    fresh, hits = np.empty(count, np.int64), 0
    for c in range(count):
        slot = t.touched[c]
        m, state = t.memory[slot], t.state[slot]
        law, p, n = t.law[state[ROW]], t.p[state[ROW]], t.memory[slot, NORMAL : NORMAL + 3]
        b = t.point_body[int(t.found[slot, 2])]
        z = t.found[slot, 0]
        r = t.found[slot, 4:7]
        x, v = place(t.pose[b], r[0], r[1], r[2]), velocity(t.pose[b], r[0], r[1], r[2])
        speed = -(n[0] * v[0] + n[1] * v[1] + n[2] * v[2])
        known = state[MODE] != IDLE
        # what normal motion swept in one step; beyond it the element was entered from the side
        swept = max(1.05 * speed * h, 0.0) + 1e-6
        before = m[FORCE] if known else 0.0
        jump = z - (m[SINKAGE] if known else 0.0)
        was = m[AREA]
        m[AREA] = t.found[slot, 1]
        m[SPREAD] = z - t.found[slot, 3]
        if known:
            change_owner(t, slot, b, r, speed)
            if jump > swept and law[PLASTIC] != 0 and law[REST_STIFFNESS] == 0:
                enter_from_the_side(law, p, t.s[slot], m, z, before * m[AREA] / max(was, 1e-12))
                state[MODE] = LOADING if z >= m[LINE_Z] else UNLOADING
        for k in range(3):
            m[PLACE + k] = x[k]
        m[SINKAGE] = z
        if not known:
            for k in range(3):
                m[OWNER_R + k] = r[k]
                m[SHEAR + k] = 0.0
            state[BODY] = b
            state[HITS] += 1
            acceleration = depth_acceleration(t.pose[b], r, n)
            start = max(z - swept, rut_depth(m))
            # v_s at the surface, not up to a step later: K_b1 grows with its 18.7th power
            latched = math.sqrt(max(speed * abs(speed) - 2.0 * acceleration * min(z - start, swept), 0.0))
            m[TOUCH_SPEED] = latched
            m[MASS_B] = 0.0
            total = math.sqrt(v[0] * v[0] + v[1] * v[1] + v[2] * v[2])
            angle = math.acos(min(max(speed / total, -1.0), 1.0)) if total > 1e-9 else 0.0
            t.found[slot, 1], t.found[slot, 2] = start, angle
            m[FORCE] = 0.0
            t.active[t.counts[ACTIVE]] = slot
            fresh[hits] = t.counts[ACTIVE]
            hits += 1
            t.counts[ACTIVE] += 1
        t.found[slot, 0] = 0.0
    if hits == 0:
        return 0.0
    share = np.zeros(hits)
    share_mass(t, fresh, hits, share)
    moving = False
    for k in range(hits):
        slot = t.active[fresh[k]]
        begin_contact(t, slot, share[k])
        moving = moving or t.memory[slot, MASS_B] > 0.0
    return exchange(t, fresh, hits, qd) if moving else 0.0


@compiled
def begin_contact(t: Any, slot: int, share: float) -> None:
    """Start an element's memory for this touch with the law's mass; its flags, its event."""
    m, state = t.memory[slot], t.state[slot]
    row = state[ROW]
    soil = t.soil[row]
    speed, start, angle = m[TOUCH_SPEED], t.found[slot, 1], t.found[slot, 2]
    rule = soil[MASS_RULE]
    mass = soil[MASS_GIVEN] if rule == RULE_REFERENCE else share * REFERENCE_AREA / max(m[AREA], 1e-12)
    if rule == RULE_CLAMPED and speed > 0.0:
        mass = min(mass, soil[MOMENTUM_MOST] / speed)
    begin(t.law[row], t.p[row], t.s[slot], m, state, mass, start)
    state[FLAGS] = domain_flags(t.domain[row], speed, mass, angle, state[HITS])
    note_event(t, TOUCH, state[BODY], (m[PLACE], m[PLACE + 1], m[PLACE + 2]), speed)

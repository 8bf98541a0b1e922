"""Compiled: how the contacts with elements begin, are renewed and end."""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from ground.compiled import compiled, leaf
from ground.kernel import (
    AREA,
    BODY,
    FLAGS,
    FORCE,
    GROWING,
    HITS,
    IDLE,
    LINE_Z,
    LOADING,
    MASS_B,
    MODE,
    NEAR,
    NORMAL,
    OWNER_R,
    PLACE,
    PLASTIC,
    PLOUGHED,
    REST_STIFFNESS,
    ROW,
    SHEAR,
    SHEARED,
    SINKAGE,
    SPREAD,
    TOUCH_SPEED,
    UNLOADING,
    begin,
    enter_from_the_side,
    rut_depth,
)
from ground.law import REFERENCE_AREA
from rollover.kernels.broad_phase import search
from rollover.kernels.impact import exchange, share_mass
from rollover.kernels.tables import (
    ACTIVE,
    EVENTS,
    MASS_GIVEN,
    MASS_RULE,
    MEMORYLESS,
    MOMENTUM_MOST,
    NOT_VIRGIN,
    OBLIQUE,
    OUT_OF_MOMENTUM,
    OUT_OF_SPEED,
    RULE_CLAMPED,
    RULE_REFERENCE,
    SOIL,
    TOUCH,
)
from rollover.kernels.vectors import depth_acceleration, place, velocity


@leaf
def note_event(t: Any, kind: int, subject: int, x: Any, value: float) -> None:
    """Append to the events of this step; a full list drops the rest (the caller empties it every step)."""
    e = t.counts[EVENTS]
    if e < t.event.shape[0]:
        t.event[e, 0], t.event[e, 1] = kind, subject
        for k in range(3):
            t.event[e, 2 + k] = x[k]
        t.event[e, 5] = value
        t.counts[EVENTS] = e + 1


@leaf
def drop_mass(t: Any, slot: int) -> None:
    """Let an element's co-moving mass go; its kinetic energy stays in the soil."""
    m, b = t.memory[slot], t.state[slot, BODY]
    if m[MASS_B] > 0.0:
        v = velocity(t.pose[b], m[OWNER_R], m[OWNER_R + 1], m[OWNER_R + 2])
        speed = m[NORMAL] * v[0] + m[NORMAL + 1] * v[1] + m[NORMAL + 2] * v[2]
        t.work[SOIL] += 0.5 * m[MASS_B] * speed * speed
        m[MASS_B] = 0.0
    m[GROWING] = 0.0


@leaf
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


@leaf
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
                t.memory[slot, SINKAGE] = t.memory[slot, LINE_Z] = 0.0  # no rut stays
        else:
            t.active[kept] = slot
            kept += 1
    t.counts[ACTIVE] = kept


@leaf
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
        if renew(t, slot, h):
            t.active[t.counts[ACTIVE]] = slot
            fresh[hits] = t.counts[ACTIVE]
            hits += 1
            t.counts[ACTIVE] += 1
        t.found[slot, 0] = 0.0
    if hits == 0:
        return 0.0
    share = np.zeros(hits)
    asked, moving = False, False
    for k in range(hits):
        soil = t.soil[t.state[t.active[fresh[k]], ROW]]
        asked = asked or soil[MEMORYLESS] == 0.0 or soil[MASS_RULE] != RULE_REFERENCE
    if asked:
        share_mass(t, fresh, hits, share)
    for k in range(hits):
        slot = t.active[fresh[k]]
        begin_contact(t, slot, share[k])
        moving = moving or t.memory[slot, MASS_B] > 0.0
    return exchange(t, fresh, hits, qd) if moving else 0.0


@leaf
def renew(t: Any, slot: int, h: float) -> bool:
    """Sinkage, area and owner of an element as the search found them; whether its contact is new, and then latched."""
    m, state, f = t.memory[slot], t.state[slot], t.found[slot]
    law, p, n = t.law[state[ROW]], t.p[state[ROW]], m[NORMAL : NORMAL + 3]
    b, z, r = t.point_body[int(f[2])], f[0], f[4:7]
    if t.soil[state[ROW], MEMORYLESS] > 0.0:
        z = f[3]  # a single point, which may still be above the ground
    x, v = place(t.pose[b], r[0], r[1], r[2]), velocity(t.pose[b], r[0], r[1], r[2])
    speed = -(n[0] * v[0] + n[1] * v[1] + n[2] * v[2])
    known = state[MODE] != IDLE
    # what normal motion swept in one step; beyond it the element was entered from the side
    swept = max(1.05 * speed * h, 0.0) + 1e-6
    was, jump = m[AREA], z - m[SINKAGE]
    m[AREA], m[SPREAD] = f[1], z - f[3]
    if known:
        change_owner(t, slot, b, r, speed)
        if jump > swept and law[PLASTIC] != 0 and law[REST_STIFFNESS] == 0:
            enter_from_the_side(law, p, t.s[slot], m, z, m[FORCE] * m[AREA] / max(was, 1e-12))
            state[MODE] = LOADING if z >= m[LINE_Z] else UNLOADING
    for k in range(3):
        m[PLACE + k] = x[k]
    m[SINKAGE] = z
    if known:
        return False
    latch(t, slot, b, speed, swept, z)
    return True


@leaf
def latch(t: Any, slot: int, b: int, speed: float, swept: float, z: float) -> None:
    """What a new contact with body b keeps of its touch: place, speed at the surface, start, angle of the way in."""
    m, state, f = t.memory[slot], t.state[slot], t.found[slot]
    n, r = m[NORMAL : NORMAL + 3], f[4:7]
    for k in range(3):
        m[OWNER_R + k] = r[k]
        m[SHEAR + k] = 0.0
    m[SHEARED] = m[PLOUGHED] = 0.0
    state[BODY] = b
    acceleration = depth_acceleration(t.pose[b], r, n)
    start = max(z - swept, rut_depth(m))
    # v_s at the surface, not up to a step later: K_b1 grows with its 18.7th power
    m[TOUCH_SPEED] = math.sqrt(max(speed * abs(speed) - 2.0 * acceleration * min(z - start, swept), 0.0))
    m[MASS_B] = m[FORCE] = 0.0
    v = velocity(t.pose[b], r[0], r[1], r[2])
    total = math.sqrt(v[0] * v[0] + v[1] * v[1] + v[2] * v[2])
    angle = math.acos(min(max(speed / total, -1.0), 1.0)) if total > 1e-9 else 0.0
    f[1], f[2] = start, angle


@leaf
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
    state[FLAGS] = domain_flags(t.domain[row], speed, mass, angle, state[HITS] + 1)
    if soil[MEMORYLESS] > 0.0 and m[SINKAGE] <= 0.0:
        state[MODE] = NEAR
    else:
        meet(t, slot)


@leaf
def meet(t: Any, slot: int) -> None:
    """Count a touch, and make it an event."""
    m, state = t.memory[slot], t.state[slot]
    state[HITS] += 1
    note_event(t, TOUCH, state[BODY], (m[PLACE], m[PLACE + 1], m[PLACE + 2]), m[TOUCH_SPEED])

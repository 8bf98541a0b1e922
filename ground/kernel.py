"""The compiled inner loop over touched elements: force to be tried, memory to be committed.

An element that is in contact moves with the vehicle's point above it (restitution 0, no separation while it is
loaded), so its sinkage and sinkage rate are the point's and its mass goes into the vehicle's mass matrix.
`normal_force` and `friction_force` are pure; only `commit` and `commit_friction` write.

Memory of an element, one row of `memory` each; forces there are per reference area, so that a contact area
that grows or shrinks only multiplies them.
"""

from __future__ import annotations

import math
from typing import Any

from ground.compiled import call_advance, call_begin, call_force, inlined, leaf
from ground.law import BRANCH, MASS, REFERENCE_AREA, SPEED

# columns of memory (float)
SINKAGE = 0  # deepest point's z at the last commit, m
LINE_Z = 1  # deepest sinkage so far: where the unloading line starts, m
LINE_F = 2  # force there, N per reference area
LINE_K = 3  # K_u, N/m per reference area
LINE_C = 4  # dashpot of the unloading line, N s/m per reference area
AREA = 5  # contact area now, m2
MASS_B = 6  # co-moving mass m_b1, kg
SHEAR = 7  # 7, 8, 9: shear displacement since the last slip, world axes, m
PLACE = 10  # 10, 11, 12: that centroid at the last commit, world, m
OWNER_R = 13  # 13, 14, 15: centroid of the covered area in its body's axes about its centre of mass, m
NORMAL = 16  # 16, 17, 18: unit normal of the undisturbed surface, world, up
OFFSET = 19  # normal . (a point of the undisturbed surface), m
FORCE = 20  # normal force at the start of the step, N
FRICTION = 21  # 21, 22, 23: friction force at the start of the step, N
TOUCH_SPEED = 24  # latched normal impact speed, m/s
SPREAD = 25  # how far the mean of the covered area stands above its deepest point, m
GROWING = 26  # 1 while the co-moving mass may still grow with depth
SHEARED = 27  # shear displacement j since the touch, of ground that shears, m
PLOUGHED = 28  # passive earth pressure that it takes to push the soil ahead aside, N; frozen for a step
COLUMNS = 29

# columns of state (int)
# which element, body above it, mode, domain flags, touches so far, row of its law and friction
CELL, BODY, MODE, FLAGS, HITS, ROW = 0, 1, 2, 3, 4, 5
STATE_COLUMNS = 6
IDLE, LOADING, UNLOADING = 0, 1, 2
NEAR = 3  # of memoryless ground: a point that should reach it within the step

# columns of the law's settings
PLASTIC, REST_STIFFNESS, ADDRESS_FORCE, ADDRESS_ADVANCE, ADDRESS_BEGIN = 0, 1, 2, 3, 4
EFFECTS = 5  # where the effects' numbers begin in p, behind those of the law
TERMS = 6  # how many compiled force terms there are; their addresses follow

# places of the effects' numbers, from law[EFFECTS] on; forces are per reference area
DAMPING, DAMPING_EXPONENT = 0, 1  # d, N (s/m)^zeta, and zeta
PER_DECADE, SLOW = 2, 3  # lambda, and the rate below which there is no hardening, m/s
DRAG = 4  # 1/2 C rho A, N s2/m2
GROWTH = 5  # dm_b1/dz, kg/m
RECOVERY, REBOUND_DAMPING = 6, 7  # least share that springs back; dashpot of the unloading line over critical
ADHESION, REACH = 8, 9  # pull-off force, N; gap over which it fades, m
LAYER_DEPTH, LAYER_RATIO, CRUST_DEPTH, CRUST_RATIO = 10, 11, 12, 13
STIFFNESS = 14  # factor on the law
GROWTH_END, FADE = 15, 16  # sinkage at which the growth ends, and over which it dies out behind, m
LAYER_ONSET = 17  # 0: a layer's force leaps at its top; 1: it sets in there with nothing
LAYER_WIDTH, CRUST_WIDTH = 18, 19  # over which the ratio changes at their edge, m; 0: at once
LAYER_SPRING = 20  # a layer's own stiffness, added from its top on, N/m
PROPORTION, POWER = 21, 22  # J of a resistance that adds J v times itself, s/m; beta of one that goes by (v/v_0)^beta
SLOWEST = 23  # rate below which that power goes no further, m/s
CLINGS = 24  # 1: the soil that moves along stays on the face when it lifts off, and is not hit anew
CRUST_REMAINS = 25  # share of what a crust adds at its end that stays below it
UNLOADING_STIFFNESS, UNLOADING_GROWTH = 26, 27  # k_0, N/m, and A_u, N/m2, of a law with a line of its own; 0: recovery
EFFECT_PLACES = 28  # numbers of the compiled terms follow, TERM_PLACES for each
TERM_PLACES = 8

DOUBLED, HALVED = 12, 50  # times, of the way from a rut to where its line meets another curve
SAME = 1e-10  # m: sinkages closer than this are one, so that rounding does not switch a loaded element to its line

# outcomes of a commit, as bits
BRANCHED, ARRESTED, RELEASED, MET = 1, 2, 4, 8


@inlined
def passed(z: float, edge: float, width: float) -> float:
    """How far sinkage z has passed an edge of some width, 0 before to 1 behind: u^2 (3 - 2 u)."""
    u = min(max((z - edge) / width + 0.5, 0.0), 1.0)
    return u * u * (3.0 - 2.0 * u)


@inlined
def loading_force(law: Any, p: Any, s: Any, z: float, v: float) -> float:
    """The law's loading curve with the effects that act on it, N per reference area; rates count on the way down.

    F = (r(z) F_law + k_h (z - h)) (1 + lambda log10(v/v_0)) (v/v_0)^beta (1 + J v) + d v^zeta + 1/2 C rho A v^2
    + terms, r the ratio of crust and layer, k_h what a layer below h has of its own; the ratio of a layer counts for
    the sinkage beyond its onset alone, that of a crust, below it, for what of its thickness remains. Where an edge has
    a width, r changes over that.
    """
    e = law[EFFECTS]
    f = p[e + STIFFNESS] * call_force(law[ADDRESS_FORCE], (p.ctypes, s.ctypes, z, v))
    if p[e + CRUST_WIDTH] > 0.0:
        gone = passed(z, p[e + CRUST_DEPTH], p[e + CRUST_WIDTH])
        gone *= 1.0 - p[e + CRUST_REMAINS] * p[e + CRUST_DEPTH] / max(z, p[e + CRUST_DEPTH])
        f *= 1.0 + (p[e + CRUST_RATIO] - 1.0) * (1.0 - gone)
    elif z < p[e + CRUST_DEPTH]:
        f *= p[e + CRUST_RATIO]
    elif p[e + CRUST_REMAINS] != 0.0:
        f *= 1.0 + (p[e + CRUST_RATIO] - 1.0) * p[e + CRUST_REMAINS] * p[e + CRUST_DEPTH] / z
    if p[e + LAYER_WIDTH] > 0.0:
        spared = p[e + LAYER_ONSET] * p[e + LAYER_DEPTH] / max(z, p[e + LAYER_DEPTH])
        f *= 1.0 + (p[e + LAYER_RATIO] - 1.0) * (1.0 - spared) * passed(z, p[e + LAYER_DEPTH], p[e + LAYER_WIDTH])
    elif z > p[e + LAYER_DEPTH]:
        if p[e + LAYER_ONSET] == 0.0:
            f *= p[e + LAYER_RATIO]
        else:
            f *= 1.0 + (p[e + LAYER_RATIO] - 1.0) * (1.0 - p[e + LAYER_ONSET] * p[e + LAYER_DEPTH] / z)
    if p[e + LAYER_SPRING] != 0.0 and z > p[e + LAYER_DEPTH]:
        f += p[e + LAYER_SPRING] * (z - p[e + LAYER_DEPTH])
    if p[e + POWER] != 0.0:
        f *= (max(v, p[e + SLOWEST]) / p[e + SLOW]) ** p[e + POWER]
    if v > 0.0:
        if v > p[e + SLOW] and p[e + PER_DECADE] != 0.0:
            f *= 1.0 + p[e + PER_DECADE] * math.log10(v / p[e + SLOW])
        if p[e + PROPORTION] != 0.0:
            f *= 1.0 + p[e + PROPORTION] * v
        if p[e + DAMPING] != 0.0:
            f += p[e + DAMPING] * v ** p[e + DAMPING_EXPONENT]
        f += p[e + DRAG] * v * v
    for k in range(law[TERMS]):
        own = p[e + EFFECT_PLACES + TERM_PLACES * k :]
        f += call_force(law[TERMS + 1 + k], (own.ctypes, s.ctypes, z, v))
    return f  # type: ignore[no-any-return]


@inlined
def springs_back(law: Any, p: Any) -> float:
    """Share of the deepest sinkage that springs back: the law's own, or that of the rebound effect if it is more."""
    return max(p[0], p[law[EFFECTS] + RECOVERY])  # type: ignore[no-any-return]


@inlined
def growth(law: Any, p: Any, z: float) -> float:
    """How fast the co-moving mass grows at sinkage z, over how it grows before the end: exp(-(z - end)/fade) behind."""
    beyond, fade = z - p[law[EFFECTS] + GROWTH_END], p[law[EFFECTS] + FADE]
    if beyond < 0.0:
        return 1.0
    return math.exp(-beyond / fade) if fade > 0.0 else 0.0


@inlined
def grown(law: Any, p: Any, z: float) -> float:
    """Sinkage at which the mass would be as large, had it grown evenly: the integral of `growth`, m."""
    end, fade = p[law[EFFECTS] + GROWTH_END], p[law[EFFECTS] + FADE]
    if z <= end:
        return z
    return end - fade * math.expm1((end - z) / fade) if fade > 0.0 else end  # type: ignore[no-any-return]


@inlined
def normal_force(law: Any, p: Any, s: Any, row: Any, z: float, v: float) -> float:
    """Spring force of one element at sinkage z and rate v, N: a pull only from adhesion; memory is only read.

    z is that of the deepest point; the law is asked once, at the mean of the covered area (midpoint rule).
    Loading follows the law; below the deepest sinkage the line of stiffness K_u with its dashpot, capped by
    the loading curve at the line's start.
    """
    if z <= 0.0:
        return 0.0
    if law[PLASTIC] == 0 or z >= row[LINE_Z] - SAME:
        f = max(loading_force(law, p, s, max(z - row[SPREAD], 0.0), v), 0.0)
        if v > 0.0 and row[GROWING] != 0.0 and row[LINE_Z] - SAME <= z:
            # soil set moving takes its momentum, d(m_b1)/dt v
            f += growth(law, p, z) * p[law[EFFECTS] + GROWTH] * v * v
    else:
        f = min(line_force(row, z, v), row[LINE_F])
        pull = p[law[EFFECTS] + ADHESION]
        if pull > 0.0 or p[law[EFFECTS] + CLINGS] != 0.0:
            gap = rut_depth(row) - z
            if gap > 0.0:
                f = min(f, 0.0)
                pull *= max(1.0 - gap / p[law[EFFECTS] + REACH], 0.0)
        f = max(f, 0.0 - pull)
    return f * row[AREA] / REFERENCE_AREA  # type: ignore[no-any-return]


@inlined
def line_force(row: Any, z: float, v: float) -> float:
    """Force of the unloading line and its dashpot, N per reference area, before it is capped at either end."""
    return row[LINE_F] - row[LINE_K] * (row[LINE_Z] - z) + row[LINE_C] * v  # type: ignore[no-any-return]


@inlined
def lets_go(law: Any, p: Any, row: Any) -> float:
    """Sinkage at which an unloaded element lets go, m: its rut less adhesion's reach; the surface if soil clings."""
    if p[law[EFFECTS] + CLINGS] != 0.0:
        return 0.0
    if p[law[EFFECTS] + ADHESION] > 0.0:
        return max(rut_depth(row) - p[law[EFFECTS] + REACH], 0.0)  # type: ignore[no-any-return]
    return rut_depth(row)


@inlined
def rut_depth(row: Any) -> float:
    """Sinkage below which the unloaded element gives no force: the rut that stays, m."""
    if row[LINE_K] <= 0.0:
        return 0.0
    return max(row[LINE_Z] - row[LINE_F] / row[LINE_K], 0.0)  # type: ignore[no-any-return]


@inlined
def steepness(law: Any, p: Any, f: float, z: float) -> float:
    """K_u of the line of unloading from (z, f), N/m: k_0 + A_u z of the law, never below the secant, or by recovery.

    An effect that lets more spring back than the law's own line does takes its place.
    """
    k, grows = p[law[EFFECTS] + UNLOADING_STIFFNESS], p[law[EFFECTS] + UNLOADING_GROWTH]
    if k > 0.0 or grows > 0.0:
        own, rebound = max(k + grows * z, f / z), p[law[EFFECTS] + RECOVERY]
        return min(own, f / (rebound * z)) if rebound > 0.0 else own  # type: ignore[no-any-return]
    return f / (springs_back(law, p) * z)


@leaf
def set_line(law: Any, p: Any, s: Any, row: Any, z: float) -> None:
    """Start the unloading line at (z, F(z)) with K_u = K'(z)/recovery."""
    f = loading_force(law, p, s, max(z - row[SPREAD], 0.0), 0.0)
    row[LINE_Z] = z
    row[LINE_F] = f
    row[LINE_K] = steepness(law, p, f, z) if z > 0.0 else 0.0


@leaf
def meet_again(law: Any, p: Any, s: Any, row: Any) -> None:
    """Let the line of a rut end where it meets the loading curve of another hit: K_u (z - z_r) = F(z).

    The ground learns of the new hit's speed where it yields anew, not before.
    """
    if row[LINE_K] <= 0.0:
        set_line(law, p, s, row, row[LINE_Z])
        return
    rut = rut_depth(row)
    low, high = rut, row[LINE_Z]
    for _ in range(DOUBLED):
        if row[LINE_K] * (high - rut) >= loading_force(law, p, s, max(high - row[SPREAD], 0.0), 0.0):
            break
        low, high = high, rut + 2.0 * (high - rut)
    for _ in range(HALVED):
        middle = 0.5 * (low + high)
        if row[LINE_K] * (middle - rut) >= loading_force(law, p, s, max(middle - row[SPREAD], 0.0), 0.0):
            high = middle
        else:
            low = middle
    row[LINE_Z], row[LINE_F] = high, row[LINE_K] * (high - rut)


@leaf
def set_rest_line(row: Any, mass: float) -> None:
    """(6) read literally, K_b3 = 9.81 m_s / z_p,max: a secant through the origin, so the force drops to the weight."""
    if row[LINE_Z] > 0.0:
        row[LINE_K] = 9.81 * mass * REFERENCE_AREA / row[AREA] / row[LINE_Z]
        row[LINE_F] = row[LINE_K] * row[LINE_Z]


@leaf
def enter_from_the_side(law: Any, p: Any, s: Any, row: Any, z: float, force: float) -> None:
    """Let a sinkage that was not swept by normal motion begin on the reloading line with `force` (N).

    A member that slides into an element pushes its soil aside: the element's work was not done, so its force
    must not be there at once. It climbs K_u to the loading curve as the member sinks further.
    """
    per_reference = force * REFERENCE_AREA / max(row[AREA], 1e-12)
    f = loading_force(law, p, s, max(z - row[SPREAD], 0.0), 0.0)
    if f <= per_reference or z <= 0.0:
        return
    row[LINE_K] = steepness(law, p, f, z)
    row[LINE_Z] = z + (f - per_reference) / row[LINE_K]
    row[LINE_F] = f
    row[LINE_C] = 0.0


@leaf
def commit(law: Any, p: Any, s: Any, row: Any, state: Any, z: float, v: float, h: float, mass: float) -> int:
    """Accept a step that ended at (z, v): move the deepest point, turn round, or let go. Returns outcome bits.

    `mass` (kg) is the share of the effective mass above the element; it only enters the literal eq (6).
    """
    outcome = 0
    before = row[SINKAGE]
    row[SINKAGE] = z
    if law[ADDRESS_ADVANCE] != 0:
        # the mean rate makes a law's own states second order in the step
        call_advance(law[ADDRESS_ADVANCE], (p.ctypes, s.ctypes, max(z - row[SPREAD], 0.0), (z - before) / h, h))
    if row[GROWING] != 0.0 and z > row[LINE_Z]:
        swept = max(grown(law, p, z) - grown(law, p, row[LINE_Z]), 0.0)
        row[MASS_B] += p[law[EFFECTS] + GROWTH] * row[AREA] / REFERENCE_AREA * swept
        if law[PLASTIC] == 0:
            row[LINE_Z] = z  # how far it has grown; no line starts there
    if law[PLASTIC] == 0:
        if z <= 0.0:
            outcome |= RELEASED
        elif state[MODE] == NEAR:
            state[MODE] = LOADING
            outcome |= MET
        return outcome
    if z > row[LINE_Z]:
        if state[MODE] == LOADING and before < s[BRANCH] <= z:
            outcome |= BRANCHED
        state[MODE] = LOADING
        set_line(law, p, s, row, z)
    if state[MODE] == LOADING and v <= 0.0:
        state[MODE] = UNLOADING
        row[LINE_C] = 0.0  # a new line asks for its dashpot
        outcome |= ARRESTED
        if law[REST_STIFFNESS] != 0:
            set_rest_line(row, mass)
    if z <= lets_go(law, p, row) and v <= 0.0:
        outcome |= RELEASED
    return outcome


@leaf
def begin(law: Any, p: Any, s: Any, row: Any, state: Any, mass: float, start: float) -> None:
    """Start an element's memory for a touch at TOUCH_SPEED: latched terms, and where the unloading line starts.

    `mass` (kg) is m_s of the law, `start` (m) the sinkage from which normal motion swept the element.
    """
    s[:] = 0.0
    s[SPEED] = row[TOUCH_SPEED]
    s[MASS] = mass
    s[BRANCH] = math.inf
    if law[ADDRESS_BEGIN] != 0:
        call_begin(law[ADDRESS_BEGIN], (p.ctypes, s.ctypes))
    state[MODE] = LOADING
    row[GROWING] = 1.0 if p[law[EFFECTS] + GROWTH] > 0.0 else 0.0
    if law[PLASTIC] != 0:
        if row[LINE_Z] > 0.0 and law[REST_STIFFNESS] == 0:
            meet_again(law, p, s, row)
        if start > rut_depth(row) + 1e-6 and start > row[LINE_Z] * (1.0 - 1e-9):
            enter_from_the_side(law, p, s, row, start, 0.0)
        if row[SINKAGE] < row[LINE_Z]:
            state[MODE] = UNLOADING


@leaf
def friction_force(
    mu: float, stick: float, relaxation: float, force: float, shear: Any, moved: Any, v: Any, n: Any
) -> Any:
    """F_t = -mu F_n (d + tau v_t)/d_s, |F_t| <= mu F_n; d = committed shear plus what has moved since.

    Vectors are in world axes; only their parts along the surface of normal n count. Returns three components.
    """
    if mu <= 0.0 or force <= 0.0:
        return 0.0, 0.0, 0.0
    x = shear[0] + moved[0] + relaxation * v[0]
    y = shear[1] + moved[1] + relaxation * v[1]
    z = shear[2] + moved[2] + relaxation * v[2]
    along = x * n[0] + y * n[1] + z * n[2]
    x, y, z = x - along * n[0], y - along * n[1], z - along * n[2]
    factor = -mu * force / max(math.sqrt(x * x + y * y + z * z), stick)
    return factor * x, factor * y, factor * z


@leaf
def commit_friction(stick: float, shear: Any, moved: Any, n: Any) -> None:
    """Add what has moved to the shear displacement and cut it at d_s: the rest was slip."""
    x, y, z = shear[0] + moved[0], shear[1] + moved[1], shear[2] + moved[2]
    along = x * n[0] + y * n[1] + z * n[2]
    x, y, z = x - along * n[0], y - along * n[1], z - along * n[2]
    size = math.sqrt(x * x + y * y + z * z)
    factor = stick / size if size > stick else 1.0
    shear[0], shear[1], shear[2] = factor * x, factor * y, factor * z

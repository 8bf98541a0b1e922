"""The tables that the compiled kernels share: constants of the vehicle and the ground, and their memory.

One named tuple of plain arrays, so that a kernel is handed everything in one argument. Bodies are rows of
`pose`; their generalised coordinates are [position of the centre of mass (world), rotation vector], their
velocities [velocity (world), angular velocity (body axes)], as Exudyn's NodeRigidBodyRotVecLG has them.
Body axes are parallel to the vehicle's axes in the design position; points are given about the centre of mass.
"""

from __future__ import annotations

from typing import Any, NamedTuple

from ground.compiled import StructRefProxy, StructType, compiled, define_proxy, register

# columns of pose
X, ROT, VEL, OMEGA, ACC, ALPHA, POSE_COLUMNS = 0, 3, 12, 15, 18, 21, 24

# columns of wheel_f
W_CENTRE, W_AXIS, W_RADIUS, W_HALF, W_CROWN, W_KZ, W_KY, W_C, W_MU, W_ROLLS = 0, 3, 6, 7, 8, 9, 10, 11, 12, 13
# deflection at which the rim bottoms and the stiffness that it adds; stiffness flat on the side over k_y, 0: rigid
W_BOTTOM, W_KB, W_SIDE, WHEEL_COLUMNS = 14, 15, 16, 17
# columns of wheel_memory: anchor of the stick spring in the carrier's axes, its place and shear; then what was found
# at the start of the step (depth, normal force, damping force, elastic energy, friction) and what is found now
E_ANCHOR, E_PLACE, E_SHEAR, E_DEPTH, E_FORCE, E_DAMPING, E_ENERGY, E_FRICTION = 0, 3, 6, 9, 10, 11, 12, 13
E_DEPTH_NOW, E_FORCE_NOW, E_DAMPING_NOW, E_ENERGY_NOW, E_FRICTION_NOW = 16, 17, 18, 19, 20
# way of the anchor since the start of the step and what of it strains the spring; the tread's lowest point in the
# carrier's axes and in the world
E_MOVED, E_SLIP, E_POINT, E_WHERE = 23, 26, 29, 32
# normal of the ground under the tread at the start of the step and now; how far the pressure's centre lies within the
# ring and cosine of the camber, at the start of the step and now
E_NORMAL, E_NORMAL_NOW, E_INWARD, E_COSINE, E_INWARD_NOW, E_COSINE_NOW, EDGE_COLUMNS = 35, 38, 41, 42, 43, 44, 45

# columns of spin_f: inertia about the axle, limit of the brake's torque, whether the drive turns this wheel,
# whether the brake holds it against the ground instead of its carrier, whether it has a brake, whether it is steered
P_INERTIA, P_BRAKE, P_DRIVEN, P_HELD, P_BRAKED, P_STEERED, SPIN_COLUMNS = 0, 1, 2, 3, 4, 5, 6
# columns of spin_memory: angle, torque and strain of the brake at the start of the step; angle, rate and torque now
P_ANGLE, P_TORQUE, P_STRAIN, P_ANGLE_NOW, P_RATE_NOW, P_TORQUE_NOW = 0, 1, 2, 3, 4, 5
# torque of the ground that holds it and its rate spin + omega . e, at the start of the step and now
P_HOLD, P_ABSOLUTE, P_HOLD_NOW, P_ABSOLUTE_NOW, SPIN_MEMORY = 6, 7, 8, 9, 10
# places in drive: torque that the engine may give now, rate at which it gives none any more, stiffness and damping
# of a locked axle
D_TORQUE, D_RATE, D_STIFFNESS, D_DAMPING, DRIVES = 0, 1, 2, 3, 4

# columns of mount_f, mounts of the ROPS and its hinges alike: point on body b, on body a; then for the six axes (along
# x, y, z of body a, about them) stiffness, damping, yield, hardening, play, rate D of the rate factor as a speed (0: no
# factor); its exponent q; whether it may turn far
T_B, T_A, T_K, T_C, T_YIELD, T_HARD, T_PLAY, T_RATE, T_Q, T_FAR, MOUNT_COLUMNS = 0, 3, 6, 12, 18, 24, 30, 36, 42, 43, 44
# columns of mount_memory, each for the six axes: permanent set, plastic way, deflection and force at the start of the
# step; the same now
S_SET, S_FLOWED, S_DELTA, S_FORCE, S_SET_NOW, S_FLOWED_NOW, S_DELTA_NOW, S_FORCE_NOW = 0, 6, 12, 18, 24, 30, 36, 42
BLOCK = 32  # points that one box stands for; looking at it costs as much as looking at two of them
SET_COLUMNS = 48

# columns of approach: bound of what any point of a body has sunk by since the first search, distance of its boxes from
# its centre of mass; depth of its centre below the plane and the plane's normal in its axes at the last search
L_WAY, L_FAR, L_BASE, L_DOWN, APPROACH_COLUMNS = 0, 1, 2, 3, 6

# columns of axle_f and axle_memory
A_SWING, A_K, A_C, A_IMPACT, A_RESTITUTION, AXLE_COLUMNS = 0, 1, 2, 3, 4, 5
# angle and torque at the start of the step and now; whether the next touch of a stop is an impact, the angle at which
# the last one was, and the angular impulse of all
M_ANGLE, M_TORQUE, M_ANGLE_NOW, M_TORQUE_NOW, M_FREE, M_REACH, M_IMPULSE, AXLE_MEMORY = 0, 1, 2, 3, 4, 5, 6, 7

# rows of joint_i: kind, body a, body b (or -1); columns of joint_f: point on a, point on b, about the centres of mass
PIVOT, GUIDE = 0, 1

# places in soil
MU, STICK, RELAXATION, FRACTION, MASS_RULE, MASS_GIVEN, MOMENTUM_MOST = 0, 1, 2, 3, 4, 5, 6
# 1: the ground remembers nothing and nothing of it moves along: each point of a body is a contact of its own
MEMORYLESS = 7
# of soil that shears: c, Pa, and K, m, 0 for Coulomb friction; `MU` is tan(phi)
COHESION, MODULUS = 8, 9
# of soil that is pushed aside: A, N/m3, and B, N/m2, of a force for each width F/b = A z^2 + B z; 0: it is not
PLOUGH_SQUARE, PLOUGH_LINEAR, SOIL_COLUMNS = 10, 11, 12
RULE_REFERENCE, RULE_EFFECTIVE, RULE_CLAMPED = 0, 1, 2

# places in counts
SLOTS, ACTIVE, EVENTS, OUTSIDE, FLAGS_NOW, COUNTS = 0, 1, 2, 3, 4, 5

# places in work (J taken from the vehicle since the start)
SOIL, TYRE, ROPS, FRICTION_WORK, COLLISION, AXLE, DEVICE, LASHING = 0, 1, 2, 3, 4, 5, 6, 7
EXTRA_WORK, DRIVE, INPUT, OCCUPANT, HITCH, SUSPENSION, WORKS = 8, 9, 10, 11, 12, 13, 14

# columns of trial: what the last evaluation found for each active element
Z, ZDOT, FN, FT, MOVED, TRIAL_COLUMNS = 0, 1, 2, 3, 6, 9

# columns of resultant, one row for each body: normal contact force, friction force (world), point, weight, impulse
R_NORMAL, R_TANGENT, R_POINT, R_WEIGHT, R_IMPULSE, RESULTANT_COLUMNS = 0, 3, 6, 9, 10, 13

# places in device_out
O_FORCE, O_DEFLECTION, O_ENERGY, O_POINT, O_WAY, OUT_COLUMNS = 0, 1, 2, 3, 6, 9

# columns of event: time is added by the caller
EV_KIND, EV_SUBJECT, EV_PLACE, EV_VALUE, EVENT_COLUMNS = 0, 1, 2, 5, 6
TOUCH, BRANCH_CHANGE, TURN, WHEEL_OFF, WHEEL_ON, AXLE_STOP, HINGE, AXLE_BLOW, EVENT_KINDS = 0, 1, 2, 3, 4, 5, 6, 7, 8

# bits of an element's domain flags, and their names
OUT_OF_SPEED, OUT_OF_MOMENTUM, OUT_OF_AREA, NOT_VIRGIN, OBLIQUE = 1, 2, 4, 8, 16
# bits that follow from an element's law alone
UNCALIBRATED, DEEP = 1 << 16, 1 << 17
FLAG_NAMES = {
    OUT_OF_SPEED: "impact-speed",
    OUT_OF_MOMENTUM: "momentum",
    OUT_OF_AREA: "contact-area",
    NOT_VIRGIN: "second-hit",
    OBLIQUE: "oblique-impact",
}


class Tables(NamedTuple):
    """See the column names above; sizes: nb bodies, np points, nm members, nw wheels, nt mounts, ns slots, nr laws."""

    # vehicle
    mass: Any  # (6 nb, 6 nb) constant mass matrix
    inverse: Any  # (6 nb, 6 nb)
    joint_i: Any  # (nj, 3)
    joint_f: Any  # (nj, 6)
    point_r: Any  # (np, 3)
    point_n: Any  # (np, 3)
    point_a: Any  # (np,)
    point_body: Any  # (np,)
    member_f: Any  # (nm, 9) centre and half size of a box around a patch's points, normal of a flat patch or 0
    member_i: Any  # (nm, 5) body, first point, end, next member if the box is nowhere near the ground, first block
    block_f: Any  # (nk, 6) centre and half size of a box around `BLOCK` points of a patch that follow each other
    block_wake: Any  # (nk,) of a body's L_WAY at which a point of the block may be in the ground
    member_wake: Any  # (nm,) the least of a member's blocks
    approach: Any  # (nb, APPROACH_COLUMNS)
    wheel_f: Any  # (nw, WHEEL_COLUMNS)
    wheel_i: Any  # (nw,) carrier
    spin_i: Any  # (nw,) coordinate of the wheel's angle, or -1: it does not turn by itself
    spin_f: Any  # (nw, SPIN_COLUMNS)
    spin_mass: Any  # (n, n) what turning wheels add to the mass matrix; n = 6 nb + turning wheels
    drive: Any  # (DRIVES,)
    mount_f: Any  # (nt, MOUNT_COLUMNS)
    mount_i: Any  # (nt, 3) rows of body a and body b, row of the post that it is or -1: a spring on each axis
    axle_f: Any  # (AXLE_COLUMNS,) or (0,)
    axle_i: Any  # (2,) chassis and axle rows
    term_i: Any  # (ne, 3) kind, body, other body
    term_f: Any  # (ne, terms.TERM_NUMBERS)
    # ground
    law: Any  # (nr, 5) see ground.kernel; the first row is the ground's, the others are those of its patches
    p: Any  # (nr, most parameters)
    soil: Any  # (nr, SOIL_COLUMNS)
    domain: Any  # (nr, 6)
    patch_f: Any  # (nr - 1, 4) smallest and largest x, smallest and largest y
    plane: Any  # (4,) normal and offset of a flat surface; of an uneven one near the start
    relief: Any  # (parts, PART_COLUMNS) of an uneven surface, see ground.relief
    nodes: Any  # heights of its maps
    grid_f: Any  # (4,) x0, y0, dx, dy
    grid_i: Any  # (2,) nx, ny
    # memory
    slot_of: Any  # (nx ny,) int32, -1: never touched; with `MEMORYLESS` ground also one for each law and point
    memory: Any  # (ns, COLUMNS)
    state: Any  # (ns, STATE_COLUMNS)
    s: Any  # (ns, 3 + hidden)
    active: Any  # (ns,)
    trial: Any  # (ns, TRIAL_COLUMNS)
    found: Any  # (ns, 7) deepest sinkage, area, deepest point, mean sinkage, centroid (3): found by the search
    touched: Any  # (np,) slots found by the search
    candidate_i: Any  # (np, 2) slot and point
    candidate_f: Any  # (np, 2) projected area, depth
    wheel_memory: Any  # (nw, EDGE_COLUMNS)
    spin_memory: Any  # (nw, SPIN_MEMORY)
    mount_memory: Any  # (nt, SET_COLUMNS)
    axle_memory: Any  # (AXLE_MEMORY,)
    scheme: Any  # (4,) of generalised alpha: alpha_m, alpha_f, gamma; 1 if any ground is `MEMORYLESS`
    applied: Any  # (2, 3, n) see rollover.kernels.applied_forces; n = 6 nb + turning wheels
    velocity: Any  # (n,) at the start of the step
    clock: Any  # (3,) length of the step that is tried, time at which forces are tried, s; tries that the step needed
    term_memory: Any  # (ne, terms.TERM_MEMORY)
    pose: Any  # (nb, POSE_COLUMNS)
    counts: Any  # (COUNTS,)
    work: Any  # (WORKS,)
    resultant: Any  # (nb, RESULTANT_COLUMNS)
    event: Any  # (ne, EVENT_COLUMNS)
    # test stand; nd devices, none in a rollover: see rollover.kernels.stand_devices
    device_i: Any  # (nd, DEVICE_INTEGERS)
    device_f: Any  # (nd, DEVICE_COLUMNS)
    device_memory: Any  # (nd, DEVICE_MEMORY)
    device_q: Any  # (2 ACCOUNTS, 6 nb) generalised forces now, then at the start of the step
    device_x: Any  # (nb, 6) positions and angular velocities at the start of the step
    device_out: Any  # (OUT_COLUMNS,) force, deflection, energy, point, way: what is recorded
    # what is prescribed over time, see rollover.kernels.inputs; ni inputs, none until the bodies are placed
    input_i: Any  # (ni, INPUT_INTEGERS)
    input_f: Any  # (ni, INPUT_COLUMNS)
    input_memory: Any  # (ni, INPUT_MEMORY)
    input_q: Any  # (2, 6 nb) generalised forces now, then at the start of the step
    pieces: Any  # (np, PIECE_COLUMNS) of all signals
    # what holds an occupant, a trailer, a sprung wheel, see rollover.kernels.links; nl links, none without
    link_i: Any  # (nl, 5) kind, body b, body a, first place in link_out, account in work
    link_f: Any  # (nl, LINK_COLUMNS)
    link_memory: Any  # (nl, LINK_MEMORY)
    link_out: Any  # (no,) what is recorded: contact force on each part (world), straps, joints; hitch, struts
    # posts that bend, see rollover.kernels.posts; none unless a frame has segments
    post_i: Any  # (npo, 2) first section and end
    post_f: Any  # (npo, POST_COLUMNS)
    post_memory: Any  # (npo, POST_MEMORY)
    section_f: Any  # (nse, SECTION_COLUMNS)
    section_memory: Any  # (nse, SECTION_MEMORY)


@register
class TablesType(StructType):
    """The kernels' view of `Tables`: one pointer, so that a call costs half a microsecond and compiles quickly."""


class Handle(StructRefProxy):  # type: ignore[misc]
    """What kernels take as their first argument; made by `handle`, shares the arrays."""


define_proxy(Handle, TablesType, list(Tables._fields))


@compiled
def handle(t: Any) -> Any:
    """Bundle the arrays of `Tables` for the kernels; to be made again when an array is replaced."""
    return Handle(
        t.mass,
        t.inverse,
        t.joint_i,
        t.joint_f,
        t.point_r,
        t.point_n,
        t.point_a,
        t.point_body,
        t.member_f,
        t.member_i,
        t.block_f,
        t.block_wake,
        t.member_wake,
        t.approach,
        t.wheel_f,
        t.wheel_i,
        t.spin_i,
        t.spin_f,
        t.spin_mass,
        t.drive,
        t.mount_f,
        t.mount_i,
        t.axle_f,
        t.axle_i,
        t.term_i,
        t.term_f,
        t.law,
        t.p,
        t.soil,
        t.domain,
        t.patch_f,
        t.plane,
        t.relief,
        t.nodes,
        t.grid_f,
        t.grid_i,
        t.slot_of,
        t.memory,
        t.state,
        t.s,
        t.active,
        t.trial,
        t.found,
        t.touched,
        t.candidate_i,
        t.candidate_f,
        t.wheel_memory,
        t.spin_memory,
        t.mount_memory,
        t.axle_memory,
        t.scheme,
        t.applied,
        t.velocity,
        t.clock,
        t.term_memory,
        t.pose,
        t.counts,
        t.work,
        t.resultant,
        t.event,
        t.device_i,
        t.device_f,
        t.device_memory,
        t.device_q,
        t.device_x,
        t.device_out,
        t.input_i,
        t.input_f,
        t.input_memory,
        t.input_q,
        t.pieces,
        t.link_i,
        t.link_f,
        t.link_memory,
        t.link_out,
        t.post_i,
        t.post_f,
        t.post_memory,
        t.section_f,
        t.section_memory,
    )

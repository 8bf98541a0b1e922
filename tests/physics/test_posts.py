"""Posts that bend in a run: closed forms, collapse by theory, rate, energy, the frame of beams alone, overturns."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.optimize import brentq

from rollover.assessment.frame_test import frame_test
from rollover.assessment.ledger import closure
from rollover.dynamics.assembly import tables_of
from rollover.dynamics.bodies import bodies_of
from rollover.dynamics.post_rows import post_rows
from rollover.dynamics.simulate import run
from rollover.kernels import posts as k
from rollover.kernels.forces import generalised_forces
from rollover.kernels.jacobian import stiffness
from rollover.kernels.step import finish_mounts, start_step
from rollover.kernels.tables import ROPS, Tables, handle
from rollover.scenario import Scenario, load
from rollover.spec import document
from rollover.spec.rops import Rops
from rollover.spec.steel import CowperSymonds
from rollover.system.errors import InputError

Array = NDArray[np.float64]
FILE = document.shipped_folder() / "vehicles" / "rops" / "two_post_rear_tubes_3t.yaml"
FRAME = document.load(FILE, Rops)
POST = FRAME.beams[0]
H, WIDE = 1.61, 1.0
# perfectly plastic, but for what keeps a mechanism from having no stiffness
FLAT = replace(POST.material, tensile_strength=POST.material.yield_strength, rate_factor=None)
SLOW = 1e9  # s, of a step without a rate
N, F_H, F_B, T, M_B, M_H = range(6)  # of the load on a head; the shipped frame's depth is along x, its width along y


def bent(rops: Rops = FRAME, segments: int = 12, **changes: Any) -> Tables:
    """Tables of a tractor with that frame, its posts in segments; perfectly plastic where `steel` says so."""
    if (steel := changes.pop("steel", None)) is not None:
        rops = replace(rops, members=tuple(replace(b, material=steel) for b in rops.beams))
    s = load("side_overturn").replaced({"vehicle.rops": replace(rops, segments=segments, **changes)})
    return tables_of(s, bodies_of(s.vehicle, s.ground.elements))


def head(t: Tables, v: Array, h: float = SLOW, post: int = 0) -> Array:
    """Load on a post's head that goes with v (6,)."""
    k.try_load(handle(t), post, v, h, np.zeros((k.ROOM_ROWS, k.ROOM_COLUMNS)))
    return t.post_memory[post, :6].copy()


def keep(t: Tables) -> None:
    finish_mounts(handle(t))


def along(c: int, value: float) -> Array:
    v = np.zeros(6)
    v[c] = value
    return v


def test_a_post_alone_is_a_cantilever() -> None:
    """H^3/3EI, H^2/2EI, H/EI of its head, H/EA and H/GJ."""
    _, f, _ = post_rows(replace(FRAME, members=FRAME.beams[:2], segments=4))
    C = f[0, k.P_C : k.P_C + 36].reshape(6, 6)
    p, E = POST.section.properties, POST.material.youngs_modulus
    EI = E * p.second_h
    want = np.diag(
        [H / (E * p.area), *[H**3 / (3.0 * EI)] * 2, H / (POST.material.shear_modulus * p.torsion)] + 2 * [0.0]
    )
    want[[M_B, M_H], [M_B, M_H]] = H / EI
    want[F_H, M_H] = want[M_H, F_H] = H**2 / (2.0 * EI)
    want[F_B, M_B] = want[M_B, F_B] = -(H**2) / (2.0 * EI)
    assert pytest.approx(want, rel=1e-12, abs=1e-20) == C


def test_posts_under_a_rail_are_a_portal() -> None:
    """Sway 12 E I/H^3 (1 + 6 r)/(4 + 6 r) of each post; heads against each other twist half of the rail each."""
    _, f, _ = post_rows(replace(FRAME, segments=4))
    K, C = (f[0, at : at + 36].reshape(6, 6) for at in (k.P_K, k.P_C))
    p, steel = POST.section.properties, POST.material
    EI, r = steel.youngs_modulus * p.second_h, H / WIDE
    assert K[F_B, F_B] == pytest.approx(12.0 * EI / H**3 * (1.0 + 6.0 * r) / (4.0 + 6.0 * r), rel=1e-12)
    assert C[M_H, M_H] == pytest.approx(H / EI + 0.5 * WIDE / (steel.shear_modulus * p.torsion), rel=1e-12)


@pytest.mark.parametrize("rail", [(80.0, 80.0, 6.0), (50.0, 50.0, 4.0)])
def test_a_portal_collapses_by_theory(rail: Any) -> None:
    """Sideways 2 M_p/H a post, with a weak rail (M_p + M_rail)/H; lengthways, its head free to turn, M_p/H."""
    *posts, bar = FRAME.beams
    frame = replace(FRAME, members=(*posts, replace(bar, section=replace(bar.section, tube=rail))))
    t = bent(frame, 4, steel=FLAT)
    m, knee = frame.beams[0].plastic_resistance[1], frame.beams[2].plastic_resistance[2]
    assert head(t, along(F_B, 0.06))[F_B] == pytest.approx((m + min(m, knee)) / H, rel=0.01)
    t = bent(replace(FRAME, members=FRAME.beams[:2]), 4, steel=FLAT)
    v = along(F_H, 0.09)
    # the turn at which its head carries no moment
    v[M_H] = brentq(lambda turn: head(t, along(F_H, 0.09) + along(M_H, turn))[M_H], 0.0, 0.2, xtol=1e-12)
    s = head(t, v)
    assert abs(s[M_H]) < 1e-3 * m
    assert s[F_H] == pytest.approx(m / H, rel=0.01)


def test_axial_force_and_moment_share_the_foot() -> None:
    """One hinge at the foot that lengthens by e and turns by d/H: (n, m) is normal to n^2 + m^2 = 1 there."""
    t = bent(replace(FRAME, members=FRAME.beams[:2]), 4, steel=FLAT)
    force, m, _, _ = replace(POST, material=FLAT).plastic_resistance
    for d, e in ((0.05, 0.0005), (0.1, 0.001), (0.2, 0.003)):  # the last far beyond, on a straight path
        v = along(F_H, d)
        v[M_H], v[N] = d / H, e
        s = head(t, v)
        foot, way = s[M_H] + H * s[F_H], t.post_memory[0, k.P_WAY : k.P_WAY + 6].copy()
        keep(t)
    gone = t.post_memory[0, k.P_WAY : k.P_WAY + 6] - way
    n, u = gone[N] * force, gone[F_H] / H * m
    assert s[N] / force == pytest.approx(n / np.hypot(n, u), rel=0.01)
    assert np.hypot(s[N] / force, foot / m) == pytest.approx(1.0, rel=0.01)
    assert abs(s[M_H]) < 0.5 * m  # the foot is the one hinge


def test_a_post_pulled_at_a_speed_is_cowper_and_symonds() -> None:
    """N = A f_y (1 + (e'/D)^(1/q)) of a perfectly plastic bar that is strained at e' everywhere."""
    steel = replace(FLAT, rate_factor=CowperSymonds(rate=40.4, exponent=5.0))
    t = bent(replace(FRAME, members=FRAME.beams[:2]), steel=steel)
    force = replace(POST, material=steel).plastic_resistance[0]
    speed, h = 2.0, 1e-4
    for n in range(1, 101):
        s = head(t, along(N, n * speed * h), h)
        keep(t)
    assert s[N] == pytest.approx(force * (1.0 + (speed / H / 40.4) ** 0.2), rel=1e-3)


def test_what_a_cycle_takes_is_its_plastic_work() -> None:
    """There, over and back: the loop's area less what a spring gives back is what is booked as plastic."""
    t, work, last, before = bent(), 0.0, np.zeros(6), np.zeros(6)
    way = np.concatenate([np.linspace(0.0, 0.12, 241), np.linspace(0.12, -0.08, 401), np.linspace(-0.08, 0.1, 361)])
    for d in way:
        v = along(F_B, d)
        v[N], v[F_H] = -0.02 * d, 0.5 * d
        s = head(t, v)
        work += float(0.5 * (s + before) @ (v - last))
        keep(t)
        last, before = v, s
    elastic = 0.5 * float(before @ t.post_f[0, k.P_C : k.P_C + 36].reshape(6, 6) @ before)
    assert t.post_memory[0, k.P_WORK] > 5e3
    assert work - elastic == pytest.approx(t.post_memory[0, k.P_WORK], rel=2e-3)
    assert head(t, t.post_memory[0, k.P_WAY : k.P_WAY + 6]) == pytest.approx(np.zeros(6), abs=1e-3)


def test_every_deflection_has_its_load() -> None:
    """Far and near, with and without hardening and rate: what is left of v on the elastic springs is below 1e-12 J."""
    rng, room = np.random.default_rng(7), np.zeros((k.ROOM_ROWS, k.ROOM_COLUMNS))
    r, J, u = np.zeros(6), np.zeros((6, 6)), np.zeros((2, 12))
    for t, h in ((bent(steel=FLAT), SLOW), (bent(), SLOW), (bent(), 1e-3)):
        K = t.post_f[0, k.P_K : k.P_K + 36].reshape(6, 6)
        for scale in (0.02, 0.1, 0.5, 2.0):
            for v in rng.normal(size=(100, 6)) * scale * [0.02, 1.0, 1.0, 0.5, 0.5, 0.5]:
                k.try_load(handle(t), 0, v, h, room)
                k.compliant(handle(t), 0, t.post_memory[0, :6].copy(), v, h, r, J, u)
                assert r @ K @ r < 1e-12


@pytest.mark.parametrize("h", [SLOW, 1e-3])
def test_the_tangent_is_the_slope_of_the_load(h: float) -> None:
    t = bent()
    v = np.array([-0.004, 0.06, 0.09, 0.05, 0.02, -0.01])
    head(t, v, h)
    K = t.post_memory[0, k.P_TANGENT : k.P_TANGENT + 36].reshape(6, 6).copy()
    eps = 1e-7
    found = np.array([head(t, v + eps * e, h) - head(t, v - eps * e, h) for e in np.eye(6)]).T / (2.0 * eps)
    assert np.abs(found - K).max() < 1e-4 * np.abs(K).max()
    assert np.abs(K - K.T).max() < 1e-6 * np.abs(K).max()
    assert K[F_B, F_B] < 0.5 * t.post_f[0, k.P_K + 14]


def test_newton_s_matrix_is_that_of_the_forces() -> None:
    """At rest in the air, where turning frames add nothing."""
    t = bent()
    n = len(t.mass)
    q, K = np.zeros(n), np.zeros((n, n))
    bodies = bodies_of(
        load("side_overturn").replaced({"vehicle.rops": FRAME}).vehicle, load("side_overturn").ground.elements
    )
    q.reshape(-1, 6)[:, :3] = [b.centre for b in bodies]
    q[2::6] += 50.0

    def forces(x: Array) -> Array:
        Q = np.zeros(n)
        generalised_forces(handle(t), x, np.zeros(n), Q)
        return Q

    forces(q)
    stiffness(handle(t), 1.0, 0.0, K)
    eps = 1e-6
    found = -np.array([forces(q + eps * e) - forces(q - eps * e) for e in np.eye(n)]).T / (2.0 * eps)
    rops = slice(n - 6, n)
    assert np.abs(found[rops, rops] - K[rops, rops]).max() < 1e-4 * np.abs(K[rops, rops]).max()
    assert np.abs(found[:6, rops] - K[:6, rops]).max() < 1e-4 * np.abs(K[:6, rops]).max()


def test_segments_converge() -> None:
    """At 150 mm in both directions at once, 2 m/s: 6 segments within 0.5 % of 48."""
    found = []
    for segments in (3, 6, 48):
        t = bent(segments=segments)
        for d in np.linspace(0.0, 0.15, 76)[1:]:
            v = along(F_B, d)
            v[F_H], v[M_H] = 0.6 * d, 0.4 * d
            s = head(t, v, 1e-3)
            keep(t)
        found.append([float(s @ v), t.post_memory[0, k.P_WORK]])
    coarse, usual, fine = np.array(found)
    assert usual == pytest.approx(fine, rel=5e-3)
    assert np.all(np.abs(coarse - fine) > np.abs(usual - fine))


@pytest.mark.parametrize(("asks", "come_from"), [("side", "left"), ("longitudinal", "rear")])
def test_a_slow_load_is_that_of_the_frame_of_beams(asks: str, come_from: str) -> None:
    """Force over deflection within 5 % all along, as calculated with fibres; the end and the set too."""
    quiet = {f"vehicle.rops.members.{b.name}.material.rate_factor": None for b in FRAME.beams}
    push = {"initiation.loads": [{"name": "x", "asks": asks, "come_from": come_from}], "initiation.rate": 0.4}
    scenario: Scenario = load("static_rops_test").replaced({"vehicle.rops": str(FILE)}).replaced(quiet | push)
    (beams,) = frame_test(scenario).tests
    done = run(scenario.replaced({"vehicle.rops.segments": 6}))
    (found,) = done.tests
    way, force = done.recording["device/deflection"], done.recording["device/force"]
    top = int(np.argmax(way))
    x, y = np.array(beams["curve"]).T
    at = np.linspace(0.02, 0.98 * min(x.max(), way[top]), 12)  # before it is let go
    assert np.interp(at, way[:top], force[:top]) == pytest.approx(np.interp(at, x, y), rel=0.05)
    assert found["energy"] == pytest.approx(beams["energy"], rel=0.01)
    assert found["deflection"] == pytest.approx(beams["deflection"], rel=0.03)
    assert found["permanent_set"] == pytest.approx(beams["permanent_set"], rel=0.05)


def test_an_overturn_closes_its_ledger_and_keeps_what_bent() -> None:
    upset = load("field_upset_bent").replaced({"simulation.integrator": "compiled"})
    done = run(upset)
    assert closure(done).largest < 1e-3
    bent_in, use = (done.recording[f"rops/post/left/{name}"] for name in ("plastic_work", "use"))
    assert np.all(np.diff(bent_in) >= 0.0)
    assert bent_in[0] == 0.0 < bent_in[-1] < done.recording["rops/energy"][-1]
    # at rest the upper corner stays away by what stayed of the posts, the loaded one less than both together
    sets = [done.recording[f"rops/post/{name}/set"][-1] for name in ("left", "right")]
    assert min(sets) < done.recording["rops/deflection"][-1] < sum(sets)
    first = next(e for e in done.events if e.kind == "plastic-hinge" or "yields" in e.detail)
    assert use[done.recording.time < first.time - 1e-9].max() <= 1.0 < use.max()
    finer = run(upset.replaced({"vehicle.rops.segments": 20})).recording
    for name in ("rops/force", "rops/deflection", "rops/post/left/plastic_work"):
        assert done.recording[name].max() == pytest.approx(finer[name].max(), rel=0.01)


def test_what_is_stated_of_a_foot_is_what_its_post_has() -> None:
    stated = tuple(replace(f, side_stiffness=3.0e5, side_yield=15e3) for f in FRAME.feet)
    t = bent(FRAME, 4, feet=stated, steel=FLAT)
    assert t.post_f[0, k.P_K + 14] == pytest.approx(3.0e5)
    assert head(t, along(F_B, 0.09))[F_B] == pytest.approx(15e3, rel=0.01)


@pytest.mark.parametrize(
    ("changes", "said"),
    [
        (
            {"feet": (replace(FRAME.feet[0], play=0.002), FRAME.feet[1])},
            "feet.left.play: a post that bends has no play",
        ),
        ({"feet": (), "mounts": load("side_overturn").vehicle.rops.mounts}, "segments: no feet, got 6"),  # type: ignore[union-attr]
    ],
)
def test_what_cannot_bend_is_refused(changes: dict[str, Any], said: str) -> None:
    with pytest.raises((ValueError, InputError), match=said):
        replace(FRAME, segments=6, **changes)


def test_effects_of_the_rops_reach_its_posts() -> None:
    """Stiffness and yield as those of feet; of play, which they do not have, a scenario says that nothing feels it."""
    base = load("field_upset_bent")
    weak = base.replaced({"effects.rops-plasticity.yield_force": 20e3}).applied().vehicle.rops  # type: ignore[union-attr]
    assert weak is not None
    assert [f.side_yield for f in weak.feet] == [10e3, 10e3]
    loose = base.replaced({"effects.mount-play.gap": 0.002})
    assert loose.applied().vehicle == base.vehicle
    assert "effects.mount-play: needs a ROPS; nothing feels it here" in loose.idle


def test_a_tractor_s_work_on_its_posts_is_the_ledger_s() -> None:
    """A head moved and turned about all axes at once: the account of the ROPS is the work of its load."""
    t = bent()
    n = len(t.mass)
    bodies = bodies_of(
        load("side_overturn").replaced({"vehicle.rops": FRAME}).vehicle, load("side_overturn").ground.elements
    )
    q = np.concatenate([[*b.centre[:2], b.centre[2] + 50.0, 0.0, 0.0, 0.0] for b in bodies])
    far, steps, total = np.array([0.06, 0.08, -0.002, 0.03, -0.05, 0.04]), 400, 0.0
    Q, last, h = np.zeros(n), np.zeros(6), handle(t)
    t.clock[0] = SLOW
    for j in range(steps + 1):
        way = j / steps * far
        x = q.copy()
        x[-6:] += way
        generalised_forces(h, x, np.zeros(n), Q)
        # moments do their work on the angular velocity, turned by half of what the rotation vector turns in a step
        force = Q[-6:].copy()
        if j > 0:
            total -= float(0.5 * (force + last) @ (far / steps))
        last = force
        finish_mounts(h)
        start_step(h)
    assert t.work[ROPS] == pytest.approx(total, rel=2e-3)
    assert t.post_memory[:, k.P_WORK].sum() > 500.0


def test_stiff_posts_are_a_rigid_frame() -> None:
    """A hundred times as stiff they deflect a hundredth, and the tractor lies as on stiff springs."""
    upset = load("side_overturn").replaced({"simulation.integrator": "compiled", "simulation.duration": 2.5})

    def landed(stiff: float, segments: int | None) -> Any:
        steel = replace(FLAT, youngs_modulus=stiff * 210e9, yield_strength=3e9, tensile_strength=3e9)
        frame = replace(FRAME, members=tuple(replace(b, material=steel) for b in FRAME.beams), segments=segments)
        return run(upset.replaced({"vehicle.rops": frame})).recording

    soft, hard, springs = landed(10.0, 6), landed(100.0, 6), landed(1000.0, None)
    assert soft["rops/deflection"].max() == pytest.approx(10.0 * hard["rops/deflection"].max(), rel=0.05)
    assert hard["rops/post/left/plastic_work"][-1] == 0.0
    assert hard["energy/soil"][-1] == pytest.approx(springs["energy/soil"][-1], rel=0.01)
    assert hard["chassis/roll"][-1] == pytest.approx(springs["chassis/roll"][-1], abs=0.01)
    assert hard["rops/force"].max() == pytest.approx(springs["rops/force"].max(), rel=0.05)

"""Effects of ground and striker against closed forms; each derivation stands in its test.

The ground of these tests is linear, F = K z, so that the motion down has a closed form: with m the striker, m_b the
soil that moves along and M = m + m_b, M z'' = m g - F(z, z') from z = 0 with v_0 = v_s m/M.
"""

from __future__ import annotations

import math

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.integrate import solve_ivp
from scipy.linalg import expm

from ground.law import REFERENCE_AREA
from ground.ye import Ye2006
from rollover.dynamics.drop_test import DropModel, simulate_drop
from tests.physics.scenes import drop, shipped

Array = NDArray[np.float64]
m, g, FRACTION = 132.0, 9.81, 0.1
m_b = FRACTION * m
M = m + m_b
SOFT = 1e-3  # N/m, ground that is not there


def linear(stiffness: float, speed: float = 3.0, recovery: float = 0.02) -> DropModel:
    """A drop on F = K z: one branch, without dependence on speed or momentum."""
    law = Ye2006(
        recovery=recovery,
        speed_coefficient=0.0,
        first_stiffness=stiffness,
        second_stiffness=1e9,
        sinkage_exponent=0.0,
        momentum_base=1.0,
    )
    return DropModel(scenario=drop(speed, law=law, duration=1.0))


def motion(model: DropModel, times: Array) -> tuple[Array, Array, Array, Array]:
    """z, v and a, positive down, and the ground's spring force F = F_s - m_b a."""
    r = model.run(times)
    a = -r["striker/acceleration_z"]
    return -r["striker/position_z"], -r["striker/velocity_z"], a, r["ground/force_normal"] - m_b * a


def test_viscous_damping_on_linear_ground_is_an_oscillator() -> None:
    """M z'' + d z' + K z = m g: z = z_s + e^(-delta t)(A cos w t + B sin w t), until z' = 0."""
    K, d, v0 = 2e4, 1500.0, 3.0 / 1.1
    delta = d / (2 * M)
    w = math.sqrt(K / M - delta**2)
    z_s = m * g / K
    A, B = -z_s, (v0 - delta * z_s) / w
    turn = (math.atan2(w * B - delta * A, w * A + delta * B)) / w  # z' = 0
    t = np.linspace(0.0, 0.999 * turn, 200)
    z, v, _, F = motion(linear(K).with_({"effects.soil-viscous-damping.damping": d}), t)
    fade, c, s = np.exp(-delta * t), np.cos(w * t), np.sin(w * t)
    exact = z_s + fade * (A * c + B * s)
    rate = fade * ((w * B - delta * A) * c - (w * A + delta * B) * s)
    assert z == pytest.approx(exact, rel=1e-8, abs=1e-9)
    assert v == pytest.approx(rate, abs=1e-7)
    assert pytest.approx(K * exact + d * rate, rel=1e-7) == F


def test_viscous_damping_has_its_exponent() -> None:
    K, d, zeta = 2e4, 900.0, 1.7
    t = np.linspace(0.001, 0.1, 50)
    changed = {"effects.soil-viscous-damping.damping": d, "effects.soil-viscous-damping.exponent": zeta}
    z, v, _, F = motion(linear(K).with_(changed), t)
    assert np.all(v > 0.5)
    assert pytest.approx(K * z + d * v**zeta, rel=1e-12) == F


def test_inertial_drag_takes_speed_with_depth() -> None:
    """Without ground M v dv/dz = m g - c v^2, c = 1/2 C rho A: v^2 = v_t^2 + (v_0^2 - v_t^2) e^(-2 c z/M)."""
    C, rho, v0 = 40.0, 1700.0, 3.0 / 1.1
    c = 0.5 * C * rho * REFERENCE_AREA
    terminal = m * g / c
    model = linear(SOFT).with_({"effects.soil-inertial-drag.coefficient": C, "effects.soil-inertial-drag.density": rho})
    z, v, _, _ = motion(model, np.linspace(0.0, 0.3, 100))
    assert v**2 == pytest.approx(terminal + (v0**2 - terminal) * np.exp(-2 * c * z / M), rel=1e-6)
    assert z[-1] > 0.4


STAMPS = np.linspace(0.001, 0.19, 400)


def test_rate_hardening_is_a_factor_on_the_law() -> None:
    """F = K z (1 + lambda log10(v/v_0)) above v_0, K z below."""
    K, lam, slow = 2e4, 0.12, 0.5
    changed = {"effects.soil-rate-hardening.per_decade": lam, "effects.soil-rate-hardening.reference_speed": slow}
    z, v, _, F = motion(linear(K).with_(changed), np.linspace(0.001, 0.19, 200))
    down = v > 0.0
    assert np.any(v[down] < slow)
    assert np.any(v[down] > 4 * slow)
    factor = 1.0 + lam * np.log10(np.maximum(v[down], slow) / slow)
    assert F[down] == pytest.approx(K * z[down] * factor, rel=1e-12)


@pytest.mark.parametrize("slowest", [None, 0.02])
def test_strength_may_go_by_a_power_of_the_rate(slowest: float | None) -> None:
    """F = K z (max(v, least)/v_0)^beta; without a least rate of its own v_0 is the least."""
    K, power, v0 = 2e4, 0.08, 0.5
    numbers = {"per_decade": 0.0, "power": power, "reference_speed": v0, "slowest": slowest}
    z, v, _, F = motion(linear(K).with_({f"effects.soil-rate-hardening.{n}": x for n, x in numbers.items()}), STAMPS)
    down = v > 0.0
    least = v0 if slowest is None else slowest
    assert np.any(v[down] < v0)
    assert F[down] == pytest.approx(K * z[down] * (np.maximum(v[down], least) / v0) ** power, rel=1e-12)


def test_damping_may_be_in_proportion_to_the_force() -> None:
    """F = K z (1 + J v) on the way down (Smith)."""
    K, J = 2e4, 0.4
    numbers = {"damping": 0.0, "proportion": J}
    z, v, _, F = motion(linear(K).with_({f"effects.soil-viscous-damping.{n}": x for n, x in numbers.items()}), STAMPS)
    down = v > 0.0
    assert F[down] == pytest.approx(K * z[down] * (1.0 + J * v[down]), rel=1e-12)


def test_what_clings_keeps_its_momentum_over_a_bounce() -> None:
    """In the air m + m_b moves along and m alone is pulled: a = m g/(m + m_b); no landing takes a share again."""
    K = 2e4
    numbers = {"recovery": 0.3, "damping_ratio": 0.0, "clings": 1.0}
    t = np.linspace(0.0, 1.2, 2401)
    model = linear(K).with_({f"effects.soil-elastic-rebound.{n}": x for n, x in numbers.items()})
    z, v, a, F = motion(model, t)
    run = model.run(t)
    aloft = (F == 0.0) & (t > 0.01) & (np.abs(a - m / M * g) < 1e-9)
    assert np.sum(aloft) > 50
    assert np.ptp(run["ground/impulse_normal"][1:]) == 0.0  # but the first
    E = 0.5 * M * v**2 - m * g * z  # without a dashpot each flight has what the one before had
    assert np.ptp(E[aloft]) < 2e-3 * np.max(np.abs(E[aloft]))
    stays = linear(K).with_({f"effects.soil-elastic-rebound.{n}": x for n, x in {**numbers, "clings": 0.0}.items()})
    assert np.ptp(stays.run(t)["ground/impulse_normal"][1:]) > 1.0


def test_a_layer_may_have_a_stiffness_of_its_own() -> None:
    """F = K z + k_h (z - h) below h, whatever the law's K there."""
    K, h, own = 2e4, 0.05, 3e4
    numbers = {"depth": h, "stiffness_ratio": 1.0, "stiffness": own}
    z, v, _, F = motion(linear(K).with_({f"effects.soil-layer.{n}": x for n, x in numbers.items()}), STAMPS)
    down = v > 0.0
    assert np.any(z[down] > 2.0 * h)
    assert F[down] == pytest.approx(K * z[down] + own * np.maximum(z[down] - h, 0.0), rel=1e-12)


@pytest.mark.parametrize("onset", [0.0, 0.4, 1.0])
def test_layer_jumps_or_sets_in(onset: float) -> None:
    """F = K z above h, K (z + (r - 1)(z - onset h)) below: at the top it leaps by K h (r - 1)(1 - onset)."""
    K, h, r = 2e4, 0.05, 2.5
    layer = {f"effects.soil-layer.{n}": v for n, v in {"depth": h, "stiffness_ratio": r, "onset": onset}.items()}
    z, v, _, F = motion(linear(K).with_(layer), STAMPS)
    down = v > 0.0
    expected = K * (z + np.where(z > h, (r - 1.0) * (z - onset * h), 0.0))
    assert np.any(z[down] > 2.0 * h)
    assert F[down] == pytest.approx(expected[down], rel=1e-12)


@pytest.mark.parametrize(("remains", "width"), [(1.0, 0.0), (0.3, 0.0), (1.0, 0.02)])
def test_what_a_crust_adds_may_stay_below_it(remains: float, width: float) -> None:
    """F = K (z + (r - 1) z) in the crust, K (z + (r - 1) s h) below, s what remains; b passes from one to the other."""
    K, h, r = 2e4, 0.05, 2.5
    numbers = {"thickness": h, "stiffness_ratio": r, "remains": remains, "width": width}
    z, v, _, F = motion(linear(K).with_({f"effects.soil-crust.{n}": x for n, x in numbers.items()}), STAMPS)
    z, force = z[v > 0.0], F[v > 0.0]
    u = np.clip((z - h) / width + 0.5, 0.0, 1.0) if width > 0.0 else np.where(z > h, 1.0, 0.0)
    b = u**2 * (3.0 - 2.0 * u)
    assert np.any(z > 2.0 * h)
    expected = K * (z + (r - 1.0) * ((1.0 - b) * z + b * remains * np.minimum(z, h)))
    assert force == pytest.approx(expected, rel=1e-12)


@pytest.mark.parametrize(
    ("effect", "edge", "sign"), [("soil-layer", "depth", 1.0), ("soil-crust", "thickness", -1.0)], ids=str
)
def test_an_edge_of_some_width_is_passed_smoothly(effect: str, edge: str, sign: float) -> None:
    """F = K z (1 + (r - 1) b), b = u^2 (3 - 2 u) below and 1 - b above, u = (z - h)/w + 1/2 from 0 to 1."""
    K, h, r, w = 2e4, 0.05, 2.5, 0.03
    numbers = {edge: h, "stiffness_ratio": r, "width": w}
    z, v, _, F = motion(linear(K).with_({f"effects.{effect}.{n}": x for n, x in numbers.items()}), STAMPS)
    down = v > 0.0
    u = np.clip((z[down] - h) / w + 0.5, 0.0, 1.0)
    assert np.sum((u > 0.0) & (u < 1.0)) > 5
    below = u**2 * (3.0 - 2.0 * u)
    assert F[down] == pytest.approx(K * z[down] * (1.0 + (r - 1.0) * (below if sign > 0.0 else 1.0 - below)), rel=1e-12)


def test_growing_added_mass_keeps_the_momentum() -> None:
    """p = (M + r z) v, dp/dt = m g: p^2 = p_0^2 + 2 m g (M z + r z^2/2), as p dp = m g (M + r z) dz."""
    r, v0 = 60.0, 3.0 / 1.1
    model = linear(SOFT).with_({"effects.soil-added-mass-growth.rate": r})
    t = np.linspace(0.0, 0.3, 100)
    z, v, a, _ = motion(model, t)
    p = np.sqrt((M * v0) ** 2 + 2 * m * g * (M * z + 0.5 * r * z**2))
    # ground of 1 mN/m takes 1e-6 m/s from 145 kg meanwhile
    assert v == pytest.approx(p / (M + r * z), abs=1e-6)
    assert v[-1] < 0.85 * (v0 + m / M * g * t[-1])  # against no growth
    # and what the load cell reads is all that brakes the striker: m_b a + dm_b/dt v
    force = model.run(t)["ground/force_normal"]
    assert force == pytest.approx(m * (g - a), rel=1e-12)


def test_rebound_gives_its_energy_back() -> None:
    """Undamped line from (z_m, F_m): at lift-off z_m (1 - R); M v^2/2 = F_m R z_m/2 - m g R z_m."""
    K, R = 2e4, 0.3
    changed = {"effects.soil-elastic-rebound.recovery": R, "effects.soil-elastic-rebound.damping_ratio": 0.0}
    model = linear(K, speed=6.0).with_(changed)
    t = np.linspace(1e-5, 0.4, 40000)
    z, v, _, F = motion(model, t)
    touching = model.run(t)["ground/sinkage"] > 0.0
    deepest = z.max()
    off = int(np.argmin(touching))  # first row without contact
    assert 0 < off < len(t) - 1
    assert z[off] == pytest.approx(deepest * (1 - R), abs=2e-4 * deepest)
    energy = 0.5 * K * deepest * R * deepest - m * g * R * deepest
    assert 0.5 * M * v[off] ** 2 == pytest.approx(energy, rel=1e-3)
    on_line = (v < 0.0) & touching
    assert F[on_line] == pytest.approx(K * deepest - K / R * (deepest - z[on_line]), rel=1e-6, abs=1e-3)


def test_damped_rebound_leaves_the_weight_on_its_line() -> None:
    """At rest F = m g = F_m - K_u (z_m - z): z = z_m - R z_m (1 - m g/F_m), K_u = K/R."""
    K, R = 4e4, 0.2
    changed = {"effects.soil-elastic-rebound.recovery": R, "effects.soil-elastic-rebound.damping_ratio": 1.0}
    z, _, _, _ = motion(linear(K).with_(changed), np.array([0.0, *np.linspace(0.05, 0.3, 5000), 6.0]))
    deepest = z.max()
    assert z[-1] == pytest.approx(deepest - R * deepest * (1 - m * g / (K * deepest)), rel=1e-6)
    # a recovery below the law's own 0.02 changes nothing
    same = linear(K).with_(
        {"effects.soil-elastic-rebound.recovery": 0.01, **{k: v for k, v in changed.items() if "ratio" in k}}
    )
    t = np.linspace(0.0, 0.5, 50)
    assert np.array_equal(same.rows(t), linear(K).rows(t))


def test_adhesion_pulls_at_lift_off_and_takes_its_work() -> None:
    """Beyond the rut F = -min(K_u gap, P (1 - gap/reach)): a triangle of base reach, height P K_u/(K_u + P/reach)."""
    K, R, reach, stress = 2e4, 0.3, 0.02, 60_000.0
    P = stress * REFERENCE_AREA
    rebound = {"effects.soil-elastic-rebound.recovery": R, "effects.soil-elastic-rebound.damping_ratio": 0.0}
    hold = {"effects.soil-adhesion.stress": stress, "effects.soil-adhesion.reach": reach}
    t = np.linspace(1e-5, 0.4, 40000)
    held = DropModel(scenario=linear(K, speed=6.0).with_({**rebound, **hold}).scenario, step=2e-5)
    z, v, _, F = motion(held, t)
    deepest = z.max()
    K_u, rut = K / R, deepest * (1 - R)
    out = (v < 0.0) & (z < rut) & (z > rut - reach)
    gap = rut - z[out]
    assert out.sum() > 50
    assert F[out] == pytest.approx(-np.minimum(K_u * gap, P * (1 - gap / reach)), rel=1e-4, abs=1e-2)
    assert F.min() == pytest.approx(-P * K_u / (K_u + P / reach), rel=2e-3)
    work = 0.5 * reach * P * K_u / (K_u + P / reach)
    energy = 0.5 * K * deepest * R * deepest - m * g * (R * deepest + reach) - work
    free = int(np.argmin(held.run(t)["ground/sinkage"] > 0.0))
    assert 0.5 * M * v[free] ** 2 == pytest.approx(energy, rel=2e-3)
    # without it, never a pull
    assert linear(K, speed=6.0).with_(rebound).run(t)["ground/force_normal"].min() >= 0.0


@pytest.mark.parametrize("ratio", [3.0, 0.5])
def test_layer_and_crust_are_exact_in_depth(ratio: float) -> None:
    """F = r K z below the layer's top, and above the crust's bottom; energy M v^2/2 to the last digit through both."""
    K, depth, thickness, crust = 8e3, 0.15, 0.05, 2.5
    layer = {"effects.soil-layer.depth": depth, "effects.soil-layer.stiffness_ratio": ratio}
    top = {"effects.soil-crust.thickness": thickness, "effects.soil-crust.stiffness_ratio": crust}
    model = linear(K).with_({**layer, **top})
    z, v, _, F = motion(model, np.linspace(0.0, 0.5, 3001))
    down = (v > 0.0) & (np.abs(z - depth) > 1e-6) & (np.abs(z - thickness) > 1e-6)
    factor = np.where(z < thickness, crust, 1.0) * np.where(z > depth, ratio, 1.0)
    assert F[down] == pytest.approx((factor * K * z)[down], rel=1e-9, abs=1e-4)

    def work(x: float) -> float:
        parts = [(0.0, thickness, crust), (thickness, depth, 1.0), (depth, math.inf, ratio)]
        return sum(0.5 * K * f * (min(x, b) ** 2 - a**2) for a, b, f in parts if x > a)

    v0, deepest = 3.0 / 1.1, float(z.max())
    assert deepest > depth
    assert work(deepest) == pytest.approx(0.5 * M * v0**2 + m * g * deepest, rel=1e-5)


def test_guide_friction_slows_the_free_fall() -> None:
    """Before contact a = g - F_c/m; with v_s at t = 0, x = v_s t + a t^2/2."""
    force = 150.0
    t = np.linspace(-0.2, -1e-6, 50)
    r = linear(2e4).with_({"effects.guide-friction.force": force}).run(t)
    a = g - force / m
    assert r["striker/acceleration_z"] == pytest.approx(-a, rel=1e-12)
    assert r["striker/velocity_z"] == pytest.approx(-(3.0 + a * t), rel=1e-12)
    assert r["striker/position_z"] == pytest.approx(-(3.0 * t + 0.5 * a * t**2), rel=1e-9)
    assert np.all(r["ground/force_normal"] == 0.0)


def test_a_guide_holds_what_has_come_to_rest() -> None:
    """On its way up the striker is pressed back by F_c: it stops where the ground carries m g + F_c."""
    force = 150.0
    rest = linear(2e4).with_({"effects.guide-friction.force": force}).run(np.array([7.0, 8.0]))
    assert rest["ground/force_normal"] == pytest.approx(m * g + force, rel=1e-3)
    assert rest["striker/velocity_z"] == pytest.approx(0.0, abs=1e-12)


def test_a_guide_that_creeps_lets_the_striker_settle() -> None:
    """m a = m g - F_c tanh(v/v_c) - F_s in every row, (1) with m_b1 in F_s; in the end the ground carries m g alone."""
    force, creep = 150.0, 0.004
    changed = {"effects.guide-friction.force": force, "effects.guide-friction.creep": creep}
    r = linear(2e4).with_(changed).run(np.array([-0.05, 0.02, 0.1, 0.3, 0.31, 0.33, 0.4, 12.0]))
    v, a = -r["striker/velocity_z"], -r["striker/acceleration_z"]
    rubbed = m * (g - a) - r["ground/force_normal"]
    assert rubbed == pytest.approx(force * np.tanh(v / creep), abs=1e-3 * force)
    assert np.min(np.abs(rubbed)) < 0.5 * force < np.max(np.abs(rubbed)), "rows on both sides of v_c"
    assert r["ground/force_normal"][-1] == pytest.approx(m * g, rel=1e-3)


def test_air_brakes_towards_the_terminal_speed() -> None:
    """m v' = m g - c v^2: v(t) = v_t tanh(artanh(v_s/v_t) + g t/v_t), x = v_t^2/g ln cosh of it, less its start."""
    area, cd, rho = 3.0, 1.1, 1.204
    c = 0.5 * rho * cd * area
    v_t = math.sqrt(m * g / c)
    changed = {"effects.air-drag.area": area, "effects.air-drag.drag_coefficient": cd, "effects.air-drag.density": rho}
    t = np.linspace(-1.5, -1e-6, 60)
    r = linear(2e4, speed=14.0).with_(changed).run(t)
    phase = math.atanh(14.0 / v_t) + g * t / v_t
    assert v_t > 14.0
    assert -r["striker/velocity_z"] == pytest.approx(v_t * np.tanh(phase), rel=1e-9, abs=1e-9)
    x = v_t**2 / g * (np.log(np.cosh(phase)) - math.log(math.cosh(math.atanh(14.0 / v_t))))
    assert -r["striker/position_z"] == pytest.approx(x, rel=1e-9, abs=1e-9)


def test_behind_a_drag_crisis_a_round_body_falls_faster() -> None:
    """m v' = m g - c(v) v^2 with c(v) = c (r + (1 - r)/(1 + exp((v/v_c - 1)/0.1))), by an integrator of its own."""
    mass, area, critical, ratio = 0.27, 0.035, 10.0, 0.25
    drag = {"area": area, "drag_coefficient": 0.5, "crisis_speed": critical, "crisis_ratio": ratio}
    t = np.linspace(0.0, 2.5, 51)
    scenario = shipped("ball_drop").replaced({f"effects.air-drag.{n}": x for n, x in drag.items()})
    scenario = scenario.replaced({"vehicle.mass": mass, "initiation.height": 60.0})

    def falls(_: float, y: Array) -> list[float]:
        c = 0.5 * 1.204 * 0.5 * area * (ratio + (1.0 - ratio) / (1.0 + math.exp((y[1] / critical - 1.0) / 0.1)))
        return [y[1], 9.81 - c * y[1] ** 2 / mass]

    own = solve_ivp(falls, (0.0, 2.5), [0.0, 0.0], t_eval=t, rtol=1e-10, atol=1e-12).y
    r = simulate_drop(scenario, t)
    assert r["striker/position_z"] == pytest.approx(60.0 - own[0], abs=1e-6)
    thick = simulate_drop(scenario.replaced({"effects.air-drag.crisis_speed": None}), t)
    assert thick["striker/position_z"][-1] > r["striker/position_z"][-1] + 1.0
    assert thick["striker/position_z"][t < 0.6] == pytest.approx(r["striker/position_z"][t < 0.6], abs=2e-3)


def test_a_striker_in_two_parts_is_the_two_mass_oscillator() -> None:
    """(m_1 + m_b, m_2) on K to the ground, k and c between: a linear system, solved by the matrix exponential."""
    K, k, c, share = 5e4, 3e5, 300.0, 0.25
    m1, m2 = share * m, (1 - share) * m
    m1b = m1 + m_b
    changed = {"stiffness": k, "damping": c, "nose_share": share}
    model = linear(K).with_({f"effects.structural-compliance.{name}": value for name, value in changed.items()})
    t = np.linspace(0.0, 0.04, 81)
    r = model.run(t)
    # u = (x1, v1, x2, v2, 1): u' = A u
    A = np.array(
        [
            [0, 1, 0, 0, 0],
            [-(K + k) / m1b, -c / m1b, k / m1b, c / m1b, m1 * g / m1b],
            [0, 0, 0, 1, 0],
            [k / m2, c / m2, -k / m2, -c / m2, g],
            [0, 0, 0, 0, 0],
        ]
    )
    start = np.array([0.0, 3.0 * m1 / m1b, 0.0, 3.0, 1.0])
    exact = np.array([expm(A * time) @ start for time in t])
    going = np.cumprod(exact[:, 1] > 0.0).astype(bool)  # until the nose turns for the first time
    assert going.sum() > 30
    assert r["ground/sinkage"][going] == pytest.approx(exact[going, 0], rel=1e-5, abs=1e-8)
    assert -r["striker/position_z"][going] == pytest.approx(exact[going, 2], rel=1e-5, abs=1e-8)
    assert -r["striker/velocity_z"][going] == pytest.approx(exact[going, 3], rel=1e-5)


def test_a_stiff_striker_in_two_parts_is_the_rigid_one() -> None:
    t = np.linspace(-0.01, 0.15, 100)
    rigid = linear(2e4).run(t)
    # far beyond critical: the nose must not swing back, or the soil that moves along would leave it
    damping = 20.0 * math.sqrt(1e8 * m * 0.1 * 0.9)
    path = "effects.structural-compliance"
    stiff = linear(2e4).with_({f"{path}.stiffness": 1e8, f"{path}.damping": damping}).run(t)
    assert stiff["striker/position_z"] == pytest.approx(rigid["striker/position_z"], abs=2e-4)


def test_soil_stiffness_scales_the_law() -> None:
    a = linear(3e4).run(np.linspace(0, 0.5, 50))
    b = linear(2e4).with_({"effects.soil-stiffness.scale": 1.5}).run(np.linspace(0, 0.5, 50))
    for name in a.channels:
        assert b[name] == pytest.approx(a[name], rel=1e-9, abs=1e-12)

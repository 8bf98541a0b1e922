"""The drop test of Ye (2006), Fig. 5, against an independent solution, energy, and its own convergence."""

from __future__ import annotations

import numpy as np
import pytest

from ground.ye import CO_MOVING_FRACTIONS
from rollover.assessment.loads import peak_loads
from rollover.dynamics.result import Run
from rollover.dynamics.simulate import run
from tests.ground.reference_drop import solve
from tests.physics.scenes import drop, shipped

# z_max mm, t(z_max) ms, peak F_s N: worked out from eqs (1)-(5), as printed in the documentation of the law
TABLE = {1.0: (67.4, 105, 3198), 2.0: (163.1, 148, 3452), 3.0: (326.6, 205, 3552), 3.5: (436.4, 237, 3551)}


def deepest(result: Run) -> tuple[float, float, float]:
    """Deepest sinkage (m), its time (s) and the peak of the load cell (N)."""
    z, force = result.recording["ground/sinkage"], result.recording["ground/force_normal"]
    return float(z.max()), float(result.recording.time[z.argmax()]), float(force.max())


@pytest.mark.parametrize("speed", TABLE)
def test_drop_agrees_with_independent_solution_and_table(speed: float) -> None:
    result = run(drop(speed))
    z, t, force = deepest(result)
    expected = solve(speed)
    assert z == pytest.approx(expected.z_max, rel=5e-3)
    assert t == pytest.approx(expected.t_max, rel=5e-3)
    assert force == pytest.approx(expected.load_cell_peak, rel=5e-3)
    # the table is rounded to half a digit of its last place
    assert (1e3 * z, 1e3 * t, force) == pytest.approx(TABLE[speed], rel=5e-3)


@pytest.mark.parametrize("speed", TABLE)
def test_whole_history_follows_the_independent_solution(speed: float) -> None:
    result, expected = run(drop(speed)), solve(speed)
    before = (result.recording.time > 2e-3) & (result.recording.time < expected.t_max - 2e-3)
    time = result.recording.time[before]
    # 0.3 % of the largest value: a step of 0.2 ms blurs the kink at the branch change by F'' h^2
    assert np.abs(result.recording["ground/sinkage"][before] - expected.z(time)).max() < 3e-3 * expected.z_max
    error = result.recording["ground/force_normal"][before] - expected.load_cell(time)
    assert np.abs(error).max() < 3e-3 * expected.load_cell_peak


@pytest.mark.parametrize("speed", TABLE)
def test_energy_ledger_closes_and_collision_takes_its_share(speed: float) -> None:
    result = run(drop(speed))
    kinetic = 0.5 * 132.0 * speed**2
    # (8) with k_s = 0 over (7): m_b/(m_s + m_b) = 0.1/1.1
    assert result.ledger["collision"] == pytest.approx(kinetic * 0.1 / 1.1, rel=1e-9)
    assert result.released == pytest.approx(kinetic + 132.0 * 9.81 * deepest(result)[0], rel=1e-3)
    residual = np.abs(result.recording["energy/residual"]).max()
    assert residual < 1e-3 * result.released
    spent = sum(result.ledger[k] for k in ("soil", "collision", "friction", "tyre", "rops", "axle"))
    assert result.ledger["kinetic"] + result.ledger["potential"] + spent == pytest.approx(kinetic, abs=residual + 1e-6)


def test_impulse_is_the_momentum_given_to_the_soil() -> None:
    result = run(drop(3.5))
    # v+ = v/1.1, impulse = m_b v+ = 13.2 * 3.5/1.1 = 42 N s
    assert result.recording["ground/impulse_normal"][-1] == pytest.approx(42.0, rel=1e-6)
    peak = next(p for p in peak_loads(result) if p.channel == "ground/force_normal")
    assert peak.impulse == pytest.approx(42.0, rel=1e-6)
    # and no force history shows it: twelve times the plateau if it took one millisecond
    assert result.recording["ground/force_normal"].max() < 4000.0


def test_first_contact_lies_at_time_zero_whatever_the_lead() -> None:
    free = run(shipped("drop_test"))
    touch = next(e for e in free.events if e.kind == "first-touch")
    assert touch.time == pytest.approx(0.0, abs=free.scenario.simulation.step)
    fall = free.recording.time < -1e-9
    assert fall.sum() > 50
    assert free.recording["striker/acceleration_z"][fall] == pytest.approx(-9.81, rel=1e-9)
    assert free.recording["ground/force_normal"][fall] == pytest.approx(0.0, abs=0.0)
    z, t, force = deepest(free)
    expected = solve(3.0)
    assert (z, t, force) == pytest.approx((expected.z_max, expected.t_max, expected.load_cell_peak), rel=5e-3)


def test_rest_force_is_the_weight_and_the_rut_stays() -> None:
    result = run(drop(2.0, duration=1.0))
    assert result.recording["ground/force_normal"][-1] == pytest.approx(132.0 * 9.81, rel=1e-4)
    z = result.recording["ground/sinkage"]
    # unloading line K_u = K'/0.02 from F_max down to the weight: back by 0.02 z (1 - m g/F_max)
    spring = solve(2.0).spring_force
    assert z[-1] == pytest.approx(z.max() * (1 - 0.02 * (1 - 132.0 * 9.81 / spring)), rel=1e-4)
    after = result.recording.time > result.recording.time[z.argmax()]
    # critically damped: it comes back once and stays
    assert np.all(np.diff(z[after]) < 1e-9)


def test_order_of_convergence_in_the_step() -> None:
    """Errors of z_max fall with the step: first order in general (touch within a step), asserted with the rate."""
    expected = solve(3.0).z_max
    steps = np.array([8e-4, 4e-4, 2e-4, 1e-4])
    # a lead that is no multiple of any step: first contact falls between two steps, as it does in a rollover
    errors = []
    for step in steps:
        scenario = drop(3.0, step=float(step)).replaced({"initiation.lead_time": 0.0123})
        errors.append(abs(deepest(run(scenario))[0] - expected) / expected)
    rate = float(np.polyfit(np.log(steps), np.log(errors), 1)[0])
    assert 0.7 < rate < 2.5, f"observed order {rate:.2f}, errors {errors}"
    assert errors[-1] < 2e-4, f"observed order {rate:.2f}, errors {errors}"


@pytest.mark.parametrize("divide", [1, 2, 4])
def test_same_footprint_on_a_finer_array_is_the_same_drop(divide: int) -> None:
    expected = solve(3.0)
    result = run(drop(3.0, spacing=(0.140 / divide, 0.045 / divide)))
    z, t, force = deepest(result)
    assert len(result.track.element) >= divide**2
    assert (z, t, force) == pytest.approx((expected.z_max, expected.t_max, expected.load_cell_peak), rel=2e-3)
    assert result.ledger["collision"] == pytest.approx(0.5 * 132 * 9 * 0.1 / 1.1, rel=1e-6)


def test_literal_third_branch_stands_on_its_secant() -> None:
    """(6): K_b3 = 9.81 m/z_p,max through the origin: the force drops to the weight where the striker stopped."""
    result = run(drop(3.0).replaced({"ground.law.unloading": "rest-stiffness"}))
    z, force = result.recording["ground/sinkage"], result.recording["ground/force_normal"]
    stop = int(z.argmax())
    assert force[stop + 2] == pytest.approx(132.0 * 9.81, rel=1e-2)
    secant = force[stop + 2 :] / z[stop + 2 :]
    assert secant == pytest.approx(132.0 * 9.81 / z[stop], rel=1e-2)
    # the plastic line has given way by 0.02 z (1 - m g/F) = 4.3 mm at rest, this one not at all
    assert z[-1] == pytest.approx(z[stop], rel=2e-3)


def test_variants_of_mass_and_fraction() -> None:
    for fraction in (0.0, 0.33):
        z, _, force = deepest(run(drop(2.0, fraction=fraction)))
        expected = solve(2.0, fraction=fraction)
        assert (z, force) == pytest.approx((expected.z_max, expected.load_cell_peak), rel=5e-3)


def test_domain_flags_say_what_lies_outside() -> None:
    assert run(drop(3.5, duration=0.02)).domain_flags == ()
    assert run(drop(1.0, duration=0.02)).domain_flags == ()
    assert "impact-speed" in run(drop(4.5, duration=0.02)).domain_flags
    assert "impact-speed" in run(drop(0.5, duration=0.02)).domain_flags
    wide = drop(2.0, duration=0.02).replaced({"vehicle.face_length": 0.2})
    assert "contact-area" in run(wide).domain_flags


@pytest.mark.parametrize(
    ("given", "fraction"),
    [({"estimate": "kundt-1987"}, 0.33), ({"loss_share": 0.09}, 0.0989), ({"fraction": 0.2}, 0.2)],
)
def test_co_moving_mass_is_given_by_table_or_by_loss(given: dict[str, object], fraction: float) -> None:
    """Table 1 by name, or (10): y = x/(1 - x), 9 % gives 9.89 %."""
    result = run(drop(2.0, duration=0.02).replaced({"ground.co_moving_mass": given}))
    kinetic = 0.5 * 132.0 * 4.0
    assert result.ledger["collision"] == pytest.approx(kinetic * fraction / (1 + fraction), rel=2e-4)


def test_two_sources_of_the_co_moving_mass_are_refused() -> None:
    with pytest.raises(ValueError, match="one of both"):
        drop(2.0).replaced({"ground.co_moving_mass": {"estimate": "kundt-1987", "loss_share": 0.1}})


def test_every_estimate_of_table_1_can_be_named() -> None:
    for name, fraction in CO_MOVING_FRACTIONS.items():
        assert drop(2.0).replaced({"ground.co_moving_mass.estimate": name}).ground.co_moving_mass.share == fraction

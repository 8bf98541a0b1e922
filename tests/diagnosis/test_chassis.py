"""The residual generalised force on a chassis: which degree of freedom, and how large."""

from __future__ import annotations

import numpy as np
import pytest

from rollover.diagnosis.data.dataset import Dataset, dataset_of
from rollover.diagnosis.forward.full_run import RunSimulator
from rollover.diagnosis.inference.vehicle_dependence import misfit_by_degree_of_freedom
from rollover.recording import Recording
from rollover.scenario import Scenario
from rollover.spec.vehicle import chassis_of
from tests.physics.scenes import shipped

ALONG = tuple(f"chassis/acceleration_{axis}" for axis in "xyz")
ABOUT = tuple(f"chassis/angular_velocity_{axis}" for axis in "xyz")


def toss(speed: float) -> Scenario:
    return shipped("cube_toss").replaced(
        {"initiation.velocity": [-1.0, -0.85, -speed], "initiation.position": [0.2, 0.2, 0.4]}
    )


def thrown(speed: float, off: dict[str, str]) -> tuple[Scenario, Dataset]:
    """A toss, recorded in flight, with `off`: channel -> what is added to it."""
    time = np.arange(0.0, 0.16, 0.001)
    own = toss(speed)
    no_jacobian = Recording(title="r", time=time, channels=dict.fromkeys((*ALONG, *ABOUT), np.zeros(time.size)))
    simulator = RunSimulator(own, no_jacobian)
    run, state = simulator.predict({}, 0.0), simulator.state(0.0)
    assert run is not None
    rng = np.random.default_rng(int(100 * speed))
    added = {c: eval(text, {"t": time, "state": state, "np": np}) for c, text in off.items()}
    made = {c: run[c] + added.get(c, 0.0) + rng.normal(0.0, 0.01, time.size) for c in (*ALONG, *ABOUT)}
    recording = Recording(title="r", time=time, channels=made)
    found = dataset_of(f"v{speed}", recording, RunSimulator(own, recording))
    assert found is not None
    return own, found


def test_a_force_along_one_axis_is_found_with_its_size() -> None:
    tosses = [thrown(v, {ALONG[1]: "2.0 * np.sin(30.0 * t)"}) for v in (0.5, 1.0)]
    degrees = misfit_by_degree_of_freedom([s for s, _ in tosses], [e for _, e in tosses], [0.0, 0.0])
    first = degrees[0]
    assert (first.body, first.axis, first.unit) == ("chassis", "along y", "N")
    assert first.share > 0.95
    assert sum(d.share for d in degrees) == pytest.approx(1.0)
    mass = chassis_of(tosses[0][0].vehicle).mass  # type: ignore[arg-type]
    expected = mass * np.sqrt(np.mean((2.0 * np.sin(30.0 * np.arange(0.0, 0.16, 0.001))) ** 2))
    assert first.rms == pytest.approx(expected, rel=0.02)


def test_a_moment_is_inertia_times_angular_acceleration() -> None:
    own, e = thrown(0.7, {ABOUT[2]: "6.0 * t"})
    degrees = misfit_by_degree_of_freedom([own], [e], [0.0])
    assert degrees[0].axis == "about z"
    assert degrees[0].unit == "N m"
    inertia = chassis_of(own.vehicle).inertia[2]  # type: ignore[arg-type]
    assert degrees[0].rms == pytest.approx(6.0 * inertia, rel=0.2)  # a derivative of noise beside it


def test_instruments_elsewhere_are_no_forces_on_the_chassis() -> None:
    own, e = thrown(0.7, {})
    no_jacobian = Recording(
        title="r", time=e.recording.time, channels={"chassis/position_z": np.zeros(e.recording.time.size)}
    )
    there = dataset_of(
        "r",
        Recording(
            title="r",
            time=no_jacobian.time,
            channels={"chassis/position_z": np.linspace(0.0, 0.3, no_jacobian.time.size)},
        ),
        RunSimulator(own, no_jacobian),
    )
    assert there is not None
    assert misfit_by_degree_of_freedom([own], [there], [0.0]) == ()

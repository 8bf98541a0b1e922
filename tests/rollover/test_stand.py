"""What a scenario of a test stand may say, and what its run leaves behind."""

from __future__ import annotations

from dataclasses import replace

import pytest

from rollover.assessment.results import read_run_json, write
from rollover.scenario import load
from rollover.spec.channels import describe
from rollover.spec.excitation import Harmonic
from rollover.spec.stand import Lashing, StaticLoad, StaticTest, TiltTable
from tests.rollover.example import run_of


def test_a_load_needs_an_energy_or_a_force() -> None:
    for given in ({}, {"energy": 1.0, "force": 1.0}):
        with pytest.raises(ValueError, match="one of energy and force"):
            StaticLoad(name="a", come_from="left", point=(0.0, 0.0, 0.0), **given)  # type: ignore[arg-type]


def test_loads_have_names_of_their_own() -> None:
    one = StaticLoad(name="a", come_from="left", point=(0.0, 0.0, 0.0), energy=1.0)
    with pytest.raises(ValueError, match="share a name"):
        StaticTest(loads=(one, one))
    with pytest.raises(ValueError, match="at least one"):
        StaticTest(loads=())


def test_a_rope_has_a_length_and_a_table_moves() -> None:
    with pytest.raises(ValueError, match="less than 10 mm"):
        Lashing(name="r", point=(0.0, 0.0, 0.0), anchor=(0.0, 0.0, 0.001), stiffness=1.0)
    with pytest.raises(ValueError, match="not beyond"):
        TiltTable(from_deg=30.0, to_deg=20.0)


@pytest.mark.parametrize(
    ("name", "changes", "message"),
    [
        ("static_rops_test", {"vehicle.rops": None}, "loads a ROPS"),
        ("pendulum", {"vehicle.rops": None}, "loads a ROPS"),
        ("tilt_table", {"vehicle.wheels": [], "vehicle.front_axle": None}, "at least 3 wheels"),
        ("drop_test", {"initiation": {"kind": "tilt-table"}}, "a striker cannot begin so"),
    ],
)
def test_stand_and_vehicle_must_fit(name: str, changes: dict[str, object], message: str) -> None:
    with pytest.raises(ValueError, match=message):
        load(name).replaced(changes)


def test_only_a_striker_is_driven() -> None:
    with pytest.raises(ValueError, match="drives a striker only"):
        replace(load("rops_drop"), excitation=Harmonic(eccentric_moment=0.1, frequency=50.0))


def test_a_law_with_derived_recovery_is_replaced_alike() -> None:
    """What follows from other values is no key of a file: a scenario with such a law can be written and read again."""
    scenario = load("driven_pile")
    finer = scenario.replaced({"simulation.step": 5e-5})
    assert finer.ground.law == scenario.ground.law
    assert finer.simulation.step == 5e-5


def test_what_a_test_found_stands_in_run_json(tmp_path) -> None:  # type: ignore[no-untyped-def]
    found = {"kind": "static-load", "name": "side", "energy": 5437.0}
    write(tmp_path / "out", replace(run_of(load("drop_test")), tests=(found,)), ())
    assert read_run_json(tmp_path / "out")["tests"] == [found]


@pytest.mark.parametrize(("name", "unit"), [("force", "N"), ("deflection", "m"), ("energy", "J")])
def test_channels_of_a_test_stand(name: str, unit: str) -> None:
    assert describe(f"device/{name}").unit == unit

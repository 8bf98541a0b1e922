"""Values that no file states: worked out from what is stated, and said to be so; refused where they cannot be."""

from __future__ import annotations

import pytest

from rollover.scenario import Scenario, load
from rollover.spec.estimates import in_words
from rollover.system.errors import InputError


def driven(vehicle: str) -> Scenario:
    return load("kerb_trip").replaced({"vehicle": f"vehicles/{vehicle}.yaml"})


def test_wheels_without_inertia_take_that_of_their_tyre_size() -> None:
    found = {e.path: e for e in driven("large_tractor").estimates}
    front, rear = 500.0 * 0.7 * 0.45, 500.0 * 0.95 * 0.58
    assert {path: e.value for path, e in found.items()} == pytest.approx(
        {
            "vehicle.wheels.front_left.inertia": 0.5 * front * 0.7**2,
            "vehicle.wheels.front_right.inertia": 0.5 * front * 0.7**2,
            "vehicle.wheels.rear_left.inertia": 0.6 * rear * 0.95**2,
            "vehicle.wheels.rear_right.inertia": 0.6 * rear * 0.95**2,
        }
    )
    one = found["vehicle.wheels.rear_left.inertia"].plain
    assert (one["unit"], one["confidence"]) == ("kg m2", "estimate")
    assert one["source"] == "0.6 m r^2 with r = 0.95 m and m = 500 kg/m2 x r x 0.58 m = 276 kg, by the tyre's size"


def test_the_estimate_is_near_what_the_utility_tractor_states() -> None:
    stated = load("kerb_trip")
    assert stated.estimates == ()
    bare = stated.replaced({"vehicle.wheels.front_left.inertia": None, "vehicle.wheels.rear_left.inertia": None})
    assert [e.value for e in bare.estimates] == pytest.approx([6.3, 45.0], rel=0.05)  # rounded sizes


def test_only_free_wheels_without_inertia_are_estimated() -> None:
    assert load("side_overturn").replaced({"vehicle": "vehicles/large_tractor.yaml"}).estimates == ()
    assert driven("light_vehicle").estimates == ()
    one = driven("large_tractor").replaced({"vehicle.wheels.rear_left.inertia": 120.0})
    assert [e.path.split(".")[2] for e in one.estimates] == ["front_left", "front_right", "rear_right"]


def test_the_notice_tells_equal_wheels_together() -> None:
    told = in_words(driven("vineyard_tractor").estimates)
    assert told.startswith("Estimated, for the vehicle states none: vehicle.wheels.front_left.inertia, vehicle.wheels.")
    assert told.count("kg m2 (") == 2
    assert in_words(()) == ""


@pytest.mark.parametrize(
    ("changes", "told"),
    [
        (
            {"vehicle.wheels.*.inertia": None},
            "their axle has, got 1.58 kg m2, by the size of their tyres; less than 1.4 ",
        ),
        ({"vehicle.wheels.rear_left.inertia": 90.0}, "the chassis has, got 91 kg m2; less than "),
    ],
)
def test_wheels_with_more_inertia_than_their_carrier_are_refused(changes: dict[str, float | None], told: str) -> None:
    with pytest.raises(InputError) as found:
        driven("light_vehicle").replaced(changes)
    assert f"the wheels turn with more inertia than {told}" in str(found.value)
    assert ("state vehicle.wheels.*.inertia of front_left, front_right" in str(found.value)) == (
        None in changes.values()
    )

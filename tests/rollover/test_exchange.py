"""Values exchanged by path: what `replaced` makes of a file's text, without the text."""

from __future__ import annotations

import itertools
from collections.abc import Mapping
from dataclasses import replace
from typing import Any

import pytest

from rollover.effects import EFFECTS
from rollover.scenario import Scenario, load, with_effects_at
from rollover.spec.document import exchanged

DROP, OVERTURN = "drop_test", "side_overturn"
LAYER = {"effects.soil-layer.depth": 0.05, "effects.soil-layer.stiffness_ratio": 2.0}


@pytest.mark.parametrize(
    ("name", "changes"),
    [
        (DROP, {}),
        (DROP, {"gravity": 1.6}),
        (DROP, {"vehicle.mass": 140.0, "initiation.speed": 2.0, "ground.law.stiffness_scale": 1.2}),
        (DROP, LAYER),
        (DROP, {**LAYER, "effects.mass.added": 3.0, "vehicle.mass": 140.0}),
        (
            DROP,
            {"effects.sensor-gain.channel": "ground/sinkage", "effects.sensor-gain-2.channel": "ground/force_normal"},
        ),
        (OVERTURN, {"vehicle.wheels.rear_left.tyre.friction": 0.6, "effects.slope.angle": 0.1}),
    ],
)
def test_what_is_exchanged_is_what_is_replaced(name: str, changes: Mapping[str, Any]) -> None:
    scenario = load(name)
    assert exchanged(scenario, changes) == scenario.replaced(changes)


@pytest.mark.parametrize(
    "order", [*itertools.permutations(["effects.soil-layer", "effects.soil-layer.depth", "gravity"])]
)
def test_a_part_and_its_value_are_exchanged_in_any_order(order: tuple[str, ...]) -> None:
    kind: Any = EFFECTS["soil-layer"]
    layer = kind(stiffness_ratio=3.0)
    values = {"effects.soil-layer": layer, "effects.soil-layer.depth": 0.05, "gravity": 1.6}
    found = exchanged(exchanged(load(DROP), LAYER), {path: values[path] for path in order})
    assert found.effects == {"soil-layer": replace(layer, depth=0.05)}
    assert found.gravity == 1.6


def test_effects_stand_in_the_order_in_which_they_are_named() -> None:
    names = ["soil-stiffness", "air-drag", "mass", "guide-friction"]
    paths = ["scale", "area", "added", "force"]
    for some in itertools.permutations(range(4), 3):
        found = exchanged(load(DROP), {f"effects.{names[k]}.{paths[k]}": 1.0 for k in some})
        assert list(found.effects) == [names[k] for k in some]


def test_what_was_there_stays_as_it_was() -> None:
    before = load(DROP)
    on = exchanged(before, LAYER)
    softer = exchanged(on, {"effects.soil-layer.stiffness_ratio": 0.5})
    assert before.effects == {}
    assert on.effects["soil-layer"].stiffness_ratio == 2.0
    assert (softer.effects["soil-layer"].depth, softer.effects["soil-layer"].stiffness_ratio) == (0.05, 0.5)
    assert exchanged(on, {"effects.mass.added": 1.0}).effects["soil-layer"] is on.effects["soil-layer"]


@pytest.mark.parametrize(
    ("changes", "error", "says"),
    [
        ({"effects.soil-layer.depht": 0.05}, KeyError, "no such path: depht in SoilLayer"),
        ({"effects.mass.added": 1.0, "effects.mass.addded": 1.0}, KeyError, "no such path: addded in Mass"),
        ({"effects.soil-roots.depth": 0.05}, KeyError, "soil-roots"),
        ({"vehicle.weight": 3.0}, KeyError, "no such path: weight in Striker"),
        ({"wehicle.mass": 3.0}, KeyError, "no such path: wehicle in Scenario"),
        ({"effects.soil-layer.depth": -0.05}, ValueError, "depth: out of bounds, got -0.05"),
        ({"gravity": 31.0}, ValueError, "gravity: out of bounds, got 31.0"),
        ({"effects.mass": EFFECTS["soil-layer"]()}, ValueError, "effects: not parameters of mass"),
        ({"effects.soil-roots": EFFECTS["soil-layer"]()}, ValueError, "effects: unknown effect, got 'soil-roots'"),
    ],
)
def test_what_does_not_exist_or_is_out_of_bounds_is_refused(
    changes: Mapping[str, Any], error: type[Exception], says: str
) -> None:
    scenario: Scenario = load(DROP)
    with pytest.raises(error, match=says):
        exchanged(scenario, changes)


def test_what_several_scenarios_share_is_exchanged_once() -> None:
    """Six drops of one striker differ by their speed: an effect is made for the first, and is that of all others."""
    some = load(DROP)
    other = exchanged(some, {"initiation.speed": 2.0})
    assert exchanged(other, LAYER).effects is exchanged(some, LAYER).effects
    twice = {**LAYER, "effects.mass.added": 1.0}
    assert exchanged(other, twice).effects["soil-layer"] == exchanged(some, LAYER).effects["soil-layer"]
    assert exchanged(other, {**LAYER, "effects.soil-layer.depth": 0.06}).effects["soil-layer"].depth == 0.06


def test_a_part_is_told_from_another_by_what_its_values_are() -> None:
    """1 and 1.0 are equal, and not the same."""
    for value in (1.0, 1, 1.0):
        assert type(exchanged(load(DROP), {"effects.mass.added": value}).effects["mass"].added) is type(value)


def test_an_unhashable_value_is_exchanged_all_the_same() -> None:
    class Loose(float):
        __hash__ = None  # type: ignore[assignment]

    with pytest.raises(TypeError):
        hash(Loose(3.0))
    for added in (3.0, 4.0):
        assert exchanged(load(DROP), {"effects.mass.added": Loose(added)}).effects["mass"].added == added


def test_values_of_effects_alone_are_exchanged_the_same() -> None:
    some = load(DROP)
    twice = {**LAYER, "effects.mass.added": 1.0}
    found = with_effects_at(some, twice)
    assert found == exchanged(some, twice)
    assert some.effects == {}
    assert with_effects_at(exchanged(some, {"initiation.speed": 2.0}), twice).effects is found.effects
    with pytest.raises(ValueError, match=r"depth: out of bounds, got -0\.05"):
        with_effects_at(some, {"effects.soil-layer.depth": -0.05})
    with pytest.raises(KeyError, match="no such path: depht in SoilLayer"):
        with_effects_at(some, {"effects.soil-layer.depht": 0.05})

"""What a scenario holds: written and read again, hashed, addressed and replaced by path, checked from Python too."""

from __future__ import annotations

import json
import math
import os
import pickle
import random
import subprocess
import sys
from pathlib import Path
from typing import Annotated, Any, ClassVar

import numpy as np
import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st
from ruamel.yaml import YAML

from ground.quantity import Quantity, parameters
from ground.surface import Slope
from ground.ye import Ye2006
from rollover.effects import EFFECTS
from rollover.scenario import Scenario, load
from rollover.spec import document
from rollover.spec.document import content_hash, dump, paths, to_mapping
from rollover.spec.vehicle import Striker, Vehicle
from rollover.system.errors import InputError
from tests.rollover.example import TEXT
from tests.rollover.test_scenario import faults_of


@pytest.fixture(autouse=True)
def _inside(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)


# ---------------------------------------------------------------- back to text, and the hash


SHIPPED = [path.stem for path in sorted(document.shipped_folder().glob("*.yaml"))]


@pytest.mark.parametrize("name", SHIPPED)
def test_a_dump_gives_the_scenario_again(name: str) -> None:
    scenario = load(name)
    Path("again.yaml").write_text(dump(scenario, "a comment\nof two lines"))
    assert load("again.yaml") == scenario
    assert content_hash(load("again.yaml")) == content_hash(scenario)
    assert pickle.loads(pickle.dumps(scenario)) == scenario


numbers = st.floats(min_value=1e-300, max_value=1e300)


@settings(max_examples=60, deadline=None)
@example(first=1.0, coefficient=1e-300, length=1.0, title="\x85")  # a line break to some
@example(first=0.1, coefficient=5e-324, length=1.0, title="1e6")
@given(first=numbers, coefficient=numbers, length=st.floats(1e-3, 50.0), title=st.text(st.characters(codec="utf-8")))
def test_every_bit_of_a_number_and_every_letter_survive(
    first: float, coefficient: float, length: float, title: str
) -> None:
    Path("drop.yaml").write_text(TEXT)
    changes = {
        "title": title,
        "ground.law.first_stiffness": first,
        "ground.law.speed_coefficient": coefficient,
        "ground.elements.length": length,
    }
    scenario = load("drop.yaml").replaced(changes)
    Path("again.yaml").write_text(dump(scenario), encoding="utf-8")
    again = load("again.yaml")
    assert again == scenario
    assert content_hash(again) == content_hash(scenario)
    assert math.copysign(1.0, again.ground.law.p[4]) == 1.0


@settings(max_examples=25, deadline=None)
@given(seed=st.integers(0, 2**32))
def test_the_hash_does_not_depend_on_the_order_of_keys(seed: int) -> None:
    shuffler = random.Random(seed)

    def shuffled(value: Any) -> Any:
        if isinstance(value, dict):
            items = list(value.items())
            shuffler.shuffle(items)
            return {key: shuffled(child) for key, child in items}
        return [shuffled(child) for child in value] if isinstance(value, list) else value

    scenario = load("side_overturn_slope")
    Path("shuffled.yaml").write_text(json.dumps(shuffled(to_mapping(scenario))))  # JSON is YAML
    assert content_hash(load("shuffled.yaml")) == content_hash(scenario)


def test_the_hash_does_not_depend_on_the_layout_of_files() -> None:
    Path("soil.yaml").write_text("kind: ye-2006\n")
    Path("a.yaml").write_text(TEXT)
    Path("b.yaml").write_text("base: a.yaml\nground: {law: soil.yaml}\n")
    Path("c.yaml").write_text(TEXT.replace("3.0", "3").replace("1.0", "1").replace("0.6", "6.0e-1"))
    assert len({content_hash(load(f"{name}.yaml")) for name in "abc"}) == 1


def test_the_hash_takes_integers_and_minus_zero_as_floats() -> None:
    assert content_hash(Slope(angle_deg=5, direction_deg=-0.0)) == content_hash(Slope(angle_deg=5.0, direction_deg=0.0))


def test_the_hash_depends_on_every_value() -> None:
    scenario = load("side_overturn")
    seen = {content_hash(scenario)}
    for leaf in paths(scenario):
        if isinstance(leaf.value, float) and leaf.path not in ("simulation.step", "simulation.output_step"):
            changed = leaf.value * (1.0 - 1e-12) if leaf.value else 1e-12
            seen.add(content_hash(scenario.replaced({leaf.path: changed})))
    numbers_ = [leaf for leaf in paths(scenario) if isinstance(leaf.value, float)]
    assert len(seen) == len(numbers_) - 1  # both steps left out, the scenario itself put in


# ---------------------------------------------------------------- by path


@pytest.mark.parametrize("name", SHIPPED)
def test_every_path_takes_its_own_value(name: str) -> None:
    scenario = load(name)
    leaves = paths(scenario)
    assert len({leaf.path for leaf in leaves}) == len(leaves)
    assert scenario.replaced({leaf.path: leaf.value for leaf in leaves}) == scenario
    for leaf in leaves[::7]:
        assert scenario.replaced({leaf.path: leaf.value}) == scenario


def test_paths_carry_unit_and_meaning() -> None:
    leaf = {leaf.path: leaf for leaf in paths(load("drop_test"))}["initiation.speed"]
    assert leaf == ("initiation.speed", 3.0, "m/s", "downward, at first contact")


def test_elements_of_lists_by_name_and_by_place() -> None:
    scenario = load("side_overturn")
    by_name = scenario.replaced({"vehicle.wheels.rear_left.tyre.friction": 0.6})
    assert by_name == scenario.replaced({"vehicle.wheels.2.tyre.friction": 0.6})
    assert isinstance(by_name.vehicle, Vehicle)
    assert [wheel.tyre.friction for wheel in by_name.vehicle.wheels] == [0.8, 0.8, 0.6, 0.8]
    inertia = scenario.replaced({"vehicle.whole.inertia.1": 2900})
    assert isinstance(inertia.vehicle, Vehicle)
    assert inertia.vehicle.whole.inertia == (1300.0, 2900.0, 3300.0)


def test_numbers_of_numpy_objects_mappings_and_files_are_values() -> None:
    scenario = load("side_overturn")
    slope = Slope(angle_deg=5.0)
    for value in (slope, {"kind": "slope", "angle_deg": np.float64(5.0)}, {"kind": "slope", "angle_deg": np.int64(5)}):
        assert scenario.replaced({"ground.surface": value}).ground.surface == slope
    assert scenario.replaced({"vehicle.whole.inertia": np.array([1300.0, 3000.0, 3300.0])}) == scenario
    softer = scenario.replaced({"ground.law": "soils/natural_clay_soft.yaml"})
    assert softer.ground.law == Ye2006(stiffness_scale=0.762)


def test_a_new_kind_starts_its_part_afresh() -> None:
    scenario = load("drop_test")
    changes = {"ground.surface.angle_deg": 5.0, "ground.surface.kind": "slope"}
    assert scenario.replaced(changes).ground.surface == Slope(angle_deg=5.0)
    with pytest.raises(InputError) as caught:
        scenario.replaced({"ground.law.kind": "press"})
    assert [fault.path for fault in caught.value.faults if "missing" in fault.message] == [
        f"ground.law.{name}" for name in ("stiffness", "damping", "side_damping", "side_mass")
    ]
    assert len(caught.value.faults) == 4  # and none about what belonged to the other kind


@pytest.mark.parametrize(
    ("changes", "line"),
    [
        (
            {"ground.law.stifness_scale": 1.2},
            "replaced: ground.law.stifness_scale: no such path; did you mean 'ground.law.stiffness_scale' "
            "or 'ground.law.first_stiffness' or 'ground.law.second_stiffness'?",
        ),
        (
            {"ground.law.stiffness_scale": -1},
            "replaced: ground.law.stiffness_scale: out of bounds, got -1; a number greater than 0 is allowed",
        ),
        (
            {"ground.law.stiffness_scale": "1.2"},
            "replaced: ground.law.stiffness_scale: not a number, got text '1.2'; a number greater than 0 is allowed "
            "(without quotes)",
        ),
        (
            {"ground.law.stiffness_scale": float("nan")},
            "replaced: ground.law.stiffness_scale: not finite, got nan; a number greater than 0 is allowed",
        ),
        ({"x": 1}, "replaced: x: no such path; see `rollover list paths SCENARIO`"),
        (
            {"ground.law.stiffness_scale": object()},
            "replaced: ground.law.stiffness_scale: not a value of a file, got object; a number, text, list or mapping",
        ),
        (
            {"simulation.step": 0.0003},
            "replaced: simulation.output_step: not a multiple of step (0.0003 s), got 0.0002; such as 0.0003",
        ),
        (
            {"effects.soil-adhesio.stress": 500.0},
            "replaced: effects.soil-adhesio: unknown effect, got 'soil-adhesio'; did you mean 'soil-adhesion'?"
            " (one of your own: `rollover --effects FILE ...`)",
        ),
        (
            {"vehicle": "vehicles/compact_tractr.yaml"},
            "replaced: vehicle: no such file, got 'vehicles/compact_tractr.yaml'; "
            "did you mean 'vehicles/compact_tractor.yaml'?",
        ),
    ],
)
def test_a_wrong_change_is_one_line(changes: dict[str, Any], line: str) -> None:
    with pytest.raises(InputError) as caught:
        load("drop_test").replaced(changes)
    assert str(caught.value) == line


def test_settings_of_the_command_line_are_read_as_in_a_file() -> None:
    path, value = document.parse_setting("ground.elements.centre=[1, 2e0]")
    assert load("drop_test").replaced({path: value}).ground.elements.centre == (1.0, 2.0)
    path, value = document.parse_setting("initiation.speed=3 km/h")
    with pytest.raises(InputError, match=r"^--set: initiation.speed: not a number, got text '3 km/h'"):
        load("drop_test").replaced({path: value}, origin="--set")
    for text in ("a", "a=", "=3"):
        with pytest.raises(InputError, match=r"^--set: not a setting, got .*; PATH=VALUE is needed$"):
            document.parse_setting(text)


# ---------------------------------------------------------------- what is open: laws and effects


@parameters
class Adhesion:
    """A made-up effect."""

    kind: ClassVar[str] = "physics"

    stress: Annotated[float, Quantity("Pa", "pull-off stress", least=0)]


def test_an_effect_of_the_table_is_read_replaced_and_written(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(EFFECTS, "soil-adhesion", Adhesion)
    Path("with.yaml").write_text(f"{TEXT}effects: {{soil-adhesion: {{stress: 500}}}}\n")
    scenario = load("with.yaml")
    assert scenario.effects == {"soil-adhesion": Adhesion(stress=500.0)}
    assert ("effects.soil-adhesion.stress", 500.0, "Pa", "pull-off stress") in paths(scenario)
    Path("again.yaml").write_text(dump(scenario))
    assert load("again.yaml") == scenario
    Path("bare.yaml").write_text(TEXT)
    assert load("bare.yaml").replaced({"effects.soil-adhesion.stress": 500.0}) == scenario
    assert faults_of(f"{TEXT}effects: {{soil-adhesio: {{stress: 5}}}}\n") == [
        "bad.yaml:11: effects.soil-adhesio: unknown effect, got 'soil-adhesio'; did you mean 'soil-adhesion'?"
        " (one of your own: `rollover --effects FILE ...`)"
    ]
    assert faults_of(f"{TEXT}effects: {{soil-adhesion: {{stress: -5}}}}\n") == [
        "bad.yaml:11: effects.soil-adhesion.stress: out of bounds, got -5; a number at least 0 Pa is allowed"
    ]


def test_effects_from_python_are_checked_too(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(EFFECTS, "soil-adhesion", Adhesion)
    drop = load("drop_test")

    def with_(effects: dict[str, Any]) -> Scenario:
        parts = {name: getattr(drop, name) for name in ("title", "vehicle", "ground", "initiation", "simulation")}
        return Scenario(**parts, effects=effects)

    assert with_({"soil-adhesion": Adhesion(stress=1.0)}).effects
    monkeypatch.setitem(EFFECTS, "soil-suction", Adhesion)
    both = {"soil-adhesion": Adhesion(stress=1.0), "soil-suction": Adhesion(stress=2.0)}
    assert content_hash(with_(both)) == content_hash(with_(dict(reversed(both.items()))))
    monkeypatch.delitem(EFFECTS, "soil-suction")
    with pytest.raises(ValueError, match=r"^effects: unknown effect, got 'nope'; allowed: .*soil-adhesion"):
        with_({"nope": Adhesion(stress=1.0)})
    with pytest.raises(ValueError, match=r"^effects: not parameters of soil-adhesion, got 5; Adhesion$"):
        with_({"soil-adhesion": 5})


NEW_LAW = """
from typing import Annotated, Literal
from ground.law import GroundLaw
from ground.quantity import Quantity, parameters
from rollover.scenario import load

load("drop.yaml")

@parameters
class Peat(GroundLaw):
    kind: Literal["peat"] = "peat"
    stiffness: Annotated[float, Quantity("N/m", "secant", above=0)] = 3.0e4

print(load("peat.yaml").ground.law)
"""


def test_a_law_defined_later_is_accepted() -> None:
    # in a process of its own: the table of laws forgets nothing
    Path("drop.yaml").write_text(TEXT)
    Path("peat.yaml").write_text(TEXT.replace("ye-2006", "peat"))
    env = {**os.environ, "PYTHONPATH": str(Path(__file__).resolve().parents[2])}
    done = subprocess.run([sys.executable, "-c", NEW_LAW], capture_output=True, text=True, check=True, env=env)
    assert done.stdout.strip() == "Peat(recovery=0.02, calibration=None, kind='peat', stiffness=30000.0)"


# ---------------------------------------------------------------- parts that must fit together


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"vehicle.wheels": []}, "initiation.side: nothing to tip over, got 0 wheels on the left and 0 on the other"),
        (
            {"vehicle.wheels": [], "initiation.kind": "standing"},
            "initiation.kind: 'standing' needs at least 3 wheels on both sides, got 0 left and 0 right",
        ),
        (
            {"vehicle.wheels": [], "vehicle.rops": None, "vehicle.outline": [], "initiation.kind": "drop",
             "initiation.speed": 1.0},
            "vehicle.outline: nothing can touch the ground, got no outline, wheels or ROPS members",
        ),
        ({"vehicle.front_axle": None}, "vehicle.wheels: a wheel is carried by 'front_axle' but there is none"),
        ({"simulation.duration": 1e-4}, "simulation.duration: less than output_step (0.001 s), got 0.0001; longer"),
        ({"vehicle.rops.mounts.left.name": "a.b"}, "vehicle.rops.mounts.a.b.name: not a plain name, got text 'a.b'"),
    ],
)  # fmt: skip
def test_parts_must_fit_together(changes: dict[str, Any], message: str) -> None:
    with pytest.raises(InputError) as caught:
        load("side_overturn").replaced(changes)
    assert message in str(caught.value)
    assert len(caught.value.faults) == 1


def test_a_rigid_tractor_without_axle_may_tip() -> None:
    scenario = load("side_overturn")
    vehicle = to_mapping(scenario)["vehicle"]
    wheels = [{**wheel, "carrier": "chassis"} for wheel in vehicle["wheels"]]
    rigid = scenario.replaced({"vehicle.wheels": wheels, "vehicle.front_axle": None})
    assert not isinstance(rigid.vehicle, Striker)
    assert rigid.vehicle.front_axle is None


def test_the_dump_is_plain_yaml_1_2() -> None:
    scenario = load("side_overturn")
    assert YAML(typ="safe", pure=True).load(dump(scenario)) == to_mapping(scenario)
    assert "inertia: [1300.0, 3000.0, 3300.0]\n" in dump(scenario)


def test_a_change_reaches_into_what_another_one_brought() -> None:
    """A file, and a file or a value below it: whatever the order, the whole comes before its parts."""
    scenario = load("side_overturn")
    whole = {"vehicle": "vehicles/compact_tractor.yaml"}
    below = {"vehicle.rops": "vehicles/rops/two_post_rear_450.yaml", "vehicle.wheels.rear_left.tyre.friction": 0.3}
    below["vehicle.rops.mounts.left.yield_force"] = [1.0, 2.0, 3.0]
    found = scenario.replaced({**whole, **below})
    assert found == scenario.replaced({**below, **whole})
    assert found == scenario.replaced(whole).replaced(below)
    assert isinstance(found.vehicle, Vehicle)
    assert found.vehicle.rops is not None
    assert found.vehicle.rops.mounts[0].yield_force == (1.0, 2.0, 3.0)
    assert found.vehicle.wheels[2].tyre.friction == 0.3
    assert found.vehicle.name == "Compact tractor, two-post rear ROPS"


def test_a_key_missing_in_an_included_file_may_be_set() -> None:
    scenario = load("side_overturn")
    law = {"ground.law": "soils/natural_clay_soft.yaml"}
    assert scenario.replaced({**law, "ground.law.recovery": 0.02}).ground.law == Ye2006(
        stiffness_scale=0.762, recovery=0.02
    )
    with pytest.raises(InputError, match=r"ground\.law\.recovry: unknown key"):
        scenario.replaced({**law, "ground.law.recovry": 0.02})
    with pytest.raises(InputError, match=r"vehicle: no such file, got 'vehicles/tractr\.yaml'"):
        scenario.replaced({"vehicle": "vehicles/tractr.yaml", "vehicle.rops": None})
    with pytest.raises(InputError, match=r"ground\.surface\.x\.y: no such path"):
        scenario.replaced({"ground.surface": {"kind": "plane"}, "ground.surface.x.y": 1.0})


def test_kind_and_value_of_what_the_command_line_brought() -> None:
    """A mapping as text: its kind and what is below it can be set as well."""
    scenario = load("side_overturn")
    text = dict([document.parse_setting("ground.surface={kind: slope, angle_deg: 5}")])
    assert scenario.replaced({**text, "ground.surface.angle_deg": 7.0}).ground.surface == Slope(angle_deg=7.0)
    same = scenario.replaced({**text, "ground.surface.kind": "slope"})
    assert same.ground.surface == Slope(angle_deg=5.0)

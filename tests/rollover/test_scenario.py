"""The door: files in, objects out, back again, by path; and a sentence for everything that is wrong."""

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
from ground.surface import Plane, Slope
from ground.ye import Ye2006
from rollover import document
from rollover.document import content_hash, dump, paths, to_mapping
from rollover.effects import EFFECTS
from rollover.faults import InputError
from rollover.scenario import Scenario, load
from rollover.vehicle import Striker, Vehicle
from tests.rollover.example import TEXT

SPEED = "a number greater than 0 and at most 20 m/s is allowed"
SIMULATION = "duration, step, output_step, spectral_radius, stop_at_rest"
DROP = "kind, speed, lead_time, roll_deg, pitch_deg, yaw_deg, position"
ROOT = "format, title, vehicle, ground, initiation, simulation, excitation, loads, gravity, effects"
LAWS = "bearing, compaction, fluid-entry, hard, press, treated, ye-2006"
PAIR = "a list of 2, each a number greater than 0 m,"


@pytest.fixture(autouse=True)
def _inside(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)


def faults_of(text: str | bytes, **others: str) -> list[str]:
    """Lines of what is wrong with a file `bad.yaml`, with others beside it."""
    for name, content in others.items():
        Path(f"{name}.yaml").write_text(content, encoding="utf-8")
    Path("bad.yaml").write_bytes(text if isinstance(text, bytes) else text.encode())
    with pytest.raises(InputError) as caught:
        load("bad.yaml")
    lines = str(caught.value).splitlines()
    assert lines == [str(fault) for fault in caught.value.faults]
    return lines


def without(old: str, new: str) -> str:
    assert TEXT.count(old) == 1
    return TEXT.replace(old, new)


ONE_FAULT: dict[str, tuple[str | bytes, str]] = {
    "quoted number": (
        without("speed: 3.0", "speed: '1e6'"),
        f"bad.yaml:8: initiation.speed: not a number, got text '1e6'; {SPEED} (without quotes)",
    ),
    "unit": (
        without("speed: 3.0", "speed: 3 km/h"),
        f"bad.yaml:8: initiation.speed: not a number, got text '3 km/h'; {SPEED} (the bare number, without its unit)",
    ),
    "nan": (without("speed: 3.0", "speed: .nan"), f"bad.yaml:8: initiation.speed: not finite, got nan; {SPEED}"),
    "inf": (without("speed: 3.0", "speed: -.inf"), f"bad.yaml:8: initiation.speed: not finite, got -inf; {SPEED}"),
    "overflow": (without("speed: 3.0", "speed: 1e999"), f"bad.yaml:8: initiation.speed: not finite, got inf; {SPEED}"),
    "NaN": (
        without("speed: 3.0", "speed: NaN"),
        f"bad.yaml:8: initiation.speed: not a number, got text 'NaN'; {SPEED}",
    ),
    "true": (without("speed: 3.0", "speed: true"), f"bad.yaml:8: initiation.speed: not a number, got true; {SPEED}"),
    "nothing": (without("speed: 3.0", "speed:"), f"bad.yaml:8: initiation.speed: not a number, got nothing; {SPEED}"),
    "negative": (without("speed: 3.0", "speed: -3"), f"bad.yaml:8: initiation.speed: out of bounds, got -3; {SPEED}"),
    "empty": ("", "bad.yaml:1: empty, got nothing but comments; a mapping is needed"),
    "comments": ("# x\n# y\n", "bad.yaml:1: empty, got nothing but comments; a mapping is needed"),
    "list": ("- 1\n", f"bad.yaml:1: not a mapping, got [1]; a mapping ({ROOT}) or the name of a .yaml file is needed"),
    "duplicate": (f"{TEXT}title: again\n", "bad.yaml:11: title: given twice, first on line 1; once is allowed"),
    "duplicate inside": (
        without("  speed: 3.0", "  speed: 3.0\n  speed: 4.0"),
        "bad.yaml:9: initiation.speed: given twice, first on line 8; once is allowed",
    ),
    "unknown key": (
        f"{TEXT}  duraton: 2\n",
        f"bad.yaml:11: simulation.duraton: unknown key, got 'duraton'; did you mean 'duration'? allowed: {SIMULATION}",
    ),
    "unlike any key": (f"{TEXT}zzz: 1\n", f"bad.yaml:11: zzz: unknown key, got 'zzz'; allowed: {ROOT}"),
    "number as key": (f"{TEXT}1: 2\n", f"bad.yaml:11: 1: unknown key, got '1'; allowed: {ROOT}"),
    "unknown kind": (
        without("ye-2006", "ye-2005"),
        f"bad.yaml:5: ground.law.kind: unknown kind, got text 'ye-2005'; did you mean 'ye-2006'? allowed: {LAWS}",
    ),
    "no kind": (
        without("{kind: ye-2006}", "{recovery: 0.1}"),
        f"bad.yaml:5: ground.law.kind: missing; one of {LAWS} is needed",
    ),
    "missing key": (without("title: Drop\n", ""), "bad.yaml:1: title: missing; text is needed"),
    "missing inside": (
        without("  duration: 0.6", "  step: 0.001"),
        "bad.yaml:9: simulation.duration: missing; a number greater than 0 and at most 120 s is needed",
    ),
    "number for a mapping": (
        without("{kind: ye-2006}", "5"),
        "bad.yaml:5: ground.law: not a mapping, got 5; "
        "a mapping (kind: bearing or compaction or fluid-entry or hard or press or treated or ye-2006) "
        "or the name of a .yaml file is allowed",
    ),
    "too short": (
        without("width: 1.0", "width: 1.0, spacing: []"),
        f"bad.yaml:4: ground.elements.spacing: too short, got a list of 0; {PAIR} is needed",
    ),
    "too long": (
        without("width: 1.0", "width: 1.0, spacing: [1, 1, 1]"),
        f"bad.yaml:4: ground.elements.spacing: too long, got a list of 3; {PAIR} is allowed",
    ),
    "number for a list": (
        without("width: 1.0", "width: 1.0, spacing: 0.1"),
        f"bad.yaml:4: ground.elements.spacing: not a list, got 0.1; {PAIR} is allowed",
    ),
    "element of a list": (
        without("width: 1.0", "width: 1.0, spacing: [0.1, 0]"),
        "bad.yaml:4: ground.elements.spacing.1: out of bounds, got 0; a number greater than 0 m is allowed",
    ),
    "rule of a class": (
        without("width: 1.0", "width: 1.0, spacing: [1e-5, 1e-5]"),
        "bad.yaml:4: ground.elements.spacing: gives 100000 x 100000 elements; at most 4000000 in all",
    ),
    "between steps": (
        f"{TEXT}  output_step: 0.0015\n",
        "bad.yaml:11: simulation.output_step: not a multiple of step (0.001 s), got 0.0015; such as 0.002",
    ),
    "choice": (
        without("  law:", "  striker_mass: refrence\n  law:"),
        "bad.yaml:5: ground.striker_mass: not one of the choices, got text 'refrence'; did you mean 'reference'? "
        "allowed: reference, effective, clamped",
    ),
    "choice of numbers": (
        f"{TEXT}loads: {{cfc: 61}}\n",
        "bad.yaml:11: loads.cfc: not one of the choices, got 61; 60 or 180 or 600 or 1000 is allowed",
    ),
    "yes": (
        f"{TEXT}  stop_at_rest: yes\n",
        "bad.yaml:11: simulation.stop_at_rest: not true or false, got text 'yes'; true or false is allowed",
    ),
    "title": (without("title: Drop", "title: 5"), "bad.yaml:1: title: not text, got 5; text is allowed"),
    "effect": (
        f"{TEXT}effects:\n  soil-adhesio: {{stress: 5}}\n",
        "bad.yaml:12: effects.soil-adhesio: unknown effect, got 'soil-adhesio'; did you mean 'soil-adhesion'?",
    ),
    "striker tips": (
        without("kind: drop\n  speed: 3.0", "kind: tip-over"),
        "bad.yaml:7: initiation.kind: a striker cannot begin so, got 'tip-over'; 'drop' or 'release' is allowed",
    ),
    "striker rolls": (
        without("speed: 3.0", "speed: 3.0\n  roll_deg: 5"),
        "bad.yaml:9: initiation.roll_deg: a striker keeps level on its guide, got 5.0; 0 is allowed",
    ),
    "syntax": (
        without("ground:", "ground: ["),
        "bad.yaml:5: not valid YAML: while parsing a flow sequence, expected ',' or ']', but got '<scalar>'",
    ),
    "indentation": ("title: a\n  b: c\n", "bad.yaml:2: not valid YAML: mapping values are not allowed here"),
    "two documents": (
        "a: 1\n---\nb: 2\n",
        "bad.yaml:2: not valid YAML: expected a single document in the stream, but found another document",
    ),
    "control character": (b"a: 1\nb: \x01\n", "bad.yaml:2: not valid YAML: special characters are not allowed"),
    "not text": (b"a: 1\nb: \xff\n", "bad.yaml:2: not UTF-8 text, got byte 0xff"),
    "alias to itself": ("title: &a {x: *a}\n", "bad.yaml:1: title.x: contains itself through an alias"),
    "tag": (
        without("title: Drop", "title: !foo Drop"),
        "bad.yaml:1: title: unknown tag, got !foo; plain values are allowed",
    ),
    "list as key": ("? [1]\n: 2\n", "bad.yaml:1: a key is not text, got a list or mapping; keys are plain words"),
    "nested": ("[" * 4000, "bad.yaml:1: nested too deeply"),
    "missing vehicle file": (
        without("{kind: striker}", "vehicles/utilty_tractor.yaml"),
        "bad.yaml:2: vehicle: no such file, got 'vehicles/utilty_tractor.yaml'; "
        "did you mean 'vehicles/utility_tractor.yaml'?",
    ),
    "missing base": (
        "base: side_overtrun.yaml\n",
        "bad.yaml:1: base: no such file, got 'side_overtrun.yaml'; did you mean 'side_overturn.yaml'?",
    ),
    "base is no file": ("base: 3\n", "bad.yaml:1: base: not a file name, got 3; a .yaml file is needed"),
    "includes itself": (
        "base: bad.yaml\n",
        "bad.yaml:1: base: a file includes itself, got bad.yaml -> bad.yaml; no circles",
    ),
}


@pytest.mark.parametrize("name", ONE_FAULT)
def test_each_fault_is_one_line_with_its_place(name: str) -> None:
    text, line = ONE_FAULT[name]
    assert faults_of(text) == [line]


def test_all_faults_are_told_at_once() -> None:
    text = without("speed: 3.0", "speed: x\n  lead: 3").replace("duration: 0.6", "duration: 0")
    assert faults_of(text) == [
        f"bad.yaml:8: initiation.speed: not a number, got text 'x'; {SPEED}",
        f"bad.yaml:9: initiation.lead: unknown key, got 'lead'; did you mean 'lead_time'? allowed: {DROP}",
        "bad.yaml:11: simulation.duration: out of bounds, got 0; a number greater than 0 and at most 120 s is allowed",
    ]


def test_a_fault_in_an_included_file_names_that_file() -> None:
    text = without("{kind: ye-2006}", "soil.yaml")
    soil = "# clay\nkind: ye-2006\nfirst_stiffness: -3\n"
    assert faults_of(text, soil=soil) == [
        "soil.yaml:3: ground.law.first_stiffness: out of bounds, got -3; a number greater than 0 N/m is allowed"
    ]
    missing = (
        "soil.yaml:1: ground.law.kind: missing; "
        "one of bearing, compaction, fluid-entry, hard, press, treated, ye-2006 is needed"
    )
    assert faults_of(text, soil="recovery: 0.1\n") == [missing]
    wrong = (
        "a mapping (kind: bearing or compaction or fluid-entry or hard or press or treated or ye-2006) "
        "or the name of a .yaml file is needed"
    )
    assert faults_of(text, soil="- 3\n") == [f"soil.yaml:1: not a mapping, got [3]; {wrong}"]


def test_a_circle_of_files_is_found() -> None:
    assert faults_of("base: other.yaml\n", other="base: bad.yaml\n") == [
        "other.yaml:1: base.base: a file includes itself, got bad.yaml -> other.yaml -> bad.yaml; no circles"
    ]


def test_no_such_scenario() -> None:
    with pytest.raises(InputError, match=r"^side_overtun: no such file; did you mean 'side_overturn'\?$"):
        load("side_overtun")


def test_python_is_checked_like_files() -> None:
    with pytest.raises(ValueError, match=r"^angle_deg: out of bounds, got 61; at least -60 and at most 60 deg"):
        Slope(angle_deg=61)
    with pytest.raises(ValueError, match="not a multiple of step"):
        load("drop_test").simulation.__class__(duration=1.0, step=0.001, output_step=0.0015)


def test_whole_numbers_and_lists_are_accepted() -> None:
    Path("good.yaml").write_text(without("width: 1.0", "width: 1, spacing: [1, 1]"))
    elements = load("good.yaml").ground.elements
    assert elements.spacing == (1.0, 1.0)
    assert isinstance(elements.spacing[0], float)


def test_yaml_is_1_2() -> None:
    Path("good.yaml").write_text(without("title: Drop", "title: no").replace("0.6", "6e-1"))
    scenario = load("good.yaml")
    assert (scenario.title, scenario.simulation.duration) == ("no", 0.6)


# ---------------------------------------------------------------- includes and base


def test_a_base_is_overridden_key_by_key() -> None:
    Path("base.yaml").write_text(TEXT)
    Path("variant.yaml").write_text("base: base.yaml\nground: {elements: {width: 2.0}}\n")
    base, variant = load("base.yaml"), load("variant.yaml")
    assert variant == base.replaced({"ground.elements.width": 2.0})


def test_a_different_kind_replaces_the_base() -> None:
    Path("base.yaml").write_text(TEXT.replace("  law:", "  surface: {kind: slope, angle_deg: 5}\n  law:"))
    Path("variant.yaml").write_text("base: base.yaml\nground: {surface: {kind: plane}}\n")
    assert load("variant.yaml").ground.surface == Plane()


def test_an_included_part_takes_overrides_and_a_file_replaces_it() -> None:
    Path("soil.yaml").write_text("kind: ye-2006\nrecovery: 0.1\n")
    Path("other.yaml").write_text("kind: ye-2006\nstiffness_scale: 2.0\n")
    Path("base.yaml").write_text(TEXT.replace("{kind: ye-2006}", "soil.yaml"))
    Path("scaled.yaml").write_text("base: base.yaml\nground: {law: {stiffness_scale: 3.0}}\n")
    Path("swapped.yaml").write_text("base: base.yaml\nground: {law: other.yaml}\n")
    assert load("scaled.yaml").ground.law == Ye2006(recovery=0.1, stiffness_scale=3.0)
    assert load("swapped.yaml").ground.law == Ye2006(stiffness_scale=2.0)


def test_files_are_looked_for_beside_the_including_file_and_then_among_the_shipped() -> None:
    Path("mine").mkdir()
    Path("mine/soil.yaml").write_text("kind: ye-2006\nrecovery: 0.3\n")
    Path("mine/a.yaml").write_text(TEXT.replace("{kind: ye-2006}", "soil.yaml"))
    Path("mine/b.yaml").write_text(TEXT.replace("{kind: ye-2006}", "soils/natural_clay.yaml"))
    assert load("mine/a.yaml").ground.law.recovery == 0.3
    assert load("mine/b.yaml").ground.law == Ye2006()
    Path("mine/soils").mkdir()
    Path("mine/soils/natural_clay.yaml").write_text("kind: ye-2006\nrecovery: 0.4\n")
    assert load("mine/b.yaml").ground.law.recovery == 0.4


def test_shipped_scenarios_are_found_by_name() -> None:
    assert load("drop_test") == load("drop_test.yaml") == load(document.shipped_folder() / "drop_test.yaml")


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


def test_the_hash_takes_whole_numbers_and_minus_zero_from_python_as_the_numbers_they_are() -> None:
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
            "replaced: effects.soil-adhesio: unknown effect, got 'soil-adhesio'; did you mean 'soil-adhesion'?",
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
    assert found.vehicle.name == "Compact tractor 2 t, two-post rear ROPS"


def test_a_key_that_the_brought_file_lacks_may_be_set_and_is_checked() -> None:
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

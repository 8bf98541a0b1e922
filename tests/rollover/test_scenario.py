"""The door: files in, objects out, back again, by path; and a sentence for everything that is wrong."""

from __future__ import annotations

from pathlib import Path

import pytest

from ground.surface import Plane, Slope
from ground.ye import Ye2006
from rollover.cli import catalogue
from rollover.scenario import AnyVehicle, load
from rollover.spec import document
from rollover.system.errors import InputError
from tests.rollover.example import TEXT

SPEED = "a number greater than 0 and at most 20 m/s is allowed"
SIMULATION = "duration, step, output_step, spectral_radius, integrator, stop_at_rest"
DROP = "kind, speed, lead_time, roll_deg, pitch_deg, yaw_deg, position"
ROOT = "format, title, vehicle, ground, initiation, simulation, excitation, inputs, loads, gravity, effects"
LAWS = "bearing, bekker-wong, compaction, fluid-entry, hard, press, treated, ye-2006"
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
    "decimal comma": (
        without("speed: 3.0", "speed: 3,5"),
        f"bad.yaml:8: initiation.speed: not a number, got text '3,5'; {SPEED} (with a decimal point)",
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
        "a mapping (kind: bearing or bekker-wong or compaction or fluid-entry or hard or press or treated or ye-2006) "
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
        "bad.yaml:12: effects.soil-adhesio: unknown effect, got 'soil-adhesio'; did you mean 'soil-adhesion'?"
        " (one of your own: `rollover --effects FILE ...`)",
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
        "bad.yaml:5: not valid YAML: while parsing a flow sequence, expected ',' or ']', but got '<scalar>'; "
        "quote text that holds : # [ ] { } & * ! %, and indent with blanks",
    ),
    "indentation": (
        "title: a\n  b: c\n",
        "bad.yaml:2: not valid YAML: mapping values are not allowed here; "
        "quote text that holds : # [ ] { } & * ! %, and indent with blanks",
    ),
    "two documents": (
        "a: 1\n---\nb: 2\n",
        "bad.yaml:2: not valid YAML: expected a single document in the stream, but found another document; "
        "quote text that holds : # [ ] { } & * ! %, and indent with blanks",
    ),
    "control character": (
        b"a: 1\nb: \x01\n",
        "bad.yaml:2: not valid YAML: special characters are not allowed; printable text is needed",
    ),
    "not text": (b"a: 1\nb: \xff\n", "bad.yaml:2: not UTF-8 text, got byte 0xff; save it as UTF-8"),
    "alias to itself": (
        "title: &a {x: *a}\n",
        "bad.yaml:1: title.x: contains itself through an alias; plain values, lists and mappings of them are allowed",
    ),
    "tag": (
        without("title: Drop", "title: !foo Drop"),
        "bad.yaml:1: title: unknown tag, got !foo; plain values are allowed",
    ),
    "tag of a mapping": (
        without("title: Drop", "title: !!python/object:os.x {a: 1}"),
        "bad.yaml:1: title: unknown tag, got tag:yaml.org,2002:python/object:os.x; plain values are allowed",
    ),
    "tag of a row": (
        without("title: Drop", "title: !!python/tuple [1.0, 2.0]"),
        "bad.yaml:1: title: unknown tag, got tag:yaml.org,2002:python/tuple; plain values are allowed",
    ),
    "list as key": ("? [1]\n: 2\n", "bad.yaml:1: a key is not text, got a list or mapping; keys are plain words"),
    "nested": ("[" * 4000, "bad.yaml:1: nested too deeply; a few levels are needed"),
    "missing vehicle file": (
        without("{kind: striker}", "vehicles/utilty_tractor.yaml"),
        "bad.yaml:2: vehicle: no such file, got 'vehicles/utilty_tractor.yaml'; "
        "did you mean 'vehicles/utility_tractor.yaml'?",
    ),
    "missing base": (
        "base: side_overtrun.yaml\n",
        "bad.yaml:1: base: no such file, got 'side_overtrun.yaml'; did you mean 'side_overturn.yaml'?",
    ),
    "base is no file": (
        "base: 3\n",
        "bad.yaml:1: base: not a file name, got 3; a .yaml file or the name of a shipped one is needed",
    ),
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
        "one of bearing, bekker-wong, compaction, fluid-entry, hard, press, treated, ye-2006 is needed"
    )
    assert faults_of(text, soil="recovery: 0.1\n") == [missing]
    wrong = (
        "a mapping (kind: bearing or bekker-wong or compaction or fluid-entry or hard or press or treated or ye-2006) "
        "or the name of a .yaml file is needed"
    )
    assert faults_of(text, soil="- 3\n") == [f"soil.yaml:1: not a mapping, got a list; {wrong}"]


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


def test_includes_are_found_beside_the_file_then_shipped() -> None:
    Path("mine").mkdir()
    Path("mine/soil.yaml").write_text("kind: ye-2006\nrecovery: 0.3\n")
    Path("mine/a.yaml").write_text(TEXT.replace("{kind: ye-2006}", "soil.yaml"))
    Path("mine/b.yaml").write_text(TEXT.replace("{kind: ye-2006}", "soils/natural_clay.yaml"))
    assert load("mine/a.yaml").ground.law.recovery == 0.3
    assert load("mine/b.yaml").ground.law == Ye2006()
    Path("mine/soils").mkdir()
    Path("mine/soils/natural_clay.yaml").write_text("kind: ye-2006\nrecovery: 0.4\n")
    assert load("mine/b.yaml").ground.law.recovery == 0.4


def test_list_elements_are_overridden_by_name() -> None:
    shipped = load("side_overturn")
    Path("mine.yaml").write_text("base: utility_tractor\nwheels: {front_left: {inertia: 2.5, tyre: {friction: 0.1}}}\n")
    Path("a.yaml").write_text("base: side_overturn\nvehicle: mine.yaml\n")
    by_set = {"vehicle.wheels.front_left.inertia": 2.5, "vehicle.wheels.front_left.tyre.friction": 0.1}
    assert load("a.yaml").vehicle == shipped.replaced(by_set).vehicle
    # over a base in the same file, and by place
    Path("b.yaml").write_text("base: side_overturn\nvehicle: {wheels: {'0': {inertia: 2.5}}}\n")
    assert load("b.yaml") == shipped.replaced({"vehicle.wheels.0.inertia": 2.5})


def test_an_element_that_the_base_lacks_is_named() -> None:
    Path("mine.yaml").write_text("base: utility_tractor\nwheels:\n  front_lef: {inertia: 2.5}\n")
    with pytest.raises(
        InputError, match=r"mine.yaml:3: wheels.front_lef: no such element, .* did you mean 'front_left'"
    ):
        document.load("mine.yaml", AnyVehicle)


def test_base_and_parts_go_by_the_names_that_list_shows() -> None:
    Path("a.yaml").write_text("base: side_overturn\nvehicle: vineyard_tractor\nground: {law: natural_clay_soft}\n")
    whole = {"vehicle": "vehicles/vineyard_tractor.yaml", "ground.law": "soils/natural_clay_soft.yaml"}
    assert load("a.yaml") == load("side_overturn").replaced(whole)
    Path("vineyard_tractor.yaml").write_text("base: utility_tractor\nname: one of my own\n")
    assert load("a.yaml").vehicle.name == "one of my own"
    Path("a.yaml").write_text("base: side_overtur\n")
    with pytest.raises(InputError, match=r"a.yaml:1: base: no such file, got 'side_overtur'; did you mean 'side_over"):
        load("a.yaml")


@pytest.mark.parametrize("what", ["scenario", "study", "vehicle", "soil"])
def test_base_finds_every_name_that_list_shows(what: str) -> None:
    names = [row["name"] for row in catalogue.TABLES[what.replace("y", "ie") + "s"]()]
    assert len(names) >= 4
    for name in names:
        Path("own.yaml").write_text(f"base: {name}\n")
        assert catalogue.check("own.yaml") == what, name


def test_a_frame_goes_by_its_name_too() -> None:
    Path("own.yaml").write_text("base: compact_tractor\nrops: two_post_rear_3t\n")
    assert document.load("own.yaml", AnyVehicle).rops == load("side_overturn").vehicle.rops


@pytest.mark.parametrize(
    ("base", "cure"),
    [
        ("utility_tracto", "did you mean 'utility_tractor'?"),
        ("slope_side_overtur", "did you mean 'slope_side_overturn'?"),
        ("../elsewhere/zzzz.yaml", "a file beside this one or a name that `rollover list` shows is needed"),
    ],
)
def test_a_base_that_is_not_there_is_the_fault_not_the_kind(base: str, cure: str) -> None:
    """A file that says nothing but its base is not asked what it is: the base would have told."""
    Path("own.yaml").write_text(f"# mine\nbase: {base}\nmass: 3000\n")
    with pytest.raises(InputError) as e:
        catalogue.check("own.yaml")
    assert str(e.value) == f"own.yaml:2: base: no such file, got '{base}'; {cure}"


def test_a_star_stands_for_every_element_of_a_list() -> None:
    shipped = load("side_overturn")
    names = [wheel.name for wheel in shipped.vehicle.wheels]
    each = shipped.replaced({f"vehicle.wheels.{name}.inertia": 7.0 for name in names})
    assert shipped.replaced({"vehicle.wheels.*.inertia": 7.0}) == each
    # one element's own value stands, in whichever order they are given
    one = {"vehicle.wheels.rear_left.inertia": 9.0, "vehicle.wheels.*.inertia": 7.0}
    assert shipped.replaced(one) == each.replaced({"vehicle.wheels.rear_left.inertia": 9.0})
    with pytest.raises(InputError, match=r"vehicle.\*.mass: no list, got 'vehicle' before the \*"):
        shipped.replaced({"vehicle.*.mass": 1.0})
    with pytest.raises(InputError, match=r"vehicle.wheels.front_left.inertai: no such path; did you mean"):
        shipped.replaced({"vehicle.wheels.*.inertai": 1.0})


def test_a_file_that_says_not_what_it_is_is_asked_for_its_kind() -> None:
    Path("soil.yaml").write_text("surface_pressure: 3000\ndepth_pressure: 2000\n")
    message = r"soil.yaml:1: kind: missing, got surface_pressure, depth_pressure; bearing \(a soil\), .*scenario"
    with pytest.raises(InputError, match=message):
        catalogue.check("soil.yaml")
    Path("tractor.yaml").write_text("name: mine\nwhole: {mass: 3000}\nwheels: []\n")
    with pytest.raises(InputError, match=r"tractor.yaml:1: kind: missing, .*; vehicle \(a vehicle\)"):
        catalogue.check("tractor.yaml")


def test_shipped_scenarios_are_found_by_name() -> None:
    assert load("drop_test") == load("drop_test.yaml") == load(document.shipped_folder() / "drop_test.yaml")

"""Every shipped file: loads, opens with comments, says where its numbers come from, fits the JSON schema."""

from __future__ import annotations

import json
import math
import subprocess
import sys
from dataclasses import is_dataclass
from pathlib import Path
from typing import Any

import jsonschema  # type: ignore[import-untyped]
import numpy as np
import pytest

from ground.array import Elements
from ground.soils import soils
from rollover import scenario as scenarios
from rollover import studies
from rollover.cli import catalogue
from rollover.recording.importers import read_recording
from rollover.scenario import Scenario, load, schema
from rollover.spec import document
from rollover.spec.document import Leaf
from rollover.spec.provenance import Provenance
from rollover.spec.rops import Rops
from rollover.spec.shapes import Tube
from rollover.spec.steel import Steel
from rollover.spec.vehicle import Striker, Vehicle, chassis_of, pitch_inertia

FOLDER = document.shipped_folder()
SIGNALS = sorted((FOLDER / "signals").glob("*.csv"))  # with a sidecar each
FILES = sorted(p for p in FOLDER.rglob("*.yaml") if p.name != "excluded.yaml" and p.parent.name != "signals")
SCENARIOS = [path for path in FILES if path.parent == FOLDER]
VEHICLES = [path for path in FILES if path.parent.name == "vehicles"]
STEELS = [path for path in FILES if path.parent.name == "steels"]
SOILS = [path for path in FILES if path.parent.name == "soils"]
FRAMES = [path for path in FILES if path.parent.name == "rops"]
STUDIES = [path for path in FILES if path.parent.name == "studies"]
BASELINES = [path for path in FILES if path.parent.name == "baselines"]


def name_of(path: Path) -> str:
    return path.relative_to(FOLDER).with_suffix("").as_posix()


def test_there_are_files_of_every_sort() -> None:
    assert {"drop_test", "rops_drop", "side_overturn", "side_overturn_slope"} <= {p.stem for p in SCENARIOS}
    assert {"utility_tractor", "compact_tractor", "rops_rig"} <= {p.stem for p in VEHICLES}
    more = {"vineyard_tractor", "row_crop_tractor", "large_tractor", "mf178", "light_vehicle"}
    assert more <= {p.stem for p in VEHICLES}
    assert {document.load(p, Rops).frame for p in FRAMES} == {"two-post-rear", "two-post-front", "four-post", "cab"}
    assert {"natural_clay"} <= {p.stem for p in SOILS}
    assert set(FILES) == {*SCENARIOS, *VEHICLES, *SOILS, *STEELS, *FRAMES, *STUDIES, *BASELINES}
    assert {"bank_slope_speed", "soil_side_overturn", "rops_stiffness"} <= {p.stem for p in STUDIES}


@pytest.mark.parametrize("path", FILES, ids=name_of)
def test_every_file_is_in_order(path: Path) -> None:
    sort = {
        "vehicles": "vehicle",
        "soils": "soil",
        "rops": "rops",
        "steels": "steel",
        "baselines": "baseline",
        "studies": "study",
    }.get(path.parent.name, "scenario")
    assert catalogue.check(str(path)) == sort


@pytest.mark.parametrize("path", SIGNALS, ids=name_of)
def test_every_signal_is_a_recording_named_by_a_scenario(path: Path) -> None:
    assert read_recording(path).source.startswith("made up: ")
    assert path.read_text(encoding="utf-8").startswith("# Made up, not measured: ")
    assert any(f"file: {name_of(path)}.csv" in p.read_text(encoding="utf-8") for p in SCENARIOS)
    assert len(list(path.parent.glob(f"{path.stem}.*"))) == 2


@pytest.mark.parametrize("path", FILES, ids=name_of)
def test_every_file_opens_with_comments(path: Path) -> None:
    lines = path.read_text(encoding="utf-8").splitlines()
    opening = lines[: next(i for i, line in enumerate(lines) if not line.startswith("#"))]
    assert len(opening) >= (5 if path in SCENARIOS + STUDIES else 3)
    assert 20 <= len(catalogue.headline(path)) <= 120
    if path in SCENARIOS + STUDIES:
        text = " ".join(line.strip("# ") for line in opening)
        assert "Look at" in text, "it says what to look at"


# ---------------------------------------------------------------- provenance


def uncovered(thing: Any, provenance: tuple[Provenance, ...]) -> list[str]:
    """Paths of numbers that no entry covers; parts with a provenance of their own answer for themselves."""
    prefixes = [prefix for entry in provenance for prefix in entry.of]
    own = [f.name for f in _parts(thing) if getattr(getattr(thing, f.name), "provenance", ())]
    return [
        leaf.path
        for leaf in document.paths(thing)
        if _is_number(leaf)
        and leaf.path.split(".")[0] not in own
        and not any(leaf.path == prefix or leaf.path.startswith(f"{prefix}.") for prefix in prefixes)
    ]


def _parts(thing: Any) -> list[Any]:
    from dataclasses import fields

    return [f for f in fields(thing) if is_dataclass(getattr(thing, f.name))]


def _is_number(leaf: Leaf) -> bool:
    values = leaf.value if isinstance(leaf.value, list) else [leaf.value]
    return any(isinstance(value, float) for value in values)


def idle(thing: Any, provenance: tuple[Provenance, ...]) -> list[str]:
    """Entries that cover nothing, such as one with a misspelt path."""
    paths = [leaf.path for leaf in document.paths(thing)]
    prefixes = [prefix for entry in provenance for prefix in entry.of]
    return [p for p in prefixes if not any(path == p or path.startswith(f"{p}.") for path in paths)]


@pytest.mark.parametrize("path", [*VEHICLES, *FRAMES, *STEELS], ids=name_of)
def test_every_number_says_where_it_comes_from(path: Path) -> None:
    thing = document.load(path, Rops if path in FRAMES else Steel if path in STEELS else scenarios.AnyVehicle)
    assert uncovered(thing, thing.provenance) == []
    assert idle(thing, thing.provenance) == []
    assert all(len(entry.source) > 30 for entry in thing.provenance)


def test_a_number_without_source_is_found() -> None:
    vehicle = document.load(VEHICLES[0], scenarios.AnyVehicle)
    assert "whole.mass" in uncovered(vehicle, vehicle.provenance[1:])
    assert uncovered(vehicle, ()) != []


# ---------------------------------------------------------------- JSON schema


@pytest.fixture(scope="module")
def schemas(tmp_path_factory: pytest.TempPathFactory) -> dict[str, Path]:
    folder = tmp_path_factory.mktemp("schemas")
    parts = {"scenario": schema(), "vehicle": schema("vehicle"), "soil": schema("soil")}
    parts["study"] = studies.schema()
    parts["rops"] = document.schema(Rops, "rollover rops")
    for name, content in parts.items():
        jsonschema.Draft202012Validator.check_schema(content)
        (folder / f"{name}.json").write_text(json.dumps(content))
    return {name: folder / f"{name}.json" for name in parts}


@pytest.mark.parametrize(
    ("part", "files"),
    [("scenario", SCENARIOS), ("vehicle", VEHICLES), ("soil", SOILS), ("rops", FRAMES), ("study", STUDIES)],
)
def test_the_schema_accepts_all_shipped_files(schemas: dict[str, Path], part: str, files: list[Path]) -> None:
    command = [sys.executable, "-m", "check_jsonschema", "--schemafile", str(schemas[part]), *map(str, files)]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stdout + done.stderr


def test_the_schema_agrees_with_the_loader() -> None:
    validator = jsonschema.Draft202012Validator(schema())
    for path in SCENARIOS:
        whole = document.to_mapping(load(path))
        assert validator.is_valid(whole)
        for break_ in (
            lambda m: m.pop("title"),
            lambda m: m.update(zzz=1),
            lambda m: m["simulation"].update(duration=0.0),
            lambda m: m["simulation"].update(duraton=1.0),
            lambda m: m["ground"]["law"].update(kind="ye-2005"),
            lambda m: m["ground"]["law"].pop("kind"),
            lambda m: m["ground"]["elements"].update(spacing=[0.1]),
            lambda m: m["loads"].update(cfc=61),
            lambda m: m.update(effects={"nope": {}}),
        ):
            broken = json.loads(json.dumps(whole))
            break_(broken)
            assert not validator.is_valid(broken)


def test_the_schema_knows_base_and_file_names() -> None:
    validator = jsonschema.Draft202012Validator(schema())
    assert validator.is_valid({"base": "a.yaml", "simulation": {"duration": 2}, "ground": {"law": "soil.yaml"}})
    assert not validator.is_valid({"base": "a.yaml", "simulation": {"duraton": 2}})
    assert validator.is_valid({"base": "side_overturn", "vehicle": "utility_tractor"})
    wheels = {"base": "a.yaml", "vehicle": {"kind": "vehicle", "wheels": {"front_left": {"inertia": 2.5}}}}
    assert validator.is_valid(wheels)
    wheels["vehicle"]["wheels"]["front_left"] = {"inertai": 2.5}
    assert not validator.is_valid(wheels)
    assert not validator.is_valid({"base": "a.yaml", "ground": {"law": "soil.txt"}})
    assert not validator.is_valid({"simulation": {"duration": 2}})


def test_the_schema_tells_units_and_meanings() -> None:
    drop = schema()["$defs"]["Drop"]["else"]["properties"]
    assert drop["speed"]["description"] == "downward, at first contact [m/s]"
    assert (drop["speed"]["exclusiveMinimum"], drop["speed"]["maximum"]) == (0, 20)


def test_every_field_of_a_scenario_has_a_unit_or_a_meaning() -> None:
    for path in SCENARIOS:
        for leaf in document.paths(load(path)):
            last = leaf.path.rsplit(".", 1)[-1]
            if _is_number(leaf):
                assert leaf.unit, leaf.path
            elif not isinstance(leaf.value, str):
                assert leaf.meaning or last in ("cfc",) or leaf.value in (None, []), leaf.path


# ---------------------------------------------------------------- what the numbers have to be


def test_the_soils_are_those_of_the_ground_package() -> None:
    for name, soil in soils().items():
        law = document.load(FOLDER / "soils" / f"{name.replace('-', '_')}.yaml", scenarios.AnyLaw)
        assert type(law) is type(soil.law)
        assert law.p == pytest.approx(soil.law.p, rel=1e-3)
    assert document.load(FOLDER / "soils" / "natural_clay.yaml", scenarios.AnyLaw) == soils()["natural-clay"].law


def test_the_drop_test_is_the_rig_of_the_paper() -> None:
    scenario = load("drop_test")
    assert isinstance(scenario.vehicle, Striker)
    striker = (scenario.vehicle.mass, scenario.vehicle.face_length, scenario.vehicle.face_width)
    assert striker == (132.0, 0.140, 0.045)
    assert scenario.ground.elements == Elements(length=0.140, width=0.045, spacing=(0.140, 0.045))
    assert scenario.ground.elements.count == (1, 1)
    assert scenario.replaced({"initiation.speed": 3.5}).vehicle == scenario.vehicle


def side_load_curve(rops: Rops, height: float) -> tuple[float, float]:
    """Stiffness and yield load of a side load at a height: mounts in parallel, sway and tilt of the frame in series."""
    lateral = sum(m.stiffness[1] for m in rops.mounts)
    tilting = sum(m.stiffness[2] * m.position[1] ** 2 + m.rotational_stiffness[0] for m in rops.mounts)
    arm = height - rops.mounts[0].position[2]
    yields = [m.yield_force[1] for m in rops.mounts]
    return 1.0 / (1.0 / lateral + arm**2 / tilting), math.fsum(y for y in yields if y is not None)


def test_the_utility_rops_has_the_measured_side_load_curve() -> None:
    # MF 178 side test: 34 kN, 5437 J at 213 mm (one specimen, +-5 %); elastic, perfectly plastic: 0.32 MN/m
    rops = document.load(FOLDER / "vehicles/rops/two_post_rear_3t.yaml", Rops)
    stiffness, load_ = side_load_curve(rops, 2.46)
    assert load_ == 34_000.0
    assert stiffness == pytest.approx(0.32e6, rel=0.01)
    assert load_ * (0.213 - 0.5 * load_ / stiffness) == pytest.approx(5437.0, rel=0.01)


def test_the_mf_178_rops_has_the_measured_side_load_curve() -> None:
    rops = document.load(FOLDER / "vehicles/rops/two_post_rear_mf178.yaml", Rops)
    stiffness, load_ = side_load_curve(rops, 2.40)
    assert load_ == 34_000.0
    assert stiffness == pytest.approx(0.32e6, rel=0.01)
    assert load_ / stiffness == pytest.approx(0.106, abs=0.002)  # where it yields
    assert load_ * (0.213 - 0.5 * load_ / stiffness) == pytest.approx(5437.0, rel=0.01)


@pytest.mark.parametrize(
    ("name", "height", "mass"),
    [
        ("two_post_front_1500", 2.165, 1500.0),
        ("two_post_folding_2t", 2.265, 2000.0),
        ("four_post_4500", 2.655, 4500.0),
        ("cab_7000", 2.925, 7000.0),
        ("two_post_rear_450", 1.725, 450.0),
    ],
)
def test_an_estimated_rops_takes_the_side_energy_of_its_tractor(name: str, height: float, mass: float) -> None:
    rops = document.load(FOLDER / f"vehicles/rops/{name}.yaml", Rops)
    stiffness, load_ = side_load_curve(rops, height)
    assert 1.0 <= load_ * (0.200 - 0.5 * load_ / stiffness) / (1.75 * mass) < 1.05


def test_a_folded_rops_is_the_upright_one_turned() -> None:
    upright, folded = (
        document.load(FOLDER / f"vehicles/rops/two_post_{name}_2t.yaml", Rops) for name in ("folding", "folded")
    )
    assert upright.body == folded.body
    assert upright.members == folded.members
    assert [h.position for h in upright.hinges] == [h.position for h in folded.hinges]
    x, z = upright.hinges[0].position[0], upright.hinges[0].position[2]
    for before, after in zip(upright.upper.members, folded.upper.members, strict=True):  # type: ignore[union-attr]
        for a, b in ((before.start, after.start), (before.end, after.end)):  # type: ignore[union-attr]
            assert np.hypot(a[0] - x, a[2] - z) == pytest.approx(np.hypot(b[0] - x, b[2] - z), abs=2e-3)
            assert a[1] == pytest.approx(b[1], abs=1e-9)
    bar = folded.upper.members[-1].start  # type: ignore[union-attr]
    assert math.degrees(math.atan2(x - bar[0], bar[2] - z)) == pytest.approx(115.0, abs=0.1)
    assert folded.corner[2] < upright.corner[2] - 0.7
    assert folded.upper.body.mass == upright.upper.body.mass  # type: ignore[union-attr]


# nothing on wheels, or no front axle that swings: no tractor, whose pendulum test anchors the pitch inertia
WITHOUT_AXLE = ("rops_rig", "acrylic_cube", "skid_load", "quad_bike", "quad_bike_sprung", "side_by_side")
WITHOUT_AXLE += ("mini_excavator", "forwarder")


@pytest.mark.parametrize("path", [p for p in VEHICLES if p.stem not in WITHOUT_AXLE], ids=name_of)
def test_the_stated_pitch_inertia_is_the_computed_one(path: Path) -> None:
    """I = Iyy + m (a^2 + (h - r)^2) about the rear axle, against 0.378 M L^2, as `rollover list vehicles` words it."""
    vehicle = document.load(path, scenarios.AnyVehicle)
    said = [entry.source for entry in vehicle.provenance if "whole" in entry.of]
    wheels = {wheel.name: wheel.centre for wheel in vehicle.wheels}
    m, (a, _, h), L = vehicle.whole.mass, vehicle.whole.centre_of_mass, wheels["front_left"][0]
    about = vehicle.whole.inertia[1] + m * (a**2 + (h - wheels["rear_left"][2]) ** 2)
    assert pitch_inertia(vehicle) == pytest.approx((about, 0.378 * m * L**2), rel=1e-12)
    line = catalogue.pitch_line(*pitch_inertia(vehicle))
    assert line[0].upper() + line[1:] + "." in said[0]


def test_the_list_of_vehicles_shows_their_pitch_inertia() -> None:
    shown = {row["name"]: row["pitch"] for row in catalogue.vehicles()}
    assert shown["utility_tractor"].endswith("5493 kg m2 against 0.378 M L^2 = 5741 kg m2, -4.3 %")
    assert shown["rops_rig"] == ""


@pytest.mark.parametrize("name", ["rops_rig", "quad_bike", "side_by_side", "mini_excavator", "forwarder"])
def test_without_axles_there_is_no_pitch_inertia_to_state(name: str) -> None:
    assert pitch_inertia(document.load(FOLDER / f"vehicles/{name}.yaml", scenarios.AnyVehicle)) is None


def test_the_compact_rops_takes_the_side_energy_of_its_tractor() -> None:
    rops = document.load(FOLDER / "vehicles/rops/two_post_rear_2t.yaml", Rops)
    stiffness, load_ = side_load_curve(rops, 2.265)
    assert load_ * (0.200 - 0.5 * load_ / stiffness) == pytest.approx(3600.0, rel=0.01)
    assert load_ * (0.200 - 0.5 * load_ / stiffness) > 1.75 * 2000.0


# class: mass, wheelbase, centre of mass ahead of the rear axle, tracks rear and front, heights of the centre of mass
# and the pivot, rear tyre width, Ixx, Iyy, Izz, ROPS top and half width
CLASSES = {
    "utility_tractor": (3000, 2.25, 0.90, 1.50, 1.45, 0.82, 0.55, 0.42, 1300, 3000, 3300, 2.5, 0.60),
    "vineyard_tractor": (1500, 1.70, 0.80, 0.95, 0.95, 0.70, 0.45, 0.28, 350, 900, 1000, 2.2, 0.45),
    "row_crop_tractor": (4500, 2.45, 1.05, 1.60, 1.60, 0.95, 0.65, 0.47, 2300, 6000, 6500, 2.7, 0.75),
    "large_tractor": (7000, 2.80, 1.30, 1.85, 1.85, 1.10, 0.75, 0.58, 5000, 12000, 13500, 3.0, 0.85),
    "compact_tractor": (2000, 1.90, 0.75, 1.35, 1.30, 0.72, 0.50, 0.32, 650, 1500, 1650, 2.3, 0.55),
}


@pytest.mark.parametrize("name", CLASSES)
def test_the_tractors_are_those_of_their_class(name: str) -> None:
    m, L, a, rear, front, h, pivot, width, xx, yy, zz, top, half = CLASSES[name]
    vehicle = document.load(FOLDER / "vehicles" / f"{name}.yaml", scenarios.AnyVehicle)
    assert isinstance(vehicle, Vehicle)
    assert vehicle.front_axle is not None
    assert vehicle.rops is not None
    wheels = {wheel.name: wheel for wheel in vehicle.wheels}
    assert (vehicle.whole.mass, vehicle.whole.centre_of_mass, vehicle.whole.inertia) == (m, (a, 0, h), (xx, yy, zz))
    assert wheels["front_left"].centre[0] == L == vehicle.front_axle.pivot[0]
    assert wheels["rear_left"].centre[1] - wheels["rear_right"].centre[1] == rear
    assert wheels["front_left"].centre[1] - wheels["front_right"].centre[1] == front
    assert (vehicle.front_axle.pivot[2], wheels["rear_left"].tyre.width) == (pivot, width)
    assert vehicle.rops.corner[1:] == (half, top)
    assert vehicle.front_axle.body.mass == pytest.approx(0.12 * m)
    # wheels stand at their loaded radius
    for end, share in (("rear", 1.0 - a / L), ("front", a / L)):
        tyre = wheels[f"{end}_left"].tyre
        sag = 0.5 * share * m * 9.81 / tyre.vertical_stiffness
        assert wheels[f"{end}_left"].centre[2] == pytest.approx(tyre.radius - sag, abs=1.5e-3)
    assert chassis_of(vehicle).mass > 0.8 * m
    assert np.hypot(vehicle.rops.corner[0], vehicle.rops.corner[1]) < 1.0


@pytest.mark.parametrize("name", CLASSES)
def test_on_its_side_a_tractor_lies_on_rear_tyre_and_rops(name: str) -> None:
    # the plane through the rear tyre's outer edge and the ROPS corner leaves everything else on its inner side
    vehicle = document.load(FOLDER / "vehicles" / f"{name}.yaml", scenarios.AnyVehicle)
    rear = {wheel.name: wheel for wheel in vehicle.wheels}["rear_left"]
    y0, z0 = rear.centre[1] + 0.5 * rear.tyre.width, rear.centre[2]
    lean = (y0 - vehicle.rops.corner[1]) / (vehicle.rops.corner[2] - z0)
    for box in vehicle.outline:
        assert box.high[1] < y0 - lean * (box.high[2] - z0) - 0.05
    for end in ("front", "rear"):
        wheel = {w.name: w for w in vehicle.wheels}[f"{end}_left"]
        for post in vehicle.rops.members:
            near = isinstance(post, Tube) and abs(post.start[0]) < wheel.tyre.radius
            if near and post.name in ("post_left", "rear_post_left"):  # posts clear the rear tyres
                high = wheel.centre[2] + wheel.tyre.radius
                along = min(1.0, (high - post.start[2]) / (post.end[2] - post.start[2]))
                y = post.start[1] + along * (post.end[1] - post.start[1]) + 0.5 * post.diameter
                assert end == "front" or y < wheel.centre[1] - 0.5 * wheel.tyre.width


def test_the_slope_falls_to_the_side_it_tips_to() -> None:
    scenario = load("side_overturn_slope")
    assert isinstance(scenario, Scenario)
    gx, gy = scenario.ground.surface.gradient
    assert gx == pytest.approx(0.0, abs=1e-15)
    assert gy == pytest.approx(-math.tan(math.radians(20.0)))
    assert scenario.replaced({"ground.surface.kind": "plane"}).vehicle == load("side_overturn").vehicle

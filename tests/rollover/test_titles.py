"""Titles cannot contradict values: no number in a shipped title is one that a path holds, and what differs is told."""

from __future__ import annotations

import re
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest

from rollover.assessment.shipped import MOST_IN_WORDS, origin
from rollover.scenario import AnyVehicle, load
from rollover.spec import document
from rollover.studies import load as load_study
from viz.content.blocks import Details, Table
from viz.content.differences import differences_section

SHELF = document.shipped_folder()
SCENARIOS = sorted(SHELF.glob("*.yaml"))
VEHICLES = sorted((SHELF / "vehicles").glob("*.yaml"))
STUDIES = sorted((SHELF / "studies").glob("*.yaml"))
STANDARD = re.compile(r"\b(?:OECD )?(?:Code|ISO|SAE|EN) [A-Z]?\d+(?:-\d+)?")  # the number of a document is no value
WHEELS = ("front_left", "front_right", "rear_left", "rear_right")
FACTORS = (1.0, 1e3, 1e-3, 3.6, 1e6, 1e-6)  # a number in a title may stand in t, mm, km/h or kN


def numbers_of(thing: Any) -> Iterator[float]:
    for leaf in document.paths(thing):
        values = leaf.value if isinstance(leaf.value, (tuple, list)) else (leaf.value,)
        yield from (float(v) for v in values if isinstance(v, (int, float)) and not isinstance(v, bool))


def told_and_held(title: str, thing: Any) -> list[str]:
    """Numbers in a title that a path of the thing holds, in one unit or another."""
    text = STANDARD.sub("", title)
    found = re.findall(r"\d+(?:\.\d+)?", text)
    held = {abs(v) * f for v in numbers_of(thing) for f in FACTORS if v}
    return [n for n in found if any(abs(float(n) - v) <= 1e-6 * v for v in held)]


def test_the_search_finds_what_it_is_for() -> None:
    scenario = load("side_overturn_slope")
    assert told_and_held("Side overturn of a 3 t tractor down a slope of 20 degrees", scenario) == ["3", "20"]
    assert told_and_held("Pendulum after OECD Code 3, ISO 5700", scenario) == []


@pytest.mark.parametrize("path", SCENARIOS, ids=lambda p: p.stem)
def test_no_title_of_a_scenario_holds_a_value(path: Path) -> None:
    scenario = load(path)
    assert told_and_held(scenario.title, scenario) == []
    assert told_and_held(scenario.vehicle.name, scenario) == []


@pytest.mark.parametrize("path", VEHICLES, ids=lambda p: p.stem)
def test_no_name_of_a_vehicle_holds_a_value(path: Path) -> None:
    vehicle = document.load(path, AnyVehicle)
    assert told_and_held(vehicle.name, vehicle) == []


@pytest.mark.parametrize("path", STUDIES, ids=lambda p: p.stem)
def test_no_title_of_a_study_holds_a_value(path: Path) -> None:
    study = load_study(path)
    assert told_and_held(study.title, study.scenario) == []


def test_titles_name_their_scenario() -> None:
    """What differs is found by the title: each stands once, and none differs from itself."""
    titles = [load(path).title for path in SCENARIOS]
    assert len(set(titles)) == len(titles)
    for path in SCENARIOS:
        found = origin(load(path))
        assert found is not None
        assert (found.name, found.differences) == (path.stem, ())


@pytest.mark.parametrize(
    ("name", "changes", "told"),
    [
        ("side_overturn", {"vehicle.whole.mass": 4500.0}, [("vehicle.whole.mass", "3000", "4500")]),
        ("multiple_roll", {"ground.surface.slope_deg": 25.0}, None),
        (
            "side_overturn",
            {"vehicle": "vehicles/row_crop_tractor.yaml"},
            [("vehicle", "Utility tractor, two-post rear ROPS", "Row-crop tractor, four-post ROPS")],
        ),
        ("drop_test", {"ground.law": {"kind": "hard"}}, [("ground.law", "ye-2006", "hard")]),
        ("drop_test", {"gravity": 9.81 + 1e-12}, [("gravity", "9.81", "9.810000000001")]),
        (
            "drop_test",
            {"effects.ground-friction.coefficient": 0.3},
            [("effects.ground-friction.coefficient", "none", "0.3")],
        ),
    ],
)
def test_what_differs_from_the_shipped_scenario(name: str, changes: dict[str, Any], told: Any) -> None:
    scenario = load(name)
    if told is None:
        path = next(
            leaf.path
            for leaf in document.paths(scenario)
            if leaf.path.endswith("angle_deg") or leaf.path.endswith("slope_deg")
        )
        value = document.value_at(scenario, path)
        changes, told = {path: 25.0}, [(path, f"{value:.6g}", "25")]
    found = origin(scenario.replaced(changes))
    assert found is not None
    assert [(d.path, d.shipped, d.now) for d in found.differences] == told
    assert found.in_words.startswith(f"Differs from the shipped {name}: {told[0][0]}: {told[0][1]} -> ")


def test_another_frame_is_told_in_a_few_lines() -> None:
    """Parts that only one of them has are told as one, and where numbers come from is no value."""
    shipped = load("side_overturn")
    found = origin(shipped.replaced({"vehicle.rops": "vehicles/rops/two_post_rear_tubes_3t.yaml"}))
    assert found is not None
    told = {d.path: (d.shipped, d.now) for d in found.differences}
    assert told["vehicle.rops.mounts"] == ("left, right", "none")
    assert told["vehicle.rops.feet"] == ("none", "left, right")
    assert told["vehicle.rops.members.post_left"] == ("tube", "beam")
    assert len(told) <= MOST_IN_WORDS
    assert "provenance" not in found.in_words


def test_a_title_of_ones_own_has_no_origin() -> None:
    assert origin(load("drop_test").replaced({"title": "My own drop"})) is None


def test_a_page_folds_many_differences() -> None:
    shipped = load("side_overturn")
    few = {"vehicle.whole.mass": 3100.0}
    many = {f"vehicle.wheels.{n}.tyre.{k}": 0.4 for n in WHEELS for k in ("radius", "width", "crown", "friction")}
    ((_, table),) = [section.blocks for section in differences_section(shipped.replaced(few))]
    ((_, folded),) = [section.blocks for section in differences_section(shipped.replaced(few | many))]
    assert isinstance(table, Table)
    assert isinstance(folded, Details)
    assert folded.summary == "17 values"

"""The verdicts of virtual tests: which load answers to which requirement, what is met, and what is not said."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from rollover.assessment.criteria import Criterion, criteria, in_words
from rollover.assessment.criterion import with_half_step
from rollover.assessment.stand_results import findings
from rollover.dynamics.result import Motion, Run
from rollover.scenario import Scenario, load
from rollover.spec.standards.codes import STATIC
from rollover.spec.standards.requirement import Requirement
from tests.viz import example

NOT_DUE = {"fall": 0.0, "required": False, "extra_energy": 0.0, "passed": None}


def made(scenario: Scenario, *tests: Mapping[str, Any], **channels: Any) -> Run:
    """A run of this scenario that found `tests`; nothing moves. Made up by hand."""
    run = example.overturn()
    thin = {name: v[::10] for name, v in run.recording.channels.items()}
    run = replace(run, recording=replace(run.recording, time=run.recording.time[::10], channels=thin))
    n = run.recording.time.size
    still = Motion(origin=np.zeros((n, 3)), quaternion=np.tile([0.0, 0.0, 0.0, 1.0], (n, 1)))
    zero = {f"device/{name}": np.zeros(n) for name in ("force", "deflection", "energy")}
    values = {**run.recording.channels, **zero, **{k.replace("__", "/"): v for k, v in channels.items()}}
    recording = replace(run.recording, channels=values)
    pose = {"chassis": still, "rops": still}
    return replace(run, scenario=scenario, recording=recording, pose=pose, status="done", tests=tests)


def pushed(name: str, come_from: str, **values: Any) -> dict[str, Any]:
    found = {
        "kind": "static-load", "name": name, "come_from": come_from, "status": "reached", "begun_at": 0.1,
        "required_energy": None, "required_force": None, "overload": {}, "reached_at": 0.5, "deflection": 0.2,
        "peak_force": 34e3, "force": 34e3, "energy": 0.0, "permanent_set": 0.1,
    }  # fmt: skip
    return {**found, **values}


SEQUENCE = (
    pushed("rear", "rear", required_energy=4350.0, energy=4350.0, overload=NOT_DUE),
    pushed("crush-rear", "above", required_force=62140.0, force=62140.0),
    pushed("side", "left", required_energy=5437.0, energy=5437.0, overload=NOT_DUE),
    pushed("crush-front", "above", required_force=62140.0, force=62140.0),
    pushed("front", "front", required_energy=1087.0, energy=1087.0, overload=NOT_DUE),
)


def rows_of(run: Run) -> dict[str, Criterion]:
    return {row.requirement.name: row for row in criteria(run)}


def test_each_load_is_judged_by_the_vehicles_mass() -> None:
    """3000 kg: 4200 J from the rear, 60 kN, 5250 J from the side, 60 kN, 1050 J from the front, whatever was given."""
    rows = rows_of(made(load("static_rops_test"), *SEQUENCE))
    asked = {
        name: row.requirement.value for name, row in rows.items() if row.requirement.quantity in ("energy", "force")
    }
    assert list(asked) == [
        "longitudinal load, rear", "crush, rear", "side load", "crush, front", "second longitudinal load, front"
    ]  # fmt: skip
    assert list(asked.values()) == pytest.approx([4200.0, 60e3, 5250.0, 60e3, 1050.0])
    assert rows["side load"].margin is None, "how far it was told to go is no margin"
    assert rows["side load"].in_words[2] == "not stated"
    assert {row.verdict for row in rows.values()} == {"met"}
    assert rows["distance of the structure"].requirement.quantity == "distance"
    assert "distance of the ground" not in rows, "the tractor stands on its wheels"
    heavier = load("static_rops_test").replaced({"vehicle.whole.mass": 3200.0})
    rows = rows_of(made(heavier, *SEQUENCE))
    assert rows["side load"].verdict == rows["crush, rear"].verdict == "not met"
    assert rows["side load"].margin == pytest.approx(5437.0 / 5600.0 - 1.0)


def test_a_force_exactly_as_asked_is_met() -> None:
    """20 x 3000 kg, held: rounding must not decide."""
    loads = {"initiation.loads": [{"name": "c", "come_from": "above", "point": [-0.1, 0.0, 2.5], "force": 60000.0}]}
    scenario = load("static_rops_test").replaced(loads)
    for force, verdict in ((60e3 * (1.0 - 1e-12), "met"), (59.99e3, "not met")):
        rows = rows_of(made(scenario, pushed("c", "above", required_force=60e3, force=force)))
        assert rows["crush, rear"].verdict == verdict
        assert set(rows) == {"crush, rear", "distance of the structure"}, "only what was tested"
    given_up = pushed("c", "above", required_force=60e3, force=60e3, status="given up: too far")
    assert rows_of(made(scenario, given_up))["crush, rear"].verdict == "not met"


def one_load(come_from: str) -> Scenario:
    point = {"name": "one", "come_from": come_from, "point": [-0.1, 0.6, 2.46], "energy": 5250.0}
    return load("static_rops_test").replaced({"initiation.loads": [point]})


def test_a_load_that_stops_too_early_has_no_verdict() -> None:
    """4000 J were asked for and reached where the code asks for 5250 J: nothing is known about the frame."""
    scenario = load("static_rops_test").replaced({"initiation.loads.side.energy": 4000.0})
    entry = pushed("side", "left", required_energy=5250.0, energy=4001.0, overload=NOT_DUE)
    run = made(scenario, *SEQUENCE[:2], entry, *SEQUENCE[3:])
    row = rows_of(run)["side load"]
    assert (row.verdict, row.margin, row.in_words[2]) == ("no verdict", None, "not stated")
    assert "not loaded far enough: no verdict" in row.note
    words = in_words(criteria(run))
    assert words[0] == "Not loaded far enough, so no verdict: side load."
    failed = entry | {"energy": 3900.0, "status": "given up: deflected by more than 600 mm"}
    row = rows_of(made(scenario, failed))["side load"]
    assert (row.verdict, row.margin) == ("not met", pytest.approx(3900.0 / 5250.0 - 1.0))


def test_a_load_fails_where_it_pushes_the_frame_into_the_zone() -> None:
    """3150 J at the entry, six tenths of what is asked, though the load went on to it; later loads are not blamed."""
    run = made(load("static_rops_test"))
    time = run.recording.time
    n, third = time.size, time.size // 3
    ahead = np.zeros((n, 3))
    ahead[third:] = (0.5, 0.3, 0.0)  # the right-hand post stands beside the seat, and stays there
    side = pushed(
        "side", "left", begun_at=float(time[5]), reached_at=float(time[2 * third]), energy=5437.0, overload=NOT_DUE
    )
    after = pushed(
        "front",
        "front",
        begun_at=float(time[2 * third + 1]),
        reached_at=float(time[-1]),
        energy=1087.0,
        overload=NOT_DUE,
    )
    run = made(load("static_rops_test"), side, after, device__energy=np.linspace(0.0, 3150.0 * (n - 1) / third, n))
    rops = Motion(origin=ahead, quaternion=run.pose["rops"].quaternion)
    rows = rows_of(replace(run, pose={**run.pose, "rops": rops}))
    assert rows["side load"].verdict == "not met"
    assert rows["side load"].margin == pytest.approx(3150.0 / 5250.0 - 1.0, abs=1e-3)
    assert "entered the clearance zone" in rows["side load"].note
    assert rows["second longitudinal load, front"].verdict == "met"


def test_a_load_that_was_given_up_or_never_ended() -> None:
    scenario = one_load("right")
    short = pushed("one", "right", required_energy=5250.0, energy=4000.0, status="given up: too far")
    row = rows_of(made(scenario, short))["side load"]
    assert (row.verdict, row.simulated) == ("not met", 4000.0)
    assert "given up" in row.note
    running = {k: v for k, v in short.items() if k not in ("reached_at", "energy", "force", "deflection")}
    energy = np.linspace(0.0, 3100.0, made(scenario).recording.time.size)
    row = rows_of(made(scenario, {**running, "status": "not finished"}, device__energy=energy))["side load"]
    assert (row.verdict, row.simulated) == ("not met", 3100.0)
    row = rows_of(made(scenario))["side load"]
    assert (row.verdict, row.simulated) == ("not met", 0.0)
    assert "never began" in row.note


@pytest.mark.parametrize(
    ("rule", "verdict", "note"),
    [
        ({"fall": 0.02, "required": False}, "met", "no overload test is due"),
        ({"fall": 0.05, "required": True, "extra_energy": 0.05, "passed": True}, "met", "passed with 5 % more energy"),
        ({"fall": 0.05, "required": True, "extra_energy": 0.2, "passed": False}, "not met", "not passed with 20 %"),
    ],
)
def test_overload_rule(rule: dict[str, Any], verdict: str, note: str) -> None:
    run = made(one_load("left"), pushed("one", "left", required_energy=5250.0, energy=5250.0, overload=rule))
    row = rows_of(run)["overload rule, side load"]
    assert (row.verdict, row.simulated, row.requirement.value) == (verdict, rule["fall"], 0.03)
    assert note in row.note
    assert row.requirement.source == STATIC


def test_other_standards_take_the_same_loads() -> None:
    """Code 6: 500 + 0.5 M from either end; OSHA: rear and side, the overload rule is none of its."""
    standards = load("static_rops_test").replaced({"loads.standards": ["code-6", "sae-j1194"]})
    rows = criteria(made(standards, *SEQUENCE))
    six = {r.requirement.name: r for r in rows if r.requirement.standard.startswith("OECD Code 6")}
    assert six["longitudinal load"].requirement.value == pytest.approx(2000.0)
    assert six["longitudinal load"].simulated == 4350.0
    assert six["second longitudinal load"].simulated == 1087.0
    assert "lateral stability" not in six
    osha = {r.requirement.name for r in rows if "J1194" in r.requirement.standard}
    assert osha == {"rear load", "crush", "side load"}
    assert not any("overload" in r.requirement.name for r in rows)


def test_structure_that_enters_the_zone_fails_the_test() -> None:
    run = made(load("static_rops_test"), *SEQUENCE)
    ahead = np.zeros((run.recording.time.size, 3))
    ahead[100] = (0.5, 0.3, 0.0)  # for an instant, the right-hand post stands beside the seat
    rops = Motion(origin=ahead, quaternion=run.pose["rops"].quaternion)
    row = rows_of(replace(run, pose={**run.pose, "rops": rops}))["distance of the structure"]
    assert row.verdict == "not met"
    assert row.margin < 0.0


def test_a_blow_has_its_height_and_allowed_rebound() -> None:
    """3000 kg: 575 mm from the side; of 400 mm at most 160 +- 10 mm are left: 240 mm are elastic, of 250 allowed."""
    scenario = load("pendulum")
    n = made(scenario).recording.time.size
    way = np.full(n, 0.16) + 0.01 * np.sin(2.0 * np.pi * np.arange(n) / 10.0)
    way[n // 2] = 0.40
    struck = {"kind": "pendulum-blow", "status": "done", "struck_at": 0.1}
    rows = rows_of(made(scenario, struck, rops__deflection=way))
    assert set(rows) == {"side impact", "elastic deflection", "distance of the structure"}
    assert (rows["side impact"].simulated, rows["side impact"].verdict) == (0.575, "met")
    assert rows["elastic deflection"].simulated == pytest.approx(0.24, abs=1e-4)
    assert rows["elastic deflection"].verdict == "met"
    assert "+-10 mm" in rows["elastic deflection"].note
    way[n // 2] = 0.42
    assert rows_of(made(scenario, struck, rops__deflection=way))["elastic deflection"].verdict == "not met"
    low = scenario.replaced({"initiation.height": 0.5})
    assert rows_of(made(low, struck, rops__deflection=way))["side impact"].verdict == "not met"
    missed = {"kind": "pendulum-blow", "status": "not struck"}
    rows = rows_of(made(scenario, missed, rops__deflection=0.0 * way))
    assert {rows[name].verdict for name in ("side impact", "elastic deflection")} == {"not met"}
    rear = scenario.replaced({"initiation.come_from": "rear"})
    rows = rows_of(made(rear, struck, rops__deflection=way))
    assert set(rows) == {"rear impact, by wheelbase", "distance of the structure"}


@pytest.mark.parametrize(
    ("unstable", "table", "verdict", "degrees"),
    [
        (35.0, 35.0, "not met", 35.0),
        (38.5, 38.5, "met", 38.5),
        (None, 45.0, "met", 45.0),
        (None, 30.0, "compared", 30.0),
    ],
)
def test_tilt_table_against_38_degrees(unstable: float | None, table: float, verdict: str, degrees: float) -> None:
    scenario = load("tilt_table").replaced({"loads.standards": ["code-6"]})
    found = {"kind": "tilt-table", "unstable_deg": unstable, "table_deg": table}
    rows = rows_of(made(scenario, found))
    assert set(rows) == {"lateral stability"}
    assert np.degrees(rows["lateral stability"].simulated) == pytest.approx(degrees)
    assert rows["lateral stability"].verdict == verdict
    assert criteria(made(load("tilt_table"), found)) == (), "Code 4 asks for no angle"
    lengthways = scenario.replaced({"initiation.heading_deg": 90.0})
    assert criteria(made(lengthways, found)) == ()


def test_a_tilt_table_judges_a_tractor_without_a_rops() -> None:
    scenario = load("tilt_table").replaced({"loads.standards": ["code-6"], "vehicle.rops": None})
    rows = rows_of(made(scenario, {"kind": "tilt-table", "unstable_deg": 39.0, "table_deg": 39.0}))
    assert rows["lateral stability"].verdict == "met"


def test_a_verdict_that_turns_at_half_the_step_is_told() -> None:
    run = made(load("static_rops_test"), *SEQUENCE)
    worse = [dict(entry) for entry in SEQUENCE]
    worse[2]["energy"] = 5200.0
    rows = {
        row.requirement.name: row
        for row in with_half_step(criteria(run), criteria(made(load("static_rops_test"), *worse)))
    }
    assert rows["side load"].at_half_step == 5200.0
    assert rows["side load"].note.endswith("; not met at half the step")
    assert rows["side load"].half_step_in_words == "4.4 %"
    assert rows["longitudinal load, rear"].at_half_step == 4350.0
    assert "half the step" not in rows["longitudinal load, rear"].note


@pytest.mark.parametrize(
    ("quantity", "unit", "value", "upper", "simulated", "words"),
    [
        ("energy", "J", 5250.0, None, 7875.0, ("at least 5.25 kJ", "7.875 kJ", "1.50 x")),
        ("angle", "rad", np.radians(38.0), None, np.radians(19.0), ("at least 38 deg", "19 deg", "0.50 x")),
        ("share", "1", 0.43, 0.61, 0.215, ("43 to 61 %", "21.5 %", "-50 %")),
        ("share", "1", 0.43, 0.61, 0.5, ("43 to 61 %", "50 %", "within")),
        ("share", "1", 0.43, 0.61, 0.671, ("43 to 61 %", "67.1 %", "-10 %")),
        ("distance", "m", 0.0, None, -0.012, ("stays outside", "-12 mm", "-12 mm")),
    ],
)
def test_in_words(
    quantity: Any, unit: str, value: float, upper: float | None, simulated: float, words: tuple[str, str, str]
) -> None:
    from rollover.assessment.criterion import compared

    requirement = Requirement(
        standard="s", name="n", formula="f", clause="c", quantity=quantity, unit=unit, value=value, upper=upper,
        bound="least" if upper is None else "range", source="", confidence="source checked",
    )  # fmt: skip
    assert compared(requirement, simulated, "").in_words == words


def test_what_a_stand_found_is_told_in_a_sentence() -> None:
    unfinished = {k: v for k, v in SEQUENCE[0].items() if k not in ("energy", "force", "peak_force", "deflection")}
    found = findings([unfinished | {"status": "not finished"}, SEQUENCE[1]])
    assert found is not None
    assert found.sentence.startswith("1 of 2 loads")
    assert all(len(row) == len(found.headings) for row in found.rows)
    assert found.rows[0][3] == "-"
    assert found.rows[1][4] == "62.14"
    missed = findings([{"kind": "pendulum-blow", "name": "from left", "status": "not struck"}])
    assert missed is not None
    assert missed.sentence == "The block missed"
    assert findings(()) is None

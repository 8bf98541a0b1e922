"""All that is shipped goes together: vehicles in scenarios, laws under one; done, or refused with a cure."""

from __future__ import annotations

import json
from pathlib import Path

import pytest
from typer.testing import CliRunner

from ground.law import laws
from rollover.cli.main import app
from rollover.dynamics import simulate
from rollover.dynamics.setup import set_up
from rollover.scenario import AnyLaw, Scenario, load
from rollover.spec import document
from rollover.spec.vehicle import Vehicle
from rollover.system.errors import InputError

SHELF = document.shipped_folder()
SCENARIOS = [p.stem for p in sorted(SHELF.glob("*.yaml")) if isinstance(load(p).vehicle, Vehicle)]
VEHICLES = [p.stem for p in sorted(SHELF.glob("vehicles/*.yaml"))]
BRIEF = {"simulation.duration": 0.02}  # s: a start and some steps
TRAILED = {"forwarder", "tractor_trailer"}  # longer than the ground that a frame alone is dropped on
WIDE = {"ground.elements.length": 14.0, "ground.elements.width": 6.0}
DROPPED = {"rops_drop", "tractor_drop_corner"}
WITHOUT_WHEELS = {"rops_drop", "static_rops_test", "tractor_drop_corner"}  # what a rig without wheels can do
# these are so wide that their lower wheels stand on the flange or beyond it: refused; further up they stand
UNBALANCED = {"compact_tractor", "compact_tractor_folded", "electric_tractor", "large_tractor", "row_crop_tractor"}
UNBALANCED |= {"utility_tractor", "utility_tractor_tubes", *TRAILED}  # and a trailer behind stands beside the platform
WITHOUT_AXLE = {
    "mini_excavator",
    "quad_bike",
    "quad_bike_sprung",
    "side_by_side",
    "forwarder",
}  # their front wheels are bodies of no axle


def expected(scenario: str, vehicle: str) -> str:
    """Words of the refusal; empty where it is to run."""
    if vehicle in ("acrylic_cube", "skid_load") and scenario in ("pendulum", "static_rops_test"):
        return "loads a ROPS, got a vehicle without; one with members"
    if vehicle in ("acrylic_cube", "rops_rig", "skid_load") and scenario not in WITHOUT_WHEELS:
        return "got 0 "
    if vehicle in UNBALANCED and scenario == "dolly_rollover":
        return "does not stand on this surface"
    if (vehicle, scenario) == ("tractor_trailer", "multiple_roll"):
        return "no balance on two wheels was found on this surface"
    if vehicle in WITHOUT_AXLE and scenario == "pendulum":
        return "no such body, got 'front"
    if vehicle in ("quad_bike", "quad_bike_sprung") and scenario == "static_rops_test":
        return "initiation.code: does not follow from the vehicle, got a track of 0.92 m, 289 kg"
    if (vehicle, scenario) == ("rops_rig", "static_rops_test"):
        return "initiation.code: does not follow from the vehicle, got no track, 3000 kg"
    return ""


def outcome(scenario: Scenario) -> str:
    """Empty for a run that is done; else the refusal, one line."""
    try:
        run = simulate.run(scenario)
    except InputError as e:
        return str(e)
    assert run.status == "done", run.sentence
    return ""


@pytest.mark.parametrize("scenario", SCENARIOS)
def test_each_shipped_vehicle_goes_into_each_scenario(scenario: str) -> None:
    base = load(scenario)
    for vehicle in VEHICLES:
        try:
            room = WIDE if vehicle in TRAILED and scenario in DROPPED else {}
            changes = {"vehicle": f"vehicles/{vehicle}.yaml", **BRIEF, **room}
            told = outcome(base.replaced(changes, origin="--set"))
        except InputError as e:
            told = str(e)
        wanted = expected(scenario, vehicle)
        assert bool(told) == bool(wanted), f"{scenario} with {vehicle}: {told or 'done'}"
        if wanted:
            assert wanted in told
            assert "\n" not in told
            assert "; " in told.partition("got ")[2]  # a cure


def test_a_wide_tractor_stands_further_up_the_dolly() -> None:
    """Its lower wheel clear of the flange at y = 0.55 m: half the track 0.75 m and half the tyre 0.21 m above it."""
    base = load("dolly_rollover").replaced({"vehicle": "vehicles/utility_tractor.yaml", **BRIEF})
    assert "another initiation.position" in outcome(base)
    assert outcome(base.replaced({"initiation.position": [0.0, 0.55 - 0.96 - 0.01]})) == ""


def test_the_matrix_holds_what_is_shipped() -> None:
    assert len(SCENARIOS) >= 12
    assert {"utility_tractor", "compact_tractor_folding", "rops_rig"} < set(VEHICLES)
    assert len(VEHICLES) >= 10


@pytest.mark.parametrize("kind", laws())
def test_each_law_goes_under_a_structure_or_asks_for_its_values(kind: str) -> None:
    soils = {document.load(p, AnyLaw).kind: p for p in sorted(SHELF.glob("soils/*.yaml"))}
    base = load("rops_drop")
    try:
        chosen = base.replaced({"ground.law.kind": kind, **BRIEF}, origin="--set")
    except InputError as e:
        for line in str(e).splitlines():
            assert line.startswith("--set: ground.law.")
            assert ": missing; a number " in line
        # no coefficients are typical of every soil: a file of the law brings them
        if kind not in soils:
            return
        chosen = base.replaced({"ground.law": soils[kind].as_posix(), **BRIEF})
    run = simulate.run(chosen)
    assert run.status == "done", run.sentence
    assert run.recording["ground/force_normal"].max() > 0.0


def test_the_notice_stands_in_terminal_results_and_page(tmp_path: Path) -> None:
    own = tmp_path / "own.yaml"
    own.write_text(f"base: {document.find('kerb_trip').resolve()}\nvehicle: vehicles/vineyard_tractor.yaml\n")
    out = tmp_path / "out"
    command = ["run", str(own), "--no-half-step", "--set", "simulation.duration=0.02", "--out", str(out)]
    done = CliRunner().invoke(app, command)
    assert done.exit_code == 0, done.stderr
    assert "vehicle.wheels.front_left.inertia" in done.stdout
    told = json.loads((out / "run.json").read_text(encoding="utf-8"))["estimates"]
    assert [(e["path"].split(".")[2], e["confidence"]) for e in told] == [
        (name, "estimate") for name in ("front_left", "front_right", "rear_left", "rear_right")
    ]
    assert f"{told[0]['value']:.3g} kg m2" in (out / "report.html").read_text(encoding="utf-8")
    # as it ran: what was estimated is still stated by nobody
    assert [e.value for e in load(out / "scenario.yaml").estimates] == [e["value"] for e in told]


@pytest.mark.parametrize(
    ("lines", "told"),
    [
        (
            "ground: {surface: {kind: slope, angle_deg: 60.0}}\n",
            "got ground of 60 deg, which it turns over on from 49.2 deg; a gentler ground.surface",
        ),
        (
            "vehicle: {whole: {centre_of_mass: [2.6, 0.0, 0.8]}}\n",
            "got its centre of mass [2.6, 0, 0.8] m outside the feet of its wheels; another place",
        ),
    ],
)
def test_an_impossible_start_names_its_cause_and_file(tmp_path: Path, lines: str, told: str) -> None:
    own = tmp_path / "own.yaml"
    own.write_text(f"# mine\nbase: {document.find('field_upset_side').resolve()}\n{lines}")
    done = CliRunner().invoke(app, ["run", str(own), "--out", str(tmp_path / "out")])
    assert done.exit_code == 2
    assert done.stderr.splitlines()[-1].startswith(f"{own}:2: initiation: the vehicle does not stand on this surface, ")
    assert told in done.stderr
    assert not (tmp_path / "out").exists()


def test_a_frame_held_by_barely_enough_stiffness_stands() -> None:
    base = load("tilt_table")
    path = "vehicle.rops.mounts.*.rotational_stiffness"
    with pytest.raises(InputError, match=r"more than (\d+) N m/rad together") as refused:
        base.replaced({path: [1e6, 0.0, 5e5]})
    need = float(str(refused.value).partition("more than ")[2].split()[0])
    start = set_up(base.replaced({path: [1e6, 0.55 * need, 5e5]}).applied()).start
    assert abs(float(start.q[3:5].max())) < 0.5  # upright

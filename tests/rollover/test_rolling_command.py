"""`rollover rolling`: what it writes, answers and refuses."""

from __future__ import annotations

import json
from pathlib import Path

import pytest
from typer.testing import CliRunner, Result

from rollover.cli.main import app
from rollover.spec.document import shipped_folder


def rollover(*words: object) -> Result:
    return CliRunner().invoke(app, ["rolling", *(str(w) for w in words)])


def test_report_and_page_of_a_vehicle(tmp_path: Path) -> None:
    done = rollover("vineyard_tractor", "--set", "vehicle.whole.mass=1600", "--out", tmp_path, "--json")
    assert done.exit_code == 0, done.output
    answer = json.loads((tmp_path / "rolling.json").read_text())
    assert json.loads(done.stdout) == answer
    assert answer["format"] == "rollover-rolling/1"
    assert answer["verdict"] == "interrupted"
    value = {i["symbol"]: i["value"] for i in answer["inputs"]}
    expected = {
        "H1": 0.7, "L3": 0.8, "L2": 0.9, "D3": 1.04, "D2": 0.66, "H6": 2.2, "L6": -0.04, "B6": 0.9, "H7": 1.15,
        "B7": 0.48, "L7": 1.25, "H0": 0.45, "S": 0.95, "B0": 0.28, "Mc": 1600.0, "Q": 350.0, "U": 0.2, "T": 0.2,
    }  # fmt: skip
    assert {name: value[name] for name in expected} == pytest.approx(expected)
    assert {s["basis"] for s in answer["steps"]} == {"recalled", "derived"}
    assert "no type approval" in answer["source"]
    page = (tmp_path / "report.html").read_text()
    assert "Interrupted rolling" in page
    assert "<svg" in page
    assert "--set vehicle.whole.mass=1600" in page


def test_an_input_goes_before_the_vehicle(tmp_path: Path) -> None:
    assert rollover("vineyard_tractor", "--input", "H6=1.6", "--input", "U=0", "--out", tmp_path).exit_code == 0
    answer = json.loads((tmp_path / "rolling.json").read_text())
    assert answer["verdict"] == "continuous"
    origin = {i["symbol"]: i["from"] for i in answer["inputs"]}
    assert (origin["H6"], origin["U"], origin["T"], origin["H1"]) == (
        "--input", "--input", "regulation, recalled", "vehicle",
    )  # fmt: skip


def test_what_lies_outside_its_field_is_said(tmp_path: Path) -> None:
    done = rollover("utility_tractor", "--out", tmp_path)
    assert done.exit_code == 0
    said = " ".join(done.stdout.split())
    assert "not front-mounted (two-post-rear)" in said
    assert "track of 1.50 m is no narrow one" in said
    assert json.loads((tmp_path / "rolling.json").read_text())["outside"][0] in said


def test_effects_of_a_scenario_are_left_out_and_named(tmp_path: Path) -> None:
    own = tmp_path / "own.yaml"
    own.write_text(
        "base: side_overturn\ntitle: own\nvehicle: vehicles/vineyard_tractor.yaml\n"
        "effects: {mass: {added: 300.0}, centre-of-mass: {height: 0.3}}\n"
    )
    done = rollover(own, "--out", tmp_path / "with")
    assert done.exit_code == 0, done.output
    assert "Effects were left out: centre-of-mass, mass." in done.stdout
    answer, plain = json.loads((tmp_path / "with" / "rolling.json").read_text()), tmp_path / "plain"
    assert answer["effects_left_out"] == ["centre-of-mass", "mass"]
    assert "Effects were left out: centre-of-mass, mass." in (tmp_path / "with" / "report.html").read_text()
    assert rollover("vineyard_tractor", "--out", plain).exit_code == 0
    without = json.loads((plain / "rolling.json").read_text())
    assert without["effects_left_out"] == []
    assert without["steps"] == answer["steps"]
    assert "left out" not in (plain / "report.html").read_text()


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (["vineyard_tractor", "--input", "h6=2"], "--input: h6: not an input, got 'h6'; did you mean 'H6'?"),
        (["vineyard_tractor", "--input", "B6=3"], "--input: B6: wider than the rear tyres, got 3 m; at most"),
        (["vineyard_tractor", "--input", "B6=wide"], "--input: B6: not a number, got 'wide'; a number in m"),
        (["vineyard_tractor", "--input", "H6=null"], "--input: H6: not a number, got None; a number in m"),
        (["vineyard_tractor", "--input", f"H6={'9' * 400}"], "--input: H6: out of bounds, got 999"),
        (["vineyard_tractor", "--input", f"L6=-{'9' * 309}"], "--input: L6: out of bounds, got -999"),
        (["vineyard_tractor", "--input", f"Mc=0x{'f' * 5000}"], "--input: Mc: not a number, got '0xfff"),
        (["compact_tractor_folded"], "H6: the ROPS does not land before the bonnet, got 1.4"),
        (["rops_rig"], "has no wheels to stand on"),
        (["vineyard_tracto"], "did you mean 'vineyard_tractor'?"),
    ],
)
def test_wrong_input_is_one_line(words: list[str], said: str, tmp_path: Path) -> None:
    done = rollover(*words, "--out", tmp_path / "out")
    assert done.exit_code == 2
    assert said in done.stderr
    assert len(done.stderr.strip().splitlines()) == 1
    assert not (tmp_path / "out").exists()


def test_what_the_vehicle_does_not_say_is_asked_for(tmp_path: Path) -> None:
    text = (shipped_folder() / "vehicles" / "vineyard_tractor.yaml").read_text()
    bare = tmp_path / "bare.yaml"
    frame = shipped_folder() / "vehicles" / "rops" / "two_post_front_1500.yaml"
    bare.write_text(text.replace("name: bonnet", "name: hood").replace("rops/two_post_front_1500.yaml", str(frame)))
    done = rollover(bare, "--out", tmp_path / "out")
    assert done.exit_code == 2
    assert "a box called bonnet in its outline; --input H7=VALUE for each: H7 (height of the bonnet), B7" in done.stderr
    given = [word for symbol in ("H7=1.15", "B7=0.48", "L7=1.25") for word in ("--input", symbol)]
    assert rollover(bare, *given, "--out", tmp_path / "out").exit_code == 0

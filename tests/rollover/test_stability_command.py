"""`rollover stability`: what it writes, answers and refuses."""

from __future__ import annotations

import json
from pathlib import Path

import pytest
from typer.testing import CliRunner, Result

from rollover.cli.main import app


def rollover(*words: object) -> Result:
    return CliRunner().invoke(app, ["stability", *(str(w) for w in words)])


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    out = tmp_path_factory.mktemp("stability") / "light"
    done = rollover("light_vehicle", "--headings", 4, "--set", "vehicle.whole.mass=460", "--out", out, "--json")
    assert done.exit_code == 0, done.output
    assert json.loads(done.stdout) == json.loads((out / "stability.json").read_text())
    return out


def test_report_of_a_vehicle(folder: Path) -> None:
    answer = json.loads((folder / "stability.json").read_text())
    assert answer["format"] == "rollover-stability/1"
    rows = answer["headings"]
    assert [row["heading_deg"] for row in rows] == [0.0, 90.0, 180.0, 270.0]
    for row in rows:
        assert 20.0 < row["lift_off_deg"] <= row["balance_deg"] <= row["overturn_deg"] < 60.0
        inner, outer = (row["closed_form"][where]["rigid_deg"] for where in ("centre_line", "outer_edge"))
        assert inner < outer + 1e-9
    # across the slope it is weaker than along it, and the balance on the pivot is the one that is lost
    assert answer["least"]["heading_deg"] in (90.0, 270.0)
    assert answer["least"]["balance_deg"] == min(rows[1]["phase_one_deg"], rows[3]["phase_one_deg"])
    assert [each["part"] for each in answer["losses"]] == ["ROPS", "driver of 75 kg"]
    for each in answer["losses"]:
        assert each["share"] == pytest.approx(1.0 - each["with_deg"] / each["without_deg"])
        assert 0.01 < each["share"] < 0.20
    assert answer["code_6"]["confidence"] == "recalled, source not checked"


@pytest.mark.parametrize(
    ("vehicle", "said"), [("utility_tractor", "tractors, not of this one ("), ("vineyard_tractor", "tractors (")]
)
def test_the_limit_is_that_of_narrow_tractors(vehicle: str, said: str, tmp_path: Path) -> None:
    done = rollover(vehicle, "--headings", 1, "--out", tmp_path / vehicle)
    assert f"38 deg asked of narrow {said}recalled" in done.output.replace("\n", " ")
    assert f"38 degrees asked of narrow {said}recalled" in (tmp_path / vehicle / "report.html").read_text()


def test_page(folder: Path) -> None:
    page = (folder / "report.html").read_text()
    answer = json.loads((folder / "stability.json").read_text())
    assert f"{answer['least']['balance_deg']:.1f} degrees, whichever way it faces" in page
    assert f"{answer['headings'][1]['overturn_deg']:.2f}" in page
    assert "5.4-8 %" in page
    assert "<svg" in page
    assert "--set vehicle.whole.mass=460" in page


def test_results_of_another_vehicle_stay(folder: Path) -> None:
    before = (folder / "stability.json").read_bytes()
    done = rollover("utility_tractor", "--headings", 1, "--out", folder)
    assert done.exit_code == 2
    assert "--force replaces" in done.output
    assert (folder / "stability.json").read_bytes() == before


@pytest.mark.parametrize(
    ("name", "says"),
    [
        ("rops_rig", "has no wheels to stand on"),
        ("acrylic_cube", "has no wheels to stand on"),
        ("drop_test", "needs wheels to stand on"),
        ("utility_tracto", "did you mean 'utility_tractor'"),
        ("tilt_tabel", "did you mean 'tilt_table'"),
    ],
)
def test_what_cannot_stand(name: str, says: str, tmp_path: Path) -> None:
    done = rollover(name, "--headings", 1, "--out", tmp_path / "out")
    assert done.exit_code == 2, done.output
    assert says in done.output
    assert not (tmp_path / "out").exists()


def test_a_vehicle_that_does_not_stand_is_refused_in_a_line(tmp_path: Path) -> None:
    """What no value of its own shows: a pivot so far away that the axle holds nothing."""
    path = tmp_path / "tall.yaml"
    path.write_text(
        "base: vehicles/utility_tractor.yaml\nfront_axle: {pivot: [2.25, 0.0, 6.0e+13]}\n", encoding="utf-8"
    )
    done = rollover(path, "--headings", 1, "--out", tmp_path / "out")
    assert done.exit_code == 2, done.output
    (line,) = done.output.strip().splitlines()
    assert line.startswith(f"{path}: wheels: chassis with front_axle turns freely about x")
    assert line.endswith("a further wheel off this axis")


def test_scenario_and_table(tmp_path: Path) -> None:
    """A scenario's effects stay out, and it says so."""
    effect = "effects.tank-slosh.mass=100"
    done = rollover("tilt_table", "--headings", 1, "--set", effect, "--out", tmp_path / "t")
    assert done.exit_code == 0, done.output
    assert "Effects were left out: tank-slosh" in done.stdout
    answer = json.loads((tmp_path / "t" / "stability.json").read_text())
    assert f"{answer['headings'][0]['overturn_deg']:.2f}" in done.stdout

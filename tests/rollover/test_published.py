"""Published drops of cones, balls, penetrometers and impactors, and their import: made-up files, and the owners'."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np
import pytest
from scipy.io import loadmat, savemat
from typer.testing import CliRunner

from rollover.cli.main import app
from rollover.recording import Recording
from rollover.recording.importers import COLLECTIONS, read_recording
from tests.rollover import published_files as files
from tests.rollover.published_files import published, read, refused

G = 9.80665


# cones


def write_cone(path: Path, **drops: np.ndarray) -> None:
    savemat(path, drops)


def cone_drop(peak: float = 60.0) -> np.ndarray:
    """A drop as published: seconds before and after it too, 0 g in the fall, a spike that the instrument clips."""
    t = np.arange(-1.0, 3.0, 1.0 / 4040.0)
    axial = np.where(t < -0.45, 1.0, np.where(t < 0.0, 0.01, 3.0))
    spike = (t > 0.001) & (t < 0.003)
    axial[spike] = np.minimum(peak, 41.7)
    return np.stack([t, axial, 0.2 + 0 * t, 0.3 + 0 * t], axis=1)


def test_drops_of_cones_come_from_the_owners_files(tmp_path: Path) -> None:
    write_cone(tmp_path / "SR45025.mat", SR450251=cone_drop(), SR450253=cone_drop(peak=20.0))
    write_cone(tmp_path / "SF60150.mat", SF601502=cone_drop(peak=20.0))
    write_cone(tmp_path / "SS12100.mat", SS121001=cone_drop(peak=20.0))
    found = read("cone-drops", tmp_path)
    assert sorted(found) == ["SF601502", "SR450251", "SR450253", "SS121001"]
    clipped, whole = found["SR450251"], found["SR450253"]
    assert whole.time.size - clipped.time.size == int(np.sum(cone_drop()[:, 1] > 40.5))
    assert any(note.startswith("8 rows above 40.45 g cut out") for note in clipped.notes)
    assert -0.015 < whole.time[0] < -0.0147
    assert 0.0497 < whole.time[-1] < 0.050
    a = "striker/acceleration_z"
    assert list(whole.channels) == [a]  # lateral axes say nothing of it
    assert whole[a][0] == pytest.approx(0.01 * G - 9.81)
    assert whole[a].max() == pytest.approx(20.0 * G - 9.81)
    assert whole.conditions["vehicle.mass"] == pytest.approx(0.5228 + 0.0343 + 0.0301 + 0.0025)
    assert whole.conditions["initiation.speed"] == pytest.approx(math.sqrt(2.0 * 9.81 * 0.25))
    assert whole.conditions["ground.law.drag_coefficient"] == pytest.approx(0.485, abs=5e-4)
    assert whole.conditions["vehicle.nose_height"] == pytest.approx(0.026)
    assert not [path for path in whole.conditions if path.startswith("effects.")]
    firm, soft = found["SF601502"].conditions, found["SS121001"].conditions
    assert firm["vehicle.mass"] == pytest.approx(0.5228 + 0.0343 + 0.0300 + 0.0040)
    assert firm["ground.law.drag_coefficient"] == pytest.approx(0.603, abs=5e-4)
    share = firm["effects.structural-compliance.nose_share"]
    assert share == pytest.approx(1.0 - 0.5228 / firm["vehicle.mass"])
    # what the water's mass is in the end, by the authors' fit: k rho r^3 of the depth, and three times it by 2/tau^2
    rate, fade = (firm[f"effects.soil-added-mass-growth.{n}"] for n in ("rate", "fade"))
    k, depth, tau = 0.8726557, 0.0146327, 2.5294626
    assert fade == pytest.approx(2.0 * depth / tau**2, rel=1e-4)
    from ground.fluid import cone_rate

    assert rate == pytest.approx(cone_rate(math.radians(60.0), density=997.0, coefficient=k), rel=1e-4)
    assert soft["vehicle.nose_height"] == pytest.approx(0.026 / math.tan(math.radians(12.5)))


@pytest.mark.parametrize(
    ("name", "rows", "says"),
    [
        ("SR450251", np.zeros((5, 3)), "four columns"),
        ("SR330251", cone_drop(), "no such cone, got 33"),
        ("SR450251", cone_drop()[::-1], "runs backwards"),
        ("SR450251", cone_drop()[:100], "nothing from"),
    ],
)
def test_what_is_no_drop_of_a_cone_is_refused(tmp_path: Path, name: str, rows: np.ndarray, says: str) -> None:
    write_cone(tmp_path / f"{name[:-1]}.mat", **{name: rows})
    assert says in refused(lambda: read("cone-drops", tmp_path))


def test_published_cones_match_an_independent_reading() -> None:
    folder = published("cones")
    found = read("cone-drops", folder)
    count = {series: sum(name.startswith(series) for name in found) for series in ("SR45", "SS25", "SF60")}
    assert count == {"SR45": 35, "SS25": 12, "SF60": 6}
    rows = loadmat(folder / "SS25100.mat")["SS251006"]
    rows = rows[(rows[:, 0] > -0.015) & (rows[:, 0] < 0.05) & (rows[:, 1] < 40.449)]
    assert found["SS251006"].time == pytest.approx(rows[:, 0])
    assert found["SS251006"]["striker/acceleration_z"] == pytest.approx(rows[:, 1] * G - 9.81)


# balls


def write_balls(folder: Path, **more: object) -> None:
    t = np.arange(30) / 15.0
    fall = 46.0 - 0.5 * 9.81 * t**2
    hit = [*fall[:28], fall[27] - 0.1, fall[27] - 0.1]
    sheets = {
        "Whiffle Ball 1": files.ball_rows({1: fall.tolist(), 2: hit}),
        "Yellow Whiffle Ball": files.ball_rows({1: fall.tolist()}) + [[None] * 4] * 50,
        "Volleyball": files.ball_rows({1: fall.tolist()}),
        **more,
    }
    files.write_book(folder / "Ball_drops_data.xls", sheets)
    (folder / "balls.txt").write_text(
        "ball            weight(oz)  circumference(cm)\nwiffleball1     1           22.8\n"
        "yellowWiffle    1.5         29.0\nvolleyball      ??          ??\n",
        encoding="utf-8",
    )


def test_balls_come_from_a_workbook_with_an_older_ending(tmp_path: Path) -> None:
    pytest.importorskip("openpyxl")
    write_balls(tmp_path)
    found = read("falling-balls", tmp_path)
    assert list(found) == ["whiffle-ball-1-1", "whiffle-ball-1-2", "yellow-whiffle-ball-1", "volleyball-1"]
    first, landed = found["whiffle-ball-1-1"], found["whiffle-ball-1-2"]
    assert first.time[1] == pytest.approx(1.0 / 15.0)
    assert list(first.channels) == ["striker/position_z"]  # the speed is a difference of it
    assert (first.time.size, landed.time.size) == (30, 28)
    assert any("2 rows after the landing" in note for note in landed.notes)
    # the file's zero is not the ground: without air a light ball would land in its record
    assert first.conditions["initiation.height"] == 80.0
    assert first["striker/position_z"][:2] == pytest.approx([80.0, 80.0 - 0.5 * 9.81 / 15.0**2])
    assert any("shifted by +34.000 m" in note for note in first.notes)
    assert first.uncertainty == {"initiation.height": 0.3, "initiation.speed": 0.3}
    assert (first.clock.zero, first.clock.within) == ("unknown", 0.1)
    assert first.conditions["vehicle.mass"] == pytest.approx(0.0283495, rel=1e-5)
    area = math.pi * (0.228 / (2.0 * math.pi)) ** 2
    assert first.conditions["vehicle.face_length"] ** 2 == pytest.approx(area)
    # an area of 0.01 m2 times this is C_d A
    assert first.conditions["effects.air-drag.drag_coefficient"] == pytest.approx(area / 0.01)
    volleyball = found["volleyball-1"]
    assert volleyball.conditions["vehicle.mass"] == 0.27
    assert volleyball.uncertainty["vehicle.mass"] == 0.006
    assert any("by the rules of the game" in note for note in volleyball.notes)


def test_what_is_no_workbook_of_balls_is_refused(tmp_path: Path) -> None:
    pytest.importorskip("openpyxl")
    write_balls(tmp_path, Golf=[["a", "b"], [1, 2]])
    assert "sheet 'Golf': not a ball, got a, b" in refused(lambda: read("falling-balls", tmp_path))
    write_balls(tmp_path, Golf=[*files.ball_rows({1: [3.0, 2.0]}), [1, "soon", 1.0, 0.0]])
    assert "sheet 'Golf', row 4, Time (s): not a number, got 'soon'" in refused(lambda: read("falling-balls", tmp_path))
    (tmp_path / "Ball_drops_data.xls").write_bytes(b"\xd0\xcf\x11\xe0 an older workbook")
    assert "not a readable Excel" in refused(lambda: read("falling-balls", tmp_path))
    (tmp_path / "Ball_drops_data.xls").unlink()
    assert "no falling balls in this folder" in refused(lambda: read("falling-balls", tmp_path))


def test_the_eleven_published_balls_stop_before_landing() -> None:
    pytest.importorskip("openpyxl")
    found = read("falling-balls", published("balls"))
    balls = {name.rpartition("-")[0] for name in found}
    assert len(balls) == 11
    assert {"baseball", "blue-basketball", "golf-ball", "tennis-ball", "volleyball", "whiffle-ball-1"} < balls
    shift = 80.0 - 47.6989460979
    assert found["baseball-1"]["striker/position_z"][:2] == pytest.approx([80.0, 47.7588059889 + shift])
    assert found["baseball-1"].conditions["vehicle.mass"] == pytest.approx(5 * 0.0283495, rel=1e-5)
    for name, drop in found.items():
        assert 25.0 < 80.0 - drop["striker/position_z"][-1] < 40.0, name
        assert drop.time.size > 40, name


# penetrometer


def write_drop(folder: Path, offset: float = 0.0, **books: object) -> None:
    g, factors = files.drop_log(offset)
    files.write_log(folder / "bLog0A01.bin", g, factors, first=(1 << 24) - 5)
    heading = ["Sensor", "May_2020_offset", "May_2020_scale"]
    own = [heading, *([name, *pair] for name, pair in factors.items())]
    wrong = [heading, *([name, pair[0] + 4e4 * k, pair[1]] for k, (name, pair) in enumerate(factors.items()))]
    sheets = {"README": [["Calibration factors"]], "bluedrop_1": wrong, "bluedrop_3": own} | books
    files.write_book(folder / "BlueDrop_Calibration_Factors.xlsx", {k: v for k, v in sheets.items() if v is not None})


def test_a_penetrometer_log_takes_its_instruments_factors(tmp_path: Path) -> None:
    pytest.importorskip("openpyxl")
    write_drop(tmp_path)
    drop = read("soil-penetrometer", tmp_path)["bLog0A01"]
    assert drop.conditions["initiation.speed"] == pytest.approx(4.2, rel=0.02)
    assert any("factors of bluedrop_3, May_2020" in note for note in drop.notes)
    # 0.7 s before the contact to 1.2 s behind it, at 2 kHz; the stop takes 0.2 s, with a peak of pi/2 v/T
    assert drop.time.size == pytest.approx(3800, abs=1)
    assert drop["striker/acceleration_z"].max() == pytest.approx(0.5 * math.pi * 4.2 / 0.2, rel=0.02)
    assert drop.time[np.argmax(drop["striker/acceleration_z"])] == pytest.approx(0.1, abs=0.02)
    assert drop.uncertainty["initiation.speed"] == 0.05
    assert (drop.clock.zero, drop.clock.within) == ("known", 0.01)
    # no acceleration in the water before: all that buoyancy leaves of the weight is drag
    weight = 7.71 * 9.81 - 2.473e-3 * 1025.0 * 9.81
    assert drop.conditions["effects.air-drag.area"] == pytest.approx(weight / (0.5 * 1025.0 * 4.2**2), rel=0.05)


def test_logs_without_factors_and_other_bytes_are_refused(tmp_path: Path) -> None:
    pytest.importorskip("openpyxl")
    write_drop(tmp_path, bluedrop_3=None)
    assert "no sheet of BlueDrop_Calibration_Factors.xlsx fits" in refused(lambda: read("soil-penetrometer", tmp_path))
    (tmp_path / "BlueDrop_Calibration_Factors.xlsx").unlink()
    assert "no calibration factors, got no BlueDrop" in refused(lambda: read("soil-penetrometer", tmp_path))
    data = bytearray((tmp_path / "bLog0A01.bin").read_bytes())
    (tmp_path / "bLog0A01.bin").write_bytes(data[:-7])
    assert "a multiple of 30" in refused(lambda: read("soil-penetrometer", tmp_path))
    write_drop(tmp_path)
    data[300:303] = data[330:333]  # the count stands still
    (tmp_path / "bLog0A01.bin").write_bytes(data)
    assert "row 11 is out of order" in refused(lambda: read("soil-penetrometer", tmp_path))


def test_published_penetrometer_drops_are_found_in_time() -> None:
    pytest.importorskip("openpyxl")
    folder = published("penetrometer")
    found = read("soil-penetrometer", folder)
    assert list(found) == ["bLog0D2F", "bLog0D31"]
    assert [drop.conditions["initiation.speed"] for drop in found.values()] == pytest.approx([4.241, 4.274], abs=2e-3)
    drop = found["bLog0D2F"]
    assert any("bluedrop_3, Sequim_2021" in note for note in drop.notes)
    raw = np.frombuffer((folder / "bLog0D2F.bin").read_bytes(), np.uint8).reshape(-1, 10, 3)[:, 3].astype(int)
    g = (raw[:, 0] * 65536 + raw[:, 1] * 256 + raw[:, 2] + 12322.1) / 163530.7  # the 18 g range, all positive here
    at = int(np.argmax(drop["striker/acceleration_z"]))
    assert np.min(np.abs((g - 1.0) * G - drop["striker/acceleration_z"][at])) < 1e-9


# IDE


def test_a_water_entry_has_its_speed_from_its_fall() -> None:
    pytest.importorskip("idelib")
    found = read("impack", published("impact_ide"))
    speeds = {name: r.conditions["initiation.speed"] for name, r in found.items()}
    # told 2 and 6 m/s; 6.045 by the owners' time of fall
    assert speeds["6mps_sphere_1"] == pytest.approx(6.045, abs=0.03)
    assert speeds["2mps_sphere_1"] == pytest.approx(speeds["2mps_sphere_2"], abs=0.02)
    cone = found["6mps_150degcone_1"]
    assert cone.conditions["vehicle.nose_height"] == pytest.approx(0.022225 / math.tan(math.radians(75.0)))
    before, after = cone.time < -0.002, (cone.time > 0.0) & (cone.time < 0.002)
    assert np.mean(cone["striker/acceleration_z"][before]) == pytest.approx(-9.81, abs=0.1)
    assert cone["striker/acceleration_z"][after].max() > 20.0 * G
    assert np.diff(cone.time) == pytest.approx(5e-5, rel=0.5)


def test_an_ide_file_is_read_by_profile_and_a_cut_one_refused(tmp_path: Path) -> None:
    idelib = pytest.importorskip("idelib")
    source = published("impact_ide") / "2mps_sphere_1.ide"
    profile = tmp_path / "profile.yaml"
    profile.write_text(
        "format: rollover-profile/1\nchannels:\n"
        "  40g DC Acceleration/X (40g):\n"
        "    {channel: sensor/axial/acceleration_z, sensor: {body: striker, gravity: proper}}\n"
        "  Rotation/Z: {channel: sensor/axial/angular_velocity_z, sensor: {body: striker}}\n",
        encoding="utf-8",
    )
    found = read_recording(source, profile=profile)
    with idelib.importFile(str(source)) as data:
        table = data.channels[80].getSession().arraySlice()
    time, values = found.samples("sensor/axial/acceleration_z")
    assert time == pytest.approx(table[0] * 1e-6)
    assert values == pytest.approx(table[1] * G)
    assert found.samples("sensor/axial/angular_velocity_z")[1][0] == pytest.approx(math.radians(0.183))
    cut = tmp_path / "cut.ide"
    for lost in (10, 100_000):
        cut.write_bytes(source.read_bytes()[:-lost])
        assert "not a readable IDE file" in refused(lambda: read_recording(cut, profile=profile))


# the commands


def test_the_imported_folder_is_taken_by_its_scenario(tmp_path: Path) -> None:
    files.write_old_pt(tmp_path / "4.pt", files.as_tensor(files.cube_rows()))
    write_cone(tmp_path / "SF60150.mat", SF601502=cone_drop(peak=20.0))
    for name, scenario in (("cube-tosses", "cube_toss"), ("cone-drops", "cone_drop")):
        out = tmp_path / name
        made = CliRunner().invoke(app, ["import", str(tmp_path), "--as", name, "--out", str(out)])
        assert made.exit_code == 0, made.output
        written = sorted(str(path) for path in out.glob("*.csv"))
        checked = CliRunner().invoke(app, ["check", "--scenario", scenario, *written])
        assert checked.exit_code == 0, checked.output


def test_an_empty_folder_is_refused_with_needed_files(tmp_path: Path) -> None:
    for name in COLLECTIONS:
        asked = CliRunner().invoke(app, ["import", str(tmp_path), "--as", name, "--out", str(tmp_path / "out")])
        assert asked.exit_code == 2, name
        assert "needed" in asked.output, name
    assert not (tmp_path / "out").exists()


def test_an_import_keeps_asked_channels_and_names_the_rest(tmp_path: Path) -> None:
    files.write_old_pt(tmp_path / "4.pt", files.as_tensor(files.cube_rows()))

    def imported(name: str, *options: str) -> Recording:
        out = tmp_path / name
        done = CliRunner().invoke(app, ["import", str(tmp_path), "--as", "cube-tosses", "--out", str(out), *options])
        assert done.exit_code == 0, done.output
        return read_recording(out / "toss004.csv")

    place = [f"chassis/position_{axis}" for axis in "xyz"]
    usual, all_of_it, one = imported("a"), imported("b", "--channel", "*"), imported("c", "--channel", place[2])
    # along the table, and of its axes those along which the cube moves: 1.0 and 0.4 m/s here
    assert list(usual.channels) == place[:2]
    assert "chassis/position_z, chassis/quaternion_w" in usual.notes[-1]
    rows = files.cube_rows()
    rows[:, 1] = 0.1 + 0.2 * (rows[:, 0] - 0.2)
    files.write_old_pt(tmp_path / "4.pt", files.as_tensor(rows))
    assert list(imported("f").channels) == place[:1]
    files.write_old_pt(tmp_path / "4.pt", files.as_tensor(files.cube_rows()))
    assert len(all_of_it.channels) == 7
    assert not any("channels left out" in note for note in all_of_it.notes)
    assert list(one.channels) == place[2:]
    # the others by --channel: any format, and nothing is written for one that is not there
    csv = str(tmp_path / "a" / "toss004.csv")
    options = ["--channel", "chassis/position_x", "--out", str(tmp_path / "d")]
    assert CliRunner().invoke(app, ["import", csv, *options]).exit_code == 0
    assert list(read_recording(tmp_path / "d" / "toss004.csv").channels) == place[:1]
    wrong = CliRunner().invoke(app, ["import", csv, "--channel", "chassis/positon_x", "--out", str(tmp_path / "e")])
    assert wrong.exit_code == 2
    assert "--channel: no such channel, got 'chassis/positon_x'; did you mean 'chassis/position_x'" in wrong.output
    assert not (tmp_path / "e").exists()

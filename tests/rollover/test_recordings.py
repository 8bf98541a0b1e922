"""`rollover-recording/1`: a table and a sidecar, read and written; and what stands in the published sets."""

from __future__ import annotations

import math
import os
from pathlib import Path

import numpy as np
import pytest

from rollover.dynamics.drop_test import DropModel
from rollover.recording import Clock, Recording, Sensor, write_parquet
from rollover.recording.importers import COLLECTIONS, read_recording, write_recording
from rollover.scenario import load
from rollover.system.errors import InputError

TABLE = """\
# a drop
t,F,z,spare

-1,0,1.5,x
# halfway
0, 2.5 ,,y
1e0,NaN,3,z
"""
SIDECAR = """\
format: rollover-recording/1
title: Drop on clay
source: the lab
conditions:
  initiation.speed: 3.0
channels:
  t: {channel: time, unit: ms}
  F: {channel: ground/force_normal, unit: kN, noise: 0.05}
  z: {channel: striker/acceleration_z, unit: g, cfc: 180}
"""


def written(folder: Path, table: str | bytes = TABLE, sidecar: str = SIDECAR) -> Path:
    (folder / "d.csv").write_bytes(table.encode() if isinstance(table, str) else table)
    (folder / "d.yaml").write_text(sidecar)
    return folder / "d.csv"


def test_a_table_and_its_sidecar(tmp_path: Path) -> None:
    path = written(tmp_path)
    for name in (path, path.with_suffix(".yaml")):
        found = read_recording(name)
        assert found.time.tolist() == [-0.001, 0.0, 0.001]
        assert found["ground/force_normal"] == pytest.approx([0.0, 2500.0, np.nan], nan_ok=True)
        assert found["striker/acceleration_z"] == pytest.approx([1.5 * 9.80665, np.nan, 3.0 * 9.80665], nan_ok=True)
        assert (found.title, found.source, found.conditions) == (
            "Drop on clay", "the lab", {"initiation.speed": 3.0},
        )  # fmt: skip
        assert found.noise == {"ground/force_normal": pytest.approx(50.0)}
        assert found.cfc == {"striker/acceleration_z": 180}
        assert found.clock.zero == "known"
        assert found.notes == ("1 of 4 columns left out, without a description: spare",)


def test_a_byte_order_mark_and_windows_lines(tmp_path: Path) -> None:
    path = written(tmp_path, b"\xef\xbb\xbf" + TABLE.replace("\n", "\r\n").encode())
    assert read_recording(path)["ground/force_normal"][1] == 2500.0


def test_conditions_are_scenario_values(tmp_path: Path) -> None:
    found = read_recording(written(tmp_path, sidecar=SIDECAR.replace("3.0", "2.5")))
    assert load("drop_test").replaced(found.conditions).initiation.speed == 2.5  # type: ignore[union-attr]


@pytest.mark.parametrize("ending", ["csv", "parquet"])
def test_nothing_is_lost_on_the_way(tmp_path: Path, ending: str) -> None:
    values = np.random.default_rng(3).normal(size=(2, 100)) * 1e3
    values[1, 7:20] = np.nan
    sensor = Sensor(body="rops", position=(0.1, -0.2, 1.7), orientation_deg=(0.0, 90.0, 10.0), gravity="proper")
    made = Recording(
        title="Odd: # 'title'",
        source="a, b\nc",
        time=np.cumsum(np.random.default_rng(4).uniform(1e-4, 1e-3, 100)) - 0.01,
        channels={"sensor/top/acceleration_x": values[0], "rops/mount/left/force_x": values[1]},
        conditions={"initiation.speed": 3.1, "initiation.kind": "drop"},
        noise={"rops/mount/left/force_x": 0.1},
        cfc={"rops/mount/left/force_x": 600},
        clock=Clock(zero="unknown"),
        sensors={"sensor/top/acceleration_x": sensor},
        notes=("one", "two"),
    )
    write_recording(made, tmp_path / "deep" / f"r.{ending}")
    assert sorted(p.name for p in (tmp_path / "deep").iterdir()) == sorted([f"r.{ending}", "r.yaml"])
    found = read_recording(tmp_path / "deep" / f"r.{ending}")
    assert found.time.tobytes() == made.time.tobytes()
    for name, column in made.channels.items():
        assert np.array_equal(found[name], column, equal_nan=True)
    for part in ("title", "source", "conditions", "noise", "cfc", "clock", "sensors", "notes"):
        assert getattr(found, part) == getattr(made, part), part


def test_writing_over_results_is_refused_and_leaves_nothing(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    made = read_recording(written(tmp_path))
    with pytest.raises(InputError, match=r"d\.csv: exists; --force replaces it"):
        write_recording(made, tmp_path / "d.csv")
    write_recording(made, tmp_path / "d.csv", force=True)
    assert read_recording(tmp_path / "d.csv")["ground/force_normal"][1] == 2500.0

    def breaks(*_: object) -> None:
        raise KeyboardInterrupt

    before = sorted(tmp_path.iterdir())
    monkeypatch.setattr(os, "replace", breaks)
    with pytest.raises(KeyboardInterrupt):
        write_recording(made, tmp_path / "other.csv")
    assert sorted(tmp_path.iterdir()) == before


def test_channels_of_a_run_are_a_recording(tmp_path: Path) -> None:
    made = Recording(title="run", time=np.arange(3.0), channels={"ground/sinkage": np.arange(3.0)}, source="simulation")
    write_parquet(made, tmp_path / "channels.parquet")
    for path in (tmp_path, tmp_path / "channels.parquet"):
        assert np.array_equal(read_recording(path)["ground/sinkage"], np.arange(3.0))


@pytest.mark.parametrize("bad", [np.inf, -np.inf, np.nan])
@pytest.mark.filterwarnings("error")
def test_a_stamp_that_is_no_time_is_named(bad: float) -> None:
    with pytest.raises(ValueError, match=r"time: not finite, got .* at stamp 2; seconds"):
        Recording(title="run", time=np.array([0.0, bad, bad]), channels={})


# ---- published sets


def data(name: str) -> Path:
    if "ROLLOVER_DATA" not in os.environ:
        pytest.skip("ROLLOVER_DATA names no folder of measured recordings: real recordings are not tested")
    return Path(os.environ["ROLLOVER_DATA"], name.replace("-", "_"))


def only(name: str, *select: str) -> dict[str, Recording]:
    return dict(COLLECTIONS[name].read(data(name), select or ("*",)))


def test_cube_tosses() -> None:
    found = only("cube-tosses", "toss00*")
    assert list(found) == [f"toss00{i}" for i in range(10)]
    toss = found["toss003"]
    q = np.column_stack([toss[f"chassis/quaternion_{a}"] for a in "wxyz"])
    assert np.linalg.norm(q, axis=1) == pytest.approx(np.ones(len(q)))
    assert (np.sum(q[1:] * q[:-1], axis=1) > 0.9).all()  # no jumps of sign
    # the table is where the cube comes to rest; what comes later than 0.1 s after the first contact is cut off and said
    assert any("the table is where the cube comes to rest, -1.4 mm from the zero" in note for note in toss.notes)
    assert any(note.startswith("79 rows from 0.1 s after the first contact on cut off") for note in toss.notes)
    # each begins where and as fast as its conditions say: half of the flight before the first contact, in the scenario
    for recording in found.values():
        scenario = load("cube_toss").replaced(recording.conditions)
        start = scenario.initiation
        t = recording.time[:4]
        for k, axis in enumerate("xyz"):
            there = start.position[k] + start.velocity[k] * t - (4.905 * t**2 if axis == "z" else 0.0)
            assert recording[f"chassis/position_{axis}"][:4] == pytest.approx(there, abs=0.005)
        first = np.array([recording[f"chassis/quaternion_{axis}"][0] for axis in "wxyz"])
        assert abs(first @ np.array(start.quaternion)) == pytest.approx(1.0, abs=2e-4)
    # before contact the height falls as gravity says: the bend of z over the first rows, the median of ten tosses
    bends = [2.0 * np.polyfit(r.time[:8], r["chassis/position_z"][:8], 2)[0] for r in found.values()]
    assert np.median(bends) == pytest.approx(-9.81, rel=0.1)


def test_falling_balls() -> None:
    found = only("falling-balls")
    assert len(found) == 14
    assert found["golf-ball-1"].conditions["vehicle.mass"] == pytest.approx(1.62 * 0.0283495, rel=1e-4)
    assert found["whiffle-ball-1-1"].conditions["vehicle.mass"] == pytest.approx(0.0283495, rel=1e-4)
    assert found["volleyball-1"].conditions["vehicle.mass"] == 0.27  # not stated: by the rules of the game
    for drop in found.values():
        assert DropModel(scenario=load("ball_drop").replaced(drop.conditions)).times[0] == 0.0
        assert drop.conditions["initiation.height"] == drop["striker/position_z"][0]
    # the heights' zero is not the ground: all begin at the told 80 m, the shift is said
    assert found["baseball-1"]["striker/position_z"][0] == 80.0
    assert any("shifted by +32.301 m" in note for note in found["baseball-1"].notes)  # from 47.699 m


def test_penetrometer() -> None:
    found = only("soil-penetrometer")
    assert len(found) == 4
    for name, drop in found.items():
        assert "from a18g" in drop.notes[0]  # the 2 g one is clipped in every drop
        # zero is at first contact, as far as that can be found; the whole record stands where it cannot
        clean = name != "bLog0D39"
        assert drop.time[0] == pytest.approx(-0.7 if clean else -3.0, abs=0.01)
        assert (drop.clock.zero, drop.clock.within) == (("known", 0.01) if clean else ("unknown", None))
        assert load("penetrometer_drop").replaced(drop.conditions)
    speeds = {name: drop.conditions.get("initiation.speed") for name, drop in found.items()}
    assert speeds.pop("bLog0D39") is None  # was handled, not dropped: it says so instead
    assert any("no clean drop" in note for note in found["bLog0D39"].notes)
    assert [round(speed, 1) for speed in speeds.values()] == [4.2, 4.3, 5.1]
    at_rest = found["bLog0D31"]["striker/acceleration_z"][-500:]
    assert at_rest.mean() == pytest.approx(0.0, abs=0.1)  # 1 g taken off


def test_cone_drops() -> None:
    found = only("cone-drops", "SR60100*")
    assert len(found) == 6
    drop = found["SR601001"]
    assert drop.conditions["initiation.speed"] == pytest.approx(math.sqrt(2.0 * 9.81 * 1.0))
    assert drop.conditions["vehicle.mass"] == pytest.approx(0.5228 + 0.0300 + 0.0343 + 0.0025)
    falling = drop["striker/acceleration_z"][drop.time < -0.01]
    assert falling.mean() == pytest.approx(-9.81, abs=0.3)
    scenario = load("cone_drop").replaced(drop.conditions)
    assert scenario.vehicle.nose_height == pytest.approx(0.026 / math.tan(math.radians(60.0)))

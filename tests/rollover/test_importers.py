"""Foreign formats: each written by its own library (or by hand) and read back."""

from __future__ import annotations

import importlib.util
import json
import tarfile
import zipfile
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from rollover.recording import Recording
from rollover.recording.importers import importers, read_recording, write_recording
from rollover.recording.importers import mme_codes as codes
from rollover.recording.importers.polarity import J211_TO_ISO8855, sign, turned
from rollover.system.errors import InputError

TIME = np.arange(200) * 1e-3 - 0.05
FORCE = 40.0 * np.sin(30.0 * TIME)
PROFILE = """\
format: rollover-profile/1
title: Bench
conditions: {initiation.speed: 3.0}
channels:
"""


def needs(library: str) -> None:
    if importlib.util.find_spec(library) is None:
        pytest.skip(f"{library} is not installed: its format is not tested")


def profile(folder: Path, channels: str, more: str = "") -> Path:
    path = folder / "profile.yaml"
    path.write_text(PROFILE + channels + more)
    return path


def test_csv_as_a_german_logger_writes_it(tmp_path: Path) -> None:
    rows = [f"{t:.6f};{f:.9f};x".replace(".", ",") for t, f in zip(TIME, FORCE, strict=True)]
    text = "Prüfstand 3\nZeit;Kraft;Kürzel\ns;[kN];-\n" + "\n".join(rows) + "\n"
    (tmp_path / "a.csv").write_bytes(text.encode("cp1252"))
    how = "csv: {delimiter: ';', decimal: ',', encoding: cp1252, names_row: 2, units_row: 3}\n"
    p = profile(
        tmp_path, "  Zeit: {channel: time}\n  Kraft: {channel: ground/force_normal, scale: -1, offset: 2}\n", how
    )
    found = read_recording(tmp_path / "a.csv", profile=p)
    assert found.time == pytest.approx(TIME, abs=1e-9)
    assert found["ground/force_normal"] == pytest.approx(1000.0 * (2.0 - FORCE), abs=1e-3)
    assert found.conditions == {"initiation.speed": 3.0}
    assert found.notes == ("1 of 3 columns left out, without a description: Kürzel",)


def test_a_profile_by_rate(tmp_path: Path) -> None:
    (tmp_path / "a.txt").write_text("F\n1\n2\n3\n")
    p = profile(tmp_path, "  F: {channel: ground/force_normal, unit: N}\n", "rate: 500\nstart: -0.002\n")
    assert read_recording(tmp_path / "a.txt", profile=p).time == pytest.approx([-0.002, 0.0, 0.002])


def test_mat(tmp_path: Path) -> None:
    from scipy.io import savemat

    savemat(tmp_path / "a.mat", {"run": {"t": TIME, "F": FORCE}, "note": "x"})
    p = profile(tmp_path, "  run.t: {channel: time, unit: s}\n  run.F: {channel: rops/force_x, unit: kN}\n")
    found = read_recording(tmp_path / "a.mat", profile=p)
    assert np.array_equal(found.time, TIME)
    assert np.array_equal(found["rops/force_x"], 1000.0 * FORCE)


def test_hdf5(tmp_path: Path) -> None:
    needs("h5py")
    import h5py

    with h5py.File(tmp_path / "a.h5", "w") as file:
        file["raw/t"] = TIME[None, :]  # as MATLAB 7.3 keeps a vector
        file["raw/F"] = FORCE[None, :]
        file["raw/F"].attrs["unit"] = "kN"
    p = profile(tmp_path, "  raw/t: {channel: time, unit: s}\n  raw/F: {channel: rops/force_x}\n")
    assert np.array_equal(read_recording(tmp_path / "a.h5", profile=p)["rops/force_x"], 1000.0 * FORCE)


def test_tdms_of_two_rates(tmp_path: Path) -> None:
    needs("nptdms")
    from nptdms import ChannelObject, TdmsWriter

    def channel(name: str, values: np.ndarray, unit: str, step: float) -> ChannelObject:
        how = {"wf_increment": step, "wf_start_offset": -0.05, "unit_string": unit}
        return ChannelObject("g", name, values, properties=how)

    with TdmsWriter(str(tmp_path / "a.tdms")) as file:
        file.write_segment([channel("rops/force_x", FORCE, "kN", 1e-3), channel("slow", FORCE[::4], "mm", 4e-3)])
    p = profile(tmp_path, "  g/rops/force_x: {channel: rops/force_x}\n  g/slow: {channel: rops/deflection}\n")
    found = read_recording(tmp_path / "a.tdms", profile=p)
    time, values = found.samples("rops/deflection")
    assert time == pytest.approx(TIME[::4], abs=1e-12)
    assert np.array_equal(values, 1e-3 * FORCE[::4])
    assert np.array_equal(found["rops/force_x"], 1000.0 * FORCE)
    # without a profile the names must be channels
    assert list(read_recording(tmp_path / "a.tdms").channels) == ["rops/force_x"]


def test_mdf(tmp_path: Path) -> None:
    needs("asammdf")
    from asammdf import MDF, Signal

    with MDF(version="4.10") as file:
        file.append([Signal(FORCE, TIME + 0.05, name="F", unit="kN")])
        file.append([Signal(FORCE[::2].copy(), TIME[::2] + 0.05, name="d", unit="mm")])
        file.save(tmp_path / "a.mf4")
    p = profile(tmp_path, "  F: {channel: rops/force_x}\n  d: {channel: rops/deflection}\n")
    found = read_recording(tmp_path / "a.mf4", profile=p)
    assert np.array_equal(found.samples("rops/force_x")[1], 1000.0 * FORCE)
    assert found.samples("rops/deflection")[0] == pytest.approx(TIME[::2] + 0.05)


def test_mcap(tmp_path: Path) -> None:
    needs("mcap")
    from mcap.writer import Writer

    with (tmp_path / "a.mcap").open("wb") as stream:
        writer = Writer(stream)
        writer.start()
        schema = writer.register_schema(name="imu", encoding="jsonschema", data=b"{}")
        channel = writer.register_channel(topic="/imu", message_encoding="json", schema_id=schema)
        for i, value in enumerate(FORCE):
            data = json.dumps({"a": {"x": float(value)}, "ok": True}).encode()
            stamp = 10**18 + i * 1_000_000
            writer.add_message(channel_id=channel, log_time=stamp, publish_time=stamp, data=data)
        writer.finish()
    p = profile(tmp_path, "  /imu.a.x: {channel: chassis/acceleration_x, unit: g}\n")
    found = read_recording(tmp_path / "a.mcap", profile=p)
    assert found.time == pytest.approx(TIME + 0.05, abs=1e-12)
    assert found["chassis/acceleration_x"] == pytest.approx(9.80665 * FORCE, rel=1e-14)


def test_ros_bag(tmp_path: Path) -> None:
    needs("rosbags")
    from rosbags.rosbag2 import Writer
    from rosbags.typesys import Stores, get_typestore

    store = get_typestore(Stores.ROS2_HUMBLE)
    kind = store.types["std_msgs/msg/Float64"]
    with Writer(tmp_path / "bag", version=9) as writer:
        connection = writer.add_connection("/force", kind.__msgtype__, typestore=store)
        for i, value in enumerate(FORCE):
            writer.write(connection, i * 1_000_000, store.serialize_cdr(kind(float(value)), kind.__msgtype__))
    p = profile(tmp_path, "  /force.data: {channel: rops/force_x, unit: kN}\n")
    assert np.array_equal(read_recording(tmp_path / "bag", profile=p)["rops/force_x"], 1000.0 * FORCE)


@pytest.mark.parametrize(
    ("library", "extra", "start"),
    [("nptdms", "tdms", b"TDSm"), ("h5py", "hdf5", b"\x89HDF\r\n\x1a\n"), ("asammdf", "mdf", b"MDF     ")],
)
def test_a_missing_library_names_its_extra(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, library: str, extra: str, start: bytes
) -> None:
    (tmp_path / "a.bin").write_bytes(start + bytes(100))
    monkeypatch.setitem(__import__("sys").modules, library, None)
    with pytest.raises(
        InputError, match=rf"needs {library}, which is not installed; pip install 'rollover\[{extra}\]'"
    ):
        read_recording(tmp_path / "a.bin")


# ---- ISO-MME


def test_turning_axes_twice_is_identity_and_right_handed() -> None:
    assert np.array_equal(J211_TO_ISO8855 @ J211_TO_ISO8855, np.eye(3))
    assert np.linalg.det(J211_TO_ISO8855) == 1.0
    assert pytest.approx([0.0, 0.0, -1.0]) == J211_TO_ISO8855 @ [0.0, 0.0, 1.0]  # down is minus up


@given(st.lists(st.floats(-1e6, 1e6), min_size=3, max_size=3), st.lists(st.floats(-1e6, 1e6), min_size=3, max_size=3))
def test_turned_vectors(a: list[float], b: list[float]) -> None:
    u, v = np.array(a), np.array(b)
    assert np.array_equal(turned(turned(u)), u)
    assert turned(np.cross(u, v)) == pytest.approx(np.cross(turned(u), turned(v)))  # handedness +1
    assert [sign(f"rops/force_{axis}") * c for axis, c in zip("xyz", a, strict=True)] == pytest.approx(turned(u))


def test_signs_of_channels_without_axes() -> None:
    assert sign("ground/sinkage") == sign("rops/force") == sign("chassis/roll") == sign("chassis/quaternion_w") == 1.0
    assert sign("chassis/pitch") == sign("striker/position_z") == -1.0


def test_codes() -> None:
    assert codes.code_of("rops/force_z", 180) == "10ROPS000000FOZC"
    assert codes.channel_of("10ROPS000000FOZC") == "rops/force_z"
    assert codes.channel_of("2?ROPS000000FOZA") == "rops/force_z"
    assert codes.cfc_of("10ROPS000000FOZA") == 1000
    assert codes.channel_of("10SEAT000000FOZA") is None


def example() -> Recording:
    values = np.random.default_rng(1).normal(size=(4, 50))
    values[1, 3] = np.nan
    names = ("rops/force_y", "chassis/acceleration_z", "rops/mount/left/force_x", "chassis/quaternion_y")
    return Recording(
        title="Overturn",
        source="Lab Süd",
        time=np.arange(50) * 1e-4 - 0.01,
        channels=dict(zip(names, values, strict=True)),
        cfc={"chassis/acceleration_z": 60},
    )


@pytest.mark.parametrize("ending", [".mme.zip", ".mme"])
@pytest.mark.parametrize("even", [True, False])
def test_mme_round_trip(tmp_path: Path, ending: str, even: bool) -> None:
    time = example().time if even else np.cumsum(np.linspace(1e-4, 2e-4, 50))
    given_ = Recording(**{**vars(example()), "time": time})
    write_recording(given_, tmp_path / f"T1{ending}")
    assert sorted(p.name for p in tmp_path.iterdir()) == [f"T1{ending}"]
    found = read_recording(tmp_path / f"T1{ending}")
    assert found.time == pytest.approx(time, abs=1e-15)
    for name, values in given_.channels.items():
        assert found[name].tobytes() == values.tobytes() or np.array_equal(found[name], values, equal_nan=True)
    assert (found.title, found.source, dict(found.cfc)) == (given_.title, given_.source, dict(given_.cfc))


def test_mme_is_in_sae_polarity_on_disk(tmp_path: Path) -> None:
    write_recording(example(), tmp_path / "T1.mme")
    text = (tmp_path / "T1.mme" / "Channel" / "T1.001").read_text()
    assert "Channel code                :10ROPS000000FOY0\n" in text
    assert float(text.splitlines()[10]) == -example()["rops/force_y"][0]


FOREIGN = """\
Test object number          :1
Name of the channel         :Roll bar, vertical
Channel code                :10ROPS000000FOZC
Unit                        :{unit}
Reference channel           :implicit
Sampling interval           :0.001
Time of first sample        :-0.002
Number of samples           :3
1.5
NOVALUE
-2
"""


@pytest.mark.parametrize("unit", ["N", "NOVALUE"])
@pytest.mark.parametrize("packed", ["folder", "zip", "tar"])
def test_mme_of_another_laboratory(tmp_path: Path, packed: str, unit: str) -> None:
    folder = tmp_path / "test" / "v01"
    (folder / "CHANNEL").mkdir(parents=True)
    (folder / "v01.MME").write_bytes("Title  :Überschlag\nLaboratory name :NOVALUE\n".encode("iso-8859-1"))
    (folder / "CHANNEL" / "v01.001").write_text(FOREIGN.format(unit=unit))
    path = folder
    if packed == "zip":
        path = tmp_path / "t.zip"
        with zipfile.ZipFile(path, "w") as archive:
            for file in folder.rglob("*.*"):
                archive.write(file, f"v01/{file.relative_to(folder).as_posix()}")
    elif packed == "tar":
        path = tmp_path / "t.tar.gz"
        with tarfile.open(path, "w:gz") as tar:
            tar.add(folder, "v01")
    found = read_recording(path)
    assert (found.title, found.source) == ("Überschlag", "")
    assert found["rops/force_z"] == pytest.approx([-1.5, np.nan, 2.0], nan_ok=True)  # z down there, up here
    assert found.time == pytest.approx([-0.002, -0.001, 0.0])
    assert dict(found.cfc) == {"rops/force_z": 180}


def test_names_of_importers() -> None:
    assert {"plain", "csv", "iso-mme", "mat", "tdms", "mdf", "hdf5", "mcap"} <= set(importers())


def test_a_file_of_no_known_format_hears_of_published_sets(tmp_path: Path) -> None:
    (tmp_path / "7.pt").write_bytes(b"\x80\x02}q\x00.")
    with pytest.raises(InputError, match=r"no importer knows this file; .*--as one of cube-tosses"):
        read_recording(tmp_path / "7.pt")

"""Messages: which stamps count, arrays, text among numbers, what is left out."""

from __future__ import annotations

import json
import shutil
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from rollover.recording.importers import read_recording
from rollover.system.errors import InputError
from tests.rollover.foreign import CASES, FORCE, SINKAGE, left_out, named, needs, peak

needs("mcap")
from mcap.writer import Writer  # noqa: E402

BEGAN = 1714550400 * 10**9
N = f"{FORCE}, unit: N"


def write(path: Path, *messages: tuple[str, int, Any], encoding: str = "json") -> Path:
    """Messages `(topic, ms after the first, what)`."""
    with path.open("wb") as stream:
        writer = Writer(stream)
        writer.start()
        schema = writer.register_schema(name="x", encoding="jsonschema", data=b"{}")
        kinds = {topic: encoding if isinstance(what, bytes) else "json" for topic, _, what in messages}
        channels = {t: writer.register_channel(topic=t, message_encoding=e, schema_id=schema) for t, e in kinds.items()}
        for topic, at, what in messages:
            data = what if isinstance(what, bytes) else json.dumps(what).encode()
            stamp = BEGAN + at * 1_000_000
            writer.add_message(channel_id=channels[topic], log_time=stamp, publish_time=stamp, data=data)
        writer.finish()
    return path


def test_stamps_of_messages_that_were_logged_in_batches(tmp_path: Path) -> None:
    path = Path(shutil.copy(CASES / "batch.mcap", tmp_path))
    with pytest.raises(
        InputError, match=r"repeated stamp, .* other stamps: \{'/cell.header.stamp': \{channel: time\}\}"
    ):
        read_recording(path, profile=CASES / "batch.profile.yaml")
    found = named(path, {"/cell.force": N, "/cell.header.stamp": "time"})
    assert peak(found) == pytest.approx(3598.1, abs=0.1)
    assert found.time == pytest.approx(np.arange(400) * 1e-3, abs=1e-12)
    assert found.notes == ("time counts from 2024-05-01T08:00:00.000000000Z",)
    assert found.clock.zero == "unknown"
    assert named(path, {"/cell.force": N, "/cell.header.stamp": "time"}, "clock: {zero: known}\n").clock.zero == "known"


@pytest.mark.parametrize(
    ("stamps", "about"),
    [
        ([{"secs": 1714550400, "nsecs": ms * 10**6} for ms in (0, 1, 3)], "time"),
        ([f"2024-05-01T10:00:00.{ms:03d}+02:00" for ms in (0, 1, 3)], "time"),
        ([BEGAN + ms * 10**6 for ms in (0, 1, 3)], "time, unit: ns"),
        ([BEGAN // 10**6 + ms for ms in (0, 1, 3)], "time, unit: ms"),
    ],
)
def test_stamps_in_other_spellings(tmp_path: Path, stamps: list[Any], about: str) -> None:
    path = write(tmp_path / "a.mcap", *(("/c", 7, {"t": {"at": s}, "F": k}) for k, s in enumerate(stamps)))
    found = named(path, {"/c.t.at": about, "/c.F": N})
    assert found.time == pytest.approx([0.0, 0.001, 0.003], abs=1e-12)
    assert found.notes[0] == "time counts from 2024-05-01T08:00:00.000000000Z"


def test_a_simulators_clock_has_its_own_zero(tmp_path: Path) -> None:
    stamps = [{"sec": 2, "nanosec": 0}, {"sec": 2, "nanosec": 500_000_000}]
    path = write(tmp_path / "a.mcap", *(("/c", 0, {"t": s, "F": k}) for k, s in enumerate(stamps)))
    found = named(path, {"/c.t": "time", "/c.F": N})
    assert found.time == pytest.approx([2.0, 2.5])
    assert found.clock.zero == "known"


def test_a_message_without_its_stamp_is_refused(tmp_path: Path) -> None:
    stamp = {"sec": 5, "nanosec": 0}
    path = write(tmp_path / "a.mcap", ("/c", 0, {"t": stamp, "F": 1}), ("/c", 1, {"F": 2}))
    with pytest.raises(InputError, match=r"channels./c.t: message 1 of /c has none; a stamp in every message"):
        named(path, {"/c.t": "time", "/c.F": N})
    path = write(tmp_path / "b.mcap", ("/c", 0, {"t": stamp, "u": stamp, "F": 1}))
    with pytest.raises(InputError, match=r"channels./c.u: a second column of time for the same messages, first '/c.t'"):
        named(path, {"/c.t": "time", "/c.u": "time", "/c.F": N})


def test_topics_keep_their_distance(tmp_path: Path) -> None:
    late = {"sec": 1714550400, "nanosec": 4_000_000}
    path = write(tmp_path / "a.mcap", ("/c", 1, {"F": 1}), ("/d", 9, {"h": late, "z": 2}), ("/c", 11, {"F": 3}))
    found = named(path, {"/c.F": N, "/d.h": "time", "/d.z": f"{SINKAGE}, unit: m"})
    assert found.samples(FORCE)[0] == pytest.approx([0.0, 0.01], abs=1e-12)  # as logged
    assert found.samples(SINKAGE)[0] == pytest.approx([0.003], abs=1e-12)  # as stamped, 3 ms after the first


def test_entries_of_arrays(tmp_path: Path) -> None:
    path = Path(shutil.copy(CASES / "list.mcap", tmp_path))
    assert peak(read_recording(path, profile=CASES / "list.profile.yaml")) == pytest.approx(3598.1, abs=0.1)
    with pytest.raises(
        InputError, match=r"no such column in list.mcap, got .*; it is /joints.effort.0, /joints.effort.1"
    ):
        named(path, {"/joints.effort": N})
    nested = [{"legs": [{"f": [k, 10 * k]}, {"f": [2 * k, 20 * k]}]} for k in range(3)]
    path = write(tmp_path / "a.mcap", *(("/c", k, what) for k, what in enumerate(nested)))
    assert named(path, {"/c.legs.1.f.1": N})[FORCE] == pytest.approx([0, 20, 40])


def test_long_arrays_are_named_as_one_but_entries_may_be_read(tmp_path: Path) -> None:
    path = write(tmp_path / "a.mcap", *(("/scan", k, {"r": [k + 0.5] * 1000, "F": k}) for k in range(3)))
    found = named(path, {"/scan.F": N})
    assert "an array of 1000, whose entries a profile may name: /scan.r.0: /scan.r" in found.notes[-1]
    assert named(path, {"/scan.r.999": N})[FORCE] == pytest.approx([0.5, 1.5, 2.5])


def test_text_among_numbers_is_a_gap_and_said(tmp_path: Path) -> None:
    values = [1.0, "overload", None, 4.0]
    path = write(tmp_path / "a.mcap", *(("/c", k, {"F": value}) for k, value in enumerate(values)))
    found = named(path, {"/c.F": N})
    assert found[FORCE] == pytest.approx([1.0, np.nan, np.nan, 4.0], nan_ok=True)
    assert "/c.F: 1 of 4 values are text, left as gaps: 1 'overload'" in found.notes


def test_all_that_a_file_holds_is_counted(tmp_path: Path) -> None:
    what = {
        "F": 1.0,
        "spare": 2,
        "flag": True,
        "note": "x",
        "void": None,
        "header": {"stamp": {"sec": 5, "nanosec": 1}},
    }
    path = write(tmp_path / "a.mcap", ("/c", 0, what), ("/c", 1, what), ("/cdr", 2, b"\x00\x01"), encoding="cdr")
    found = named(path, {"/c.F": N})
    assert left_out(found) == (6, 7)
    said = " ".join(found.notes)
    for reason in ("true or false: /c.flag", "text: /c.note", "no value: /c.void", "messages in cdr: /cdr"):
        assert reason in said
    with pytest.raises(InputError, match="topic /cdr: messages in cdr"):
        named(path, {"/c.F": N, "/cdr.x": f"{SINKAGE}, unit: m"})
    with pytest.raises(InputError, match=r"channels./c.flag: not a column of numbers over time: true or false"):
        named(path, {"/c.flag": N})


def test_header_stamps_and_arrays_of_a_ros_bag(tmp_path: Path) -> None:
    pytest.importorskip("rosbags", reason="rosbags is not installed: bags are not tested")
    from rosbags.rosbag2 import Writer as Bag
    from rosbags.typesys import Stores, get_typestore

    store = get_typestore(Stores.ROS2_HUMBLE)
    joints, header, time = (
        store.types[f"{kind}"]
        for kind in ("sensor_msgs/msg/JointState", "std_msgs/msg/Header", "builtin_interfaces/msg/Time")
    )
    with Bag(tmp_path / "bag", version=9) as bag:
        connection = bag.add_connection("/joints", joints.__msgtype__, typestore=store)
        for k in range(4):
            stamp = time(sec=1714550400, nanosec=k * 2_000_000)
            empty = np.empty(0)
            message = joints(header(stamp, "base"), ["a", "b"], empty, empty, np.array([k, 10.0 * k]))
            bag.write(connection, BEGAN, store.serialize_cdr(message, joints.__msgtype__))
    found = named(tmp_path / "bag", {"/joints.header.stamp": "time", "/joints.effort.1": N})
    assert found.time == pytest.approx(np.arange(4) * 2e-3, abs=1e-12)
    assert found[FORCE] == pytest.approx(10.0 * np.arange(4))


def published(path: Path, sources: str) -> Path:
    """One topic, whose messages come by several channels, in this order."""
    with path.open("wb") as stream:
        writer = Writer(stream)
        writer.start()
        schema = writer.register_schema(name="x", encoding="jsonschema", data=b"{}")
        ids = {
            one: writer.register_channel(topic="/f", message_encoding="json", schema_id=schema, metadata={"by": one})
            for one in sorted(set(sources))
        }
        for k, one in enumerate(sources):
            stamp = BEGAN + k * 1_000_000
            data = json.dumps({"v": float(k) if one == "a" else -99.0}).encode()
            writer.add_message(channel_id=ids[one], log_time=stamp, publish_time=stamp, data=data)
        writer.finish()
    return path


def test_publishers_of_one_topic_are_not_mixed(tmp_path: Path) -> None:
    for sources in ("abab", "aaba"):
        with pytest.raises(InputError, match=r"messages of 2 publishers at the same time, got /f"):
            named(published(tmp_path / "a.mcap", sources), {"/f.v": N})
    one_after_the_other = named(published(tmp_path / "b.mcap", "aaabb"), {"/f.v": N})  # a recorder begun anew
    assert one_after_the_other[FORCE] == pytest.approx([0, 1, 2, -99, -99])


def test_counts_of_64_bits_as_text(tmp_path: Path) -> None:
    messages = [("/f", 7 * k, {"at": str(BEGAN + k * 1_000_000 + 1), "v": float(k)}) for k in range(4)]
    found = named(write(tmp_path / "a.mcap", *messages), {"/f.at": "time, unit: ns", "/f.v": N})
    assert found.time == pytest.approx(1e-3 * np.arange(4), abs=1e-12)
    assert "time counts from 2024-05-01T08:00:00.000000001Z" in found.notes


def joints(names: list[str], efforts: list[float]) -> dict[str, Any]:
    return {"name": names, "effort": efforts}


def test_entries_whose_names_change_places_go_by_name(tmp_path: Path) -> None:
    """A joint state says in `name` whose the entries are, and may say it anew in every message."""
    rows = [
        ("/j", k, joints(["hip", "knee"], [k, 900.0]) if k < 3 else joints(["knee", "hip"], [900.0, k]))
        for k in range(6)
    ]
    path = write(tmp_path / "j.mcap", *rows)
    with pytest.raises(
        InputError, match=r"/j.effort.0: its array changes its order, .* 'hip', then of 'knee'; /j.effort.hip"
    ):
        named(path, {"/j.effort.0": N})
    assert named(path, {"/j.effort.hip": N})[FORCE].tolist() == [0.0, 1.0, 2.0, 3.0, 4.0, 5.0]
    kept = write(tmp_path / "k.mcap", *rows[:3])
    assert named(kept, {"/j.effort.0": N})[FORCE].tolist() == [0.0, 1.0, 2.0]
    assert left_out(named(kept, {"/j.effort.hip": N})) == (3, 4)


def test_a_joint_that_is_not_in_every_message_has_gaps_there(tmp_path: Path) -> None:
    rows = [("/j", k, joints(["knee", "hip"], [900.0, k]) if k % 2 else joints(["hip"], [k])) for k in range(6)]
    path = write(tmp_path / "j.mcap", *rows)
    assert named(path, {"/j.effort.hip": N})[FORCE].tolist() == [0.0, 1.0, 2.0, 3.0, 4.0, 5.0]
    assert named(path, {"/j.effort.knee": N})[FORCE].tolist() == [900.0, 900.0, 900.0]
    with pytest.raises(InputError, match=r"'hip', then of 'knee'"):
        named(path, {"/j.effort.0": N})


@pytest.mark.parametrize("frames", ["lrlr", "llrl"])
def test_sensors_of_one_topic_are_not_mixed(tmp_path: Path, frames: str) -> None:
    """Two sensors on one topic, told apart by `header.frame_id` alone."""
    messages = [("/f", k, {"header": {"frame_id": frame}, "v": float(k)}) for k, frame in enumerate(frames)]
    with pytest.raises(InputError, match=r"its topic has messages of 2 frames in turn \('l', 'r'\), got /f"):
        named(write(tmp_path / "a.mcap", *messages), {"/f.v": N})
    renamed = [(topic, at, {**m, "header": {"frame_id": "llrr"[k]}}) for k, (topic, at, m) in enumerate(messages)]
    assert named(write(tmp_path / "b.mcap", *renamed), {"/f.v": N})[FORCE] == pytest.approx([0, 1, 2, 3])


@pytest.mark.parametrize("covariance", [[-1.0, *[0.0] * 8], [-1, 0, 0]])
def test_a_covariance_of_minus_one_means_no_data(tmp_path: Path, covariance: list[float]) -> None:
    def imu(k: int) -> dict[str, Any]:
        turn = {"angular_velocity": {"x": 0.5 * k}, "angular_velocity_covariance": [0.0] * 9}
        return {**turn, "linear_acceleration": {"z": 9.81}, "linear_acceleration_covariance": covariance}

    path = write(tmp_path / "a.mcap", *(("/imu", k, imu(k)) for k in range(4)))
    with pytest.raises(InputError, match=r"not a column of numbers over time: no data, by its covariance of -1"):
        named(path, {"/imu.linear_acceleration.z": N})
    found = named(path, {"/imu.angular_velocity.x": "chassis/angular_velocity_x, unit: rad/s"})
    assert found["chassis/angular_velocity_x"] == pytest.approx([0.0, 0.5, 1.0, 1.5])
    assert any(
        "1 of " in n and "no data, by its covariance of -1: /imu.linear_acceleration.z" in n for n in found.notes
    )

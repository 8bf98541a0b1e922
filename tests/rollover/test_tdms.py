"""TDMS: groups, scales and starts of channels."""

from __future__ import annotations

import shutil
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from rollover.recording.importers import read_recording, tdms
from rollover.system.errors import InputError
from tests.rollover.foreign import CASES, FORCE, SINKAGE, left_out, named, needs, peak

needs("nptdms")
from nptdms import ChannelObject, GroupObject, RootObject, TdmsWriter  # noqa: E402
from nptdms.reader import TdmsReader  # noqa: E402

RAW = np.array([1, 2, 4, 1799], dtype="i2")
START = np.datetime64("2024-05-01T10:00:00", "us")


def write(path: Path, *channels: tuple[str, str, Any, dict[str, Any]], group: dict[str, Any] | None = None) -> Path:
    groups = [GroupObject(g, properties=group or {}) for g in dict.fromkeys(g for g, _, _, _ in channels)]
    objects = [ChannelObject(g, c, values, properties=how) for g, c, values, how in channels]
    with TdmsWriter(str(path)) as file:
        file.write_segment([RootObject(), *groups, *objects])
    return path


def scaled(kind: str, **numbers: Any) -> dict[str, Any]:
    how = {f"NI_Scale[0]_{key}": value for key, value in numbers.items()}
    more = {"NI_Scaling_Status": "unscaled", "wf_increment": 1e-3, "unit_string": "N"}
    return {"NI_Number_Of_Scales": 1, "NI_Scale[0]_Scale_Type": kind, **how, **more}


def wave(**more: Any) -> dict[str, Any]:
    return {"wf_increment": 1e-3, "unit_string": "N", **more}


def test_two_groups_of_one_time_are_refused_or_chosen(tmp_path: Path) -> None:
    path = Path(shutil.copy(CASES / "twogroups.tdms", tmp_path))
    with pytest.raises(InputError, match=r"got 'run1/ground/force_normal' and 'run2/ground/force_normal'; a profile"):
        read_recording(path)
    assert peak(named(path, {"run1/ground/force_normal": FORCE})) == pytest.approx(3598.1, abs=0.1)
    assert peak(named(path, {"run2/ground/force_normal": FORCE})) == pytest.approx(1799.06, abs=0.1)


def test_successive_groups_are_joined_by_shared_name_too(tmp_path: Path) -> None:
    later = wave(wf_start_time=START + np.timedelta64(2, "s"))
    parts = [("b", "F", [5.0, 6.0], later), ("a", "F", [1.0, 2.0, 3.0], wave(wf_start_time=START))]
    found = named(write(tmp_path / "a.tdms", *parts), {"F": FORCE})
    assert found.time == pytest.approx([0.0, 0.001, 0.002, 2.0, 2.001], abs=1e-12)
    assert found[FORCE] == pytest.approx([1, 2, 3, 5, 6])
    assert any(note.startswith("ground/force_normal: joined from a/F") for note in found.notes)


def test_a_scale_that_the_reader_lacks_is_refused_not_left_away(tmp_path: Path) -> None:
    path = Path(shutil.copy(CASES / "piece.tdms", tmp_path))
    refused = r"type that cannot be applied, got PieceWisePolynomial"
    with pytest.raises(InputError, match=rf"column g/ground/force_normal: .*{refused}"):
        read_recording(path)
    with pytest.raises(InputError, match=rf"channels.g/ground/force_normal: .*{refused}"):
        named(path, {"g/ground/force_normal": FORCE})
    assert list(named(path, {"g/ground/sinkage": SINKAGE}).channels) == [SINKAGE]  # the others can still be read


@pytest.mark.parametrize("level", ["channel", "group"])
@pytest.mark.parametrize("kind", ["Reciprocal", "Map Ranges"])
def test_other_unknown_scales(tmp_path: Path, kind: str, level: str) -> None:
    how = scaled(kind)
    path = write(
        tmp_path / "a.tdms",
        ("g", FORCE, RAW, how if level == "channel" else wave()),
        group=how if level == "group" else None,
    )
    with pytest.raises(InputError, match=f"got {kind}"):
        read_recording(path)


def test_scales_that_are_well_defined(tmp_path: Path) -> None:
    linear = scaled("Linear", Linear_Slope=2.0, Linear_Y_Intercept=1.0)
    size = {"Polynomial_Coefficients_Size": 3}
    terms = {f"Polynomial_Coefficients[{k}]": c for k, c in enumerate((1.0, 0.0, 0.5))}
    square = scaled("Polynomial", **size, **terms)
    done = {**linear, "NI_Scaling_Status": "scaled"}
    gone = {**scaled("Reciprocal"), "NI_Scaling_Status": "scaled"}  # of a type that need not be known any more
    channels = [("g", "lin", RAW, linear), ("g", "sq", RAW, square), ("g", "done", RAW, done), ("g", "gone", RAW, gone)]
    path = write(tmp_path / "a.tdms", *channels)
    assert named(path, {"g/lin": FORCE})[FORCE] == pytest.approx(2.0 * RAW + 1.0)
    assert named(path, {"g/sq": FORCE})[FORCE] == pytest.approx(1.0 + 0.5 * RAW.astype(float) ** 2)
    assert named(path, {"g/done": FORCE})[FORCE] == pytest.approx(RAW)
    assert named(path, {"g/gone": FORCE})[FORCE] == pytest.approx(RAW)


def test_an_incomplete_scale_is_its_columns_fault(tmp_path: Path) -> None:
    path = write(tmp_path / "a.tdms", ("g", FORCE, RAW, scaled("Linear")), ("g", SINKAGE, [0.0, 1.0], wave()))
    with pytest.raises(
        InputError, match=r"column g/ground/force_normal: its scale cannot be applied: it lacks 'NI_Scale"
    ):
        read_recording(path)
    assert list(named(path, {"g/ground/sinkage": f"{SINKAGE}, unit: m"}).channels) == [SINKAGE]


def test_channels_that_start_apart_keep_their_distance(tmp_path: Path) -> None:
    found = read_recording(CASES / "starts.tdms")
    assert found.samples(FORCE)[0][0] == 0.0
    assert found.samples(SINKAGE)[0][[0, -1]] == pytest.approx([0.05, 0.399], abs=1e-12)
    assert found.clock.zero == "unknown"
    assert "time counts from 2024-05-01T10:00:00.000000000Z" in found.notes


def test_start_and_offset_add_up_and_a_profile_may_know_the_zero(tmp_path: Path) -> None:
    first = wave(wf_start_time=START, wf_start_offset=-0.5)
    second = wave(wf_start_time=START + np.timedelta64(30_000, "us"), wf_start_offset=0.25, unit_string="m")
    path = write(tmp_path / "a.tdms", ("g", FORCE, [1.0, 2.0], first), ("g", SINKAGE, [1.0, 2.0], second))
    names = {"g/ground/force_normal": FORCE, "g/ground/sinkage": SINKAGE}
    found = named(path, names, "clock: {zero: known}\n")
    assert found.samples(FORCE)[0] == pytest.approx([-0.5, -0.499])
    assert found.samples(SINKAGE)[0] == pytest.approx([0.28, 0.281])
    assert found.clock.zero == "known"


def test_a_start_of_1904_is_none(tmp_path: Path) -> None:
    never = wave(wf_start_time=np.datetime64("1904-01-01T00:00:00", "us"))
    found = read_recording(write(tmp_path / "a.tdms", ("g", FORCE, [1.0, 2.0], never)))
    assert found.clock.zero == "known"
    assert not found.notes


def test_two_starts_beside_a_channel_without_one_are_refused(tmp_path: Path) -> None:
    late = wave(wf_start_time=START + np.timedelta64(1, "s"), unit_string="m")
    bare = wave(unit_string="m")
    parts = [("g", FORCE, [1.0, 2.0], wave(wf_start_time=START)), ("g", SINKAGE, [1.0, 2.0], late)]
    path = write(tmp_path / "a.tdms", *parts, ("g", "rops/deflection", [1.0, 2.0], bare))
    with pytest.raises(InputError, match=r"one states none, got .*'g/rops/deflection'; a profile"):
        read_recording(path)


def test_stamps_as_a_channel_of_their_own(tmp_path: Path) -> None:
    stamps = START + np.array([0, 1000, 2500], dtype="m8[us]")
    path = write(tmp_path / "a.tdms", ("g", "time", stamps, {}), ("g", FORCE, [1.0, 2.0, 3.0], {"unit_string": "N"}))
    found = read_recording(path)
    assert found.time == pytest.approx([0.0, 0.001, 0.0025], abs=1e-9)
    assert found.clock.zero == "unknown"


def test_a_spectrum_is_not_over_time(tmp_path: Path) -> None:
    over = wave(wf_xunit_string="Hz", wf_xname="frequency")
    with pytest.raises(InputError, match="runs over frequency in 'Hz', not over time"):
        read_recording(write(tmp_path / "a.tdms", ("g", FORCE, [1.0, 2.0], over)))


def test_all_that_a_file_holds_is_counted(tmp_path: Path) -> None:
    more = [("g", "text", ["a", "b"], {}), ("g", "void", np.empty(0), {}), ("h", "spare", [1.0, 2.0], wave())]
    found = read_recording(write(tmp_path / "a.tdms", ("g", FORCE, [1.0, 2.0], wave()), *more))
    assert left_out(found) == (3, 4)
    said = " ".join(found.notes)
    assert "text: g/text" in said
    assert "empty: g/void" in said
    assert "without a description: h/spare" in said


def appended(path: Path, *pieces: tuple[Any, dict[str, Any]]) -> Path:
    """One channel, written piece by piece, each with properties of its own."""
    with TdmsWriter(str(path)) as file:
        for values, how in pieces:
            file.write_segment([ChannelObject("g", FORCE, values, properties=how)])
    return path


def started(seconds: float) -> dict[str, Any]:
    return wave(wf_start_time=START + np.timedelta64(round(seconds * 1e6), "us"))


def test_pieces_keep_their_own_starts(tmp_path: Path) -> None:
    found = read_recording(appended(tmp_path / "a.tdms", (RAW, started(0.0)), (RAW, started(10.0))))
    assert found.time == pytest.approx([0.0, 0.001, 0.002, 0.003, 10.0, 10.001, 10.002, 10.003], abs=1e-12)
    assert "time counts from 2024-05-01T10:00:00.000000000Z" in found.notes
    assert f"g/{FORCE}: 2 pieces by their wf_start_time, at 0, 10 s" in found.notes
    again = read_recording(appended(tmp_path / "b.tdms", (RAW, started(0.0)), (RAW, started(0.0))))
    assert again.time == pytest.approx(1e-3 * np.arange(8))  # repeated, not started anew
    late = read_recording(appended(tmp_path / "c.tdms", (RAW, started(0.0)), (RAW, started(0.0043))))
    assert late.time == pytest.approx(1e-3 * np.arange(8))  # a clock that is asked again, within a sample
    with pytest.raises(InputError, match="its 2 pieces overlap in time by their wf_start_time"):
        read_recording(appended(tmp_path / "d.tdms", (RAW, started(10.0)), (RAW, started(0.0))))


@pytest.mark.parametrize(
    ("key", "first", "second"),
    [
        ("wf_increment", wave(), wave(wf_increment=2e-3)),
        ("unit_string", wave(), wave(unit_string="kN")),
        (
            r"NI_Scale\[0\]_Linear_Slope",
            scaled("Linear", Linear_Slope=2.0, Linear_Y_Intercept=0.0, Linear_Input_Source=0xFFFFFFFF),
            scaled("Linear", Linear_Slope=4.0, Linear_Y_Intercept=0.0, Linear_Input_Source=0xFFFFFFFF),
        ),
    ],
)
def test_what_changes_from_piece_to_piece_is_refused(tmp_path: Path, key: str, first: Any, second: Any) -> None:
    with pytest.raises(InputError, match=rf"{key} changes within the file, got"):
        read_recording(appended(tmp_path / "a.tdms", (RAW, first), (RAW, second)))


def test_properties_that_look_like_a_scale_or_a_unit(tmp_path: Path) -> None:
    path = write(tmp_path / "a.tdms", ("g", FORCE, RAW, wave(Gain=0.5)))
    with pytest.raises(InputError, match=r"whole numbers beside Gain 0.5, which TDMS does not define"):
        read_recording(path)
    assert peak(named(path, {f"g/{FORCE}": f"{FORCE}, scale: 0.5"})) == 899.5
    real = read_recording(write(tmp_path / "b.tdms", ("g", FORCE, RAW.astype("f8"), wave(Gain=0.5))))
    assert peak(real) == 1799.0
    assert any("Gain 0.5 stands beside its numbers, and is not applied" in note for note in real.notes)
    other = {"wf_increment": 1e-3, "NI_UnitDescription": "kN"}
    assert peak(read_recording(write(tmp_path / "c.tdms", ("g", FORCE, RAW, other)))) == 1.799e6


@pytest.mark.parametrize("whose", ["group", "file"])
def test_a_scale_above_the_channel_is_one_too(tmp_path: Path, whose: str) -> None:
    def made(raw: Any, how: dict[str, Any]) -> Path:
        group, root = (how if whose == of else {} for of in ("group", "file"))
        objects = [RootObject(root), GroupObject("g", group), ChannelObject("g", FORCE, raw, properties=wave())]
        with TdmsWriter(str(tmp_path / "a.tdms")) as file:
            file.write_segment(objects)
        return tmp_path / "a.tdms"

    above = "of its group" if whose == "group" else "of the file"
    with pytest.raises(InputError, match=f"whole numbers beside gain 2 {above}, which TDMS does not define"):
        read_recording(made(RAW, {"gain": 2.0}))
    real = read_recording(made(RAW.astype("f8"), {"gain": 2.0}))
    assert peak(real) == 1799.0
    assert any(f"gain 2 {above} stands beside its numbers" in note for note in real.notes)
    assert peak(read_recording(made(RAW, {"serial_number": 2.0}))) == 1799.0


@pytest.mark.parametrize("key", ["NoValue", "novalue", "missing_value", "_FillValue"])
@pytest.mark.parametrize("mark", [-9999, -1e36])
def test_a_mark_of_gaps_marks_gaps(tmp_path: Path, key: str, mark: float) -> None:
    values = np.array([1.0, 2.0, mark, 1799.0])
    found = read_recording(write(tmp_path / "a.tdms", ("g", FORCE, values, wave(**{key: float(mark)}))))
    assert found[FORCE] == pytest.approx([1.0, 2.0, np.nan, 1799.0], nan_ok=True)
    assert any("1 of 4 values are gaps" in note for note in found.notes)


def test_what_a_file_says_of_itself_is_read_once(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    path = appended(tmp_path / "a.tdms", (RAW, started(0.0)), (RAW, started(10.0)))
    read, metadata = [], TdmsReader.read_metadata

    def counted(self: Any, *args: Any, **more: Any) -> Any:
        read.append(self)
        return metadata(self, *args, **more)

    monkeypatch.setattr(TdmsReader, "read_metadata", counted)
    (signal,) = tdms._signals(path, None).values()
    assert len(read) == 1
    assert signal.notes == ("2 pieces by their wf_start_time, at 0, 10 s",)

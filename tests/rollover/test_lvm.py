"""LabVIEW measurement files: times to the last digit of Delta_X, segments, several clocks, and what is left out."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from rollover.recording import Recording
from rollover.recording.importers import read_recording
from rollover.system.errors import InputError

STEP = 1.953125e-5
FORCE, SINKAGE, X = "ground/force_normal", "ground/sinkage", "chassis/acceleration_x"


def head(mark: str = "\t", decimal: str = ".", columns: str = "One", multi: str = "No") -> str:
    rows = [
        ("LabVIEW Measurement", ""),
        ("Writer_Version", "2"),
        ("Separator", "Comma" if mark == "," else "Tab"),
        ("Decimal_Separator", decimal),
        ("Multi_Headings", multi),
        ("X_Columns", columns),
        ("Time_Pref", "Relative"),
        ("Date", "2023/05/05"),
        ("Time", "13:39:50.5"),
        ("***End_of_Header***", ""),
    ]
    return "".join(f"{key}{mark}{value}\n" for key, value in rows) + mark + "\n"


def segment(
    mark: str,
    names: list[str],
    rows: list[list[str]],
    *,
    samples: list[object],
    delta: list[object],
    start: list[object] | None = None,
    time: list[str] | None = None,
    unit: list[str] | None = None,
) -> str:
    n = len(samples)
    tags = [
        ["Channels", str(n)],
        ["Samples", *map(str, samples)],
        ["Date", *["2023/05/05"] * n],
        ["Time", *(time or ["13:39:50.5"] * n)],
        ["Y_Unit_Label", *(unit or ["N"] * n)],
        ["X_Dimension", *["Time"] * n],
        ["X0", *map(str, start or ["0.0000000000000000E+0"] * n)],
        ["Delta_X", *map(str, delta)],
        ["***End_of_Header***"],
        [*names, "Comment"],
    ]
    return "".join(mark.join(cells) + "\n" for cells in [*tags, *rows])


def read(folder: Path, text: str, profile: str = "") -> Recording:
    (folder / "a.lvm").write_text(text)
    if not profile:
        return read_recording(folder / "a.lvm")
    (folder / "p.yaml").write_text(f"format: rollover-profile/1\n{profile}")
    return read_recording(folder / "a.lvm", profile=folder / "p.yaml")


def even(mark: str = "\t", decimal: str = ".") -> str:
    """A force at 51.2 kHz; the printed times have six decimals and two of them are the same to 2 %."""
    rows = [[f"{STEP * i:.6f}", f"{i + 0.5:.6f}"] for i in range(100)]
    rows = [[cell.replace(".", decimal) for cell in row] for row in rows]
    return head(mark, decimal) + segment(
        mark, ["X_Value", FORCE], rows, samples=[100], delta=[str(STEP).replace(".", decimal)]
    )


@pytest.mark.parametrize(("mark", "decimal"), [("\t", "."), ("\t", ","), (",", ".")])
def test_names_that_are_channels_need_no_profile(tmp_path: Path, mark: str, decimal: str) -> None:
    found = read(tmp_path, even(mark, decimal))
    assert found.time == pytest.approx(STEP * np.arange(100), abs=1e-15)  # not 0.000020, 0.000039
    assert found[FORCE].tolist() == [i + 0.5 for i in range(100)]
    assert found.notes == (
        "1 of 2 columns left out, empty: Comment",
        "zero of time is the stamp of the first channel, 2023-05-05T13:39:50.5 (local time as it stands)",
    )


def test_printed_times_that_are_not_on_the_grid_are_taken(tmp_path: Path) -> None:
    times = [0.0, 0.0101, 0.0199, 0.032]
    rows = [[f"{t:.6f}", "1.0"] for t in times]
    found = read(tmp_path, head() + segment("\t", ["X_Value", FORCE], rows, samples=[4], delta=[0.01]))
    assert found.time == pytest.approx(times, abs=1e-12)


CHANNELS = f"channels:\n  Volt: {{channel: {FORCE}, unit: kN}}\n  Slow: {{channel: {SINKAGE}, unit: mm}}\n"


def test_channels_of_other_clocks_keep_theirs(tmp_path: Path) -> None:
    rows = [[f"{1e-3 * i:.6f}", str(i), *([str(10 * i)] if i < 3 else [""])] for i in range(6)]
    text = head() + segment(
        "\t",
        ["X_Value", "Volt", "Slow"],
        rows,
        samples=[6, 3],
        delta=[1e-3, 2e-3],
        time=["13:39:50.5", "13:39:50.5005"],
        unit=["V", "mm"],
    )
    found = read(tmp_path, text, CHANNELS)
    assert found.samples(FORCE)[0] == pytest.approx(1e-3 * np.arange(6))
    assert found.samples(FORCE)[1].tolist() == [1000.0 * i for i in range(6)]
    assert found.samples(SINKAGE)[0] == pytest.approx([0.0005, 0.0025, 0.0045])
    assert found.samples(SINKAGE)[1] == pytest.approx([0.0, 0.01, 0.02])


def test_two_columns_of_x(tmp_path: Path) -> None:
    rows = [["0.5", "1", "7.0", "10", ""], ["0.6", "2", "7.2", "20", "blow"]]
    text = head(columns="Multi") + segment(
        "\t",
        ["X_Value", "Volt", "X_Value", "Slow"],
        rows,
        samples=[2, "", 2],
        delta=[0.1, "", 0.2],
        start=[0.5, "", 7.0],
        time=["13:39:50.5", "", "13:39:50.5"],
    )
    found = read(tmp_path, text, CHANNELS.replace("kN", "N"))
    assert found.samples(FORCE)[0] == pytest.approx([0.5, 0.6])
    assert found.samples(SINKAGE)[0] == pytest.approx([7.0, 7.2])
    assert "1 of 3 columns left out, text: Comment" in found.notes


def test_without_a_column_of_x(tmp_path: Path) -> None:
    rows = [["", "1"], ["", "2"], ["", "3"]]
    text = head(columns="No") + segment("\t", ["X_Value", FORCE], rows, samples=[3], delta=[0.1], start=[0.2])
    assert read(tmp_path, text).time == pytest.approx([0.2, 0.3, 0.4])


def segments(later: str) -> str:
    first = segment("\t", ["X_Value", "Volt"], [["0.0", "1"], ["0.1", "2"]], samples=[2], delta=[0.1])
    second = segment("\t", ["X_Value", "Volt"], [["0.0", "3"], ["0.1", "4"]], samples=[2], delta=[0.1], time=[later])
    return head(multi="Yes") + first + "\n" + second


def test_segments_are_joined_by_their_stamps(tmp_path: Path) -> None:
    found = read(tmp_path, segments("13:39:52.0"), f"channels:\n  Volt: {{channel: {FORCE}, unit: N}}\n")
    assert found.time == pytest.approx([0.0, 0.1, 1.5, 1.6])
    assert found[FORCE].tolist() == [1.0, 2.0, 3.0, 4.0]
    assert f"{FORCE}: joined from 1/Volt (0 to 0.1 s), 2/Volt (1.5 to 1.6 s)" in found.notes


def test_segments_of_one_time_are_refused_or_chosen(tmp_path: Path) -> None:
    with pytest.raises(InputError, match=r"got '1/Volt' and '2/Volt'; a profile chooses one"):
        read(tmp_path, segments("13:39:50.5"), f"channels:\n  Volt: {{channel: {FORCE}, unit: N}}\n")
    chosen = read(tmp_path, segments("13:39:50.5"), f"channels:\n  2/Volt: {{channel: {FORCE}, unit: N}}\n")
    assert chosen[FORCE].tolist() == [3.0, 4.0]
    assert "1 of 4 columns left out, without a description: 1/Volt" in chosen.notes


def test_packets_appended_under_one_header(tmp_path: Path) -> None:
    # a loop that writes one sample a time: Samples and Delta_X are those of the first packet
    rows = [["0.0", "1"], ["0.26", "2"], ["0.51", "3"]]
    found = read(tmp_path, head() + segment("\t", ["X_Value", FORCE], rows, samples=[1], delta=["1.000000"]))
    assert found.time == pytest.approx([0.0, 0.26, 0.51])
    bare = head(columns="No") + segment(
        "\t", ["X_Value", FORCE], [["", "1"], ["", "2"]], samples=[1], delta=["1.000000"]
    )
    with pytest.raises(InputError, match="no time, got no column of channel time; or `rate` in Hz"):
        read(tmp_path, bare)
    by_rate = read(tmp_path, bare, f"rate: 4\nchannels:\n  {FORCE}: {{channel: {FORCE}}}\n")
    assert by_rate.time.tolist() == [0.0, 0.25]


def test_a_profile_may_say_what_x_is(tmp_path: Path) -> None:
    profile = f"channels:\n  X_Value: {{channel: time, unit: s, offset: -0.05}}\n  {FORCE}: {{channel: {FORCE}}}\n"
    assert read(tmp_path, even(), profile).time == pytest.approx(STEP * np.arange(100) - 0.05, abs=1e-15)


def test_a_special_block_is_passed_over_and_said(tmp_path: Path) -> None:
    special = "***Start_Special***\nWafer\t7\n0.5\t1\n***End_Special***\n"
    found = read(tmp_path, even().replace("Channels", special + "Channels", 1))
    assert found[FORCE].size == 100
    assert "1 special blocks left out" in found.notes


@pytest.mark.parametrize(
    ("old", "new", "said"),
    [
        ("5.500000", "5,500000", r"a.lvm:\d+: column ground/force_normal: not a number, got '5,500000'"),
        ("Samples\t100", "Samples\t101", "Samples: says 101, got 100; a whole file is needed"),
        ("***End_of_Header***", "", "a header without"),
        (
            "ground/force_normal",
            "Volt",
            r"no column is a channel, got X_Value, Volt, Comment \(empty\); --profile FILE",
        ),
        ("X_Value", "time", "a row of names is needed after the header"),
    ],
)
def test_refused(tmp_path: Path, old: str, new: str, said: str) -> None:
    with pytest.raises(InputError, match=said) as caught:
        read(tmp_path, even().replace(old, new))
    assert len(caught.value.faults) == 1


def test_a_missing_channel_is_refused_with_those_there(tmp_path: Path) -> None:
    with pytest.raises(InputError, match=r"channels.G: no such column in a.lvm, got 'G'; the file holds: X_Value"):
        read(tmp_path, even(), f"channels:\n  G: {{channel: {FORCE}, unit: N}}\n")
    with pytest.raises(InputError, match=r"channels.Comment: not a column of numbers over time: empty"):
        read(tmp_path, even(), f"channels:\n  Comment: {{channel: {FORCE}, unit: N}}\n")

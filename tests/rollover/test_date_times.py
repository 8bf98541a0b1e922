"""Date-times and stamps in several columns: what loggers write, to the nanosecond, and what is refused."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from rollover.recording import Recording
from rollover.recording.importers import read_recording
from rollover.recording.importers.date_times import NotAStampError, instant, is_moment, moment, spelt
from rollover.recording.importers.stamps import since
from rollover.system.errors import InputError

HOUR = 3_600 * 10**9


def read(folder: Path, text: str, time: str, *, more: str = "", name: str = "a.csv") -> Recording:
    """Recording of a file with columns of time and a force F."""
    (folder / name).write_text(text)
    (folder / "p.yaml").write_text(
        f"format: rollover-profile/1\n{more}channels:\n  {time}\n  F: {{channel: rops/force, unit: N}}\n"
    )
    return read_recording(folder / name, profile=folder / "p.yaml")


STAMP = "t: {channel: time, unit: date-time}"


@pytest.mark.parametrize(
    "text",
    [
        "2020-11-11 13:25:02.005",
        "2020-11-11T13:25:02.005",
        "2020/11/11 13:25:02.005",
        "2020/11/11 13:25:02,005000000",
        "11.11.2020 13:25:02,005",
        "11-Nov-2020 13:25:02.005",
        "11 nov 2020 01:25:02.005 PM",
        "20201111T132502.005",
        "2020-11-11 13:25:02:005",
        "2020-11-11_13:25:02.005",
    ],
)
def test_forms_of_one_moment(text: str) -> None:
    assert moment(text).ns == moment("2020-11-11 13:25:02.005").ns
    assert spelt(moment(text)) == "2020-11-11T13:25:02.005 (local time as it stands)"
    assert is_moment(text)


def test_zones_are_one_moment() -> None:
    utc = moment("2020-11-11T13:25:02.005Z")
    for text in ("2020-11-11T14:25:02.005+01:00", "2020-11-11 08:55:02.005-0430", "2020-11-11T13:25:02.005 +00"):
        assert moment(text) == utc
    assert spelt(utc) == "2020-11-11T13:25:02.005Z"
    assert moment("2021-01-01T00:30+01:00").ns == moment("2020-12-31T23:30Z").ns


@pytest.mark.parametrize(
    "text",
    [
        *("11/12/2020 13:25:02", "2020-13-11 13:25:02", "2021-02-29 00:00:00", "2020-11-11", "24:00:00", "13:25:60"),
        *("13:61", "0:25 PM", "13:25:02.005 sometime", "1.5", "", "tomorrow", "11-Abc-2020 1:02"),
    ],
)
def test_what_is_no_moment_or_not_clear(text: str) -> None:
    with pytest.raises(NotAStampError):
        moment(text)


@pytest.mark.parametrize("number", ["0", "1.5", "-2e-3", "132502", "132502.005", "20201111", "1605101102.005", "nan"])
def test_a_number_is_no_moment(number: str) -> None:
    assert not is_moment(number)


@given(st.datetimes(), st.integers(0, 10**9 - 1))
def test_every_moment_is_spelt_as_it_is_read(when: object, ns: int) -> None:
    text = f"{str(when)[:19]}.{ns:09}"
    assert spelt(moment(text)).split(" ")[0] == text.replace(" ", "T").rstrip("0").rstrip(".")


def test_date_times_become_seconds_since_the_first(tmp_path: Path) -> None:
    found = read(tmp_path, "t,F\n2020-11-11 23:59:59.998,1\n2020-11-12 00:00:00.0005,2\n2020-11-13 0:00:00,3\n", STAMP)
    assert found.time.tolist() == [0.0, 0.0025, 86400.002]
    assert found.clock.zero == "unknown"
    assert found.notes == ("time of t: zero is the first stamp, 2020-11-11T23:59:59.998 (local time as it stands)",)


def test_the_clock_of_the_profile_stands(tmp_path: Path) -> None:
    text = "t,F\n2020-11-11 13:25:02,1\n2020-11-11 13:25:03,2\n"
    assert read(tmp_path, text, STAMP, more="clock: {zero: known}\n").clock.zero == "known"
    moved = read(tmp_path, text, "t: {channel: time, unit: date-time, offset: -0.5}")
    assert moved.time.tolist() == [-0.5, 0.5]


def test_date_times_where_the_profile_said_seconds(tmp_path: Path) -> None:
    # as WitMotion writes it: a first column that is empty
    rows = "".join(f"\t2020-11-11 13:25:{2 + 0.005 * i:06.3f}\t{i}\n" for i in range(200))
    found = read(
        tmp_path,
        "address\tChipTime\tF\n" + rows,
        "ChipTime: {channel: time, unit: s}",
        more='csv: {delimiter: "\\t"}\n',
        name="wit.txt",
    )
    assert found.time == pytest.approx(0.005 * np.arange(200), abs=1e-12)
    assert found["rops/force"].tolist() == list(range(200))
    assert found.clock.zero == "unknown"
    assert any("2020-11-11T13:25:02" in note for note in found.notes)
    assert "1 of 3 columns left out, without a description: address" in found.notes


def test_times_of_day_run_over_midnight(tmp_path: Path) -> None:
    found = read(tmp_path, "t,F\n23:59:59.5,1\n00:00:00.25,2\n12:00:00,3\n23:00:00,4\n00:30:00,5\n", STAMP)
    assert found.time.tolist() == [0.0, 0.75, 43200.5, 82800.5, 88200.5]
    assert "23:59:59.5 (a time of day)" in found.notes[0]


def test_date_and_time_in_two_columns(tmp_path: Path) -> None:
    text = "Date,Time,F\n11.11.2020,23:59:59.000000001,1\n12.11.2020,00:00:00,2\n"
    found = read(tmp_path, text, "Date: {channel: time, unit: date-time, rest: [Time]}")
    assert found.time.tolist() == [0.0, 0.999999999]
    assert found.notes == (
        "time of Date and Time: zero is the first stamp, 2020-11-11T23:59:59.000000001 (local time as it stands)",
    )


def test_date_time_and_milliseconds_in_three_columns(tmp_path: Path) -> None:
    text = "D,T,ms,F\n2020-11-11,13:25:02,998,1\n2020-11-11,13:25:03,3,2\n"
    found = read(tmp_path, text, "D: {channel: time, unit: date-time, rest: [T, ms], rest_unit: ms}")
    assert found.time.tolist() == [0.0, 0.005]


@pytest.mark.parametrize(("unit", "fractions"), [("ns", ("999999999", "1")), ("us", ("999999.999", "0.001"))])
def test_seconds_and_fraction_since_1970_keep_every_nanosecond(
    tmp_path: Path, unit: str, fractions: tuple[str, str]
) -> None:
    text = f"s,f,F\n1605101102,{fractions[0]},1\n1605101103,{fractions[1]},2\n"
    found = read(tmp_path, text, f"s: {{channel: time, unit: s, rest: [f], rest_unit: {unit}}}")
    assert found.time.tolist() == [0.0, 2e-9]  # float64 of 1.6e9 s knows steps of 240 ns
    assert found.clock.zero == "unknown"
    assert "1605101102.999999999 s" in found.notes[0]


def test_seconds_and_fraction_of_a_short_time_keep_their_zero(tmp_path: Path) -> None:
    text = "s,f,F\n-1,500,1\n0,0,2\n2,250,3\n"
    found = read(tmp_path, text, "s: {channel: time, unit: s, rest: [f], rest_unit: ms}")
    assert found.time.tolist() == [-0.5, 0.0, 2.25]
    assert (found.clock.zero, found.notes) == ("known", ())


@pytest.mark.parametrize(
    ("text", "time", "said"),
    [
        ("t,F\n13:25:02,1\n13:25:02,2\n", STAMP, r"a.csv:3: time: repeated stamp, got '13:25:02' .*`rate` in Hz"),
        ("t,F\n13:25:02,1\n13:25:01,2\n", STAMP, r"a.csv:3: time: runs backwards, got '13:25:01' after '13:25:02'"),
        ("t,F\n2020-11-11 13:25:02,1\n13:25:03,2\n", STAMP, r"a.csv:3: .*of another form than the first"),
        ("t,F\n2020-11-11T13:25:02Z,1\n2020-11-11T13:25:03,2\n", STAMP, r"a.csv:3: .*of another form"),
        ("t,F\n2020-11-11 13:25:02,1\n,2\n", STAMP, r"a.csv:3: .*empty; every row needs a stamp"),
        ("t,F\n11/12/2020 13:25:02,1\n", STAMP, r"a.csv:2: .*which is the day and which the month"),
        ("t,F\n1605101102.5,1\n", STAMP, r"a.csv:2: .*not a date-time, got '1605101102.5'; such as 2020-11-11"),
        ("t,F\n0.0,1\n13:25:02,2\n", "t: {channel: time, unit: s}", r"a.csv:3: column t: not a number, got '13:25:02'"),
        (
            "s,f,F\n1,1000,1\n",
            "s: {channel: time, unit: s, rest: [f], rest_unit: ms}",
            r"a.csv:2: .*not a fraction of a second, got '1000' ms",
        ),
        ("s,f,F\n1.5,0,1\n", "s: {channel: time, unit: s, rest: [f], rest_unit: ms}", r"a.csv:2: .*not whole seconds"),
        (
            "t,F\n13:25:02,1\n",
            "t: {channel: time, unit: date-time, rest: [d]}",
            r"rest: no such column in a.csv, got 'd'",
        ),
        ("t,F\n0,1\n", "t: {channel: time, unit: ms, rest: [F]}", r"unit: not of a stamp in several columns, got 'ms'"),
        ("t,F\n0,1\n", "t: {channel: time, unit: s, rest: [F]}", r"rest_unit: missing"),
        ("t,F\n0,1\n", "t: {channel: rops/energy, unit: date-time}", r"unit: of channel time alone"),
        ("t,F\n0,1\n", "t: {channel: time, unit: s, rest_unit: ms}", r"rest_unit: without rest"),
    ],
)
def test_refused_with_the_line(tmp_path: Path, text: str, time: str, said: str) -> None:
    with pytest.raises(InputError, match=said) as caught:
        read(tmp_path, text, time)
    assert len(caught.value.faults) == 1


def test_stamps_are_for_text_files_by_a_profile(tmp_path: Path) -> None:
    (tmp_path / "a.csv").write_text("t,F\n13:25:02,1\n13:25:03,1\n")
    (tmp_path / "a.yaml").write_text(
        f"format: rollover-recording/1\nchannels:\n  {STAMP}\n  F: {{channel: rops/force, unit: N}}\n"
    )
    with pytest.raises(InputError, match=r"a.yaml:3: channels.t: unit: date-times .* with a profile"):
        read_recording(tmp_path / "a.csv")


@pytest.mark.parametrize(
    ("text", "seconds"),
    [
        ("2024-05-01", 1714521600.0),
        ("2024-5-1 10:0", 1714557600.0),
        ("2024-05-01 10:00 +2", 1714550400.0),
        ("2024-05-01 10:00:00 -4:30", 1714573800.0),
        ("2024-05-01 +02:00", 1714514400.0),
        ("1970-1-1 0:0:0 UTC", 0.0),
        ("1969-12-31T23:59:59,25", -0.75),
        ("2024-05-01t10:00:00.5z", 1714557600.5),
        ("2024-05-01 10:00 utc", 1714557600.0),
        ("01.05.2024 10:00:00.5", 1714557600.5),
    ],
)
def test_dates_of_cf_units_are_read_by_the_same_rules(text: str, seconds: float) -> None:
    assert instant(text) == round(seconds * 10**9)
    assert since(f"ms since {text}") == (10**6, instant(text))


@pytest.mark.parametrize(
    "text", ["10:00", "x", "2024-13-01", "2024-02-30", "2024-05-01 25:00", "2024-05-01 10:00:75", ""]
)
def test_what_is_no_date_of_a_cf_unit(text: str) -> None:
    with pytest.raises(NotAStampError, match=r"not a (date|time of day), got"):
        instant(text)


@pytest.mark.parametrize(
    ("text", "whole"),
    [
        ("11.11.20 13:25:02,005", "2020-11-11 13:25:02.005"),
        ("01-May-24 10:00:00", "2024-05-01 10:00:00"),
        ("31.12.99 23:59:59", "1999-12-31 23:59:59"),
        ("1.2.68 00:00:00", "2068-02-01 00:00:00"),
    ],
)
def test_years_of_two_digits_where_the_day_is_clear(text: str, whole: str) -> None:
    assert moment(text).ns == moment(whole).ns


@pytest.mark.parametrize("text", ["24-05-01 10:00:00", "05/01/24 10:00:00", "05-01-24 10:00:00", "1/5/2024 10:00:00"])
def test_dates_that_may_be_read_two_ways_are_refused(text: str) -> None:
    with pytest.raises(NotAStampError, match="not clear which is the day and which the month or year"):
        moment(text)

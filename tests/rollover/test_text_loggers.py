"""Text tables as loggers write them: without names, of uneven rows, of any ending; all that they hold is told."""

from __future__ import annotations

import math
import re
import time
import weakref
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from rollover.recording import Recording
from rollover.recording.importers import read_recording
from rollover.recording.tables import read_csv
from rollover.recording.text_rows import Dialect, Numbers
from rollover.system.errors import InputError

G = 9.80665
X, FORCE = "chassis/acceleration_x", "rops/force"
ROWS = [(1e-4 * i - 0.05, math.sin(i / 20)) for i in range(600)]
TABBED = "".join(f"{t:.6f}\t{a:.6f}\n" for t, a in ROWS)
TIME_AND_X = '  "1": {channel: time, unit: s}\n  "2": {channel: chassis/acceleration_x, unit: g}\n'


def read(folder: Path, name: str, text: str | bytes, channels: str, csv: str = "", more: str = "") -> Recording:
    (folder / name).write_bytes(text.encode() if isinstance(text, str) else text)
    how = f"csv: {{{csv}}}\n" if csv else ""
    (folder / "p.yaml").write_text(f"format: rollover-profile/1\n{how}{more}channels:\n{channels}")
    return read_recording(folder / name, profile=folder / "p.yaml")


def left_out(recording: Recording) -> set[str]:
    """Names of all that the notes say was not read; their number is that which the notes give."""
    names: set[str] = set()
    for note in recording.notes:
        if match := re.match(r"(\d+) of \d+ columns left out, [^:]*: (.*)", note):
            assert int(match[1]) == len(match[2].split(", "))
            names |= set(match[2].split(", "))
    return names


@pytest.mark.parametrize("name", ["v00001.001", "v.txt", "shot.lvm", "noending", "a.b.c"])
@pytest.mark.parametrize("csv", ['delimiter: "\\t"', 'delimiter: "\\t", names_row: 0', "delimiter: whitespace"])
def test_a_file_without_names_and_with_any_ending(tmp_path: Path, name: str, csv: str) -> None:
    found = read(tmp_path, name, TABBED, TIME_AND_X, csv)
    assert found.time.size == 600  # the first row is one of numbers
    assert found.time == pytest.approx([t for t, _ in ROWS], abs=1e-9)
    assert found[X] == pytest.approx([G * round(a, 6) for _, a in ROWS], rel=1e-12)
    said = ("the first row holds numbers and no names: columns are 1, 2, ...",)
    assert found.notes == (() if "names_row" in csv else said)


def test_numeric_names_are_names_where_the_profile_has_them(tmp_path: Path) -> None:
    # channels 0 and 7 of a logger: the first row is no sample
    channels = '  "0": {channel: time, unit: s}\n  "7": {channel: rops/force, unit: N}\n'
    assert read(tmp_path, "a.csv", "0,7\n1,5\n2,6\n", channels)[FORCE].tolist() == [5.0, 6.0]
    one = '  "1": {channel: time, unit: s}\n  "2": {channel: rops/force, unit: N}\n'
    assert read(tmp_path, "a.csv", "1,2\n3,5\n4,6\n", one)[FORCE].tolist() == [5.0, 6.0]
    assert read(tmp_path, "a.csv", "1,2\n3,5\n4,6\n", one, "names_row: 0")[FORCE].tolist() == [2.0, 5.0, 6.0]


def test_rows_of_numbers_below_rows_that_are_none(tmp_path: Path) -> None:
    text = "Logger 7\nserial;12\n0,0;1,5\n0,1;2,5\n"
    found = read(tmp_path, "a.dat", text, TIME_AND_X, "delimiter: ';', decimal: ',', names_row: 0, data_row: 3")
    assert found.time.tolist() == [0.0, 0.1]
    assert found[X] == pytest.approx([1.5 * G, 2.5 * G])


@pytest.mark.parametrize("tail", ["", ",", ",,,", ", , "])
@pytest.mark.parametrize("head", ["", ",,,", ","])
def test_delimiters_at_the_end_of_lines_are_no_columns(tmp_path: Path, head: str, tail: str) -> None:
    text = f"X_Value,Acc_0,Acc_1{head}\n" + "".join(f"{t:.6f},{a:.6f},{2 * a:.6f}{tail}\n" for t, a in ROWS)
    channels = "  X_Value: {channel: time, unit: s}\n  Acc_0: {channel: chassis/acceleration_x, unit: m/s2}\n"
    found = read(tmp_path, "lv.csv", text, channels)
    assert found[X] == pytest.approx([a for _, a in ROWS], abs=1e-6)
    assert left_out(found) == {"Acc_1"}


def test_rows_may_end_after_the_last_column_that_is_read(tmp_path: Path) -> None:
    text = "t,F,remark,who\n0,1,start,me\n1,2\n2,,\n3,4,,\n"
    channels = "  t: {channel: time, unit: s}\n  F: {channel: rops/force, unit: N}\n"
    found = read(tmp_path, "a.csv", text, channels)
    assert found[FORCE] == pytest.approx([1, 2, np.nan, 4], nan_ok=True)
    assert left_out(found) == {"remark", "who"}


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("t,F\n0,1\n1\n", r"a.csv:3: got 1 cells; 2 are needed"),  # cut off
        ("t,F\n0,1\n1,2,3\n", r"a.csv:3: got 3 cells; 2 are needed"),  # a decimal comma
        ("t,F,\n0,1,2\n", r"a.csv:2: got 3 cells; 2 are needed"),
        ("t,F\n0,1,\n1,x,\n", r"a.csv:3: column F: not a number, got 'x'"),
        ("t,F\n0,1\n0,2\n", r"a.csv:3: time: repeated stamp, .*`rate` in Hz in a profile, and no column of time"),
        ("t,G,H\n0,1,2\n", r"p.yaml:4: channels.F: no such column in a.csv, got 'F'; the file holds: t, G, H"),
        ("t,f\n0,1\n", r"no such column in a.csv, got 'F'; did you mean 'f'\? the file holds: t, f"),
        ("0,1\n1,2\n", r"channels.t: no such column in a.csv, got 't'; the file holds: 1, 2"),
        ("t,F,F\n0,1,2\n", r"channels.F: column given twice, got 'F'; one of 'F \(column 2\)', 'F \(column 3\)'"),
        (",,\n0,1\n", r"no such column"),
        ("Bench 7\nt,F\n0,1\n", r"the file holds: Bench 7; where other rows stand above, csv.names_row says which"),
        ("t,F\n", r"empty"),
    ],
)
def test_refused_with_line_and_cure(tmp_path: Path, text: str, said: str) -> None:
    channels = "  t: {channel: time, unit: s}\n  F: {channel: rops/force, unit: N}\n"
    with pytest.raises(InputError, match=said) as caught:
        read(tmp_path, "a.csv", text, channels)
    assert len(caught.value.faults) == 1


def test_of_columns_with_one_name_the_profile_chooses_by_place(tmp_path: Path) -> None:
    text = "t,F,F,,kept\n0,1,2,3,4\n1,5,6,7,8\n"
    channels = '  t: {channel: time, unit: s}\n  "F (column 3)": {channel: rops/force, unit: N}\n'
    found = read(tmp_path, "a.csv", text, channels)
    assert found[FORCE].tolist() == [2.0, 6.0]
    assert left_out(found) == {"F (column 2)", "no name (column 4)", "kept"}


def test_blanks_in_any_number_part_columns(tmp_path: Path) -> None:
    text = "# time(s), \t \t acceleration(g)\n 0.000e+00   6.25e+00\n 2.0e-05\t 6.5e+00  \n\n"
    found = read(tmp_path, "acc.txt", text, TIME_AND_X, "delimiter: whitespace")
    assert found.time.tolist() == [0.0, 2e-5]
    assert found[X] == pytest.approx([6.25 * G, 6.5 * G])
    with pytest.raises(InputError, match=r"acc.txt:3: got 1 cells; 2 are needed"):
        read(tmp_path, "acc.txt", "0 1\n1 2\n2\n", TIME_AND_X, "delimiter: whitespace")


def test_the_unit_in_a_name_serves_where_the_profile_has_none(tmp_path: Path) -> None:
    channels = '  "t [ms]": {channel: time}\n  "F(kN)": {channel: rops/force}\n  "a (m/(s*s))": {channel: ' + X + "}\n"
    found = read(tmp_path, "a.csv", "t [ms],F(kN),a (m/(s*s))\n0,1,2\n5,3,4\n", channels)
    assert found.time.tolist() == [0.0, 0.005]
    assert found[FORCE].tolist() == [1000.0, 3000.0]
    assert found[X].tolist() == [2.0, 4.0]
    units = "  t: {channel: time}\n  a: {channel: chassis/acceleration_x}\n"
    assert read(tmp_path, "a.csv", "t,a\n[s],m/(s*s)\n0,2\n1,4\n", units, "units_row: 2")[X].tolist() == [2.0, 4.0]


def test_rate_for_stamps_that_repeat(tmp_path: Path) -> None:
    channels = "  F: {channel: rops/force, unit: N}\n"
    found = read(tmp_path, "a.csv", "t,F\n13:25:02,1\n13:25:02,2\n13:25:03,3\n", channels, more="rate: 2000\n")
    assert found.time.tolist() == [0.0, 5e-4, 1e-3]
    assert left_out(found) == {"t"}


def test_a_long_file_of_uneven_rows_keeps_every_row_and_line(tmp_path: Path) -> None:
    # more than one block of the reader: 1 MiB
    rows = [f"{i},{i % 7}{',' * (i % 3)}" for i in range(150_000)]
    channels = "  t: {channel: time, unit: ms}\n  F: {channel: rops/force, unit: N}\n"
    found = read(tmp_path, "a.csv", "t,F,,\n" + "\n".join(rows) + "\n", channels)
    assert found.time.size == 150_000
    assert float(found[FORCE].sum()) == sum(i % 7 for i in range(150_000))
    rows[140_000] = "140000,oops,"
    with pytest.raises(InputError, match=r"a.csv:140002: column F: not a number, got 'oops'"):
        read(tmp_path, "a.csv", "t,F,,\n" + "\n".join(rows) + "\n", channels)


CELL = st.one_of(st.floats(-1e6, 1e6), st.none())


@given(
    st.lists(st.lists(CELL, min_size=4, max_size=4), min_size=1, max_size=8),
    st.sampled_from([",", ";", "\t"]),
    st.lists(st.integers(0, 3), min_size=9, max_size=9),
    st.booleans(),
)
@settings(max_examples=60, deadline=None)
def test_what_stands_in_the_file_is_read_or_named(
    tmp_path_factory: pytest.TempPathFactory,
    rows: list[list[float | None]],
    mark: str,
    tails: Sequence[int],
    named: bool,
) -> None:
    folder = tmp_path_factory.mktemp("round")
    lines = [mark.join(["t", "A", "B", "C"])] if named else []
    for i, row in enumerate(rows):
        lines.append(mark.join([str(i), *["" if v is None else repr(v) for v in row[1:]]]))
    text = "\n".join(line + mark * tail for line, tail in zip(lines, tails, strict=False)) + "\n"
    t, a, c = ("t", "A", "C") if named else ("1", "2", "4")
    channels = f'  "{t}": {{channel: time, unit: s}}\n  "{a}": {{channel: rops/force, unit: N}}\n'
    channels += f'  "{c}": {{channel: rops/energy, unit: J}}\n'
    csv = f'delimiter: "{mark}"'.replace("\t", "\\t") + ("" if named else ", names_row: 0")
    wanted = {"rops/force": [row[1] for row in rows], "rops/energy": [row[3] for row in rows]}
    try:
        found = read(folder, "a.csv", text, channels, csv)
    except InputError as e:
        assert "all gaps" in str(e) or "no such column" in str(e)  # noqa: PT017
        empty = [all(v is None for v in values) for values in wanted.values()]
        assert any(empty)
        return
    for channel, values in wanted.items():
        assert found[channel] == pytest.approx([np.nan if v is None else v for v in values], nan_ok=True, abs=0)
    assert left_out(found) == {"B" if named else "3"}


# ---- cells without a value, units stated twice, digits of a clock


@pytest.mark.parametrize(
    ("cell", "gap"), [("OVER", "OVER"), ("#N/A", "#N/A"), ("-9999.000", "-9999"), ("1e30", "1E+30"), (" OVL", " OVL")]
)
def test_cells_that_the_profile_calls_gaps_are_gaps_and_counted(tmp_path: Path, cell: str, gap: str) -> None:
    text = f"t,F\n0.0,1\n0.1,{cell}\n0.2,3\n0.3,\n"
    channels = "  t: {channel: time, unit: s}\n  F: {channel: rops/force, unit: N}\n"
    found = read(tmp_path, "a.csv", text, channels, f"gaps: ['OL', {gap!r}]")
    assert found[FORCE] == pytest.approx([1.0, math.nan, 3.0, math.nan], nan_ok=True)
    assert found.notes == ("F: 2 of 4 values are gaps",)


def test_a_word_among_numbers_is_refused_with_its_cure(tmp_path: Path) -> None:
    channels = "  t: {channel: time, unit: s}\n  F: {channel: rops/force, unit: N}\n"
    with pytest.raises(InputError, match=r"a.csv:3: column F: not a number, got 'OVER'; .*csv: \{gaps: \['OVER'\]\}"):
        read(tmp_path, "a.csv", "t,F\n0.0,1\n0.1,OVER\n0.2,3\n", channels)


@pytest.mark.parametrize(("name", "unit", "other"), [("Kraft [kN]", "N", "kN"), ("F (N)", "kN", "N")])
def test_two_units_of_one_column_are_refused_with_both(tmp_path: Path, name: str, unit: str, other: str) -> None:
    channels = f'  t: {{channel: time, unit: s}}\n  "{name}": {{channel: rops/force, unit: {unit}}}\n'
    text = f"t,{name}\n0.0,1\n0.1,2\n"
    with pytest.raises(InputError, match=rf"unit: the file states '{other}', got '{unit}'; leave `unit` out") as e:
        read(tmp_path, "a.csv", text, channels)
    # the cure for a file that is wrong, as it is printed, gives the profile's unit
    cure = re.search(r"where the file is wrong: (unit: .*)$", str(e.value))
    assert cure is not None
    factor = {"N": 1.0, "kN": 1e3}[unit]
    found = read(tmp_path, "a.csv", text, channels.replace(f"unit: {unit}", cure[1]))
    assert found[FORCE] == pytest.approx([factor, 2.0 * factor])
    of_file = {"N": 1.0, "kN": 1e3}[other]
    assert read(tmp_path, "a.csv", text, channels.replace(f", unit: {unit}", ""))[FORCE][0] == of_file


def test_a_unit_that_fits_nothing_is_no_second_one(tmp_path: Path) -> None:
    channels = '  "t [s]": {channel: time, unit: s}\n  "F [V]": {channel: rops/force, unit: kN}\n'
    assert read(tmp_path, "a.csv", "t [s],F [V]\n0.0,1\n0.1,2\n", channels)[FORCE].tolist() == [1000.0, 2000.0]


@pytest.mark.parametrize(
    ("first", "rate"), [("13:25:59.88", 100), ("09:59:59.0", 20), ("23:56:30.5", 1), ("00:00:58.7", 1000)]
)
def test_digits_of_a_clock_are_no_seconds(tmp_path: Path, first: str, rate: int) -> None:
    """VBOX and GPS loggers write 132559.99 and then 132600.00: 40 s that nobody waited for."""
    h, m, s = first.split(":")
    begun = int(h) * 3600 + int(m) * 60 + float(s)
    at = [begun + k / rate for k in range(2000 if rate > 100 else 200)]
    digits = [f"{int(t // 3600):02d}{int(t % 3600 // 60):02d}{t % 60:06.3f}" for t in at]
    assert any(d[-6:-4] == "00" for d in digits[1:])
    text = "time x\n" + "".join(f"{d} {k % 7}\n" for k, d in enumerate(digits))
    channels = "  time: {channel: time, unit: s}\n  x: {channel: rops/force, unit: N}\n"
    with pytest.raises(InputError, match=r"channels.time: unit: times of day as HHMMSS, not seconds, got .* date-time"):
        read(tmp_path, "a.vbo", text, channels, "delimiter: whitespace")
    found = read(tmp_path, "a.vbo", text, channels.replace("unit: s", "unit: date-time"), "delimiter: whitespace")
    assert found.time == pytest.approx(np.array(at) - begun, abs=1.1e-3)


@pytest.mark.parametrize("start", [132559.88, 100.0, 5958.0])
def test_seconds_with_a_gap_are_seconds(tmp_path: Path, start: float) -> None:
    at = start + np.concatenate([np.arange(0, 12), np.arange(5000, 5200)]) * 0.01
    text = "time,x\n" + "".join(f"{t:.3f},{k % 7}\n" for k, t in enumerate(at))
    channels = "  time: {channel: time, unit: s}\n  x: {channel: rops/force, unit: N}\n"
    assert read(tmp_path, "a.csv", text, channels).time == pytest.approx(at, abs=1e-3)


def test_a_reader_that_has_found_a_fault_holds_nothing_any_more(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Its threads, still at work as the process ends, would abort it (status 134 beside the message)."""
    held: list[weakref.ref[Numbers]] = []
    made = Numbers.__init__

    def note(self: Numbers, *args: Any) -> None:
        made(self, *args)
        held.append(weakref.ref(self))

    monkeypatch.setattr(Numbers, "__init__", note)
    (tmp_path / "a.csv").write_text("t,F\n" + "0.5,1\n" * 50 + "Max,3000\n")
    alive = 0
    for _ in range(200):  # a tenth of them stood before
        with pytest.raises(InputError, match=r"a.csv:52: column t: not a number, got 'Max'"):
            read_csv(tmp_path / "a.csv", ["t", "F"], Dialect(loose=True))
        alive += any(h() is not None for h in held)
        time.sleep(0.002)
        held.clear()
    assert alive == 0


@pytest.mark.parametrize("name", ["F/kN", "F in kN", "F {kN}", "F (front) [kN]", "Kraft [kN] links", "F [kN] (left)"])
def test_a_unit_anywhere_in_a_name_counts(tmp_path: Path, name: str) -> None:
    text = f"t,{name}\n0.0,1\n0.1,2\n"
    channels = f'  t: {{channel: time, unit: s}}\n  "{name}": {{channel: rops/force}}\n'
    assert read(tmp_path, "a.csv", text, channels)[FORCE].tolist() == [1000.0, 2000.0]
    with pytest.raises(InputError, match="unit: the file states 'kN', got 'N'"):
        read(tmp_path, "a.csv", text, channels.replace("rops/force", "rops/force, unit: N"))


@pytest.mark.parametrize("blank", ["\n", "  \n", "\n\n"])
def test_blank_lines_are_no_samples_that_a_rate_may_count(tmp_path: Path, blank: str) -> None:
    channels = "  F: {channel: rops/force, unit: N}\n"
    with pytest.raises(InputError, match=r"a.csv:4: \d blank lines between rows of numbers, which `rate` counts"):
        read(tmp_path, "a.csv", f"F\n1\n2\n{blank}3\n4\n", channels, more="rate: 10\n")
    for text in (f"F\n1\n2\n3\n{blank}", f"F\n{blank}1\n2\n3\n", "F\n\n1\n\n2\n\n3\n", "F\n1\n# then\n2\n3\n"):
        assert read(tmp_path, "a.csv", text, channels, more="rate: 10\n")[FORCE].tolist() == [1, 2, 3]


@pytest.mark.parametrize("name", ["utf-9", "\\u202e\\0", ""])
def test_an_encoding_that_is_none_is_refused_with_its_cure(tmp_path: Path, name: str) -> None:
    with pytest.raises(InputError, match=r"encoding: unknown, got .*; such as utf-8, cp1252, utf-16"):
        read(tmp_path, "v.txt", TABBED, TIME_AND_X, f'encoding: "{name}"')


@pytest.mark.parametrize("first", ["sep=;", '"sep=;"', "SEP=;"])
@pytest.mark.parametrize("csv", ["", 'delimiter: ";", names_row: 2', 'delimiter: ";", decimal: ","'])
def test_the_line_that_excel_begins_with(tmp_path: Path, first: str, csv: str) -> None:
    mark = "," if "decimal" in csv else "."
    text = first + "\nt;a\n" + "".join(f"{t:.4f};{a:.4f}\n".replace(".", mark) for t, a in ROWS[:50])
    about = "  t: {channel: time, unit: s}\n  a: {channel: rops/force, unit: N}\n"
    found = read(tmp_path, "e.csv", text, about, csv=csv)
    assert found[FORCE] == pytest.approx([a for _, a in ROWS[:50]], abs=1e-4)
    assert "sep=; in its first line says what stands between cells" in found.notes


def test_a_delimiter_that_the_first_line_contradicts_is_refused(tmp_path: Path) -> None:
    with pytest.raises(InputError, match=r"csv.delimiter: e.csv says sep=; in its first line, got '\|'"):
        read(tmp_path, "e.csv", "sep=;\nt;a\n0;1\n1;2\n", TIME_AND_X, csv='delimiter: "|"')

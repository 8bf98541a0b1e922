"""Workbooks as programs and people make them: titles above, units in words, dates, gaps, rows left empty."""

from __future__ import annotations

import datetime as dt
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from rollover.recording import Recording
from rollover.system.errors import InputError
from tests.rollover.foreign import FORCE, named, needs

needs("openpyxl")
import openpyxl  # noqa: E402

NAN = np.nan
MIDNIGHT = dt.datetime(2026, 11, 29, 23, 59, 59, 998000)
MS = dt.timedelta(milliseconds=1)


def book(path: Path, rows: Sequence[Any]) -> Path:
    made = openpyxl.Workbook()
    for row in rows:
        made.active.append(row)
    made.save(path)
    return path


def read(folder: Path, rows: Sequence[Any], more: str = "", **columns: str) -> Recording:
    return named(book(folder / "a.xlsx", rows), columns or {"t": "time, unit: s", "F": f"{FORCE}, unit: N"}, more)


def table(stamps: Sequence[Any], head: str = "t") -> list[list[Any]]:
    return [[head, "F"], *([stamp, float(k)] for k, stamp in enumerate(stamps))]


@pytest.mark.parametrize(
    ("stamps", "began"),
    [
        ([MIDNIGHT + k * MS for k in range(5)], "2026-11-29T23:59:59.998000000Z"),
        ([(MIDNIGHT + k * MS).isoformat(timespec="milliseconds") for k in range(5)], "2026-11-29T23:59:59.998000000Z"),
        ([(MIDNIGHT + k * MS).strftime("%d.%m.%Y %H:%M:%S,%f") for k in range(5)], "2026-11-29T23:59:59.998000000Z"),
        ([(MIDNIGHT + k * MS).time() for k in range(5)], "1970-01-01T23:59:59.998000000Z"),
    ],
    ids=["dates", "ISO 8601", "German", "times of day over midnight"],
)
@pytest.mark.parametrize("unit", ["s", "date-time"])
def test_cells_of_dates_and_times_are_stamps(tmp_path: Path, stamps: list[Any], began: str, unit: str) -> None:
    found = read(tmp_path, table(stamps), t=f"time, unit: {unit}", F=f"{FORCE}, unit: N")
    assert found.time == pytest.approx(np.arange(5) * 1e-3, abs=1e-9)
    assert found.clock.zero == "unknown"
    assert f"time counts from {began}" in found.notes


def test_cells_of_elapsed_time_keep_their_zero(tmp_path: Path) -> None:
    found = read(tmp_path, table([dt.timedelta(seconds=3, milliseconds=k) for k in range(5)]))
    assert found.time == pytest.approx(3.0 + np.arange(5) * 1e-3, abs=1e-9)
    assert found.clock.zero == "known"


def test_dates_closer_than_a_millisecond_are_told_apart(tmp_path: Path) -> None:
    stamps = [MIDNIGHT + k * dt.timedelta(microseconds=250) for k in range(9)]
    assert read(tmp_path, table(stamps)).time == pytest.approx(np.arange(9) * 250e-6, abs=1e-9)
    odd = [MIDNIGHT + k * dt.timedelta(microseconds=333) for k in range(9)]
    assert read(tmp_path, table(odd)).time == pytest.approx(np.arange(9) * 333e-6, abs=3e-6)  # a day to 7e-12


def test_a_date_missing_among_dates_and_a_number_are_refused(tmp_path: Path) -> None:
    for other, said in ((None, "cells of a date beside others"), (4.5, "cells of a date beside others")):
        with pytest.raises(InputError, match=said):
            read(tmp_path, table([MIDNIGHT, other, MIDNIGHT + MS]))


def test_rows_of_names_and_units_are_the_sheet_s_own_numbers(tmp_path: Path) -> None:
    rows = [["Report 17", 5.0], [None], ["t", "F"], ["s", "kN"], [None], *([0.1 * k, float(k)] for k in range(4))]
    how = {"t": "time", "F": FORCE}
    found = read(tmp_path, rows, "csv: {names_row: 3, units_row: 4}\n", **how)
    assert found[FORCE] == pytest.approx([0, 1000, 2000, 3000])
    assert read(tmp_path, rows, "csv: {names_row: 3}\n", **how)[FORCE][1] == 1000.0  # words below names are units
    with pytest.raises(InputError, match=r"no such column in a.xlsx, got 't'"):
        read(tmp_path, rows, **how)
    bare = read(tmp_path, rows[5:], "csv: {names_row: 0}\n", **{"1": "time, unit: s", "2": f"{FORCE}, unit: N"})
    assert bare[FORCE] == pytest.approx([0, 1, 2, 3])


def test_a_unit_in_a_name_counts(tmp_path: Path) -> None:
    rows = [["t [ms]", "F in kN"], [0.0, 1.0], [1.0, 2.0]]
    found = read(tmp_path, rows, **{"t [ms]": "time", "F in kN": FORCE})
    assert (found.time[1], found[FORCE][1]) == (pytest.approx(1e-3), 2000.0)
    with pytest.raises(InputError, match="unit: the file states 'kN', got 'N'"):
        read(tmp_path, rows, **{"t [ms]": "time", "F in kN": f"{FORCE}, unit: N"})


def test_gaps_of_the_profile_are_gaps(tmp_path: Path) -> None:
    rows = [["t", "F"], [0.0, 1.0], [0.1, "#N/A"], [0.2, -9999], [0.3, 4.0]]
    found = read(tmp_path, rows, "csv: {gaps: ['#N/A', '-9999']}\n")
    assert found[FORCE] == pytest.approx([1, NAN, NAN, 4], nan_ok=True)
    assert "F: 1 of 4 values are gaps by the profile" in found.notes
    with pytest.raises(InputError, match=r"text among numbers, got '#N/A'; .* csv: \{gaps: \['#N/A'\]\}"):
        read(tmp_path, rows)


def test_no_row_is_lost_behind_empty_ones(tmp_path: Path) -> None:
    rows = [["t", "F"], *([0.1 * k, float(k)] for k in range(3)), *[[None, None]] * 150, [0.3, 3.0], [0.4, 4.0]]
    assert read(tmp_path, rows)[FORCE] == pytest.approx([0, 1, 2, 3, 4])


def test_an_empty_row_is_a_sample_where_the_rate_counts_them(tmp_path: Path) -> None:
    rows = [["F"], [0.0], [1.0], [None], [None], [4.0], [5.0]]
    found = read(tmp_path, rows, "rate: 10\n", F=f"{FORCE}, unit: N")
    assert found[FORCE] == pytest.approx([0, 1, NAN, NAN, 4, 5], nan_ok=True)
    assert found.time == pytest.approx(0.1 * np.arange(6))


def test_of_columns_with_one_name_the_profile_chooses_by_place(tmp_path: Path) -> None:
    rows = [["t", "F", "F"], *([0.1 * k, float(k), 2.0 * k] for k in range(4))]
    with pytest.raises(
        InputError, match=r"two columns mean .* got 'F \(column 2\)' and 'F \(column 3\)'; a profile chooses"
    ):
        read(tmp_path, rows)
    found = read(tmp_path, rows, **{"t": "time, unit: s", "F (column 3)": f"{FORCE}, unit: N"})
    assert found[FORCE] == pytest.approx([0, 2, 4, 6])
    assert any("1 of 3 columns left out, without a description: F (column 2)" in note for note in found.notes)
    beside = [["t", "F", None, "t", "F"], *([0.1 * k, float(k), None, 5 + 0.1 * k, 2.0 * k] for k in range(4))]
    with pytest.raises(InputError, match=r"two columns mean time, got 't \(column 1\)' and 't \(column 4\)'"):
        read(tmp_path, beside)


@pytest.mark.parametrize("at", [range(4), [2]])
def test_a_formula_without_its_value_is_no_gap(tmp_path: Path, at: Sequence[int]) -> None:
    """A program that does not work formulas out, such as openpyxl, writes none of their values."""
    rows = [["t", "F", "z"], *([0.1 * k, f"=2*{k}" if k in at else float(k), 0.01 * k] for k in range(4))]
    with pytest.raises(InputError, match=r"a formula without its value, got '=2\*\d'; saved by a program"):
        read(tmp_path, rows)
    found = read(tmp_path, rows, t="time, unit: s", z=f"{FORCE}, unit: N")
    assert any("1 of 3 columns left out, a formula without its value" in note for note in found.notes)

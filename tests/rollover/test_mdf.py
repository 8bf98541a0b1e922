"""MDF: names in several groups, conversions to numbers and texts, invalid samples, masters."""

from __future__ import annotations

import shutil
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from rollover.recording.importers import read_recording
from rollover.recording.importers.mdf_conversions import computed
from rollover.system.errors import InputError
from tests.rollover.foreign import CASES, FORCE, SINKAGE, left_out, named, needs, peak

needs("asammdf")
from asammdf import MDF, Signal  # noqa: E402

TIME = np.arange(8.0)
RAW = np.array([-5, 0, 1, 5, 9, 10, 25, 31], dtype="i2")
NAN = np.nan


def write(path: Path, *groups: tuple[str, list[Signal]], version: str = "4.10") -> Path:
    with MDF(version=version) as file:
        for title, signals in groups:
            file.append(signals, acq_name=title)
        file.save(path, overwrite=True)
    return path


def signal(name: str, values: Any = RAW, time: Any = None, **more: Any) -> Signal:
    values = np.asarray(values)
    return Signal(values, TIME[: values.size] if time is None else time, name=name, **{"unit": "N", **more})


def converted(path: Path, conversion: dict[str, Any], unit: str = "N", values: Any = RAW) -> Any:
    write(path, ("", [signal("F", values, conversion=conversion, unit="")]))
    return named(path, {"F": f"{FORCE}, unit: {unit}" if unit else FORCE})


def test_numbers_beside_one_text_stay_numbers(tmp_path: Path) -> None:
    found = read_recording(CASES / "vtt.mf4")
    assert peak(found) == 1799.0
    assert int(np.isnan(found[FORCE]).sum()) == 5
    assert f"{FORCE}: 5 of 400 values are text, left as gaps: 5 'overload'" in found.notes


def test_a_text_beside_a_linear_scale_in_its_own_unit(tmp_path: Path) -> None:
    table = {"val_0": 5, "text_0": b"open", "val_1": 31, "text_1": b"over", "default_addr": {"a": 2.0, "b": 1.0}}
    found = converted(tmp_path / "a.mf4", table)
    assert found[FORCE] == pytest.approx([-9, 1, 3, NAN, 19, 21, 51, NAN], nan_ok=True)
    assert "2 of 8 values are text, left as gaps: 1 'open', 1 'over'" in found.notes[0]
    table["default_addr"] = {"a": 2.0, "b": 1.0, "unit": "kN"}
    assert converted(tmp_path / "b.mf4", table, unit="")[FORCE][0] == pytest.approx(-9000.0)


def test_ranges_of_text_beside_ranges_of_numbers(tmp_path: Path) -> None:
    ranges = {"lower_0": -10, "upper_0": 9, "text_0": {"a": 2.0, "b": 1.0}, "lower_1": 20, "upper_1": 29}
    found = converted(tmp_path / "a.mf4", {**ranges, "text_1": b"over", "default_addr": b"broken"})
    assert found[FORCE] == pytest.approx([-9, 1, 3, 11, 19, NAN, NAN, NAN], nan_ok=True)


def test_parts_of_a_conversion_in_different_units_are_refused(tmp_path: Path) -> None:
    coarse = {"lower_0": -10, "upper_0": 9, "text_0": {"a": 2.0, "b": 1.0, "unit": "N"}, "lower_1": 10, "upper_1": 40}
    parts = {**coarse, "text_1": {"a": 0.002, "b": 0.0, "unit": "kN"}, "default_addr": b"none"}
    with pytest.raises(InputError, match=r"channels.F: parts of its conversion are in different units, got N and kN"):
        converted(tmp_path / "a.mf4", parts)


def test_a_column_of_states_is_text(tmp_path: Path) -> None:
    states = {"val_0": 0, "text_0": b"off", "val_1": 1, "text_1": b"on", "default_addr": b"unknown"}
    with pytest.raises(InputError, match=r"channels.F: not a column of numbers over time: text: 6 'unknown', 1 'off'"):
        converted(tmp_path / "a.mf4", states)


def test_ranges_to_numbers(tmp_path: Path) -> None:
    ranges = {
        "lower_0": 0,
        "upper_0": 9,
        "phys_0": 100.0,
        "lower_1": 20,
        "upper_1": 29,
        "phys_1": 200.0,
        "default": -1.0,
    }
    whole = converted(tmp_path / "a.mf4", ranges)[FORCE]
    assert whole == pytest.approx([-1, 100, 100, 100, 100, -1, 200, -1])
    real = converted(tmp_path / "b.mf4", ranges, values=np.array([-0.5, 0.0, 8.9, 9.0, 19.0, 20.0, 28.9, 29.0]))[FORCE]
    assert real == pytest.approx([-1, 100, 100, -1, -1, 200, 200, -1])  # the upper end is outside for real numbers


@pytest.mark.parametrize(
    ("formula", "right"),
    [
        ("2*X1**2+1", 2 * RAW.astype(float) ** 2 + 1),
        ("pow(X1, 2)", RAW.astype(float) ** 2),
        ("-(X1-1)/2*3e1", -15.0 * (RAW - 1.0)),
    ],
)
def test_formulas(tmp_path: Path, formula: str, right: Any) -> None:
    assert converted(tmp_path / "a.mf4", {"formula": formula})[FORCE] == pytest.approx(right)


@pytest.mark.parametrize("formula", ["foo(X1)", "X2 + 1", "X1 >> 1", "__import__('os').name", "X1 +", "1" * 3000])
def test_formulas_that_cannot_be_computed_are_refused(formula: str) -> None:
    with pytest.raises(ValueError, match="its formula cannot be computed, got"):
        computed(formula, np.ones(3))


def test_a_caret_is_a_power_of_reals_and_refused_of_integers() -> None:
    assert computed("X1^2", np.array([0.5, 3.0])) == pytest.approx([0.25, 9.0])
    with pytest.raises(ValueError, match=r"a power or exclusive or; pow\(\) is clear"):
        computed("X1^2", np.array([1, 3]))


def test_a_refused_formula_is_one_line_at_the_profile(tmp_path: Path) -> None:
    with pytest.raises(InputError, match=r"yaml:3: channels.F: its formula cannot be computed, got 'foo\(X1\)'"):
        converted(tmp_path / "a.mf4", {"formula": "foo(X1)"})


def test_tables_and_rational_functions(tmp_path: Path) -> None:
    rational = {"P1": 0.0, "P2": 2.0, "P3": 1.0, "P4": 0.0, "P5": 0.0, "P6": 4.0}
    assert converted(tmp_path / "a.mf4", rational)[FORCE] == pytest.approx((2.0 * RAW + 1.0) / 4.0)
    table = {"raw_0": 0, "phys_0": 0.0, "raw_1": 10, "phys_1": 100.0, "interpolation": True}
    assert converted(tmp_path / "b.mf4", table)[FORCE] == pytest.approx(np.clip(10.0 * RAW, 0.0, 100.0))


def test_invalid_samples_are_gaps_and_said(tmp_path: Path) -> None:
    bits = np.array([0, 0, 1, 0, 0, 1, 0, 0], dtype=bool)
    every = signal("ground/sinkage", unit="m", invalidation_bits=np.ones(8, dtype=bool))
    path = write(tmp_path / "a.mf4", ("", [signal(FORCE, invalidation_bits=bits), every]))
    found = read_recording(path)
    assert found[FORCE] == pytest.approx(np.where(bits, NAN, RAW), nan_ok=True)
    assert f"{FORCE}: 2 of 8 values are invalid, left as gaps" in found.notes
    assert "1 of 2 columns left out, all invalid: ground/sinkage" in found.notes


def test_both_halves_of_a_test_are_there(tmp_path: Path) -> None:
    halves = ("first", [signal("F")]), ("second", [signal("F", 2 * RAW, TIME + 10.0)])
    path = write(tmp_path / "a.mf4", *halves)
    found = named(path, {"F": FORCE})
    assert found.time == pytest.approx([*TIME, *(TIME + 10.0)])
    assert found[FORCE] == pytest.approx([*RAW, *(2 * RAW)])
    assert any("joined from first/F (0 to 7 s), second/F (10 to 17 s)" in note for note in found.notes)
    assert named(path, {"second/F": FORCE})[FORCE] == pytest.approx(2 * RAW)


def test_two_groups_at_the_same_time_are_refused_by_both_names(tmp_path: Path) -> None:
    path = write(tmp_path / "a.mf4", ("", [signal("F"), signal("z", unit="mm")]), ("", [signal("F", 2 * RAW)]))
    with pytest.raises(InputError, match=r"got 'F \(group 0\)' and 'F \(group 1\)'; a profile chooses one"):
        named(path, {"F": FORCE})
    assert named(path, {"F (group 1)": FORCE, "z": SINKAGE})[FORCE] == pytest.approx(2 * RAW)
    with pytest.raises(InputError, match=r"no such column in a.mf4, .*the file holds: F \(group 0\), z, F \(group 1\)"):
        named(path, {"force": FORCE})


def test_the_same_name_twice_in_one_group(tmp_path: Path) -> None:
    path = write(tmp_path / "a.mdf", ("", [signal("F"), signal("F", 2 * RAW)]), version="3.30")
    with pytest.raises(InputError, match=r"'F \(group 0\) \(0\)' and 'F \(group 0\) \(1\)'"):
        named(path, {"F": FORCE})
    assert named(path, {"F (group 0) (1)": FORCE})[FORCE] == pytest.approx(2 * RAW)


def test_text_in_mdf_3(tmp_path: Path) -> None:
    over = signal("F", conversion={"val_0": 31, "text_0": b"overload"})
    found = named(write(tmp_path / "a.mdf", ("", [over]), version="3.30"), {"F": FORCE})
    assert found[FORCE] == pytest.approx([*RAW[:-1], NAN], nan_ok=True)


def test_what_runs_over_an_angle_is_not_over_time(tmp_path: Path) -> None:
    path = write(tmp_path / "a.mf4", ("", [signal(FORCE)]))
    with MDF(path) as file:
        file.groups[0].channels[0].sync_type = 2
        file.save(tmp_path / "b.mf4")
    with pytest.raises(InputError, match="its group runs over angle, not over time"):
        read_recording(tmp_path / "b.mf4")


def test_a_group_without_a_master_has_no_time_but_a_rate(tmp_path: Path) -> None:
    path = write(tmp_path / "a.mf4", ("", [signal(FORCE)]))
    with MDF(path) as file:
        file.groups[0].channels[0].channel_type, file.groups[0].channels[0].name = 0, "t"
        file.save(tmp_path / "b.mf4")
    with pytest.raises(InputError, match="no time, got no column of channel time"):
        read_recording(tmp_path / "b.mf4")
    assert named(tmp_path / "b.mf4", {FORCE: FORCE}, "rate: 100\n").time[1] == pytest.approx(0.01)


def test_all_that_a_file_holds_is_counted(tmp_path: Path) -> None:
    text = signal("note", np.array([b"a"] * 8), encoding="utf-8", unit="")
    path = write(
        tmp_path / "a.mf4", ("", [signal("F"), signal("spare")]), ("", [text]), ("", [signal("F", time=TIME + 9)])
    )
    found = named(path, {"F (group 0)": FORCE})
    assert left_out(found) == (3, 4)
    shutil.copy(path, tmp_path / "again.mf4")
    assert left_out(named(tmp_path / "again.mf4", {"F": FORCE})) == (2, 4)


def test_a_profiles_time_channel_holds_for_its_group(tmp_path: Path) -> None:
    gps = signal("gps", 1.7e9 + 2.0 * TIME, unit="s")
    path = write(tmp_path / "a.mf4", ("", [gps, signal("F")]), ("", [signal("z", unit="m")]))
    found = named(path, {"gps": "time", "F": FORCE})
    assert found.time == pytest.approx(2.0 * TIME)
    assert found.clock.zero == "unknown"
    assert "gps: a column of time that no column goes by" in named(path, {"gps": "time", "z": SINKAGE}).notes


def test_a_channel_whose_flag_says_that_all_is_invalid(tmp_path: Path) -> None:
    with MDF(version="4.10") as file:
        file.append([signal("F"), signal("z", unit="m")])
        file.groups[0].channels[1].flags |= 1
        file.save(tmp_path / "a.mf4", overwrite=True)
    assert "1 of 2 columns left out, without a description: F" in named(tmp_path / "a.mf4", {"z": SINKAGE}).notes
    with pytest.raises(InputError, match=r"channels.F: not a column of numbers over time: all invalid"):
        named(tmp_path / "a.mf4", {"F": FORCE})


@pytest.mark.parametrize(("unit", "times"), [("ms", 1e-3), ("us", 1e-6), ("s", 1.0), ("", 1.0)])
def test_a_master_in_another_unit_than_seconds(tmp_path: Path, unit: str, times: float) -> None:
    with MDF(version="4.10") as file:
        file.append([signal("F")])
        file.groups[0].channels[0].unit = unit
        file.save(tmp_path / "a.mf4", overwrite=True)
    assert named(tmp_path / "a.mf4", {"F": FORCE}).time == pytest.approx(times * TIME)


def test_a_master_in_no_unit_of_time_is_refused(tmp_path: Path) -> None:
    with MDF(version="4.10") as file:
        file.append([signal("F")])
        file.groups[0].channels[0].unit = "mm"
        file.save(tmp_path / "a.mf4", overwrite=True)
    with pytest.raises(InputError, match="its group runs over a time in 'mm', not over time"):
        named(tmp_path / "a.mf4", {"F": FORCE})

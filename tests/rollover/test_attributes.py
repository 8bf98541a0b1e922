"""What attributes say of an array, wherever they stand and however they are spelt: applied, refused or named."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest

from rollover.recording import Recording
from rollover.system.errors import InputError
from tests.rollover.foreign import FORCE, SINKAGE, named, needs

needs("h5py")
import h5py  # noqa: E402

TIME = np.arange(6) * 0.1
RAW = np.arange(1, 7, dtype="i2")
NAN = np.nan


def grouped(
    path: Path, own: dict[str, Any], group: dict[str, Any] | None = None, *, more: str = ", unit: N", raw: Any = RAW
) -> Recording:
    """One column in a group, both with attributes."""
    with h5py.File(path, "w") as file:
        file["run/t"], file["run/F"] = TIME, raw
        file["run/t"].attrs["units"] = "s"
        file["run/F"].attrs.update(own)
        file["run"].attrs.update(group or {})
    return named(path, {"run/t": "time", "run/F": FORCE + more})


def records(path: Path, more: str = ", unit: N", **attributes: Any) -> Recording:
    """A table of records of time and force."""
    with h5py.File(path, "w") as file:
        rows = np.array(list(zip(TIME, RAW, strict=True)), dtype=[("t", "f8"), ("F", "i2")])
        file["log"] = rows
        file["log"].attrs.update(attributes)
    return named(path, {"log.t": "time, unit: s", "log.F": FORCE + more})


def matrix(path: Path, **attributes: Any) -> Recording:
    """A matrix of force and depth."""
    with h5py.File(path, "w") as file:
        file["t"], file["M"] = TIME, np.column_stack([RAW, 10 * RAW])
        file["M"].attrs.update(attributes)
    return named(path, {"t": "time, unit: s", "M[0]": f"{FORCE}, unit: N", "M[1]": f"{SINKAGE}, unit: m"})


@pytest.mark.parametrize(
    "key",
    [
        *("gain", "CalFactor", "LSB", "Coefficients", "conversion_factor", "volts_per_count", "Multiplier"),
        *("sensitivity", "conversion", "divisor", "a1", "C1", "tare", "bias", "digital_max", "adc_max"),
    ],
)
def test_whole_numbers_beside_an_unknown_scale_are_refused(tmp_path: Path, key: str) -> None:
    value = [0.0, 0.5] if key == "Coefficients" else 0.5
    with pytest.raises(InputError, match=rf"channels.run/F: whole numbers beside {key} .*0.5, which no convention"):
        grouped(tmp_path / "a.h5", {key: value})
    with pytest.raises(InputError, match=rf"channels.run/F: whole numbers beside {key} .*0.5 of its group, which"):
        grouped(tmp_path / "a.h5", {}, {key: value})
    assert grouped(tmp_path / "a.h5", {key: value}, more=", unit: N, scale: 1")[FORCE] == pytest.approx(RAW)
    real = grouped(tmp_path / "a.h5", {}, {key: value}, raw=RAW.astype("f8"))
    assert real[FORCE] == pytest.approx(RAW)
    assert any("of its group stands beside its numbers, and is not applied" in note for note in real.notes)


@pytest.mark.parametrize(
    "key", ["time_offset", "wf_start_offset", "calibration_date", "sampling_factor", "offset_samples", "serial_number"]
)
def test_what_is_no_scale_is_none(tmp_path: Path, key: str) -> None:
    assert grouped(tmp_path / "a.h5", {key: 20.0}, {key: 20.0})[FORCE] == pytest.approx(RAW)


def test_a_scale_of_the_array_comes_before_that_of_its_group(tmp_path: Path) -> None:
    assert grouped(tmp_path / "a.h5", {"scale_factor": 2.0}, {"gain": 9.0})[FORCE] == pytest.approx(2.0 * RAW)
    with pytest.raises(InputError, match="whole numbers beside scale_factor 9 of its group"):
        grouped(tmp_path / "a.h5", {}, {"scale_factor": 9.0})
    with pytest.raises(InputError, match="attribute scale_factor: got 0; any other number"):
        grouped(tmp_path / "a.h5", {"scale_factor": 0.0})


@pytest.mark.parametrize("key", ["k", "range", "zero", "resolution_uV", "Umrechnung"])
def test_no_number_beside_counts_goes_unmentioned(tmp_path: Path, key: str) -> None:
    found = grouped(tmp_path / "a.h5", {key: 4.0})
    assert found[FORCE] == pytest.approx(RAW)
    assert f"run/F: {key} 4 stands beside its numbers, and is not applied; `scale` of a profile does" in found.notes
    real = grouped(tmp_path / "b.h5", {key: 4.0}, raw=RAW.astype("f8"))
    assert not any(key in note for note in real.notes)  # measured values have a range and a zero too


@pytest.mark.parametrize("key", ["sample_rate", "channel_index", "cfc", "max", "valid_max", "dt"])
def test_a_known_number_beside_counts_needs_no_word(tmp_path: Path, key: str) -> None:
    assert not any(key in note for note in grouped(tmp_path / "a.h5", {key: 5000.0}).notes)


def test_a_prefix_of_a_unit_is_said(tmp_path: Path) -> None:
    found = grouped(tmp_path / "a.h5", {"unit_prefix": "k"}, raw=RAW.astype("f8"))
    assert any("unit_prefix 'k' stands beside its numbers, and is not applied" in note for note in found.notes)


def test_what_may_be_a_scale_is_said(tmp_path: Path) -> None:
    found = grouped(tmp_path / "a.h5", {"resolution": 0.5})
    assert (
        "run/F: resolution 0.5 stands beside its numbers, and is not applied; `scale` of a profile does" in found.notes
    )


@pytest.mark.parametrize(
    ("own", "right"),
    [
        ({"valid_range": "2, 5"}, [NAN, 2, 3, 4, 5, NAN]),
        ({"missing_value": "3 4"}, [1, 2, NAN, NAN, 5, 6]),
        ({"flag_values": np.array([3, 6], "i2"), "flag_meanings": "open overload"}, [1, 2, NAN, 4, 5, NAN]),
    ],
)
def test_marks_of_gaps_as_text_and_as_states(tmp_path: Path, own: dict[str, Any], right: list[float]) -> None:
    assert grouped(tmp_path / "a.h5", own)[FORCE] == pytest.approx(right, nan_ok=True)


def test_a_mark_that_is_no_number_is_said(tmp_path: Path) -> None:
    found = grouped(tmp_path / "a.h5", {"missing_value": "none"})
    assert "run/F: missing_value 'none' is no number, and marks no gap" in found.notes


@pytest.mark.parametrize(
    "key", ["EngineeringUnits", "unit_string", "Unit Label", "physical_unit", "NI_UnitDescription"]
)
def test_units_by_the_names_that_writers_give_them(tmp_path: Path, key: str) -> None:
    assert grouped(tmp_path / "a.h5", {key: "kN"}, more="")[FORCE] == pytest.approx(1e3 * RAW)
    with pytest.raises(InputError, match="unit: the file states 'kN', got 'N'"):
        grouped(tmp_path / "a.h5", {key: "kN"})
    assert (
        grouped(tmp_path / "a.h5", {key: "counts", "units": "kN"}, more="")[FORCE][0] == 1e3
    )  # the convention's first


def test_records_with_an_entry_for_each_field(tmp_path: Path) -> None:
    path = tmp_path / "a.h5"
    assert records(path, scale_factor=[1.0, 2.0])[FORCE] == pytest.approx(2.0 * RAW)
    assert records(path, "", units=np.array(["s", "kN"], dtype=object))[FORCE] == pytest.approx(1e3 * RAW)
    assert records(path, "", F_units="kN")[FORCE] == pytest.approx(1e3 * RAW)
    assert records(path, units_F="N", F_scale_factor=3.0)[FORCE] == pytest.approx(3.0 * RAW)
    assert records(path, _FillValue=np.int16(3))[FORCE] == pytest.approx([1, 2, NAN, 4, 5, 6], nan_ok=True)
    with pytest.raises(InputError, match="unit: the file states 'kN', got 'N'"):
        records(path, units=np.array(["s", "kN"], dtype=object))


@pytest.mark.parametrize("one", [{"scale_factor": 2.0}, {"gain": 2.0}, {"valid_range": [2, 5, 9]}])
def test_records_with_one_scale_for_all_fields_are_refused(tmp_path: Path, one: dict[str, Any]) -> None:
    with pytest.raises(InputError, match=r"channels.log.F: records of 2 fields beside .*, of which is not said"):
        records(tmp_path / "a.h5", **one)
    assert records(tmp_path / "a.h5", ", unit: N, scale: 2", **one)[FORCE][0] == 2.0


def test_a_matrix_with_a_scale_for_each_column(tmp_path: Path) -> None:
    found = matrix(tmp_path / "a.h5", scale_factor=[2.0, 0.5], add_offset=[1.0, -1.0])
    assert found[FORCE] == pytest.approx(2.0 * RAW + 1.0)
    assert found[SINKAGE] == pytest.approx(5.0 * RAW - 1.0)
    with pytest.raises(InputError, match="attribute scale_factor: not one number"):
        matrix(tmp_path / "a.h5", scale_factor=[2.0, 0.5, 3.0])


@pytest.mark.parametrize(
    ("attributes", "step"),
    [
        ({"dt": 2.0, "dt_unit": "ms"}, 2e-3),
        ({"sampling_interval": 50.0, "time_units": "us"}, 50e-6),
        ({"sample_rate": 2.0, "sample_rate_units": "kHz"}, 0.5e-3),
        ({"dt": 2.0}, 2.0),
    ],
)
def test_steps_and_rates_in_the_unit_beside_them(tmp_path: Path, attributes: dict[str, Any], step: float) -> None:
    with h5py.File(tmp_path / "a.h5", "w") as file:
        file["F"] = RAW * 1.0
        file.attrs.update(attributes)
    assert named(tmp_path / "a.h5", {"F": f"{FORCE}, unit: N"}).time == pytest.approx(step * np.arange(6))


@pytest.mark.parametrize("key", ["decimation", "Downsampling_Factor", "subsample"])
def test_samples_left_out_beside_a_groups_rate_are_refused(tmp_path: Path, key: str) -> None:
    """One in four of the group's samples: at its rate they would last a quarter of the time."""

    def held(own: dict[str, Any]) -> Recording:
        with h5py.File(tmp_path / "a.h5", "w") as file:
            file["run/F"] = RAW.astype("f8")
            file["run"].attrs["sample_rate"] = 1000.0
            file["run/F"].attrs.update({"units": "N", **own})
        return named(tmp_path / "a.h5", {"run/F": FORCE})

    with pytest.raises(InputError, match=rf"{key.lower()} 4 beside a step of time that is its group's"):
        held({key: 4})
    assert held({key: 1}).time[1] == pytest.approx(1e-3)
    assert held({key: 4, "sample_rate": 250.0}).time[1] == pytest.approx(4e-3)


def test_a_step_in_no_unit_of_time_is_refused(tmp_path: Path) -> None:
    with h5py.File(tmp_path / "a.h5", "w") as file:
        file["F"] = RAW * 1.0
        file["F"].attrs.update({"dt": 2.0, "dt_unit": "mm"})
    with pytest.raises(InputError, match="attribute dt: a unit that is none of it, got 'mm'"):
        named(tmp_path / "a.h5", {"F": f"{FORCE}, unit: N"})


def test_what_a_classic_netcdf_never_wrote_is_a_gap(tmp_path: Path) -> None:
    from scipy.io import netcdf_file

    for kind, fill in (("h", -32767), ("i", -2147483647), ("f", 9.969209968386869e36), ("d", 9.969209968386869e36)):
        with netcdf_file(tmp_path / "a.nc", "w") as file:
            file.createDimension("t", 4)
            for name, values in (("t", [0.0, 0.1, 0.2, 0.3]), ("F", [1, fill, 3, 4])):
                file.createVariable(name, kind if name == "F" else "d", ("t",))[:] = values
        found = named(tmp_path / "a.nc", {"t": "time, unit: s", "F": f"{FORCE}, unit: N"})
        assert found[FORCE] == pytest.approx([1, NAN, 3, 4], nan_ok=True)
        assert "F: 1 of 4 values are gaps: 1 fill value" in found.notes

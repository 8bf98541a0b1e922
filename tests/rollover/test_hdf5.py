"""HDF5, netCDF and MATLAB 7.3: units, scales and fill values as stated, clocks, shapes, links."""

from __future__ import annotations

import shutil
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from rollover.recording.importers import read_recording, write_recording
from rollover.system.errors import InputError
from tests.rollover.foreign import CASES, FORCE, SINKAGE, left_out, named, needs, peak

needs("h5py")
import h5py  # noqa: E402

TIME = np.arange(6) * 0.1
NAN = np.nan


def write(path: Path, things: dict[str, Any], **attributes: dict[str, Any]) -> Path:
    """Datasets by path; `attributes` by the last part of the path."""
    with h5py.File(path, "w") as file:
        for name, values in things.items():
            file[name] = values
            file[name].attrs.update(attributes.get(name.rpartition("/")[2], {}))
    return path


def force(path: Path, values: Any, more: str = "", **attributes: Any) -> Any:
    write(path, {"t": TIME, "F": values}, t={"units": "s"}, F={"units": "N", **attributes})
    return named(path, {"t": "time", "F": FORCE + more})


def test_scale_and_fill_value_of_the_case() -> None:
    found = read_recording(CASES / "cf.h5")
    assert peak(found) == 3598.0
    assert int(np.isnan(found[FORCE]).sum()) == 5
    assert f"{FORCE}: 5 of 400 values are gaps: 5 _FillValue" in found.notes


def test_units_in_capitals_in_arrays_in_bytes(tmp_path: Path) -> None:
    assert peak(read_recording(CASES / "unitcap.h5")) == pytest.approx(3598.1, abs=0.1)
    for k, unit in enumerate(
        ({"UNITS": np.array([b"kN"])}, {"unit": np.array(["kN"], dtype=object)}, {"Unit": np.bytes_("kN")})
    ):
        path = write(tmp_path / f"{k}.h5", {"t": TIME, "F": TIME}, t={"units": "s"}, F=unit)
        assert peak(named(path, {"t": "time", "F": FORCE})) == pytest.approx(500.0)
    path = write(tmp_path / "two.h5", {"t": TIME, "F": TIME}, t={"units": "s"}, F={"unit": "N", "Units": "kN"})
    with pytest.raises(InputError, match=r"channels.F: two units, got 'N' and 'kN'; one"):
        named(path, {"t": "time", "F": FORCE})


@pytest.mark.parametrize(
    ("raw", "attributes", "right"),
    [
        (np.array([1, 2, 3, -9, 5, 6], "i2"), {"missing_value": np.int16(-9)}, [1, 2, 3, NAN, 5, 6]),
        (
            np.array([1, 2, 3, -9, 5, 6], "i2"),
            {"missing_value": "-9", "scale_factor": "0.5"},
            [0.5, 1, 1.5, NAN, 2.5, 3],
        ),
        (np.array([1, 2, 3, 4, 5, 6], "i2"), {"valid_range": np.array([2, 5], "i2")}, [NAN, 2, 3, 4, 5, NAN]),
        (np.array([1, 2, 3, 4, 5, 6], "f4"), {"valid_max": np.float32(5)}, [1, 2, 3, 4, 5, NAN]),
        # bounds of whole numbers are packed, those of real numbers are physical
        (
            np.array([1, 2, 3, 4, 5, 6], "i2"),
            {"scale_factor": 0.1, "valid_min": np.int16(2)},
            [NAN, 0.2, 0.3, 0.4, 0.5, 0.6],
        ),
        (np.array([1, 2, 3, 4, 5, 6], "i2"), {"scale_factor": 0.1, "valid_min": 0.25}, [NAN, NAN, 0.3, 0.4, 0.5, 0.6]),
        (
            np.array([1, 2, -1, 4, -56, 6], "i1"),
            {"_Unsigned": "true", "_FillValue": np.int8(-1)},
            [1, 2, NAN, 4, 200, 6],
        ),
        (np.array([1, 2, -1, 4, -56, 6], "i1"), {"_Unsigned": "true", "add_offset": 1.0}, [2, 3, 256, 5, 201, 7]),
        (np.array([1, 2, 3, -999.9, 5, 6], "f4"), {"missing_value": -999.9}, [1, 2, 3, NAN, 5, 6]),
        (np.array([1, 2, 3, 7, 8, 6], "i4"), {"missing_value": np.array([7, 8], "i4")}, [1, 2, 3, NAN, NAN, 6]),
        # in other letters than the conventions'
        (np.array([1, 2, 3, 4, 5, 6], "i2"), {"Scale_Factor": 2.0, "AddOffset": 1.0}, [3, 5, 7, 9, 11, 13]),
        (np.array([1, 2, 3, 4, 5, 6], "i2"), {"SCALE_FACTOR": 2.0, "FillValue": 2}, [2, NAN, 6, 8, 10, 12]),
        (np.array([1, -9999, 3, 4, 5, 6], "f8"), {"nodata": -9999.0}, [1, NAN, 3, 4, 5, 6]),
        (np.array([1, -9999, 3, 4, 5, 6], "i2"), {"NoData_Value": "-9999"}, [1, NAN, 3, 4, 5, 6]),
        (np.array([1, 2, 3, 4, 5, 6], "i2"), {"scale_factor": 2.0, "ScaleFactor": 5.0}, [2, 4, 6, 8, 10, 12]),
    ],
)
def test_packed_numbers(tmp_path: Path, raw: Any, attributes: dict[str, Any], right: list[float]) -> None:
    assert force(tmp_path / "a.h5", raw, **attributes)[FORCE] == pytest.approx(right, nan_ok=True)


def test_what_was_never_written_is_a_gap(tmp_path: Path) -> None:
    with h5py.File(tmp_path / "a.h5", "w") as file:
        file["t"] = TIME
        cut = file.create_dataset("F", shape=(6,), dtype="i2", fillvalue=-9999, chunks=(3,))
        cut[:3] = [1, 2, 3]
        whole = file.create_dataset("z", shape=(6,), dtype="f8", fillvalue=0.0, chunks=(3,))
        whole[:] = [0, 0, 1, 2, 3, 0]
    found = named(tmp_path / "a.h5", {"t": "time, unit: s", "F": f"{FORCE}, unit: N", "z": f"{SINKAGE}, unit: m"})
    assert found[FORCE] == pytest.approx([1, 2, 3, NAN, NAN, NAN], nan_ok=True)
    assert found[SINKAGE] == pytest.approx([0, 0, 1, 2, 3, 0])
    assert "F: 3 of 6 values are gaps: 3 fill value" in found.notes


def test_an_unknown_scale_is_refused_unless_the_profile_has_it(tmp_path: Path) -> None:
    raw = np.arange(6, dtype="i2")
    with pytest.raises(InputError, match=r"channels.F: whole numbers beside gain 0.25, which no convention defines"):
        force(tmp_path / "a.h5", raw, gain=0.25)
    assert force(tmp_path / "a.h5", raw, ", scale: 0.25", gain=0.25)[FORCE] == pytest.approx(0.25 * raw)
    assert force(tmp_path / "a.h5", raw.astype(float), gain=0.25)[FORCE] == pytest.approx(raw)  # real: an amplifier's
    assert force(tmp_path / "a.h5", raw, gain=1.0, offset=0)[FORCE] == pytest.approx(raw)
    said = "F: gain 0.25 stands beside its numbers, and is not applied; `scale` of a profile does"
    assert said in force(tmp_path / "a.h5", raw.astype(float), gain=0.25).notes
    assert force(tmp_path / "a.h5", raw, gain=1.0, offset=0).notes == ()
    with pytest.raises(InputError, match=r"channels.F: attribute scale_factor: not one number, got 'half'"):
        force(tmp_path / "a.h5", raw, scale_factor="half")


@pytest.mark.parametrize(
    ("counts", "unit", "began"),
    [
        (np.array([0, 1, 3]), "seconds since 2020-01-01 00:00:00", "2020-01-01T00:00:00.000000000Z"),
        (
            np.array([5000, 6000, 8000]),
            "milliseconds since 2020-01-01T01:00:00.5+01:00",
            "2020-01-01T00:00:05.500000000Z",
        ),
        (np.array([0, 1, 3]) / 86400.0, "days since 2020-1-1", "2020-01-01T00:00:00.000000000Z"),
        (1714550400_000000001 + np.array([0, 1, 3]) * 10**9, "ns", "2024-05-01T08:00:00.000000001Z"),
    ],
)
def test_stamps_of_a_calendar(tmp_path: Path, counts: Any, unit: str, began: str) -> None:
    path = write(tmp_path / "a.h5", {"t": counts, "F": [1.0, 2.0, 3.0]}, t={"units": unit}, F={"units": "N"})
    found = named(path, {"t": "time", "F": FORCE})
    assert found.time == pytest.approx([0.0, 1.0, 3.0], abs=1e-9)
    assert found.notes == (f"time counts from {began}",)
    assert found.clock.zero == "unknown"


@pytest.mark.parametrize("unit", ["months since 2020-01-01", "days since yesterday"])
def test_a_calendar_that_is_none(tmp_path: Path, unit: str) -> None:
    path = write(tmp_path / "a.h5", {"t": TIME, "F": TIME}, t={"units": unit}, F={"units": "N"})
    with pytest.raises(InputError, match=r"channels.t: (no unit of one length|not a date)"):
        named(path, {"t": "time", "F": FORCE})


def test_clocks_of_attributes(tmp_path: Path) -> None:
    path = write(tmp_path / "a.h5", {"F": TIME}, F={"unit": "N", "wf_increment": 0.01, "wf_start_offset": -0.02})
    assert named(path, {"F": FORCE}).time == pytest.approx([-0.02, -0.01, 0.0, 0.01, 0.02, 0.03])
    with h5py.File(tmp_path / "b.h5", "w") as file:  # the innermost says it: the rate of the group, not of the file
        file.attrs["sample_rate"] = 10.0
        file["run/F"], file["run/z"] = TIME, TIME
        file["run"].attrs.update({"fs": np.array([100]), "t0": "2024-05-01T08:00:00Z"})
        file["run/z"].attrs["t0"] = "2024-05-01T08:00:01Z"
    found = named(tmp_path / "b.h5", {"run/F": f"{FORCE}, unit: N", "run/z": f"{SINKAGE}, unit: m"})
    assert found.samples(FORCE)[0] == pytest.approx(0.01 * np.arange(6))
    assert found.samples(SINKAGE)[0] == pytest.approx(1.0 + 0.01 * np.arange(6))
    path = write(tmp_path / "c.h5", {"F": TIME}, F={"dt": 0.01, "fs": 50.0})
    with pytest.raises(InputError, match=r"channels.F: two steps of time, got dt 0.01 s, fs 0.02 s; one"):
        named(path, {"F": f"{FORCE}, unit: N"})


def test_coordinates_of_dimensions(tmp_path: Path) -> None:
    with h5py.File(tmp_path / "a.nc", "w") as file:
        for name, count, step in (("fast", 6, 0.1), ("slow", 3, 0.2)):
            file[name] = np.arange(count) * step * 1000
            file[name].attrs["units"] = "ms"
            file[name].make_scale(name)
        file["F"], file["xyz"] = TIME, np.arange(15.0).reshape(5, 3)
        file["F"].dims[0].attach_scale(file["fast"])
        file["xyz"].dims[1].attach_scale(file["slow"])  # samples along the shorter axis, as the file says
    found = named(tmp_path / "a.nc", {"F": f"{FORCE}, unit: N", "xyz[4]": f"{SINKAGE}, unit: m"})
    assert found.samples(FORCE)[0] == pytest.approx(TIME)
    assert found.samples(SINKAGE)[0] == pytest.approx([0.0, 0.2, 0.4])
    assert found.samples(SINKAGE)[1] == pytest.approx([12.0, 13.0, 14.0])


def test_records_and_matrices(tmp_path: Path) -> None:
    kind = np.dtype([("t", "f8"), ("F", "i2"), ("acc", "f4", (3,)), ("at", [("z", "f8")]), ("note", "S4")])
    table = np.zeros(6, kind)
    table["t"], table["F"], table["at"]["z"] = TIME, np.arange(6), 2 * TIME
    table["acc"] = np.arange(18).reshape(6, 3)
    path = write(
        tmp_path / "a.h5", {"log/table": table, "wide": np.arange(12.0).reshape(2, 6), "cube": np.zeros((2, 2, 3))}
    )
    columns = {
        "log/table.t": "time, unit: s",
        "log/table.F": f"{FORCE}, unit: N",
        "log/table.at.z": f"{SINKAGE}, unit: m",
    }
    found = named(
        path, {**columns, "log/table.acc[1]": "chassis/acceleration_y, unit: m/s2", "wide[1]": "rops/force_x, unit: N"}
    )
    assert found.time == pytest.approx(TIME)
    assert found[FORCE] == pytest.approx(np.arange(6))
    assert found[SINKAGE] == pytest.approx(2 * TIME)
    assert found["chassis/acceleration_y"] == pytest.approx(np.arange(6) * 3 + 1)
    assert found["rops/force_x"] == pytest.approx(np.arange(6.0) + 6)
    with pytest.raises(
        InputError, match=r"no such column in a.h5, got .*; it is log/table.t, log/table.F, log/table.acc\[0\]"
    ):
        named(path, {"log/table": FORCE})
    with pytest.raises(InputError, match=r"channels.cube: .*an array \(2, 2, 3\)"):
        named(path, {"cube": FORCE})


def test_groups_one_after_another_need_no_profile(tmp_path: Path) -> None:
    runs = {"run1/time": TIME, f"run1/{FORCE}": TIME, "run2/time": TIME + 5, f"run2/{FORCE}": 2 * TIME}
    path = write(tmp_path / "a.h5", runs, time={"unit": "s"}, force_normal={"unit": "N"})
    found = read_recording(path)
    assert found[FORCE] == pytest.approx([*TIME, *(2 * TIME)])
    runs["run2/time"] = TIME + 0.3
    with pytest.raises(InputError, match=f"got 'run1/{FORCE}' and 'run2/{FORCE}'; a profile"):
        read_recording(write(tmp_path / "b.h5", runs, time={"unit": "s"}, force_normal={"unit": "N"}))


def test_links_inside_the_file(tmp_path: Path) -> None:
    with h5py.File(tmp_path / "a.h5", "w") as file:
        file["raw/3/t"], file["raw/3/F"] = TIME, 3 * TIME
        file["last"], file["F"] = h5py.SoftLink("raw/3"), h5py.SoftLink("/last/F")
        file["gone"], file["raw/up"] = h5py.SoftLink("/no"), h5py.SoftLink("/raw")
    columns = {"last/t": "time, unit: s", "F": f"{FORCE}, unit: N"}
    found = named(tmp_path / "a.h5", columns)
    assert found[FORCE] == pytest.approx(3 * TIME)
    said = " ".join(found.notes)
    assert "a link to /no, which is not there: gone" in said
    assert "a link to /raw: raw/up" in said
    with h5py.File(tmp_path / "a.h5", "a") as file:
        file["other"] = h5py.ExternalLink("b.h5", "/F")
    with pytest.raises(InputError, match=r"other: a link into another file, 'b.h5' at '/F'"):
        named(tmp_path / "a.h5", columns)


def test_matlab_7_3(tmp_path: Path) -> None:
    with h5py.File(tmp_path / "a.mat", "w", userblock_size=512) as file:
        for name, values, kind in [
            ("data", np.stack([TIME, np.arange(6.0), 2 * TIME]), "double"),  # 6 by 3 there
            ("name", np.array([[72, 105]], "u2").T, "char"),
            ("ok", np.ones((6, 1), "u1"), "logical"),
            ("tt", np.array([[3707764736, 2, 1, 1, 1, 1]], "u4"), "timetable"),
        ]:
            file[name] = values
            file[name].attrs["MATLAB_class"] = np.bytes_(kind)
        file["void"] = np.zeros(2, "u8")
        file["void"].attrs.update({"MATLAB_class": np.bytes_("double"), "MATLAB_empty": 1})
        for k in range(3):
            file[f"#refs#/{k}"] = np.full((1, 6), float(k))
        log = file.create_group("log")
        log.attrs["MATLAB_class"] = np.bytes_("struct")
        log["F"] = np.array([[file[f"#refs#/{k}"].ref] for k in range(3)], dtype=h5py.ref_dtype)
    (tmp_path / "a.mat").write_bytes(b"MATLAB 7.3 MAT-file".ljust(512) + (tmp_path / "a.mat").read_bytes()[512:])
    columns = {"data[0]": "time, unit: s", "data[1]": f"{FORCE}, unit: N", "log[2]/F": f"{SINKAGE}, unit: m"}
    found = named(tmp_path / "a.mat", columns)
    assert found[FORCE] == pytest.approx(np.arange(6.0))
    assert found[SINKAGE] == pytest.approx(np.full(6, 2.0))
    said = " ".join(found.notes)
    for reason in ("text: name", "true or false: ok", "a MATLAB object, timetable: tt", "empty: void", "#refs#"):
        assert reason in said


def test_a_square_matlab_7_3_matrix_has_columns_last(tmp_path: Path) -> None:
    there = np.array([[0.0, 5.0], [1.0, 6.0]])  # two samples of time and force, as MATLAB shows them
    path = write(tmp_path / "a.h5", {"data": there.T, "other": there}, data={"MATLAB_class": np.bytes_("double")})
    names = {"data[0]": "time, unit: s", "data[1]": f"{FORCE}, unit: N", "other[1]": f"{SINKAGE}, unit: m"}
    found = named(path, names)
    assert found.time == pytest.approx([0.0, 1.0])
    assert found[FORCE] == pytest.approx([5.0, 6.0])
    assert found[SINKAGE] == pytest.approx([5.0, 6.0])


def test_classic_netcdf(tmp_path: Path) -> None:
    from scipy.io import netcdf_file

    with netcdf_file(tmp_path / "a.nc", "w") as file:
        file.createDimension("time", 6)
        for name, kind, values in (("time", "d", TIME), ("F", "h", [1, 2, -1, 4, 5, 6])):
            file.createVariable(name, kind, ("time",))[:] = values
        file.variables["time"].units = "seconds since 2024-05-01 08:00:00"
        file.variables["F"].units, file.variables["F"].scale_factor = "kN", 2.0
        file.variables["F"]._attributes["_FillValue"] = np.int16(-1)
        file.createVariable("single", "d", ())
    found = named(tmp_path / "a.nc", {"F": FORCE})
    assert found.time == pytest.approx(TIME)
    assert found[FORCE] == pytest.approx([2000, 4000, NAN, 8000, 10000, 12000], nan_ok=True)
    assert left_out(found) == (2, 3)
    assert "time counts from 2024-05-01T08:00:00.000000000Z" in found.notes


def test_all_that_a_file_holds_is_counted(tmp_path: Path) -> None:
    things = {
        "t": TIME,
        "F": TIME,
        "a/spare": TIME,
        "a/text": "x",
        "a/flag": TIME > 0,
        "a/one": 3.0,
        "void": np.empty(0),
    }
    path = write(tmp_path / "a.h5", {**things, "m": np.zeros((6, 2)), "c": TIME + 1j, "gaps": TIME * NAN})
    found = named(path, {"t": "time, unit: s", "F": f"{FORCE}, unit: N"})
    assert left_out(found) == (9, 11)
    shutil.copy(path, tmp_path / "b.h5")
    with pytest.raises(InputError, match=r"channels.gaps: not a column of numbers over time: all gaps"):
        named(tmp_path / "b.h5", {"t": "time, unit: s", "gaps": f"{FORCE}, unit: N"})


def test_a_profiles_time_comes_before_an_attributes_step(tmp_path: Path) -> None:
    assert force(tmp_path / "a.h5", TIME, dt=0.09).time == pytest.approx(TIME)
    assert named(tmp_path / "a.h5", {"F": FORCE}).time == pytest.approx(0.09 * np.arange(6))


@pytest.mark.parametrize("kind", ["f2", "f4", "f8", np.longdouble, "i8", "u1", ">f8", ">i2"])
def test_numbers_of_any_length_are_read_and_kept(tmp_path: Path, kind: Any) -> None:
    time, values = np.arange(6).astype(kind), np.arange(6)[::-1].astype(kind)
    path = write(tmp_path / "a.h5", {"t": time, "F": values}, t={"units": "s"}, F={"units": "N"})
    with h5py.File(path, "a") as file:
        file["t"].make_scale("t")
        file["F"].dims[0].attach_scale(file["t"])
    found = named(path, {"F": FORCE})
    for name in ("text.csv", "table.parquet"):
        write_recording(found, tmp_path / name)
        again = read_recording(tmp_path / name)
        assert again.time.tolist() == np.arange(6).tolist()
        assert again[FORCE].tolist() == np.arange(6)[::-1].tolist()

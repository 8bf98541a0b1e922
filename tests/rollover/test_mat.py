"""MATLAB up to version 7: matrices, structures and arrays of them; what is no column is named."""

from __future__ import annotations

import shutil
from pathlib import Path

import numpy as np
import pytest

from rollover.recording.importers import read_recording
from rollover.system.errors import InputError
from tests.rollover.foreign import CASES, FORCE, SINKAGE, left_out, named, peak

TIME = np.arange(6) * 0.1


def save(path: Path, **things: object) -> Path:
    from scipy.io import savemat

    savemat(path, things)
    return path


def structs(count: int, **fields: object) -> np.ndarray:
    """An array of structures; `fields` gives what element k holds, `field -> function of k`."""
    found = np.zeros((1, count), dtype=[(name, "O") for name in fields])
    for k in range(count):
        found[0, k] = tuple(make(k) for make in fields.values())  # type: ignore[operator]
    return found


def test_a_column_of_a_matrix_is_named_from_zero(tmp_path: Path) -> None:
    path = Path(shutil.copy(CASES / "two.mat", tmp_path))
    columns = {"data[0]": "time, unit: s", "data[1]": f"{FORCE}, unit: N", "data[2]": f"{SINKAGE}, unit: m"}
    found = named(path, columns)
    assert peak(found) == pytest.approx(3598.1, abs=0.1)
    assert peak(found, SINKAGE) == pytest.approx(0.3272, abs=1e-4)
    with pytest.raises(
        InputError,
        match=r"yaml:3: channels.data: no such column in two.mat, got 'data'; it is data\[0\], data\[1\], data\[2\]",
    ):
        read_recording(CASES / "two.mat", profile=CASES / "two.profile.yaml")


def test_rows_of_a_wide_matrix_and_vectors_either_way(tmp_path: Path) -> None:
    path = save(tmp_path / "a.mat", t=TIME[:, None], wide=np.stack([TIME, 2 * TIME]), z=TIME[None, :])
    columns = {"t": "time, unit: s", "wide[1]": f"{FORCE}, unit: N", "z": f"{SINKAGE}, unit: m"}
    found = named(path, columns)
    assert found[FORCE] == pytest.approx(2 * TIME)
    assert found[SINKAGE] == pytest.approx(TIME)


def test_an_array_of_structures(tmp_path: Path) -> None:
    log = structs(3, t=lambda k: TIME + 10 * k, F=lambda k: k + TIME, note=lambda k: "x")
    path = save(tmp_path / "a.mat", log=log)
    found = named(path, {"log[2].t": "time, unit: s", "log[2].F": f"{FORCE}, unit: N"})
    assert found.time == pytest.approx(TIME + 20)
    assert found[FORCE] == pytest.approx(2 + TIME)
    every = {
        f"log[{k}].{f}": about for k in range(3) for f, about in (("t", "time, unit: s"), ("F", f"{FORCE}, unit: N"))
    }
    joined = named(path, every)
    assert joined[FORCE] == pytest.approx(np.concatenate([k + TIME for k in range(3)]))
    assert any("joined from log[0].F (0 to 0.5 s), log[1].F" in note for note in joined.notes)


def test_an_array_of_structures_with_a_sample_each(tmp_path: Path) -> None:
    log = structs(6, t=lambda k: TIME[k], F=lambda k: 100.0 * k)
    found = named(save(tmp_path / "a.mat", log=log), {"log.t": "time, unit: s", "log.F": f"{FORCE}, unit: N"})
    assert found.time == pytest.approx(TIME)
    assert found[FORCE] == pytest.approx(100.0 * np.arange(6))


def test_what_is_no_column_is_named_and_counted(tmp_path: Path) -> None:
    from scipy.sparse import csc_matrix

    cell = np.array([1.0, "x"], dtype=object)
    more = {"flag": TIME > 0.1, "z": TIME + 1j, "s": csc_matrix(np.eye(3)), "cell": cell, "text": "x", "rate": 1000.0}
    path = save(tmp_path / "a.mat", t=TIME, F=TIME, void=np.empty((0, 0)), cube=np.zeros((2, 2, 2)), spare=TIME, **more)
    found = named(path, {"t": "time, unit: s", "F": f"{FORCE}, unit: N"})
    assert left_out(found) == (9, 11)
    said = " ".join(found.notes)
    for reason in (
        *("true or false: flag", "complex numbers: z", "a sparse matrix: s", "a MATLAB cell: cell", "text: text"),
        *("a single number: rate", "empty: void", "an array (2, 2, 2): cube", "without a description: spare"),
    ):
        assert reason in said
    with pytest.raises(InputError, match=r"channels.flag: not a column of numbers over time: true or false"):
        named(path, {"t": "time, unit: s", "flag": f"{FORCE}, unit: N"})


def test_serial_stamps_of_whole_numbers_keep_their_nanoseconds(tmp_path: Path) -> None:
    stamps = 1714550400_000000001 + np.array([0, 1, 3])
    path = save(tmp_path / "a.mat", t=stamps, F=np.array([1.0, 2.0, 3.0]))
    found = named(path, {"t": "time, unit: ns", "F": f"{FORCE}, unit: N"})
    assert found.time == pytest.approx([0.0, 1e-9, 3e-9], abs=1e-12)
    assert found.clock.zero == "unknown"


def test_columns_of_a_lone_matrix_go_by_number(tmp_path: Path) -> None:
    # the matrix bears the name of the test: one profile serves all of them
    for name in ("SR450251", "SR450252"):
        table = np.column_stack([TIME, 10.0 * TIME, -TIME])
        save(tmp_path / f"{name}.mat", **{name: table})
        (tmp_path / "p.yaml").write_text(
            "format: rollover-profile/1\nchannels:\n  '1': {channel: time, unit: s}\n"
            "  '2': {channel: striker/acceleration_z, unit: g}\n"
        )
        found = read_recording(tmp_path / f"{name}.mat", profile=tmp_path / "p.yaml")
        assert found.time == pytest.approx(TIME)
        assert found["striker/acceleration_z"] == pytest.approx(98.0665 * TIME)
        assert found.notes == (f"1 of 3 columns left out, without a description: {name}[2]",)
    save(tmp_path / "two.mat", a=table, b=table)
    with pytest.raises(InputError, match=r"no such column in two.mat, got '1'; the file holds: a\[0\], a\[1\]"):
        read_recording(tmp_path / "two.mat", profile=tmp_path / "p.yaml")

"""What a recorded file claims to hold is summed before it is made room for, in each format."""

from __future__ import annotations

import gzip
import importlib.util
import io
import lzma
import tarfile
import zipfile
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from rollover import scenario
from rollover.recording.importers import COLLECTIONS, mat_claims, mme_archive, read_recording, tar
from rollover.recording.importers.npz import arrays_of
from rollover.recording.tables import write_parquet_columns
from rollover.system import budget
from tests.rollover.bounds import RAISED, line_of, yaml

h5py_missing = importlib.util.find_spec("h5py") is None


# --- arrays of numpy


def npz(path: Path, **claims: tuple[int, ...]) -> Path:
    """Headers that claim shapes, and not a number."""
    with zipfile.ZipFile(path, "w") as archive:
        for name, shape in claims.items():
            head = io.BytesIO()
            np.lib.format.write_array_header_1_0(head, {"descr": "<f8", "fortran_order": False, "shape": shape})
            archive.writestr(f"{name}.npy", head.getvalue())
    return path


def test_npz_claims_are_summed_over_its_arrays(tmp_path: Path, cheap: None) -> None:
    path = npz(tmp_path / "cube_tosses.npz", data=(1_000_000, 13), length=(7,))
    assert "data.npy: claims too much, got 104 MB of" in line_of(
        lambda: list(COLLECTIONS["cube-tosses"].read(path, ["*"]))
    )
    path = npz(tmp_path / "cone_drops.npz", SR451001=(1_250_000, 4), SR451002=(1_250_000, 4))
    line = line_of(lambda: list(COLLECTIONS["cone-drops"].read(path, ["*"])))
    assert "SR451002.npy: claims too much, got 80 MB of" in line  # one by one they would do


def test_npz_of_few_numbers_is_read(tmp_path: Path) -> None:
    np.savez_compressed(tmp_path / "a.npz", data=np.arange(6.0).reshape(2, 3), names=np.array(["a", "b"]))
    with arrays_of(tmp_path / "a.npz") as found:
        assert found["data"].tolist() == [[0.0, 1.0, 2.0], [3.0, 4.0, 5.0]]
        assert found["names"].tolist() == ["a", "b"]


def test_a_grid_of_heights_that_claims_much_is_refused(tmp_path: Path, cheap: None) -> None:
    with (tmp_path / "h.npy").open("wb") as file:
        np.lib.format.write_array_header_1_0(file, {"descr": "<f8", "fortran_order": False, "shape": (10**6, 10**6)})
    surface = "{kind: heightmap, heights: h.npy, spacing: [0.5, 0.5], corner: [-2.0, -2.0]}"
    path = yaml(tmp_path, f"base: side_overturn.yaml\ntitle: x\nground:\n  surface: {surface}\n")
    line = line_of(lambda: scenario.load(path), cure="")
    assert "ground.surface.heights: " in line
    assert "h.npy is no grid of numbers" in line


# --- archives


def test_a_header_of_a_tar_is_not_believed(tmp_path: Path, cheap: None) -> None:
    """A long name of 3 GB stands before the first file: Python reads it while it opens the archive."""
    info = tarfile.TarInfo("././@LongLink")
    info.type, info.size = tarfile.GNUTYPE_LONGNAME, 3 * 10**9
    for name, opened in (("a.tar.gz", gzip.open), ("a.tar.xz", lzma.open), ("a.tar", open)):
        with opened(tmp_path / name, "wb") as file:
            file.write(info.tobuf(tarfile.GNU_FORMAT) + bytes(1 << 20))
        line = line_of(lambda name=name: read_recording(tmp_path / name))  # type: ignore[misc]
        assert f"{name}: claims too much, got a part that ends after 3 GB" in line


def test_each_file_of_a_packed_tar_is_unpacked_once(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    path = tmp_path / "a.tgz"
    with tarfile.open(path, "w:gz") as archive:
        for k in range(300):
            info = tarfile.TarInfo(f"Channel/a.{k:03d}")
            info.size = 4
            archive.addfile(info, io.BytesIO(f"{k:4d}".encode()))
    opened: list[Path] = []
    open_tar = tar.open_tar
    monkeypatch.setattr(mme_archive, "open_tar", lambda place: opened.append(place) or open_tar(place))
    names = mme_archive.names_in(path)
    assert [int(mme_archive.content(path, name)) for name in names] == list(range(300))
    assert len(opened) == 2  # for the sizes, and for the contents
    path.write_bytes(b"")
    assert "neither a folder nor" in line_of(lambda: mme_archive.content(path, names[0]), cure="zip or tar")


def test_a_workbook_that_unpacks_to_much_is_refused(tmp_path: Path, cheap: None) -> None:
    pytest.importorskip("openpyxl", reason="openpyxl is not installed: workbooks are not tested")
    path = tmp_path / "Ball_drops_data.xls"
    with zipfile.ZipFile(path, "w", zipfile.ZIP_DEFLATED) as archive, archive.open("xl/sheet1.xml", "w") as part:
        for _ in range(30):
            part.write(bytes(1 << 20))
    (tmp_path / "balls.txt").write_text("1 2\n")
    line = line_of(lambda: list(COLLECTIONS["falling-balls"].read(path, ["*"])))
    assert "xl/sheet1.xml: claims too much, got 157 MB of contents" in line


@pytest.mark.parametrize("sheets", [1, 3])
def test_rows_of_a_workbook_claim_the_places_between_their_cells(sheets: int, tmp_path: Path) -> None:
    """A row with a first and a last cell, 16384 columns apart: 40 bytes on disk, 131 kB of places."""
    openpyxl = pytest.importorskip("openpyxl", reason="openpyxl is not installed: workbooks are not tested")
    book = openpyxl.Workbook(write_only=True)
    for k in range(sheets):
        page = book.create_sheet(f"s{k}")
        for _ in range(900 // sheets):
            page.append([1.0, *[None] * 16382, 2.0])
    book.save(tmp_path / "a.xlsx")
    line = line_of(lambda: read_recording(tmp_path / "a.xlsx"))
    assert f"sheet s{sheets // 2}: claims too much, got 64" in line
    assert "ROLLOVER_BUDGET=2 in the environment allows it" in line


# --- formats of instruments


def mat(folder: Path, **values: Any) -> Path:
    from scipy.io import savemat

    savemat(folder / "a.mat", values, do_compression=True)
    return folder / "a.mat"


ZEROS = np.zeros(5_000_000)  # 40 MB, packed to 39 kB


@pytest.mark.parametrize(
    ("make", "at"),
    [
        (lambda: {"run": {"time": np.arange(3.0), "F": ZEROS}}, "run.F"),
        (lambda: {"run": {"deep": {"F": ZEROS}}}, "run.deep.F"),
        (lambda: {"cells": np.array([np.zeros(3), ZEROS], dtype=object)}, "cells"),
        (lambda: {"a": ZEROS[:2_500_000], "b": ZEROS[:2_500_000]}, "b"),
        (lambda: {"a": np.zeros(9_000_000, dtype=np.uint8)}, "a"),
    ],
)
def test_mat_claims_are_summed_in_structures_and_cells(
    tmp_path: Path, make: Callable[[], dict[str, Any]], at: str
) -> None:
    path = mat(tmp_path, **make())
    assert path.stat().st_size < 50_000
    assert f"a.mat: {at}: claims too much" in line_of(lambda: mat_claims.check_claims(path))
    assert f"a.mat: {at}: claims too much" in line_of(lambda: read_recording(path))


def test_a_sound_mat_file_claims_what_it_holds(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    from rollover.recording.importers.mat_claims import Budget

    summed: list[int] = []
    monkeypatch.setattr(Budget, "claim", lambda self, count, at="": summed.append(count))
    log = np.zeros(2, dtype=[("F", object), ("name", object)])
    log["F"], log["name"] = [np.arange(100.0), np.arange(50.0)], ["first", "second"]
    mat_claims.check_claims(mat(tmp_path, log=log, m=np.ones((10, 10)), text="word", last=np.arange(1000.0)))
    held = 8 * (100 + 50 + 100 + 1000)
    assert 2 * held < sum(summed) < 2 * held + 4000  # as stored and as numbers, and 200 for each array


@pytest.mark.skipif(h5py_missing, reason="h5py is not installed: HDF5 is not tested")
def test_hdf5_claims_are_summed_over_missing_chunks(tmp_path: Path, cheap: None) -> None:
    import h5py

    with h5py.File(tmp_path / "a.h5", "w") as file:
        for name in ("time", "ground/force_normal", "ground/sinkage"):
            file.create_dataset(name, shape=(2_000_000,), chunks=(2**14,), dtype="f8")
    line = line_of(lambda: read_recording(tmp_path / "a.h5"))
    assert "a.h5: time: claims too much, got 96 MB" in line  # each by itself would do
    with h5py.File(tmp_path / "b.h5", "w") as file:
        file.create_dataset("time", shape=(10,), maxshape=(None,), chunks=(10_000_000,), dtype="f8")
    assert "b.h5: time: claims too much, got 160 MB" in line_of(lambda: read_recording(tmp_path / "b.h5"))


def test_columns_of_a_matrix_are_unpacked_once(tmp_path: Path) -> None:
    """Each by itself would unpack the chunk that all of them lie in."""
    from rollover.recording.importers import read_profile
    from rollover.recording.importers.arrays import Array, signals_of

    data = np.arange(80.0)[:, None] + np.arange(30.0) / 1000.0
    loads: list[Any] = []
    (tmp_path / "p.yaml").write_text(
        "format: rollover-profile/1\nrate: 100\nchannels:\n"
        "  'm[0]': {channel: ground/force_normal, unit: N}\n  'm[29]': {channel: ground/sinkage, unit: m}\n"
    )
    thing = Array(shape=data.shape, dtype=data.dtype, load=lambda index: loads.append(index) or data[index])
    found = signals_of(tmp_path / "p.yaml", {"m": thing}, read_profile(tmp_path / "p.yaml"))
    assert [found[f"m[{k}]"].values[1] for k in (0, 29)] == [1.0, 1.029]
    assert loads == [()]


def test_a_picture_is_no_columns_and_is_left_out(tmp_path: Path, cheap: None) -> None:
    from rollover.recording.importers.columns import matrix

    assert matrix("m", (2**31, 2**31)) == {}
    assert len(matrix("m", (2**31, 4))) == 4


def test_mcap_chunks_claim_what_they_unpack_to(tmp_path: Path, cheap: None) -> None:
    pytest.importorskip("mcap", reason="mcap is not installed: MCAP is not tested")
    (tmp_path / "p.yaml").write_text(
        "format: rollover-profile/1\nchannels:\n  /a.F: {channel: ground/force_normal, unit: N}\n"
    )

    def record(kind: int, body: bytes) -> bytes:
        return bytes([kind]) + len(body).to_bytes(8, "little") + body

    chunk = record(6, bytes(16) + (40_000_000).to_bytes(8, "little") + bytes(4) + (4).to_bytes(4, "little") + b"zstd")
    index = record(8, bytes(32) + (40_000_000).to_bytes(8, "little"))
    for name, parts in (("two.mcap", chunk * 2), ("twice.mcap", chunk + index * 2)):
        (tmp_path / name).write_bytes(b"\x89MCAP0\r\n" + record(1, bytes(8)) + parts)
        line = line_of(lambda name=name: read_recording(tmp_path / name, profile=tmp_path / "p.yaml"))  # type: ignore[misc]
        assert f"{name}: claims too much, got 80 MB" in line


def test_tables_claim_their_rows(tmp_path: Path, cheap: None) -> None:
    from rollover.recording import UnreadableError, read_pairs, read_parquet, read_table

    zeros = np.zeros(2_500_000)
    path = tmp_path / "a.parquet"
    write_parquet_columns({"t": zeros, "F": zeros}, path)
    (tmp_path / "a.yaml").write_text(
        "format: rollover-recording/1\nchannels:\n  t: {channel: time, unit: s}\n"
        "  F: {channel: ground/force_normal, unit: kN}\n"
    )
    for read in (read_recording, read_parquet):
        assert "a.parquet: claims too much, got 80 MB" in line_of(lambda read=read: read(path))  # type: ignore[misc]
    for table in (read_table, read_pairs):
        with pytest.raises(UnreadableError, match="claims too much, got 200 MB"):
            table(path)


def test_a_larger_file_may_claim_more_and_the_variable_raises_it(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    assert budget.unpacked(1000) == budget.FLOOR
    assert budget.unpacked(1_000_000) == 200_000_000
    assert budget.unpacked(10**12) == budget.MOST
    path = mat(tmp_path, time=np.arange(5_000_000.0) * 0.0)
    mat_line = line_of(lambda: mat_claims.check_claims(path))
    enough = mat_line.partition(RAISED)[2].partition(" ")[0]
    monkeypatch.setenv(budget.VARIABLE, enough)
    mat_claims.check_claims(path)  # by what the message says

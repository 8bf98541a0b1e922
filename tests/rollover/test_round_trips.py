"""What a file holds is what is read and what is said to be left out, counted, in every format that can be written here.

Each file has the same content: two channels with gaps where the format has a word for them, columns that nobody
describes, and a text where it has room for one.
"""

from __future__ import annotations

import importlib.util
import json
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from tests.rollover.foreign import FORCE, SINKAGE, left_out, named
from tests.rollover.test_crash_data import ev5, instrument
from tests.rollover.test_lvm import head, segment
from tests.rollover.test_mme import channel, made

Array = NDArray[np.float64]
STEP = 1e-3
BEGAN = 1714550400 * 10**9  # ns


@dataclass(frozen=True, kw_only=True)
class Content:
    """Columns of numbers of one length by name, F and z among them."""

    columns: Mapping[str, Array]

    @property
    def time(self) -> Array:
        return np.asarray(np.arange(len(self.columns["F"])) * STEP)

    def rows(self, gap: str = "") -> list[list[str]]:
        table = zip(self.time.tolist(), *(v.tolist() for v in self.columns.values()), strict=True)
        return [[gap if v != v else repr(v) for v in row] for row in table]


@dataclass(frozen=True, kw_only=True)
class File:
    """A file, how many things it holds, and what its columns are called there; `more` of its profile."""

    path: Path
    held: int
    time: str | None = "t"
    of: str = "{}"
    more: str = ""


def csv(folder: Path, content: Content) -> File:
    path = folder / "a.csv"
    rows = [["t", *content.columns, "remark"], *([*row, "no word"] for row in content.rows())]
    path.write_text("\n".join(map(",".join, rows)) + "\n")
    return File(path=path, held=len(content.columns) + 2)


def xlsx(folder: Path, content: Content) -> File:
    import openpyxl

    book = openpyxl.Workbook()
    book.active.append(["t", *content.columns, "remark"])
    for row in content.rows():
        book.active.append([*(float(cell) if cell else None for cell in row), "no word"])
    book.save(folder / "a.xlsx")
    return File(path=folder / "a.xlsx", held=len(content.columns) + 2)


def mat(folder: Path, content: Content) -> File:
    from scipy.io import savemat

    savemat(folder / "a.mat", {"t": content.time, **content.columns, "remark": "no word"})
    return File(path=folder / "a.mat", held=len(content.columns) + 2)


def hdf5(folder: Path, content: Content) -> File:
    import h5py

    with h5py.File(folder / "a.h5", "w") as file:
        for name, values in {"t": content.time, **content.columns, "remark": "no word"}.items():
            file[f"run/{name}"] = values
    return File(path=folder / "a.h5", held=len(content.columns) + 2, time="run/t", of="run/{}")


def netcdf(folder: Path, content: Content) -> File:
    from scipy.io import netcdf_file

    with netcdf_file(str(folder / "a.nc"), "w") as file:
        file.createDimension("sample", content.time.size)
        for name, values in {"t": content.time, **content.columns}.items():
            file.createVariable(name, "d", ("sample",))[:] = values
    return File(path=folder / "a.nc", held=len(content.columns) + 1)


def tdms(folder: Path, content: Content) -> File:
    from nptdms import ChannelObject, TdmsWriter

    wave = {"wf_increment": STEP}
    with TdmsWriter(str(folder / "a.tdms")) as file:
        objects = [ChannelObject("g", name, values, properties=wave) for name, values in content.columns.items()]
        file.write_segment([*objects, ChannelObject("g", "remark", ["no", "word"])])
    return File(path=folder / "a.tdms", held=len(content.columns) + 1, time=None, of="g/{}")


def mdf(folder: Path, content: Content, *, version: str = "4.10") -> File:
    from asammdf import MDF, Signal

    path = folder / ("a.mf4" if version >= "4" else "a.mdf")
    with MDF(version=version) as file:
        file.append([Signal(v, content.time, name=name) for name, v in content.columns.items()])
        file.save(path)
    return File(path=path, held=len(content.columns), time=None)


def mdf3(folder: Path, content: Content) -> File:
    return mdf(folder, content, version="3.30")


def mcap(folder: Path, content: Content) -> File:
    from mcap.writer import Writer

    with (folder / "a.mcap").open("wb") as stream:
        writer = Writer(stream)
        writer.start()
        schema = writer.register_schema(name="x", encoding="jsonschema", data=b"{}")
        topic = writer.register_channel(topic="/g", message_encoding="json", schema_id=schema)
        for k in range(content.time.size):
            values = {name: v[k] if np.isfinite(v[k]) else None for name, v in content.columns.items()}
            data = json.dumps({**values, "remark": "no word"}).encode()
            writer.add_message(channel_id=topic, log_time=BEGAN + k * 10**6, publish_time=BEGAN, data=data)
        writer.finish()
    return File(path=folder / "a.mcap", held=len(content.columns) + 1, time=None, of="/g.{}")


def code(k: int) -> str:
    return f"10SPAR{k:02d}0000FO00"


def iso_mme(folder: Path, content: Content) -> File:
    texts = [channel(code(k), [c or "NOVALUE" for c in column], "N") for k, column in enumerate(columns(content))]
    return File(path=made(folder, *texts), held=len(texts), time=None, of="mme")


def columns(content: Content) -> list[tuple[str, ...]]:
    return list(zip(*content.rows(), strict=True))[1:]


def lvm(folder: Path, content: Content) -> File:
    names, rows = ["X_Value", *content.columns], [[*row, "no word"] for row in content.rows("NaN")]
    count = [content.time.size] * len(content.columns)
    text = head() + segment(
        "\t", names, rows, samples=list(count), delta=[repr(STEP)] * len(count), unit=[""] * len(count)
    )
    (folder / "a.lvm").write_text(text)
    return File(path=folder / "a.lvm", held=len(content.columns) + 1, time=None)


def dts(folder: Path, content: Content) -> File:
    first = [["Sample Rate (Hz)", "1000"], ["Engineering Unit", *["N"] * len(content.columns)], ["Data Starts Here"]]
    rows = [*first, ["Time", *content.columns], *content.rows()]
    (folder / "a.csv").write_text("\n".join(map(",".join, rows)) + "\n")
    return File(path=folder / "a.csv", held=len(content.columns) + 1, time="Time")


def nhtsa(folder: Path, content: Content) -> File:
    place = folder / "v00001"
    place.mkdir()
    there = [instrument(k, "LC", "ROOF", "ZL", "NWT") for k in range(1, len(content.columns) + 2)]
    (place / "v00001.EV5").write_text(ev5(*there))
    for k, values in enumerate(content.columns.values(), start=1):
        pairs = zip(content.time.tolist(), np.nan_to_num(values).tolist(), strict=True)
        (place / f"v00001.{k:03d}").write_text("".join(f"{t!r}\t{v!r}\r\n" for t, v in pairs))
    return File(path=place, held=len(there), time=None, of="nhtsa")  # the last has no file


def ros2(folder: Path, content: Content) -> File:
    from rosbags.rosbag2 import Writer
    from rosbags.typesys import Stores, get_typestore

    store = get_typestore(Stores.ROS2_HUMBLE)
    kind = store.types["std_msgs/msg/Float64"]
    with Writer(folder / "bag", version=9) as writer:
        for name, values in content.columns.items():
            topic = writer.add_connection(f"/{name}", kind.__msgtype__, typestore=store)
            for k, value in enumerate(values):
                writer.write(topic, BEGAN + k * 10**6, store.serialize_cdr(kind(value), kind.__msgtype__))
    return File(path=folder / "bag", held=len(content.columns), time=None, of="/{}.data")


FORMATS: Sequence[tuple[Callable[[Path, Content], File], str]] = (
    *((csv, ""), (xlsx, "openpyxl"), (mat, ""), (hdf5, "h5py"), (netcdf, ""), (tdms, "nptdms"), (mdf, "asammdf")),
    *((mdf3, "asammdf"), (mcap, "mcap"), (iso_mme, ""), (lvm, ""), (dts, ""), (nhtsa, ""), (ros2, "rosbags")),
)
WITHOUT_GAPS = (nhtsa,)


def called(file: File, content: Content, name: str) -> str:
    at = list(content.columns).index(name)
    return {"mme": code(at), "nhtsa": f"{at + 1:03d}"}.get(file.of, file.of.format(name))


def mixed(content: Content, seed: int) -> Content:
    """The columns in another order, with one to three that nobody describes."""
    rng = np.random.default_rng(seed)
    names = ["F", "z", *(f"spare{k}" for k in range(int(rng.integers(1, 4))))]
    rng.shuffle(names)
    return Content(columns={name: content.columns.get(name, rng.normal(size=content.time.size)) for name in names})


@pytest.mark.parametrize("seed", range(3))
@pytest.mark.parametrize(("write", "library"), FORMATS, ids=[write.__name__ for write, _ in FORMATS])
def test_all_is_read_or_said_to_be_left_out(
    tmp_path: Path, write: Callable[[Path, Content], File], library: str, seed: int
) -> None:
    if library and importlib.util.find_spec(library) is None:
        pytest.skip(f"{library} is not installed: its format is not tested")
    rng = np.random.default_rng(seed)
    F, z = rng.normal(0.0, 1e3, 40), rng.normal(0.0, 0.1, 40)
    if write not in WITHOUT_GAPS:
        F[rng.integers(0, 40, 3)] = np.nan
    content = mixed(Content(columns={"F": F, "z": z}), seed)
    file = write(tmp_path, content)
    stated = write in (iso_mme, dts, nhtsa)  # they say N of every column
    about: dict[str, Any] = {
        **({file.time: "time, unit: s"} if file.time else {}),
        called(file, content, "F"): f"{FORCE}{'' if stated else ', unit: N'}",
        called(file, content, "z"): f"{SINKAGE}, unit: m{', scale: 1' if stated else ''}",
    }
    if stated:
        about[called(file, content, "z")] = "rops/force, unit: N"
    found = named(file.path, about)
    second = "rops/force" if stated else SINKAGE
    assert found.time - found.time[0] == pytest.approx(content.time, abs=1e-9)
    np.testing.assert_allclose(found[FORCE], F, rtol=1e-15)
    np.testing.assert_allclose(found[second], z, rtol=1e-15)
    spare, of = left_out(found)
    assert of == file.held
    assert len(about) + spare == file.held
    assert all(any(called(file, content, n) in note for note in found.notes) for n in content.columns if "spare" in n)


def test_twelve_formats_are_counted() -> None:
    assert len(FORMATS) >= 12

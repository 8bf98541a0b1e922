"""Small valid files of every kind that a command reads, made here; nothing of them is measured."""

from __future__ import annotations

import datetime
import io
import json
import random
import tempfile
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

import numpy as np

from rollover.spec.document import shipped_folder

Files = dict[str, bytes]
FORCE, SINKAGE, ACCELERATION = "ground/force_normal", "ground/sinkage", "chassis/acceleration_x"
TIME = np.arange(12) * 1e-3
BEGAN = 1714550400 * 10**9

# in the place of a stated value or attribute of a binary format
ODD: tuple[Any, ...] = (
    *("", "x", "N", "kN", "s", "ms", "seconds since 2020-01-01", "days since yesterday", "é\u202e", "n" * 300),
    *(0, -1, 1.0, 0.0, 1e300, -1e300, float("nan"), float("inf"), 2**31 - 1, -(2**31), 1e-320),
)

SIDE = f"""\
format: rollover-recording/1
title: a drop
conditions: {{initiation.speed: 3.0}}
uncertainty: {{vehicle.mass: 1.0}}
clock: {{zero: known, within: 0.001}}
notes: [made up]
channels:
  t: {{channel: time, unit: s}}
  F: {{channel: {FORCE}, unit: kN, noise: 0.1, cfc: 60}}
  a: {{channel: sensor/one/acceleration_x, unit: g, sensor: {{body: striker, position: [0, 0, 0.1]}}}}
"""
PROFILE = f"""\
format: rollover-profile/1
title: a bench
conditions: {{initiation.speed: 3.0}}
clock: {{zero: known}}
csv: {{delimiter: ",", decimal: ".", encoding: utf-8, names_row: 1, comment: "#"}}
channels:
  t: {{channel: time, unit: s}}
  F: {{channel: {FORCE}, unit: N, scale: 2.0, offset: 1.0}}
"""
BY_NAME = PROFILE + 'conditions_from: {name: "drop_{speed}", paths: {speed: initiation.speed}}\n'
BY_CHANNELS = f"""\
format: rollover-profile/1
channels:
  {FORCE}: {{channel: {FORCE}, unit: N}}
"""


def csv(columns: Mapping[str, Any], mark: str = ",") -> bytes:
    rows = zip(*columns.values(), strict=True)
    return "\n".join([mark.join(columns), *(mark.join(f"{v:.9g}" for v in row) for row in rows), ""]).encode()


def drop_columns() -> dict[str, Any]:
    return {"t": TIME, "F": np.sin(300 * TIME) ** 2, "a": np.cos(300 * TIME)}


def made(write: Callable[[Path], Any], name: str) -> bytes:
    """Bytes of the file that `write` makes."""
    with tempfile.TemporaryDirectory() as folder:
        write(Path(folder, name))
        return next(Path(folder).iterdir()).read_bytes()  # some writers choose the ending


def scenarios(*names: str) -> Files:
    """Shipped scenarios with the vehicles and soils that they include."""
    root = shipped_folder()
    found = {
        p.relative_to(root).as_posix(): p.read_bytes()
        for sub in ("soils", "vehicles")
        for p in (root / sub).rglob("*.yaml")
    }
    return {**found, **{f"{name}.yaml": (root / f"{name}.yaml").read_bytes() for name in names}}


BASED = b"""\
base: drop_test.yaml
title: based
vehicle: {mass: 140.0}
effects: {soil-added-mass: {}}
ground: {elements: {spacing: [0.14, 0.045]}}
"""
STUDY = b"""\
title: Drops
scenario: drop_test.yaml
simulator: drop
axes:
  - {kind: uniform, name: speed, paths: [initiation.speed], low: 1.0, high: 3.5}
  - {kind: soil-scatter, name: soil}
plan: {kind: lhs, count: 4, seed: 3}
outputs:
  - {name: ground/force_normal, limit: 3500.0}
  - {name: ground/sinkage}
"""
TABLE = b"""\
title: Drops of a table
scenario: {base: drop_test.yaml}
simulator: drop
axes:
  - {kind: column, name: speed, paths: [initiation.speed]}
plan: {kind: table, file: points.csv}
outputs: [{name: ground/force_normal}]
"""


def parquet(rng: random.Random | None = None) -> bytes:
    import pyarrow as pa
    import pyarrow.parquet as pq

    stream = io.BytesIO()
    pq.write_table(pa.table(drop_columns()), stream)
    return stream.getvalue()


# ---- binary formats, with odd values where `rng` says so


def _odd(rng: random.Random | None, usual: Any) -> Any:
    return rng.choice(ODD) if rng is not None and rng.random() < 0.3 else usual


def hdf5(rng: random.Random | None = None) -> bytes:
    import h5py

    stream = io.BytesIO()
    with h5py.File(stream, "w") as file:
        values: Any = np.arange(12, dtype="i2")
        if rng is not None and rng.random() < 0.4:
            kinds = (
                np.arange(12.0),
                np.array(["a"] * 12, object),
                np.arange(24.0).reshape(12, 2),
                np.array([True] * 12),
            )
            more = (
                np.float64(3.0),
                np.zeros((0,)),
                np.array([(1, 2.0)] * 12, "i4,f8"),
                np.arange(12, dtype="u8") + 2**63,
            )
            values = rng.choice((*kinds, *more, np.zeros((2, 3, 4)), np.array([1 + 2j] * 12), np.full(12, np.nan)))
        file["t"] = TIME if rng is None or rng.random() < 0.8 else TIME[::-1]
        file[FORCE] = values
        file["t"].attrs["units"] = _odd(rng, "s")
        for key, usual in {
            "units": "N",
            "scale_factor": 2.0,
            "add_offset": 0.0,
            "_FillValue": -1,
            "valid_min": -5,
        }.items():
            if rng is None or rng.random() < 0.6:
                value = _odd(rng, usual)
                if rng is not None and rng.random() < 0.2:
                    value = rng.choice(
                        (
                            np.array([1, 2]),
                            np.array(["a", "b"], object),
                            h5py.Empty("f8"),
                            np.bytes_(b"\xff\xfe"),
                            np.array([]),
                        )
                    )
                file[FORCE].attrs[key] = value
        if rng is not None and rng.random() < 0.4:
            file[FORCE].attrs[
                rng.choice(("dt", "wf_increment", "wf_start_time", "sample_rate", "missing_value", "gain", "_Unsigned"))
            ] = rng.choice(ODD)
        file["t"].make_scale("t")
        if len(file[FORCE].shape):
            file[FORCE].dims[0].attach_scale(file["t"])
        group = file.create_group("run")
        group.attrs["title"] = _odd(rng, "a")
        group["again"] = h5py.SoftLink("/t" if rng is None else rng.choice(("/t", "/run", "/run/again", "/nowhere")))
        group["records"] = np.array([(0.0, 1.0)] * 12, [("t", "f8"), ("F", "f4")])
    return stream.getvalue()


def xlsx(rng: random.Random | None = None) -> bytes:
    """A workbook of somebody else: names, units, rows, and a sheet of words."""
    from tests.rollover.published_files import write_book

    rows: list[list[Any]] = [["t", "F"], ["s", "N"], *([float(t), 100.0 * float(t)] for t in TIME)]
    sheets: dict[str, list[list[Any]]] = {"data": rows, "notes": [["made up"]]}
    if rng is not None:
        row = rng.choice(rows)
        dates = (datetime.datetime(2024, 5, 1), datetime.time(10, 0), datetime.timedelta(days=4000))
        row[rng.randrange(2)] = rng.choice((None, "x", "", True, "=1+1", "=1/0", "#N/A", 10**300, *dates, *ODD[5:14]))
        if rng.random() < 0.3:
            sheets[rng.choice(("about", "channels", "data2", "é"))] = [["format: rollover-recording/1"], *rows[:3]]
        if rng.random() < 0.2:
            del rows[rng.randrange(len(rows)) :]
    return made(lambda path: write_book(path, sheets), "a.xlsx")


def netcdf(rng: random.Random | None = None) -> bytes:
    from scipy.io import netcdf_file

    def write(path: Path) -> None:
        with netcdf_file(path, "w") as file:
            file.createDimension("time", 12)
            t = file.createVariable("time", "d", ("time",))
            t[:] = TIME
            t.units = str(_odd(rng, "s")).encode("utf-8", "replace") or b" "
            f = file.createVariable("F", "h", ("time",))
            f[:] = np.arange(12)
            f.units = str(_odd(rng, "N")).encode("utf-8", "replace") or b" "
            for key, usual in {"scale_factor": 2.0, "add_offset": 0.0, "valid_max": 20.0}.items():
                value = _odd(rng, usual)
                setattr(f, key, (value.encode() or b" ") if isinstance(value, str) else float(value))

    return made(write, "a.nc")


def mat(rng: random.Random | None = None) -> bytes:
    from scipy.io import savemat

    struct = np.zeros((1, 2), dtype=[("t", "O"), ("F", "O")])
    struct[0, 0], struct[0, 1] = (TIME, 2 * TIME), (TIME + 1, 3 * TIME)
    things: dict[str, Any] = {"t": TIME, "F": np.arange(12.0), "data": np.stack([TIME, 2 * TIME], 1), "log": struct}
    if rng is not None:
        kinds = ("text", np.zeros((0, 3)), np.array([1 + 1j] * 12), np.array([["a"], [1.0]], object), {"a": {"b": 1}})
        more = (
            np.arange(12, dtype="u8") + 2**63,
            np.array([True] * 12),
            np.nan,
            np.zeros((2, 2, 2)),
            np.full(12, np.inf),
        )
        things[rng.choice(("t", "F", "x", "log", "data"))] = rng.choice((*kinds, *more))
    return made(lambda path: savemat(path, things, do_compression=rng is not None and rng.random() < 0.3), "a.mat")


def tdms(rng: random.Random | None = None) -> bytes:
    from nptdms import ChannelObject, GroupObject, RootObject, TdmsWriter

    how: dict[str, Any] = {"wf_increment": 1e-3, "unit_string": "N", "wf_start_offset": 0.0}
    how["wf_start_time"] = np.datetime64("2024-05-01T10:00:00", "us")
    if rng is not None:
        key = rng.choice(
            (*how, "NI_Number_Of_Scales", "wf_xname", "wf_xunit_string", "wf_samples", "NI_Scaling_Status")
        )
        how[key] = rng.choice((*ODD, np.datetime64("1600-01-01", "us"), np.datetime64("2400-01-01", "us")))
        if rng.random() < 0.3:
            scale = {
                "Scale_Type": "Linear",
                "Linear_Slope": 2.0,
                "Linear_Y_Intercept": 1.0,
                "Linear_Input_Source": 0xFFFFFFFF,
            }
            how |= {"NI_Number_Of_Scales": 1, **{f"NI_Scale[0]_{k}": _odd(rng, v) for k, v in scale.items()}}
    kinds: tuple[Any, ...] = (np.arange(12, dtype="i2"),)
    if rng is not None and rng.random() < 0.3:
        kinds = (
            np.arange(12.0),
            np.array(["a"] * 12),
            np.full(12, np.nan),
            np.zeros(0),
            np.array([True] * 12),
            np.arange(12).astype("M8[us]"),
        )
    values = rng.choice(kinds) if rng is not None else kinds[0]
    stream = io.BytesIO()
    with TdmsWriter(stream) as file:
        group = "g" if rng is None else rng.choice(("g", "", "../g", "n" * 300, "a/b", "it's"))
        file.write_segment(
            [
                RootObject(properties={"name": "a"}),
                GroupObject(group),
                ChannelObject(group, FORCE, values, properties=how),
            ]
        )
        file.write_segment(
            [ChannelObject(group, SINKAGE, np.arange(12.0), properties={"wf_increment": 1e-3, "unit_string": "mm"})]
        )
    return stream.getvalue()


def mdf(rng: random.Random | None = None) -> bytes:
    from asammdf import MDF, Signal

    version = "4.10" if rng is None else rng.choice(("4.10", "3.30", "4.00"))
    conversion: Any = None
    values: Any = np.arange(12, dtype="i2")
    if rng is not None:
        linear = {"a": _odd(rng, 2.0), "b": _odd(rng, 1.0)}
        table = {"val_0": 0, "text_0": b"off", "val_1": 1, "text_1": b"on", "default_addr": b"x"}
        ranges = {"lower_0": 0, "upper_0": 9, "phys_0": _odd(rng, 1.0), "default": 0.0}
        formula = {"formula": rng.choice(("X1 * 2", "X1 / 0", "nope(X1)", "log(X1)"))}
        conversion = rng.choice((None, linear, table, ranges, formula))
        if conversion is not None:
            conversion = {k: (v if not isinstance(v, str) or k == "formula" else 1.0) for k, v in conversion.items()}
        values = rng.choice(
            (values, np.arange(12.0), np.array([b"a"] * 12), np.full(12, np.nan), np.arange(12, dtype="u8") + 2**63)
        )

    def write(path: Path) -> None:
        with MDF(version=version) as file:
            unit = str(_odd(rng, "N"))
            file.append([Signal(values, TIME, name=FORCE, unit=unit, conversion=conversion)], acq_name="one")
            file.append([Signal(np.arange(12.0), TIME, name=SINKAGE, unit="m")], acq_name="two")
            file.save(path, overwrite=True)

    return made(write, "a.mf4")


def mcap(rng: random.Random | None = None) -> bytes:
    from mcap.writer import Writer

    stream = io.BytesIO()
    writer = Writer(stream)
    writer.start(**({} if rng is None else {"profile": rng.choice(("", "ros1", "ros2"))}))
    encoding = "json" if rng is None else rng.choice(("json", "json", "json", "cdr", "ros1", "protobuf", "é"))
    schema = writer.register_schema(name="x", encoding="jsonschema", data=b"{}")
    channel = writer.register_channel(topic="/cell", message_encoding=encoding, schema_id=schema)
    for k in range(6):
        stamp = BEGAN + k * 1_000_000
        what: Any = {
            "force": float(k),
            "effort": [k, 2.0],
            "header": {"stamp": {"secs": 1714550400, "nsecs": k * 10**6}},
        }
        if rng is not None and rng.random() < 0.4:
            stamp = rng.choice((0, 2**63 - 1, 2**63, 2**64 - 1, BEGAN, 10**19))
        if rng is not None and rng.random() < 0.5:
            key = rng.choice(tuple(what))
            what[key] = rng.choice(
                (*ODD, [], {}, None, [[1]], {"secs": "x", "nsecs": None}, 10**400, [float(k)] * k, True)
            )
        data = json.dumps(what).encode()
        if rng is not None and rng.random() < 0.1:
            data = rng.choice((b"", b"{", b"\xff" * 9, b"1", b"[]", b'"x"', b"9" * 5000, b'{"force": 1e400}'))
        writer.add_message(channel_id=channel, log_time=stamp, publish_time=stamp, data=data)
    writer.finish()
    return stream.getvalue()


def ide(rng: random.Random | None = None) -> bytes:
    """The head of such a file, and elements whose lengths may be wrong; no recorder's numbers."""
    head = b"\x42\x82\x84mide"
    data = b"\x1a\x45\xdf\xa3" + bytes([0x80 | len(head)]) + head
    for _ in range(0 if rng is None else rng.randrange(1, 6)):
        assert rng is not None
        body = rng.randbytes(rng.randrange(20))
        data += (
            rng.choice((b"\x52\x70", b"\xa1", b"\x50\x03", b"\xec", b"\x1f\x43\xb6\x75"))
            + bytes([0x80 | len(body)])
            + body
        )
    return data

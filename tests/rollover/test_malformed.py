"""Sixty malformed recordings: each refused in one line, quickly, in little memory, and nothing written."""

from __future__ import annotations

import gzip
import io
import os
import struct
import subprocess
import sys
import tarfile
import zipfile
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

GOOD = "t,F\n0,1\n1,2\n2,3\n"
SIDE = """\
format: rollover-recording/1
channels:
  t: {channel: time, unit: s}
  F: {channel: ground/force_normal, unit: kN}
"""
MME = """\
Channel code                :10ROPS000000FOZC
Unit                        :N
Reference channel           :implicit
Sampling interval           :0.001
Number of samples           :3
1
2
3
"""
PROFILE = "format: rollover-profile/1\nrate: 100\nchannels:\n  F: {channel: ground/force_normal, unit: N}\n"


def csv(table: str | bytes, side: str | bytes = SIDE) -> Callable[[Path], str]:
    def make(folder: Path) -> str:
        (folder / "a.csv").write_bytes(table.encode() if isinstance(table, str) else table)
        if side:
            (folder / "a.yaml").write_bytes(side.encode() if isinstance(side, str) else side)
        return "a.csv"

    return make


def side(old: str, new: str) -> Callable[[Path], str]:
    return csv(GOOD, SIDE.replace(old, new))


def raw(name: str, data: bytes) -> Callable[[Path], str]:
    def make(folder: Path) -> str:
        (folder / name).write_bytes(data)
        (folder / "a.yaml").write_text(SIDE)
        (folder / "p.yaml").write_text(PROFILE)
        return name

    return make


def parquet(change: Callable[[bytearray], None] | None = None, **columns: object) -> Callable[[Path], str]:
    def make(folder: Path) -> str:
        import pyarrow as pa
        import pyarrow.parquet as pq

        stream = io.BytesIO()
        pq.write_table(pa.table(columns or {"t": [0.0, 1.0], "F": [1.0, 2.0]}), stream)
        data = bytearray(stream.getvalue())
        if change:
            change(data)
        return raw("a.parquet", bytes(data))(folder)

    return make


def middle(data: bytearray) -> None:
    data[4 : len(data) // 2] = b"\xff" * (len(data) // 2 - 4)


def cut(data: bytearray) -> None:
    del data[len(data) // 2 :]


def constant(rows: int) -> Callable[[Path], str]:
    """Few bytes that stand for very many equal values."""

    def make(folder: Path) -> str:
        import pyarrow as pa
        import pyarrow.parquet as pq

        schema = pa.schema([("t", pa.float64()), ("F", pa.float64())])
        with pq.ParquetWriter(folder / "a.parquet", schema) as writer:
            zeros = pa.array(np.zeros(rows // 20))
            for _ in range(20):
                writer.write_table(pa.table([zeros, zeros], schema=schema))
        (folder / "a.yaml").write_text(SIDE)
        return "a.parquet"

    return make


def mme(text: str = MME, code: str = "", **more: bytes) -> Callable[[Path], str]:
    def make(folder: Path) -> str:
        with zipfile.ZipFile(folder / "a.zip", "w", zipfile.ZIP_DEFLATED) as archive:
            archive.writestr("a.mme", "Title :x\n")
            archive.writestr("Channel/a.001", text.replace("10ROPS000000FOZC", code) if code else text)
            for name, data in more.items():
                archive.writestr(f"Channel/{name}.002", data)
        return "a.zip"

    return make


def bomb(folder: Path) -> str:
    return mme(n=MME.encode() + b"0\n" * 2_000_000)(folder)


def tar_bomb(folder: Path) -> str:
    with gzip.open(folder / "a.tar.gz", "wb", 1) as packed:
        info = tarfile.TarInfo("Channel/a.001")
        info.size = 10 * 2**30
        packed.write(info.tobuf() + bytes(1 << 20))
    return "a.tar.gz"


def mat(folder: Path) -> str:
    from scipy.io import savemat

    savemat(folder / "a.mat", {"F": np.zeros(4)})
    data = bytearray((folder / "a.mat").read_bytes())
    at = data.index(struct.pack("<iiii", 5, 8, 1, 4))
    data[at : at + 16] = struct.pack("<iiii", 5, 8, 1, 10 * 2**27)
    return raw("a.mat", bytes(data))(folder)


def hdf5(folder: Path) -> str:
    h5py = pytest.importorskip("h5py", reason="h5py is not installed: HDF5 is not tested")
    with h5py.File(folder / "a.h5", "w") as file:
        file.create_dataset("F", shape=(2**31,), chunks=(2**16,), dtype="f8", fillvalue=1.0)
    return raw("a.h5", (folder / "a.h5").read_bytes())(folder)


def is_folder(folder: Path) -> str:
    (folder / "a.csv").mkdir()
    return "a.csv"


def loop(folder: Path) -> str:
    (folder / "a.csv").symlink_to(folder / "a.csv")
    return "a.csv"


def sidecar_loop(folder: Path) -> str:
    (folder / "a.csv").write_text(GOOD)
    (folder / "a.yaml").symlink_to(folder / "a.yaml")
    return "a.csv"


def pipe(folder: Path) -> str:
    os.mkfifo(folder / "a.csv")
    (folder / "a.yaml").write_text(SIDE)
    return "a.csv"


LAUGHS = "a0: &a0 [x, x, x, x, x, x, x, x, x]\n" + "".join(
    f"a{i}: &a{i} [{', '.join([f'*a{i - 1}'] * 9)}]\n" for i in range(1, 9)
)

CASES: dict[str, tuple[Callable[[Path], str], str]] = {
    "0 bytes": (csv(""), "empty"),
    "only comments": (csv("# a\n# b\n"), "empty"),
    "only a header": (csv("t,F\n"), "empty"),
    "time backwards": (csv("t,F\n0,1\n2,2\n1,3\n"), "a.csv:4: time: runs backwards, got 1.0 after 2.0"),
    "backwards below comments": (csv("#\nt,F\n#\n0,1\n\n-1,2\n"), "a.csv:6: time: runs backwards"),
    "repeated stamp": (csv("t,F\n0,1\n0,2\n"), "a.csv:3: time: repeated stamp"),
    "no stamp": (csv("t,F\n0,1\n,2\n"), "a.csv:3: time: not a finite number"),
    "infinite stamp": (csv("t,F\n0,1\ninf,2\n"), "a.csv:3: time: not a finite number"),
    "infinite value": (csv("t,F\n0,1\n1,-inf\n"), "a.csv:3: column F: not a finite number"),
    "all gaps": (csv("t,F\n0,\n1,NaN\n"), "a.csv:2: column F: all gaps"),
    "words": (csv("t,F\n0,1\n1,high\n"), "a.csv:3: column F: not a number, got 'high'"),
    "formula": (csv("t,F\n0,1\n1,=1+1\n"), "a.csv:3: column F: not a number, got '=1+1'"),
    "command": (csv("t,F\n0,1\n1,=cmd|'/c calc'!A1\n"), "a.csv:3: column F: not a number"),
    "hexadecimal": (csv("t,F\n0,1\n1,0x10\n"), "a.csv:3: column F: not a number"),
    "underscore": (csv("t,F\n0,1\n1,1_000\n"), "a.csv:3: column F: not a number"),
    "date": (csv("t,F\n2020-01-01,1\n"), "a.csv:2: column t: not a number"),
    "unit in a cell": (csv("t,F\n0,1 N\n"), "a.csv:2: column F: not a number, got '1 N'"),
    "true": (csv("t,F\n0,true\n"), "a.csv:2: column F: not a number"),
    "decimal comma": (csv("t,F\n0,1,5\n1,2,5\n"), "a.csv:2: got 3 cells; 2 are needed, one a column; a decimal comma"),
    "semicolons": (csv("t;F\n0;1\n"), "no such column in a.csv"),
    "decimal comma in quotes": (csv('t,F\n0,"1,5"\n'), "a.csv:2: column F: not a number, got '1,5'"),
    "short row": (csv("t,F\n0,1\n1\n"), "a.csv:3: got 1 cells"),
    "cut off": (csv("t,F,G\n0,1,2\n1,2"), "a.csv:3: got 2 cells"),
    "column twice": (csv("t,F,F\n0,1,2\n"), "a.csv:1: column given twice, got 'F'"),
    "column missing": (csv("t,G\n0,1\n"), "a.yaml:4: channels.F: no such column in a.csv"),
    "UTF-16": (csv(GOOD.encode("utf-16")), "a.csv:1: not UTF-8 text, got UTF-16"),
    "UTF-16 without a mark": (csv(GOOD.encode("utf-16-le")), "a.csv:1: not a text file, got a NUL byte"),
    "UTF-32": (csv(GOOD.encode("utf-32")), "a.csv:1: not UTF-8 text, got UTF-32"),
    "mark in the middle": (csv(b"t,F\n0,1\n\xef\xbb\xbf1,2\n"), "a.csv:3: not a text file, got a byte order mark"),
    "NUL in a number": (csv(b"t,F\n0,1\n1,\x002\n"), "a.csv:3: not a text file, got a NUL byte"),
    "Latin-1": (csv(b"t,F,\xfc\n0,1,2\n"), "a.csv:1: not utf-8 text, got byte 0xfc; csv.encoding of a profile"),
    "binary junk": (csv(bytes(range(256)) * 400), "a.csv:1: not"),
    "one endless line": (csv(b"t," * 500_000), "a.csv:1: not a table, got a line of more than"),
    "endless later line": (csv("t,F\n0,1\n" + "1" * 3_000_000), "a.csv"),
    "folder": (is_folder, "a folder"),
    "link to itself": (loop, "a.csv: cannot be read"),
    "sidecar links to itself": (sidecar_loop, "a.csv: no sidecar"),
    "pipe": (pipe, "a.csv: not a plain file"),
    "no sidecar": (csv(GOOD, ""), "a.csv: no sidecar, got no a.yaml beside it; write one, or say with --profile how"),
    "sidecar of 0 bytes": (csv(GOOD, b"\n"), "a.yaml:1: empty"),
    "sidecar of another format": (side("recording/1", "recording/2"), "a.yaml:1: format: not one of the choices"),
    "sidecar is a list": (csv(GOOD, "- 1\n"), "a.yaml:1: not a mapping"),
    "deep YAML": (csv(GOOD, "a: " + "[" * 5000 + "]" * 5000), "a.yaml:1: nested too deeply"),
    "very long YAML": (csv(GOOD, "a: 1\n" * 100_000), "a.yaml: too long"),
    "aliases of aliases": (csv(GOOD, LAUGHS + SIDE), "a.yaml:"),
    "tag": (csv(GOOD, SIDE + "title: !!python/object:os.system x\n"), "tag"),
    "wrong unit": (side("kN", "bar"), "a.yaml:4: channels.F.unit: unit does not fit ground/force_normal, got 'bar'"),
    "gram for a force": (side("kN", "g"), "a.yaml:4: channels.F.unit: unit does not fit"),
    "unknown channel": (side("ground/force_normal", "ground/forse_normal"), "did you mean 'ground/force_normal'"),
    "channel twice": (csv(GOOD, SIDE + "  G: {channel: ground/force_normal, unit: N}\n"), "second column of"),
    "no unit": (side(", unit: kN", ""), "a.yaml:4: channels.F: unit: missing"),
    "no time": (side("  t: {channel: time, unit: s}\n", ""), "a.csv: no time"),
    "negative noise": (side("unit: kN", "unit: kN, noise: -1"), "a.yaml:4: channels.F.noise: out of bounds"),
    "Parquet cut off": (parquet(cut), "a.parquet: cannot be read"),
    "Parquet spoilt": (parquet(middle), "a.parquet: cannot be read"),
    "Parquet of words": (parquet(t=[0.0, 1.0], F=["a", "b"]), "column F: not numbers, got string"),
    "Parquet backwards": (parquet(t=[1.0, 0.0], F=[1.0, 2.0]), "time: runs backwards"),
    "Parquet of much in little": (constant(4_000_000), "a.parquet: claims too much"),
    "MME wrong code": (mme(code="10ROPS"), "a.001: Channel code: got '10ROPS'"),
    "MME unknown code": (mme(code="10XXXX000000XXXX"), "no column is a channel"),
    "MME says 10 GB": (mme(MME.replace(":3", ":1250000000")), "Number of samples: says 1250000000, got 3"),
    "MME with a word": (mme(MME.replace("\n2\n", "\n=2+2\n")), "a.001: line 7: not a number, got '=2+2'"),
    "MME without a clock": (mme(MME.replace("0.001", "NOVALUE")), "Sampling interval: got 'NOVALUE'"),
    "MME zip bomb": (bomb, "unpacks to"),
    "MME tar bomb": (tar_bomb, "unpacks to 10737418240 bytes"),
    "MME cut off": (raw("a.zip", b"PK\x03\x04" + bytes(50)), "a.zip: neither a folder nor a readable zip or tar"),
    "MAT says 10 GB": (mat, "a.mat: F: claims too much, got 10.74 GB"),
    "MAT junk": (raw("a.mat", b"MATLAB 5.0 MAT-file" + bytes(200)), "a.mat: not a readable MATLAB 5 file"),
    "TDMS junk": (raw("a.tdms", b"TDSm" + b"\xff" * 100), "a.tdms: no column is a channel, got none"),
    "HDF5 says 16 GB": (hdf5, "a.h5: F: claims too much, got 34.36 GB"),
    "HDF5 junk": (raw("a.h5", b"\x89HDF\r\n\x1a\n" + b"\xff" * 100), "a.h5: not a readable HDF5 file"),
    "MCAP junk": (raw("a.mcap", b"\x89MCAP0\r\n" + b"\xff" * 100), "a.mcap: not a readable MCAP"),
    "unknown ending": (raw("a.xyz", b"hello"), "channels.F: no such column in a.xyz, got 'F'; the file holds: hello"),
    "unknown ending, no text": (raw("a.xyz", b"F\n1\n\0\n"), "a.xyz:3: not a text file, got a NUL byte"),
    "missing": (lambda folder: "b.csv", "b.csv: no such file"),
}

ASK = """
import sys, time, resource
sys.path[:0] = {path!r}
from rollover.system.errors import InputError
from rollover.recording.importers import read_recording
import pyarrow.csv, pyarrow.parquet, scipy.io, numpy
try:
    import nptdms, h5py, mcap.reader
except ImportError:
    pass
def largest():
    try:  # ru_maxrss of a child begins with what its parent held
        return next(int(x.split()[1]) for x in open("/proc/self/status") if x.startswith("VmHWM")) // 1024
    except OSError:
        return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss // 1024
for line in sys.stdin:
    folder, name, profile = line.rstrip("\\n").split("\\t")
    import os
    os.chdir(folder)
    spent = float("inf")
    for _ in range(2):  # the first reading also imports
        begin = time.process_time()
        try:
            read_recording(name, profile=profile or None)
            said = ["read"]
        except InputError as e:
            said = str(e).splitlines()
        spent = min(spent, time.process_time() - begin)
    print(len(said), spent, largest(), said[0], sep="\\t", flush=True)
"""


@pytest.fixture(scope="module")
def asked(tmp_path_factory: pytest.TempPathFactory) -> dict[str, tuple[int, float, int, str, list[str], list[str]]]:
    """Every case read in one other process, whose largest memory is that of all of them."""
    names, lines, before = [], [], {}
    for name, (make, _) in CASES.items():
        folder = tmp_path_factory.mktemp("case")
        try:
            file = make(folder)
        except pytest.skip.Exception:
            continue
        profile = "p.yaml" if (folder / "p.yaml").exists() and not file.endswith((".zip", ".parquet", ".tdms")) else ""
        names.append(name)
        before[name] = (folder, sorted(os.listdir(folder)))
        lines.append(f"{folder}\t{file}\t{profile}\n")
    done = subprocess.run(
        [sys.executable, "-c", ASK.format(path=[p for p in sys.path if p])],
        input="".join(lines),
        capture_output=True,
        text=True,
        timeout=120,
    )
    answers = [line.split("\t") for line in done.stdout.splitlines()]
    assert len(answers) == len(names), done.stderr[-2000:]
    return {
        name: (int(a), float(b), int(c), d, before[name][1], sorted(os.listdir(before[name][0])))
        for name, (a, b, c, d) in zip(names, answers, strict=True)
    }


@pytest.mark.parametrize("name", CASES)
def test_refused_in_one_line(asked: dict[str, tuple[int, float, int, str, list[str], list[str]]], name: str) -> None:
    if name not in asked:
        pytest.skip(f"{name}: the library of this format is not installed")
    count, seconds, megabytes, said, before, after = asked[name]
    assert CASES[name][1] in said
    assert said != "read"
    assert count == 1
    assert seconds < 1.0  # of the processor, once the libraries are there
    assert megabytes < 500
    assert before == after

"""Every reader of the tables on every kind of damage: one whole line for each fault, whatever a library raises."""

from __future__ import annotations

import json
import random
import struct
import subprocess
import sys
import tempfile
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from rollover.comparison.run_pair import read as result
from rollover.recording import Recording, read_parquet
from rollover.recording.importers import COLLECTIONS, importers, read_recording, write_recording
from rollover.recording.importers.importer import Collection, Importer
from rollover.system import boundary
from rollover.system.errors import Fault, InputError, has_cure
from tests.fuzz import seeds, sets, texts
from tests.fuzz.oracle import is_whole
from tests.rollover.foreign import needs

for library in ("nptdms", "asammdf", "h5py", "mcap", "idelib", "openpyxl"):
    needs(library)

Files = dict[str, bytes]


def workbook() -> bytes:
    """A drop as `rollover export` writes it."""
    with tempfile.TemporaryDirectory() as folder:
        columns = {"ground/sinkage": np.sin(seeds.TIME), "ground/force_normal": np.cos(seeds.TIME)}
        drop = Recording(title="a drop", time=seeds.TIME, channels=columns)
        write_recording(drop, path := Path(folder, "a.xlsx"))
        return path.read_bytes()


# what each reader reads: the file that is handed over, and all that stands beside it
VALID: dict[str, tuple[str, Callable[[], Files]]] = {
    "plain": ("a.csv", lambda: {"a.csv": seeds.csv(seeds.drop_columns()), "a.yaml": seeds.SIDE.encode()}),
    "csv": ("a.txt", lambda: {"a.txt": seeds.csv(seeds.drop_columns())}),
    "nhtsa": ("v00001", lambda: {f"v00001/{k}": v for k, v in texts.nhtsa().items()}),
    "iso-mme": ("a.zip", lambda: {"a.zip": texts.zipped(texts.mme_members())}),
    "mat": ("a.mat", lambda: {"a.mat": seeds.mat()}),
    "xlsx": ("a.xlsx", lambda: {"a.xlsx": workbook()}),
    "tdms": ("a.tdms", lambda: {"a.tdms": seeds.tdms()}),
    "mdf": ("a.mf4", lambda: {"a.mf4": seeds.mdf()}),
    "hdf5": ("a.h5", lambda: {"a.h5": seeds.hdf5()}),
    "netcdf": ("a.nc", lambda: {"a.nc": seeds.netcdf()}),
    "mcap": ("a.mcap", lambda: {"a.mcap": seeds.mcap()}),
    "ide": ("a.ide", lambda: {"a.ide": seeds.ide(random.Random(1))}),
    "lvm": ("a.lvm", lambda: {"a.lvm": texts.lvm()}),
    "dts": ("a.csv", lambda: {"a.csv": texts.dts()}),
    "cube-tosses": ("set", lambda: {f"set/{k}": v for k, v in sets.cube().items()}),
    "elbow-tosses": ("set", lambda: {f"set/{k}": v for k, v in sets.elbow().items()}),
    "falling-balls": ("set", lambda: {f"set/{k}": v for k, v in sets.balls().items()}),
    "soil-penetrometer": ("set", lambda: {f"set/{k}": v for k, v in sets.penetrometer().items()}),
    "cone-drops": ("set", lambda: {f"set/{k}": v for k, v in sets.cones().items()}),
    "impack": ("set", lambda: {"set/2mps_sphere_1.ide": seeds.ide(random.Random(1))}),
}


def flipped(data: bytes) -> bytes:
    rng = random.Random(len(data))
    made = bytearray(data)
    for _ in range(max(1, len(data) // 50)):
        made[rng.randrange(len(data))] ^= 1 << rng.randrange(8)
    return bytes(made)


def largest_numbers(data: bytes) -> bytes:
    """Counts and lengths near the head at the ends of their range."""
    at = min(64, len(data) // 3)
    return data[:at] + struct.pack("<QQ", 2**64 - 1, 2**63) + data[at + 16 :]


DAMAGE: dict[str, Callable[[bytes], bytes]] = {
    "truncated by half": lambda data: data[: len(data) // 2],
    "truncated by a byte": lambda data: data[:-1],
    "emptied": lambda data: b"",
    "zeros": lambda data: bytes(len(data)),
    "bytes flipped": flipped,
    "wrong magic": lambda data: b"\x7fELF" + data[4:],
    "of another kind": lambda data: b"\x89HDF\r\n\x1a\n" + data[8:],
    "largest numbers": largest_numbers,
    "a number of 400 digits": lambda data: data.replace(b"0.001", b"9" * 400).replace(b":3", b":" + b"9" * 400),
    "a number of 5,000 digits": lambda data: data.replace(b"1", b"9" * 5000, 3),
    "a name of 300 characters": lambda data: data.replace(b"F", b"n" * 300, 2),
    "no text": lambda data: data.replace(b"e", b"\xe9\x00"),
    "repeated": lambda data: data + data,
}


def test_every_reader_is_tried() -> None:
    assert set(VALID) == {*importers(), *COLLECTIONS}


def read(name: str, path: Path) -> Iterator[object]:
    if name in COLLECTIONS:
        yield from COLLECTIONS[name].read(path, ["*"])
    else:
        yield read_recording(path, kind=name)


@pytest.mark.parametrize("damage", DAMAGE)
@pytest.mark.parametrize("name", VALID)
def test_damage_is_read_or_refused_in_whole_lines(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, name: str, damage: str
) -> None:
    monkeypatch.chdir(tmp_path)
    handed, make = VALID[name]
    files = make()
    for spoilt in files:
        for file, data in files.items():
            Path(file).parent.mkdir(exist_ok=True)
            Path(file).write_bytes(DAMAGE[damage](data) if file == spoilt else data)
        try:
            list(read(name, Path(handed)))
        except InputError as e:
            for line in str(e).splitlines():
                assert is_whole(line) == "", line


@pytest.mark.parametrize("name", [n for n in VALID if n not in ("ide", "impack", "csv", "mat", "mcap", "netcdf")])
def test_what_is_damaged_was_whole(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, name: str) -> None:
    monkeypatch.chdir(tmp_path)
    handed, make = VALID[name]
    for file, data in make().items():
        Path(file).parent.mkdir(exist_ok=True)
        Path(file).write_bytes(data)
    assert list(read(name, Path(handed)))


# ---- whatever a reader raises, those of other packages too

RAISED: list[Exception] = [
    ValueError("bad header"),
    ValueError("setting an array element with a sequence. The requested array has an inhomogeneous shape after 1"),
    ValueError(),
    KeyError("x"),
    TypeError("'NoneType' object is not subscriptable"),
    OverflowError("Python int too large to convert to C long"),
    RecursionError("maximum recursion depth exceeded"),
    ZeroDivisionError("division by zero"),
    AssertionError(),
    UnicodeDecodeError("utf-8", b"\xff", 0, 1, "invalid start byte"),
    struct.error("unpack requires a buffer of 4 bytes"),
    LookupError("unknown encoding: x"),
    EOFError(),
    OSError(22, "Invalid argument"),
    NotImplementedError("no such compression"),
    MemoryError("Unable to allocate 217. GiB for an array"),
]


@pytest.mark.parametrize("raised", RAISED, ids=lambda e: type(e).__name__)
def test_whatever_a_reader_raises(tmp_path: Path, raised: Exception) -> None:
    def trips(path: Path, *_: Any) -> Any:
        raise raised

    path = tmp_path / "a.lab"
    path.write_text("x")
    lab = Importer(name="lab", meaning="a lab's own", sniff=trips, read=trips, tests=trips, read_test=trips)
    shelf = Collection(name="set", meaning="", citation="", licence="", where="", read=trips)
    assert lab.sniff(path) is False
    assert lab.tests is not None
    assert lab.read_test is not None
    for call in (
        lambda: lab.read(path, None),
        lambda: lab.tests and lab.tests(path),
        lambda: lab.read_test and lab.read_test(path, None, "a"),
        lambda: shelf.read(path, ["*"]),
    ):
        with pytest.raises(InputError) as caught:
            call()
        assert is_whole(str(caught.value)) == ""
        assert str(caught.value).startswith(f"{path}: ")


def test_a_librarys_words_are_kept_and_a_full_disk_stays_one(tmp_path: Path) -> None:
    said = r"a\.x: not a readable X file: bad header; a whole, undamaged one is needed"
    with pytest.raises(InputError, match=said), boundary.reading("a.x", "X file"):
        raise ValueError("bad header.\nmore")
    with pytest.raises(OSError, match="No space"), boundary.reading("a.x", "X file"):
        raise OSError(28, "No space left on device")


def test_a_fault_without_a_cure_gets_that_of_its_entry_point() -> None:
    said = r"a\.x: line 3: nothing there; another file"
    with pytest.raises(InputError, match=said), boundary.reading("a.x", "X file", cure="another file"):
        raise InputError(Fault(file="a.x", message="line 3: nothing there"))
    assert not has_cure("line 3: nothing there")


# ---- results of runs


@pytest.fixture(scope="module")
def run_folder(tmp_path_factory: pytest.TempPathFactory) -> Files:
    from rollover.assessment import results
    from rollover.scenario import load
    from tests.rollover.example import Peak, run_of

    folder = tmp_path_factory.mktemp("run") / "one"
    results.write(folder, run_of(load("drop_test")), [Peak()])  # type: ignore[list-item]
    return {p.name: p.read_bytes() for p in folder.iterdir()}


ODD: list[Any] = [None, True, "", -1, 1e300, 10**400, float("nan"), [], {}, [None], {"a": 1}, "n" * 300]


def put(folder: Path, files: Files) -> Path:
    folder.mkdir()
    for name, data in files.items():
        (folder / name).write_bytes(data)
    return folder


def test_each_value_of_a_run_json_may_be_of_any_type(tmp_path: Path, run_folder: Files) -> None:
    from rollover.comparison.run_pair import pair, summary

    whole = json.loads(run_folder["run.json"])
    good = result(put(tmp_path / "good", run_folder))
    refused = 0
    for key in whole:
        for i, odd in enumerate(ODD):
            text = json.dumps({**whole, key: odd})
            folder = put(tmp_path / f"{key}{i}", {**run_folder, "run.json": text.encode()})
            said = ""
            try:
                summary(pair(good, result(folder)))
            except InputError as e:
                said = str(e)
            refused += bool(said)
            assert not said or is_whole(said) == "", said
    assert refused > 60


@pytest.mark.parametrize("key", ["title", "source", "conditions", "noise", "cfc", "clock", "sensors", "notes"])
def test_metadata_of_other_types(tmp_path: Path, run_folder: Files, key: str) -> None:
    import pyarrow.parquet as pq

    (tmp_path / "a.parquet").write_bytes(run_folder["channels.parquet"])
    table = pq.read_table(tmp_path / "a.parquet")
    about = json.loads(table.schema.metadata[b"rollover"])
    right = type(about[key])
    for i, odd in enumerate(ODD):
        made = table.replace_schema_metadata({"rollover": json.dumps({**about, key: odd})})
        pq.write_table(made, tmp_path / f"{i}.parquet")
        said = ""
        try:
            read_parquet(tmp_path / f"{i}.parquet")
        except InputError as e:
            said = str(e)
        assert said or isinstance(odd, right), odd
        assert not said or is_whole(said) == "", said


def test_columns_of_other_types(tmp_path: Path, run_folder: Files) -> None:
    import pyarrow as pa
    import pyarrow.parquet as pq

    (tmp_path / "a.parquet").write_bytes(run_folder["channels.parquet"])
    table = pq.read_table(tmp_path / "a.parquet")
    n = table.num_rows
    columns = [["a"] * n, [{"a": 1}] * n, [[1.0]] * n, [b"\xff"] * n, [None] * n]
    for i, values in enumerate(columns):
        for at in (0, 1):
            made = table.set_column(at, table.column_names[at], pa.array(values))
            pq.write_table(made, tmp_path / f"{i}{at}.parquet")
            said = ""
            try:
                read_parquet(tmp_path / f"{i}{at}.parquet")
            except InputError as e:
                said = str(e)
            assert said or values[0] is None
            assert not said or is_whole(said) == "", said


# ---- the command line


@pytest.mark.parametrize(
    ("words", "says"),
    [
        (["run"], "missing argument"),
        (["rn"], "no such command"),
        (["run", "drop_test", "--jbs", "3"], "no such option: --jbs"),
        (["synthesize", "drop_test", "--rate", "fast"], "invalid value for '--rate'"),
        (["synthesize", "drop_test", "--rate", "9" * 400], "invalid value for '--rate'"),
        (["synthesize", "drop_test", "--seed", "9" * 5000], "invalid value for '--seed'"),
        (["check", "n" * 300], "cannot be read: file name too long"),
        (["check", "soil.yaml"], "kind: "),
    ],
)
def test_wrong_words_are_one_line(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capfd: pytest.CaptureFixture[str], words: list[str], says: str
) -> None:
    from tests.fuzz.oracle import command

    (tmp_path / "soil.yaml").write_text("kind: [ye-2006]\nmass: 3\n")
    monkeypatch.chdir(tmp_path)
    with pytest.raises(SystemExit) as caught:
        command().main(words, prog_name="rollover")
    assert caught.value.code == 2
    lines = capfd.readouterr().err.splitlines()
    assert len(lines) == 1
    assert says in lines[0]
    assert is_whole(lines[0]) == ""


def test_a_library_says_nothing_past_the_one_line(tmp_path: Path) -> None:
    data = bytearray(seeds.mdf())
    data[0x398 : 0x398 + 4] = bytes(4)
    (tmp_path / "a.mf4").write_bytes(data[:-200])
    (tmp_path / "a.tdms").write_bytes(seeds.tdms()[:-9])
    for name in ("a.mf4", "a.tdms"):
        command = [sys.executable, "-m", "tests.rollover.command", "import", str(tmp_path / name)]
        done = subprocess.run(command, capture_output=True, text=True, timeout=120, check=False)
        assert done.returncode == 2
        assert len(done.stderr.splitlines()) == 1, done.stderr
        assert is_whole(done.stderr.strip()) == ""


def test_gaps_are_gaps(tmp_path: Path) -> None:
    # a file that is in order passes the boundary to the last bit
    for file, data in VALID["plain"][1]().items():
        (tmp_path / file).write_bytes(data)
    found = read_recording(tmp_path / "a.csv")
    assert found["ground/force_normal"] == pytest.approx(1e3 * np.sin(300 * seeds.TIME) ** 2, rel=1e-8)


# ---- the shelf of a study


def test_a_case_that_somebody_else_wrote_is_run_again(tmp_path: Path) -> None:
    import pyarrow as pa
    import pyarrow.parquet as pq

    from rollover.studies import case_store as shelf

    key = "ab" + "0" * 30
    row = shelf.Row(
        key=key,
        status="done",
        failure="",
        sentence="",
        measures={"ground/force_normal": 1.5},
        domain_flags=("speed",),
        peak_flags=(),
        provenance={"wall_time": 0.1},
    )
    shelf.keep(tmp_path, row)
    path = shelf.path_of(tmp_path, key)
    assert shelf.stored(tmp_path, key) == row
    table = pq.read_table(path)
    about = json.loads(table.schema.metadata[b"rollover"])
    others = [table.set_column(0, "name", pa.array([3])), table.set_column(1, "value", pa.array(["x"]))]
    others += [table.set_column(1, "value", pa.array([None], pa.float64()))]
    told = [
        [],
        {**about, "key": "other"},
        {**about, "status": 3},
        {**about, "sentence": []},
        {**about, "provenance": 1},
    ]
    others += [table.replace_schema_metadata({"rollover": json.dumps(each)}) for each in told]
    for other in others:
        pq.write_table(other, path)
        assert shelf.stored(tmp_path, key) is None

"""Two thousand inputs over all entry points: each refused in whole lines or done, and nothing else happens."""

from __future__ import annotations

import gc
from pathlib import Path

import pytest

from rollover.recording.importers import COLLECTIONS, importers
from tests.fuzz.all_entry_points import entry_points
from tests.fuzz.campaign import campaign, report
from tests.fuzz.oracle import command, is_whole, judge
from tests.rollover.foreign import needs

for library in ("nptdms", "asammdf", "h5py", "mcap", "idelib", "openpyxl"):
    needs(library)

INPUTS = 2000


@pytest.mark.timeout(1800)  # a minute of the processor, of which a busy machine gives little
def test_two_thousand_inputs(tmp_path: Path) -> None:
    done = campaign(tmp_path, INPUTS, 7)
    assert done.inputs.total() == INPUTS
    # what reads nothing proves nothing: each kind of file is also read, and refused
    assert sum(status[0] for status in done.statuses.values()) > 0.1 * INPUTS
    assert sum(status[2] for status in done.statuses.values()) > 0.3 * INPUTS
    assert not done.kinds, report(done)


def test_every_command_and_reader_has_an_entry_point(tmp_path: Path) -> None:
    """One that is added later is fuzzed from its first day on, or this says so."""
    all_of_them = entry_points(tmp_path)
    names = {d.name for d in all_of_them}
    assert {f"importer {n}" for n in importers() if n not in ("plain", "csv")} <= names
    assert {f"set {n}" for n in COLLECTIONS} <= names
    words = {seed.words[0] for d in all_of_them for seed in d.seeds}
    assert set(command().commands) <= words
    assert {"--laws", "--effects"} <= words


@pytest.mark.parametrize(
    ("line", "lacks"),
    [
        ("a.csv:3: column F: not a number, got 'x'; a number is needed", ""),
        ("a.csv: no such file; did you mean 'b.csv'?", ""),
        ("a.csv: cannot be read", "no cure"),
        ("cannot be read", "no place"),
        ("a.h5: not readable: 'NoneType' object has no attribute 'x'; export it anew", "bare text"),
        ("own.py:3: cannot be used: NameError: name 'x' is not defined; a file that Python imports is needed", ""),
        ("a.h5: not readable: [Errno 22] Invalid argument; export it anew", "bare text"),
    ],
)
def test_what_a_whole_line_is(line: str, lacks: str) -> None:
    assert is_whole(line).startswith(lacks)
    assert bool(is_whole(line)) == bool(lacks)


def test_the_oracle_sees_what_it_is_to_see(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    from rollover.cli import catalogue
    from tests.fuzz import oracle

    def found() -> dict[str, str]:
        return dict(judge(tmp_path, ["list", "laws"]).finds)

    assert found() == {}
    monkeypatch.setitem(catalogue.TABLES, "laws", lambda: 1 / 0)
    assert "ZeroDivisionError" in found()["traceback"]
    monkeypatch.setitem(catalogue.TABLES, "laws", lambda: (tmp_path / "beside").write_text("x") and [])
    assert found()["outside"] == "new: beside"

    def spin() -> list[object]:
        while True:
            pass

    monkeypatch.setattr(oracle, "LONGEST", 0.3)
    monkeypatch.setitem(catalogue.TABLES, "laws", spin)
    assert "hang" in found()

    def swell() -> list[object]:
        bytearray(64 << 20)[::4096] = b"x" * (16 << 10)
        return []

    monkeypatch.setattr(oracle, "MOST_MEMORY", 32 << 20)
    monkeypatch.setitem(catalogue.TABLES, "laws", swell)
    gc.collect()  # what other tests left would be freed meanwhile, and hide it
    assert "memory" in found()

    def leaves() -> list[object]:
        (tmp_path / "out").mkdir()
        (tmp_path / "out" / "a.json").write_text("{")
        return []

    monkeypatch.setitem(catalogue.TABLES, "laws", leaves)
    assert "unreadable" in found()
    assert not (tmp_path / "out").exists()

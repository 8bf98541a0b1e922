"""Two starts, and ends in the middle: the first holds, nothing is lost and nothing is left, baselines too."""

from __future__ import annotations

import json
import signal
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from rollover.recording import Recording
from rollover.recording.importers import read_recording, write_recording
from rollover.system import writing
from rollover.system.errors import InputError
from tests.rollover import forked
from tests.rollover.disks import Disk
from tests.rollover.machines import (
    WRONG,
    Killed,
    commands,
    killed,
    posix,
    recorded,
    tree,
)


@posix
@pytest.mark.parametrize("name", ["run", "compare", "study", "synthesize", "plan", "rolling", "export"])
def test_a_second_start_is_told_of_the_first(name: str, tmp_path: Path) -> None:
    words, _ = commands(tmp_path)[name]
    target = tmp_path / "out" / {"synthesize": "d.csv", "export": "e.csv"}.get(name, "a")
    with writing.working():
        writing.hold(target)
        result = forked.command(*words)
    assert result.returncode == WRONG, result.stderr
    assert "by another process" in result.stderr
    assert len(result.stderr.splitlines()) == 1
    assert forked.command(*words).returncode == 0, "once the first has ended, it goes"


@posix
def test_a_lock_ends_with_its_process_and_leftovers_go(tmp_path: Path) -> None:
    target = tmp_path / "out" / "a"
    script = f"""
import os, signal, sys
from pathlib import Path
from rollover.system import writing
with writing.working():
    writing.hold(Path({str(target)!r}))
    with writing.whole(Path({str(target)!r})) as part:
        (part / "half").write_text("half")
        print(flush=True)
        os.kill(os.getpid(), signal.SIGKILL)
"""
    assert subprocess.run([sys.executable, "-c", script], capture_output=True).returncode == -signal.SIGKILL
    assert len(list((tmp_path / "out").iterdir())) == 2, "a lock and half a folder"
    with writing.working():
        writing.hold(target)
        assert [p.name for p in (tmp_path / "out").iterdir()] == [".a.lock"]
    assert list((tmp_path / "out").iterdir()) == []


@pytest.mark.parametrize("killed_at", [1, 2])
def test_killed_between_the_two_moves_of_an_exchange(
    killed_at: int, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    target = tmp_path / "a"
    with writing.whole(target) as part:
        (part / "run.json").write_text("was")
    killed(monkeypatch, "rename", killed_at)
    with pytest.raises(Killed), writing.whole(target) as part:
        (part / "run.json").write_text("is")
    monkeypatch.undo()
    with writing.working():
        writing.hold(target)
        assert tree(target) == {"run.json": b"was"}
    assert [p.name for p in tmp_path.iterdir()] == ["a"]


@pytest.mark.parametrize("killed_at", [1, 2])
def test_a_table_and_its_sidecar_go_together(killed_at: int, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    path = recorded(tmp_path)
    other = Recording(title="new", time=np.arange(3.0), channels={"ground/sinkage": np.arange(3.0)})
    killed(monkeypatch, "replace", killed_at)
    with pytest.raises(Killed):
        write_recording(other, path, force=True)
    monkeypatch.undo()
    with pytest.raises(InputError, match="no such file"):  # before the next start: not half the one, half the other
        read_recording(path)
    with writing.working():
        writing.hold(path)
        assert list(read_recording(path).channels) == ["ground/sinkage"], "it was decided, so it is finished"
    assert sorted(p.name for p in tmp_path.iterdir()) == ["d3.csv", "d3.yaml"]


@posix
def test_kills_at_random_moments_lose_and_leave_nothing(tmp_path: Path) -> None:
    from tests.benchmarks.kills import kill_runs

    assert kill_runs(tmp_path, 3, seed=3) == []


@posix
def test_killed_a_hundred_times_while_it_writes(tmp_path: Path) -> None:
    from tests.benchmarks.kills import kill_writers

    assert kill_writers(tmp_path, 100, seed=2) == []


# ---- baselines


def update(folder: Path, out: Path, texts: dict[str, str], report: str) -> None:
    from rollover.system.transaction import update as updating

    with updating(out, {folder / name: text for name, text in texts.items()}) as part:
        (part / "regress.json").write_text(report)


@pytest.mark.parametrize("name", ["replace", "rename"])
@pytest.mark.parametrize("killed_at", [1, 2, 3, 4])
def test_baselines_and_their_report_change_in_one_stroke(
    name: str, killed_at: int, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    from rollover.system.transaction import JOURNAL, finish

    folder, out = tmp_path / "baselines", tmp_path / "out" / "regress"
    update(folder, out, {"a.yaml": "1", "b.yaml": "1"}, "first")
    before = tree(tmp_path)
    killed(monkeypatch, name, killed_at)
    ended = True
    try:
        update(folder, out, {"a.yaml": "2", "b.yaml": "2"}, "second")
    except Killed:
        ended = False
    monkeypatch.undo()
    with writing.working():  # as `rollover regress` begins
        writing.hold(folder)
        finish(folder / JOURNAL)
        writing.sweep(folder)
        writing.hold(out)
    after = {"baselines/a.yaml": b"2", "baselines/b.yaml": b"2", "out/regress/regress.json": b"second"}
    assert tree(tmp_path) in (before, after), "all of it, or nothing"
    if ended:
        assert tree(tmp_path) == after


def test_a_full_disk_leaves_all_baselines_as_they_were(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    folder, out = tmp_path / "baselines", tmp_path / "out"
    update(folder, out, {"a.yaml": "1", "b.yaml": "1"}, "first")
    before, disk = tree(tmp_path), Disk(tmp_path, monkeypatch)
    refused = 0
    for k in range(1, 30):
        disk.full(k)
        try:
            update(folder, out, {"a.yaml": "2", "b.yaml": "2"}, "second")
        except (OSError, InputError):
            disk.full(10**9)
            refused += 1
            assert tree(tmp_path) == before, f"write {k}"
        else:
            break
    assert refused >= 5
    assert json.dumps(sorted(tree(tmp_path).values()) == [b"2", b"2", b"second"])


def test_a_journal_of_somebody_else_moves_nothing(tmp_path: Path) -> None:
    from rollover.system.transaction import JOURNAL, finish

    (tmp_path / "mine").write_text("mine")
    journal = tmp_path / "baselines" / JOURNAL
    journal.parent.mkdir()
    told_ = {
        "format": "rollover-update/1",
        "files": [[str(tmp_path / "mine"), str(tmp_path / "gone")]],
        "account": ["a", "b"],
        "journals": [],
    }
    for text in (json.dumps(told_), "{", "[]"):
        journal.write_text(text)
        with pytest.raises(InputError, match="remove it to go on"):
            finish(journal)
    assert (tmp_path / "mine").read_text() == "mine"

"""What the machine does to a command: full and read-only disks, two starts, kills; one line, nothing half-written."""

from __future__ import annotations

import errno
import json
import os
import signal
import subprocess
import sys
from concurrent.futures import BrokenExecutor
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from typer.testing import CliRunner, Result

from rollover import store, writing
from rollover.cli import app
from rollover.faults import InputError
from rollover.importers import read_recording, write_recording
from rollover.machine import told
from rollover.recording import Recording
from tests.rollover import studies
from tests.rollover.disks import Disk

WRONG, MACHINE = 2, 74
posix = pytest.mark.skipif(sys.platform == "win32", reason="no such locks, links and limits")


def rollover(*words: object) -> Result:
    return CliRunner().invoke(app, [str(w) for w in words])


def tree(folder: Path) -> dict[str, bytes]:
    """Every file below a folder with its content."""
    return {str(p.relative_to(folder)): p.read_bytes() for p in sorted(folder.rglob("*")) if p.is_file()}


def recorded(folder: Path, name: str = "d3", force: float = 1000.0) -> Path:
    folder.mkdir(exist_ok=True)
    t = np.linspace(-0.02, 0.4, 127)
    channels = {"ground/force_normal": force * np.sin(4.0 * np.clip(t, 0.0, None)) ** 2}
    write_recording(Recording(title=name, time=t, channels=channels), folder / f"{name}.csv", force=True)
    return folder / f"{name}.csv"


def commands(folder: Path) -> dict[str, tuple[list[object], Path]]:
    """Command lines by name, and what they write."""
    recording = recorded(folder / "given")
    study = studies.drops(folder / "given", ("count: 20", "count: 4"))
    out = folder / "out"
    return {
        "run": (["run", "drop_test", "--no-half-step", "--out", out / "a"], out / "a"),
        "import": (["import", recording, "--out", out], out),
        "import parquet": (["import", recording, "--out", out, "--to", "parquet"], out),
        "import mme": (["import", recording, "--out", out, "--to", "mme.zip"], out),
        "synthesize": (["synthesize", "drop_test", "--out", out, "--name", "d"], out),
        "compare": (["compare", "drop_test", recording, "--out", out / "a"], out / "a"),
        "study": (["study", study, "--workers", "0", "--out", out / "a"], out / "a"),
    }


NAMES = ("run", "import", "import parquet", "import mme", "synthesize", "compare", "study")


@pytest.mark.parametrize("name", NAMES)
def test_a_disk_that_is_full_from_any_write_on_is_one_line(
    name: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    words, target = commands(tmp_path)[name]
    out = tmp_path / "out"
    disk = Disk(out, monkeypatch)
    whole = 0
    # a run takes a second: each write of the quick commands, some of a run's and a study's
    steps = (1, 2, 4, 5, 6, 40) if name in ("run", "compare", "study") else range(1, 40)
    for k in steps:
        disk.full(k)
        result = rollover(*words)
        disk.full(10**9)
        if not disk.places:
            whole = k
            break
        place = f"{name}, full from write {k}, {disk.places[0]}"
        assert result.exit_code in (WRONG, MACHINE), f"{place}: {result.output} {result.exception!r}"
        *before, last = result.stderr.splitlines()
        assert "o space left on device" in last, place
        assert all("ompil" in line or "cases" in line or "simulating" in line for line in before), place
        assert "Results" not in result.stdout
        left = [p for p in out.rglob("*") if p.name.startswith(".") and p.name != ".lock"] if out.exists() else []
        assert left == [], f"{place}: {left}"
        if name != "study":  # which keeps its finished cases, to go on
            assert not target.exists() or list(target.iterdir()) == [], place
        disk.places.clear()
    assert whole > 3, "it was never refused"
    assert result.exit_code == 0, result.output


@posix
@pytest.mark.parametrize("kilobytes", [0, 3, 20, 300])
def test_a_limit_on_file_sizes_is_one_line_too(kilobytes: int, tmp_path: Path) -> None:
    # the recording for the viewer is written by a thread of its own, which no patched function sees
    import resource

    def limited() -> None:
        resource.setrlimit(resource.RLIMIT_FSIZE, (1024 * kilobytes, resource.RLIM_INFINITY))

    words = [sys.executable, "-m", "tests.rollover.command", "run", "drop_test", "--no-half-step", "--out"]
    done = subprocess.run(
        [*words, str(tmp_path / "out" / "a")], preexec_fn=limited, capture_output=True, text=True, timeout=300
    )
    assert done.returncode == (WRONG if kilobytes == 0 else MACHINE), done.stderr
    lines = [line for line in done.stderr.splitlines() if "ompil" not in line and "simulating" not in line]
    assert len(lines) == 1, done.stderr
    assert "ile too large" in lines[0]
    assert list(tmp_path.iterdir()) == []


def test_the_earlier_results_stay_where_the_disk_is_full(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    words, _ = commands(tmp_path)["run"]
    assert rollover(*words).exit_code == 0
    before = tree(tmp_path / "out")
    disk = Disk(tmp_path / "out", monkeypatch)
    for k in (2, 4, 6):
        disk.full(k)
        assert rollover(*words).exit_code == MACHINE
        disk.full(10**9)
        assert tree(tmp_path / "out") == before


@pytest.mark.parametrize("command", ["run", "synthesize", "study", "import"])
def test_what_cannot_be_written_is_said_before_the_work(
    command: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    words, _ = commands(tmp_path)[command]
    disk = Disk(tmp_path / "out", monkeypatch)
    disk.reason = errno.EROFS
    disk.full(1)
    monkeypatch.setattr("rollover.simulate.run", lambda *a, **k: pytest.fail("it was simulated first"))
    monkeypatch.setattr("rollover.study.conduct.conduct", lambda *a, **k: pytest.fail("it was worked out first"))
    result = rollover(*words)
    assert result.exit_code == WRONG
    assert len(result.stderr.splitlines()) == 1
    assert "out" in result.stderr
    assert "ead-only file system" in result.stderr


@posix
@pytest.mark.skipif(hasattr(os, "getuid") and os.getuid() == 0, reason="platform: root may write anywhere")
def test_a_folder_without_the_right_to_write(tmp_path: Path) -> None:
    folder = tmp_path / "out"
    folder.mkdir(mode=0o555)
    result = rollover("run", "drop_test", "--out", folder / "a")
    assert result.exit_code == WRONG
    assert "cannot be written" in result.stderr


@posix
@pytest.mark.parametrize("name", ["run", "compare", "study", "synthesize"])
def test_a_second_start_is_told_of_the_first(name: str, tmp_path: Path) -> None:
    words, _ = commands(tmp_path)[name]
    target = tmp_path / "out" / ("d.csv" if name == "synthesize" else "a")
    if name == "study":
        from rollover.study import shelf

        with shelf.locked(target):
            result = other_process(words)
    else:
        with writing.working():
            writing.hold(target)
            result = other_process(words)
    assert result.returncode == WRONG, result.stderr
    assert "by another process" in result.stderr
    assert len(result.stderr.splitlines()) == 1
    assert other_process(words).returncode == 0, "once the first has ended, it goes"


def other_process(words: list[object]) -> subprocess.CompletedProcess[str]:
    line = [sys.executable, "-m", "tests.rollover.command", *map(str, words)]
    return subprocess.run(line, capture_output=True, text=True, timeout=300)


@posix
def test_the_lock_dies_with_its_process_and_what_it_left_is_swept(tmp_path: Path) -> None:
    target = tmp_path / "out" / "a"
    script = f"""
import os, signal, sys
from pathlib import Path
from rollover import writing
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


class Killed(BaseException):
    """Stands for the end of the process: nothing after it is done, no clearing up either."""


def killed(monkeypatch: pytest.MonkeyPatch, name: str, at: int) -> None:
    """End the process, as it were, at the n-th call of a function of `os`: from there on nothing reaches the disk."""
    count, real = [0], getattr(os, name)

    def call(*args: Any, **more: Any) -> Any:
        count[0] += 1
        if count[0] >= at:
            for gone in ("rename", "replace", "unlink", "rmdir"):
                monkeypatch.setattr(os, gone, lambda *a, **k: None)
            monkeypatch.setattr("shutil.rmtree", lambda *a, **k: None)
            monkeypatch.setattr(Path, "unlink", lambda *a, **k: None)
            monkeypatch.setattr(Path, "rmdir", lambda *a, **k: None)
            raise Killed
        return real(*args, **more)

    monkeypatch.setattr(os, name, call)


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


def test_a_folder_that_cannot_be_exchanged_takes_new_files_in(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    target = tmp_path / "mounted"
    target.mkdir()
    (target / "report.html").write_text("was")
    monkeypatch.setattr(os.path, "ismount", lambda path: Path(path) == target)
    with writing.working():
        writing.hold(target)
        with writing.whole(target) as part:
            assert part.parent == target
            (part / "run.json").write_text("is")
            assert "run.json" not in tree(target), "not before it is whole"
    assert tree(target) == {"run.json": b"is"}


@posix
def test_out_removed_meanwhile_is_made_again(tmp_path: Path) -> None:
    import shutil

    target = tmp_path / "out" / "a"
    with writing.working():
        writing.hold(target)
        shutil.rmtree(tmp_path / "out")
        with writing.whole(target) as part:
            (part / "run.json").write_text("is")
    assert tree(tmp_path) == {"out/a/run.json": b"is"}


def test_out_removed_while_it_is_filled_is_one_line(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    import shutil

    words, _ = commands(tmp_path)["run"]
    real = store.write_json

    def removed(path: Path, value: Any) -> None:
        shutil.rmtree(tmp_path / "out", ignore_errors=True)
        real(path, value)

    monkeypatch.setattr(store, "write_json", removed)
    result = rollover(*words)
    assert result.exit_code == MACHINE
    assert "out/a: no such file or directory: it was there and has been removed meanwhile" in result.stderr


@posix
def test_a_link_inside_out_leads_nobody_out(tmp_path: Path) -> None:
    outside = tmp_path / "mine.txt"
    outside.write_text("mine")
    for name, files in {
        "run": ["run.json", "channels.parquet"],
        "import": ["d3.csv", "d3.yaml"],
        "study": [".lock", "cases", "study.json"],
    }.items():
        words, target = commands(tmp_path)[name]
        target.mkdir(parents=True, exist_ok=True)
        for file in files:
            (target / file).symlink_to(outside)
        rollover(*words, "--force")
        assert outside.read_text() == "mine", name
        assert not (tmp_path / "given" / "cases").exists()
        import shutil

        shutil.rmtree(tmp_path / "out")


@pytest.mark.parametrize(
    ("fault", "line"),
    [
        (OSError(errno.ENOSPC, "x", "/big/a.csv"), "/big/a.csv: no space left on device: make room there"),
        (OSError(errno.EDQUOT, "x"), "out/a: disk quota exceeded: make room in your quota"),
        (PermissionError(errno.EACCES, "x", "/a"), "/a: permission denied: let it be written"),
        (OSError(errno.EMFILE, "x"), "out/a: too many open files: raise the limit on open files (ulimit -n)"),
        (MemoryError(), "out/a: memory ran out: free memory, or take fewer --workers"),
        (BrokenExecutor(), "out/a: processes that work for it are ended from outside, as when memory runs out"),
        (OSError(errno.ENOSPC, "x", "/o/.a.abcdefgh.part/f"), "out/a: no space left on device"),
    ],
)
def test_a_fault_of_the_machine_in_words(fault: Any, line: str) -> None:
    said = told(fault, Path("out/a"))
    assert said.startswith(line), said
    assert "\n" not in said


@pytest.mark.parametrize("fault", [MemoryError(), BrokenExecutor(), OSError(errno.EIO, "x")])
def test_the_door_turns_it_into_a_status_and_not_a_bug(fault: Any, monkeypatch: pytest.MonkeyPatch) -> None:
    def breaks(*_: Any, **__: Any) -> None:
        raise fault

    monkeypatch.setattr("rollover.catalogue.check", breaks)
    result = rollover("check", "drop_test")
    assert (result.exit_code, len(result.stderr.splitlines())) == (MACHINE, 1)


@posix
def test_killed_at_random_moments_nothing_is_lost_and_nothing_left(tmp_path: Path) -> None:
    from tests.benchmarks.kills import kill_runs

    assert kill_runs(tmp_path, 3, seed=3) == []


@posix
def test_killed_a_hundred_times_while_it_writes(tmp_path: Path) -> None:
    from tests.benchmarks.kills import kill_writers

    assert kill_writers(tmp_path, 100, seed=2) == []


# ---- baselines


def update(folder: Path, out: Path, texts: dict[str, str], account: str) -> None:
    from rollover.update import update as updating

    with updating(out, {folder / name: text for name, text in texts.items()}) as part:
        (part / "regress.json").write_text(account)


@pytest.mark.parametrize("name", ["replace", "rename"])
@pytest.mark.parametrize("killed_at", [1, 2, 3, 4])
def test_baselines_and_their_account_change_in_one_stroke(
    name: str, killed_at: int, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    from rollover.update import JOURNAL, finish

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
    from rollover.update import JOURNAL, finish

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

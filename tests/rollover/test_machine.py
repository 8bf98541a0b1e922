"""What the machine does to a command: full and read-only disks, limits, folders that go; nothing half-written."""

from __future__ import annotations

import errno
import os
import subprocess
import sys
import tempfile
from concurrent.futures import BrokenExecutor
from pathlib import Path
from typing import Any

import pytest

from rollover.assessment import results
from rollover.system import writing
from rollover.system.refusals import message_of
from tests.rollover.disks import Disk
from tests.rollover.machines import (
    MACHINE,
    NAMES,
    PROGRESS,
    WRONG,
    as_it_is,
    commands,
    once,
    posix,
    rollover,
    tree,
)
from viz.pages.web_page import Viewer

QUICK = ("import", "import parquet", "import mme", "synthesize", "view", "new", "rolling")
QUICK += ("export", "export xlsx", "export mat", "export mme")
WORK = (
    "rollover.diagnosis.asked.diagnosed_with_prechecks",
    "rollover.diagnosis.overlay.overlays_of",
    "rollover.diagnosis.planning.plan.plan",
    "rollover.diagnosis.own_model.diagnose_model",
    "rollover.calibration.request.calibrate",
    "rollover.calibration.identification.identified",
    "rollover.proof.runner.prove",
    "rollover.studies.regression.compared",
    "rollover.assessment.standing.found_for",
)


@pytest.mark.parametrize("name", NAMES)
def test_a_disk_that_is_full_from_any_write_on_is_one_line(
    name: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    words, target = commands(tmp_path)[name]
    out = tmp_path / "out"
    once(monkeypatch, *WORK)
    if name == "view":  # which asks the viewer for its parts
        monkeypatch.setattr("viz.pages.web_page.installed", lambda: Viewer(script="", program=b""))
    if name == "diagnose":
        as_it_is(tmp_path)
    disk = Disk(out, monkeypatch)
    whole = 0
    # a run takes a second: each write of the quick commands, some of a run's and a study's
    steps = (1, 2, 4, 5, 6, 40) if name not in QUICK else range(1, 40)
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
        assert all(any(word in line for word in PROGRESS) for line in before), f"{place}: {before}"
        assert "Results" not in result.stdout
        left = [p for p in out.rglob("*") if p.name.startswith(".")] if out.exists() else []
        if name == "prove":  # which keeps a campaign that has begun, to go on
            left = [p for p in left if p.name != ".a.cases" or not (p / "campaign.json").stat().st_size]
        assert left == [], f"{place}: {left}"
        if name != "study":  # which keeps its finished cases, to go on
            assert not target.exists() or (target.is_dir() and list(target.iterdir()) == []), place
        disk.places.clear()
    assert whole > 3, "it was never refused"
    assert result.exit_code == 0, result.output


@pytest.mark.parametrize("k", [1, 4, 6, 9])
def test_a_full_disk_of_temporary_files_is_one_line(k: int, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    (tmp_path / "tmp").mkdir()
    monkeypatch.setattr(tempfile, "tempdir", str(tmp_path / "tmp"))
    words, target = commands(tmp_path)["prove"]
    disk = Disk(tmp_path / "tmp", monkeypatch)
    disk.full(k)
    result = rollover(*words)
    disk.full(10**9)
    assert result.exit_code in (WRONG, MACHINE), f"{result.output} {result.exception!r}"
    *before, last = result.stderr.splitlines()
    assert "o space left on device" in last
    assert all("Sealed" in line or "cases" in line for line in before), before
    assert not target.exists()
    assert list((tmp_path / "tmp").iterdir()) == []


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


@pytest.mark.parametrize("command", ["run", "synthesize", "study", "import", "plan", "export", "diagnose model"])
def test_what_cannot_be_written_is_said_before_the_work(
    command: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    words, _ = commands(tmp_path)[command]
    disk = Disk(tmp_path / "out", monkeypatch)
    disk.reason = errno.EROFS
    disk.full(1)
    monkeypatch.setattr("rollover.dynamics.simulate.run", lambda *a, **k: pytest.fail("it was simulated first"))
    monkeypatch.setattr("rollover.studies.runner.conduct", lambda *a, **k: pytest.fail("it was worked out first"))
    for work in WORK:
        monkeypatch.setattr(work, lambda *a, **k: pytest.fail("it was worked out first"))
    result = rollover(*words)
    assert result.exit_code == WRONG
    lines = [line for line in result.stderr.splitlines() if "ompil" not in line]  # said once per installation
    assert len(lines) == 1
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
    real = results.write_json

    def removed(path: Path, value: Any) -> None:
        shutil.rmtree(tmp_path / "out", ignore_errors=True)
        real(path, value)

    monkeypatch.setattr(results, "write_json", removed)
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
    said = message_of(fault, Path("out/a"))
    assert said.startswith(line), said
    assert "\n" not in said


@pytest.mark.parametrize("fault", [MemoryError(), BrokenExecutor(), OSError(errno.EIO, "x")])
def test_the_command_turns_it_into_a_status_and_not_a_bug(fault: Any, monkeypatch: pytest.MonkeyPatch) -> None:
    def breaks(*_: Any, **__: Any) -> None:
        raise fault

    monkeypatch.setattr("rollover.cli.catalogue.check", breaks)
    result = rollover("check", "drop_test")
    assert (result.exit_code, len(result.stderr.splitlines())) == (MACHINE, 1)

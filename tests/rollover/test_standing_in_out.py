"""`--out .`: results of a command that was started in their folder, which its shell still stands in afterwards."""

from __future__ import annotations

import contextlib
import os
import subprocess
import sys
from pathlib import Path

import pytest

from rollover.system import writing
from rollover.system.errors import InputError
from tests.rollover import forked
from tests.rollover.machines import WRONG, Killed, commands, killed, once, posix, rollover, tree


@pytest.mark.parametrize(
    ("name", "file"),
    [
        ("run", "run.json"),
        ("compare", "compare.json"),
        ("study", "study.json"),
        ("plan", "plan.json"),
        ("rolling", "rolling.json"),
        ("prove", "benchmark.json"),
    ],
)
def test_the_folder_one_stands_in_is_not_exchanged(
    name: str, file: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    words, target = commands(tmp_path)[name]
    out = "--export" if name == "prove" else "--out"
    once(monkeypatch, "rollover.diagnosis.planning.plan.plan")
    target.mkdir(parents=True)
    monkeypatch.chdir(target)
    here = os.stat(".").st_ino
    words = [*words[: words.index("--out")], out, "."]
    for again in ((), ("--force",)):
        result = rollover(*words, *again)
        assert result.exit_code == 0, result.output
        assert Path(file).is_file(), "the shell sees what was written"
        assert target.stat().st_ino == os.stat(".").st_ino == here
        assert [p.name for p in target.iterdir() if p.name.startswith(".")] == []
        stray = {p.name for p in target.parent.iterdir()} - {"a", "a-truth.json"}
        assert stray == set()


@posix
@pytest.mark.parametrize("inside", [True, False])
def test_inside_and_outside_there_is_one_lock(inside: bool, tmp_path: Path) -> None:
    words, target = commands(tmp_path)["rolling"]
    target.mkdir(parents=True)
    first, second = (target, tmp_path) if inside else (tmp_path, target)
    before = Path.cwd()
    try:
        os.chdir(first)
        with writing.working():
            writing.hold(target)
            os.chdir(second)
            result = forked.command(*words)
    finally:
        os.chdir(before)
    assert result.returncode == WRONG, result.stderr
    assert "by another process" in result.stderr


@pytest.mark.parametrize(
    ("name", "killed_at"),
    [(n, k) for n in ("rename", "replace", "unlink") for k in (1, 2, 3) if (n, k) != ("unlink", 3)],
)
def test_a_kill_inside_is_put_right_from_elsewhere(
    name: str, killed_at: int, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The third `unlink` would be that of the lock, which ends with its process."""
    target = tmp_path / "a"
    target.mkdir()

    def written(text: str) -> None:
        with writing.whole(target) as part:
            for file in (*files, "report.html", "run.json"):
                (part / file).write_text(text)

    files = ("channels.parquet", "viewer.html")
    written("was")
    files = ()
    monkeypatch.chdir(target)
    with monkeypatch.context() as dying:
        killed(dying, name, killed_at)
        with contextlib.suppress(Killed):
            written("is")
    monkeypatch.chdir(tmp_path)
    with writing.working():
        writing.hold(target)
        found = set(tree(target).values())
        assert found in ({b"was"}, {b"is"}), "all of the one, or all of the other"
        is_new = found == {b"is"}
        names = {"report.html", "run.json"}
        assert set(tree(target)) == (names if is_new else {*names, "channels.parquet", "viewer.html"})
    assert [p.name for p in tmp_path.iterdir()] == ["a"]


def test_a_folder_above_ones_own_is_refused(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    below = tmp_path / "cases" / "case-001"
    below.mkdir(parents=True)
    monkeypatch.chdir(below)
    with writing.working(), pytest.raises(InputError, match="start from elsewhere, or another --out"):
        writing.hold(tmp_path / "cases")
    with writing.working():
        writing.hold(tmp_path / "cases" / "case-001" / "out")  # below it is anybody's right


@posix
def test_a_folder_that_is_gone_under_the_shell(tmp_path: Path) -> None:
    """A shell may stand in a folder that somebody removed; what is written elsewhere does not mind."""
    gone = tmp_path / "gone"
    gone.mkdir()
    script = f"""
import os, shutil
os.chdir({str(gone)!r})
shutil.rmtree({str(gone)!r})
from pathlib import Path
from rollover.system import writing
with writing.working():
    writing.hold(Path({str(tmp_path / "out")!r}))
    with writing.whole(Path({str(tmp_path / "out")!r})) as part:
        (part / "run.json").write_text("is")
"""
    done = subprocess.run([sys.executable, "-c", script], capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    assert tree(tmp_path) == {"out/run.json": b"is"}

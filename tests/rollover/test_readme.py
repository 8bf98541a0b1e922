"""The README as a new user follows it: every command of its sh blocks is run in order, and all that is named exists."""

from __future__ import annotations

import re
import shlex
import shutil
import subprocess
import sys
from importlib.util import find_spec
from pathlib import Path
from typing import Any

import pytest
from typer.testing import CliRunner

from rollover.cli.main import app
from rollover.spec.document import shipped_folder
from tests.viz.picture import has_software_driver

ROOT = Path(__file__).resolve().parents[2]
TEXT = (ROOT / "README.md").read_text(encoding="utf-8")
FOLDERS = ("docs", "ground", "rollover", "viz", "scenarios", "tests")
PAGES = sorted([*ROOT.glob("*.md"), *(p for folder in FOLDERS for p in (ROOT / folder).rglob("*.md"))])
BY_CI = "make demo"  # what .ci/run does by itself; here the line that make runs
COMMANDS = {c.name or c.callback.__name__ for c in app.registered_commands if c.callback}


def shell_lines() -> list[str]:
    """Commands of all sh blocks, without their comments."""
    blocks = re.findall(r"^```sh\n(.*?)^```$", TEXT, flags=re.MULTILINE | re.DOTALL)
    lines = [re.split(r"\s+#\s", line)[0].strip() for block in blocks for line in block.splitlines()]
    return [line for line in lines if line and not line.startswith("#")]


def made_by_make() -> str:
    """What `make demo` runs after setting up."""
    (line,) = re.findall(r"^demo: setup\n\t(\S*rollover .*)$", (ROOT / "Makefile").read_text(), flags=re.MULTILINE)
    return str(line)


def rollover(line: str) -> Any:
    command, _, target = line.partition(" > ")
    done = CliRunner().invoke(app, shlex.split(command)[1:])
    if target:
        Path(target).write_text(done.stdout)
    return done


def test_every_command_of_the_readme_works_in_order(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    shelf = tmp_path / "shelf"
    shutil.copytree(shipped_folder(), shelf)  # one of the lines writes a baseline anew,
    stale = shelf / "baselines" / "drop_test.yaml"  # of which nothing is new on the machine that made it
    stale.write_text(stale.read_text().replace("numpy ", "numpy 0."))
    for module in ("rollover.spec.document.include", "rollover.spec.document"):
        monkeypatch.setattr(f"{module}.shipped_folder", lambda: shelf)
    shown: list[Path] = []
    monkeypatch.setattr("viz.recordings.viewer.open_viewer", lambda path: (shown.append(path), 0)[1])
    monkeypatch.setenv("DISPLAY", ":0")  # the viewer is a stand-in: no window is opened
    here = tmp_path / "here"
    here.mkdir()
    (here / "docs").mkdir()
    monkeypatch.chdir(here)
    lines = shell_lines()
    assert len(lines) > 20
    assert BY_CI in (ROOT / ".ci" / "run").read_text()
    for line in lines:
        if line == BY_CI:
            line = made_by_make()
        if line.startswith(".venv/bin/rollover "):
            done = rollover(line)
            assert done.exit_code == 0, f"{line}\n{done.output}\n{done.exception!r}"
            assert (done.stdout + done.stderr).strip() or " view " in line, f"{line}: said nothing"
        elif line.startswith(".venv/bin/python -m "):
            if has_software_driver():
                words = [sys.executable, *shlex.split(line)[1:]]
                subprocess.run(words, cwd=here, check=True, env={"PYTHONPATH": str(ROOT), "PATH": "/usr/bin:/bin"})
        else:
            raise AssertionError(f"nobody knows how to try {line!r}")
    assert shown == [Path("out/demo/recording.rrd")]
    for written in (
        "side_overturn.html",
        "out/compare/vineyard/compare.rrd",
        "shared/d3.mme.zip",
        "scenario.schema.json",
    ):
        assert (here / written).stat().st_size > 1000
    assert "clay of another field" in (shelf / "baselines" / "drop_test.yaml").read_text()
    assert "clay of another field" not in (shipped_folder() / "baselines" / "drop_test.yaml").read_text()


def test_commands_named_in_passing_exist() -> None:
    named = set(re.findall(r"`(?:\.venv/bin/)?rollover ([a-z]+)", TEXT))
    assert named
    assert named <= COMMANDS
    assert set(re.findall(r"rollover ([a-z]+) ", "\n".join(shell_lines()))) <= COMMANDS


def test_modules_and_tests_named_exist() -> None:
    modules = set(re.findall(r"python -m (tests[\w.]+)", TEXT))
    assert len(modules) >= 5
    for module in modules:
        assert find_spec(module) is not None, module
    files = re.findall(r"\| `([\w/]+\.py)` \|$", TEXT, flags=re.MULTILINE)
    assert len(files) >= 10
    for file in files:
        assert (ROOT / "tests" / file).is_file(), file


@pytest.mark.parametrize("page", PAGES, ids=lambda p: str(p.relative_to(ROOT)))
def test_links_lead_somewhere(page: Path) -> None:
    for target in re.findall(r"\]\(([^)#\s]+)", page.read_text(encoding="utf-8")):
        if "://" not in target:
            assert (page.parent / target).exists(), target


def test_every_folder_that_people_change_has_its_page() -> None:
    pages = {str(p.relative_to(ROOT)) for p in PAGES}
    for folder in ("ground", "rollover", "rollover/diagnosis", "rollover/proof", "rollover/effects"):
        assert f"{folder}/README.md" in pages
        assert f"({folder}/README.md)" in TEXT
    for folder in ("rollover/importers", "viz", "scenarios", "tests"):
        assert f"({folder}/README.md)" in TEXT


def test_the_python_of_the_pages_runs() -> None:
    (code,) = re.findall(r"```python\n(.*?)```", (ROOT / "rollover" / "README.md").read_text(), flags=re.DOTALL)
    exec(compile(code, "rollover/README.md", "exec"), {})


def test_the_python_page_runs_from_top_to_bottom(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    blocks = re.findall(r"```python\n(.*?)```", (ROOT / "docs" / "python.md").read_text(), flags=re.DOTALL)
    assert len(blocks) == 5
    shared: dict[str, Any] = {}
    for block in blocks:
        exec(compile(block, "docs/python.md", "exec"), shared)
    assert shared["run"].status == "done"
    assert "<svg" in (tmp_path / "report.html").read_text(encoding="utf-8")
    named = set(re.findall(r"\bro\.(\w+)", (ROOT / "docs" / "python.md").read_text()))
    assert named <= set(dir(shared["ro"]))


def test_the_picture_is_small() -> None:
    (picture,) = re.findall(r"!\[[^\]]*\]\(([^)]*)\)", TEXT)
    assert 20_000 < (ROOT / picture).stat().st_size < 200_000

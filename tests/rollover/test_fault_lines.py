"""Every fault line has a place and a cure, and nothing that a library warns of stands beside it."""

from __future__ import annotations

import ast
import os
import subprocess
import sys
import warnings
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from rollover.spec.document import tree
from rollover.system.errors import Fault, has_cure
from tests.fuzz.oracle import is_whole
from tests.rollover.machines import rollover

ROOT = Path(__file__).parents[2]


@pytest.mark.parametrize("blank", ["", " ", "\t"])
@pytest.mark.parametrize(
    "words", [["compare", "drop_test"], ["study"], ["regress"], ["check"], ["run"], ["identify"], ["view"], ["import"]]
)
def test_a_blank_name_is_a_place_too(words: list[str], blank: str, tmp_path: Path, monkeypatch: Any) -> None:
    monkeypatch.chdir(tmp_path)
    result = rollover(*words, blank)
    assert result.exit_code == 2
    assert [is_whole(line) for line in result.stderr.splitlines()] == [""], result.stderr
    assert str(Fault(file=blank, line=3, message="x")).startswith(f"{blank!r}:3: x")


@pytest.mark.parametrize("size", [299, 300, 301, 5000])
@pytest.mark.parametrize("cure", ["; there are a", "; there are a, b", "; a number is allowed"])
def test_a_cure_stands_behind_a_value_of_any_length(size: int, cure: str) -> None:
    said = str(Fault(file="--select", message=f"nothing fits, got {'n' * size}{cure}"))
    assert said.endswith(cure)
    assert is_whole(said) == ""
    assert len(said) < 400


def rules() -> Iterator[tuple[str, str]]:
    """Place and text of each sentence that a class refuses its own values with, as far as it is written out there."""
    for path in sorted([*(ROOT / "rollover").rglob("*.py"), *(ROOT / "ground").rglob("*.py")]):
        for function in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
            if not isinstance(function, ast.FunctionDef) or function.name != "validate":
                continue
            for node in ast.walk(function):
                if isinstance(node, ast.Raise) and isinstance(node.exc, ast.Call) and node.exc.args:
                    text = node.exc.args[0]
                    parts = text.values if isinstance(text, ast.JoinedStr) else [text]
                    words = "".join(str(p.value) if isinstance(p, ast.Constant) else "{}" for p in parts)
                    if any(len(word) > 2 for word in words.split(": ", 1)[-1].split()):
                        yield f"{path.relative_to(ROOT)}:{node.lineno}", words


def test_every_rule_of_a_class_says_what_is_allowed() -> None:
    found = dict(rules())
    assert len(found) > 60
    assert {place: words for place, words in found.items() if not has_cure(words)} == {}


ANCHORS = "a: &x 1\nb: &x 2\nc: *x\n"


def test_an_anchor_used_again_is_no_warning(tmp_path: Path) -> None:
    (tmp_path / "a.yaml").write_text(ANCHORS)
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        assert tree.read(tmp_path / "a.yaml").plain == {"a": 1, "b": 2, "c": 2}


def run(line: list[str], folder: Path, **env: str) -> subprocess.CompletedProcess[str]:
    """A process of its own."""
    own = {**os.environ, "PYTHONPATH": str(ROOT), **env}
    return subprocess.run(line, cwd=folder, env=own, capture_output=True, text=True, timeout=300, check=False)


def alone(*words: object, cwd: Path, **env: str) -> subprocess.CompletedProcess[str]:
    return run([sys.executable, "-m", "tests.rollover.command", *map(str, words)], cwd, **env)


def test_a_readers_child_writes_nothing_beside(tmp_path: Path) -> None:
    from scipy.io import netcdf_file

    with netcdf_file(tmp_path / "a.nc", "w") as file:
        file.createDimension("time", 4)
        for name, kind, values in (("time", "d", np.arange(4.0)), ("F", "f", np.arange(4.0))):
            variable = file.createVariable(name, kind, ("time",))
            variable[:] = values
            variable.units = "s" if name == "time" else "N"
        variable.valid_max = b"1e300"  # beyond a float of four bytes, of which numpy warns
    (tmp_path / "p.yaml").write_text(
        "format: rollover-profile/1\nchannels: {time: {channel: time}, F: {channel: ground/force_normal}}\n"
    )
    script = "from rollover.recording.importers import read_recording as r; print(r('a.nc', profile='p.yaml').time[-1])"
    done = run([sys.executable, "-c", script], tmp_path)
    assert (done.returncode, done.stdout, done.stderr) == (0, "3.0\n", "")
    done = alone("import", "a.nc", "--profile", "p.yaml", cwd=tmp_path)
    assert (done.returncode, done.stderr) == (0, "")


def test_what_a_library_warns_of_is_not_shown(tmp_path: Path) -> None:
    # an effect of one's own stands for a library: it warns where it is loaded
    (tmp_path / "own.py").write_text("import warnings\nwarnings.warn('overflow encountered', RuntimeWarning)\n")
    own = {"ROLLOVER_EFFECTS": str(tmp_path / "own.py")}
    done = alone("check", "drop_test", cwd=tmp_path, **own)
    assert "Warning" not in done.stderr
    asked = alone(
        "check", "drop_test", cwd=tmp_path, ROLLOVER_EFFECTS=str(tmp_path / "own.py"), PYTHONWARNINGS="default"
    )
    assert "RuntimeWarning: overflow encountered" in asked.stderr, "but to whoever asks for it"

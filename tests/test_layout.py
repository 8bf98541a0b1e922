"""Limits of the source that no linter of ours has: how long a file may be, and the name of a test."""

from __future__ import annotations

import ast
from pathlib import Path

ROOT = Path(__file__).parent.parent
MOST = 400  # lines: what one reads in a sitting, and a file of one purpose needs
NAME = 60  # characters of a test's name: a behaviour that needs more is several
LONGER: dict[str, int] = {}  # files that may be longer, with their length and the reason


def test_no_python_file_is_longer_than_one_purpose_needs() -> None:
    folders = ("rollover", "ground", "viz", "tests")
    files = [path for folder in folders for path in (ROOT / folder).rglob("*.py")]
    assert len(files) > 500
    lines = {p.relative_to(ROOT).as_posix(): len(p.read_text(encoding="utf-8").splitlines()) for p in files}
    assert {name: n for name, n in lines.items() if n > LONGER.get(name, MOST)} == {}


def test_the_name_of_a_test_is_one_short_sentence() -> None:
    names: dict[str, int] = {}
    for path in sorted((ROOT / "tests").rglob("*.py")):
        place = path.relative_to(ROOT).as_posix()
        if place.startswith(
            ("tests/benchmarks/", "tests/diagnosis/test_selection", "tests/diagnosis/test_discrepancy")
        ):
            continue
        for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
            if isinstance(node, ast.FunctionDef) and node.name.startswith("test_"):
                names[f"{place}::{node.name}"] = len(node.name)
    assert len(names) > 2000
    assert {name: length for name, length in names.items() if length > NAME} == {}

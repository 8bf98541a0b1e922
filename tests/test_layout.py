"""Limits of the source that no linter of ours has: how long a file may be, and the name of a test."""

from __future__ import annotations

import ast
import re
from pathlib import Path

ROOT = Path(__file__).parent.parent
FOLDERS = ("rollover", "ground", "viz", "tests", "docs")
MOST = 400  # lines: what one reads in a sitting, and a file of one purpose needs
NAME = 60  # characters of a test's name: a behaviour that needs more is several
LONGER: dict[str, int] = {}  # files that may be longer, with their length and the reason


def test_no_python_file_is_longer_than_one_purpose_needs() -> None:
    files = [path for folder in FOLDERS for path in (ROOT / folder).rglob("*.py")]
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


def test_pages_name_files_that_are_there() -> None:
    """A file of Python that a page names in backticks exists, in the folder that it is said to be in."""
    pages = [p for p in ROOT.rglob("*.md") if not {".venv", ".tools", "out", "cases"} & set(p.relative_to(ROOT).parts)]
    there = [f"/{p.relative_to(ROOT)}" for name in FOLDERS for p in (ROOT / name).rglob("*.py")]
    named = [
        (page.relative_to(ROOT), file)
        for page in pages
        if page.name != "CHANGELOG.md"
        for file in re.findall(r"`([a-z_][a-z_0-9/]*\.py)`", page.read_text(encoding="utf-8"))
    ]
    assert len(named) > 100
    assert [(str(page), file) for page, file in named if not any(one.endswith(f"/{file}") for one in there)] == []

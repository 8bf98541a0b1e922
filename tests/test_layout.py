"""Limits of the source that no linter of ours has: how long a file may be."""

from __future__ import annotations

from pathlib import Path

ROOT = Path(__file__).parent.parent
MOST = 400  # lines: what one reads in a sitting, and a file of one purpose needs
LONGER: dict[str, int] = {}  # files that may be longer, with their length and the reason


def test_no_python_file_is_longer_than_one_purpose_needs() -> None:
    folders = ("rollover", "ground", "viz", "tests")
    files = [path for folder in folders for path in (ROOT / folder).rglob("*.py")]
    assert len(files) > 500
    lines = {p.relative_to(ROOT).as_posix(): len(p.read_text(encoding="utf-8").splitlines()) for p in files}
    assert {name: n for name, n in lines.items() if n > LONGER.get(name, MOST)} == {}

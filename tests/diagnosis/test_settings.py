"""Numbers of the diagnosis stand in its settings, and say what they are."""

from __future__ import annotations

import ast
from collections.abc import Iterator
from dataclasses import FrozenInstanceError, fields, is_dataclass
from pathlib import Path
from typing import Any

import pytest

import rollover.diagnosis
from rollover.diagnosis.settings import SETTINGS

ROOT = Path(rollover.diagnosis.__file__).parent
EXCEPTIONS = {
    ("fit/cache.py", "NONE"): "an empty array",
    ("fit/time_shift.py", "UNKNOWN"): "marks what cannot be compared",
    ("forward/instruments.py", "NO_FILTER"): "marks a channel without a filter class",
    ("inference/intervals.py", "EVENLY"): "standard deviation of the uniform distribution, an identity",
    ("inference/intervals.py", "BOTH"): "the two signs",
}


def numbers(source: str) -> Iterator[str]:
    """Module-level names that are given a number, unless it is derived from settings."""
    for node in ast.parse(source).body:
        if not isinstance(node, ast.Assign | ast.AnnAssign) or node.value is None:
            continue
        targets = node.targets if isinstance(node, ast.Assign) else [node.target]
        within = list(ast.walk(node.value))
        if any(isinstance(n, ast.Name) and n.id in ("SETTINGS", "TUNING") for n in within):
            continue
        if any(isinstance(n, ast.Constant) and type(n.value) in (int, float) for n in within):
            yield from (n.id for t in targets for n in ast.walk(t) if isinstance(n, ast.Name))


def undocumented(source: str) -> Iterator[str]:
    """Fields of a settings file without a comment of two words, beside them or above."""
    lines = source.splitlines()
    for node in ast.walk(ast.parse(source)):
        if not isinstance(node, ast.ClassDef) or not any("dataclass" in ast.unparse(d) for d in node.decorator_list):
            continue
        for field in node.body:
            if isinstance(field, ast.AnnAssign) and isinstance(field.value, ast.expr):
                is_stage = isinstance(field.value, ast.Call) and not field.value.args and not field.value.keywords
                beside = lines[(field.end_lineno or 0) - 1].partition("#")[2]
                above = ""
                for line in map(str.strip, lines[field.lineno - 2 :: -1]):
                    if not line.startswith("#"):
                        break
                    above = line[1:] + above
                comment = beside or above
                if not is_stage and len(comment.split()) < 2:
                    yield f"{node.name}.{ast.unparse(field.target)}"


def groups(found: Any) -> Iterator[Any]:
    """A settings object and all below it."""
    yield found
    for field in fields(found):
        value = getattr(found, field.name)
        if is_dataclass(value):
            yield from groups(value)


def test_no_module_holds_a_number_of_its_own() -> None:
    found = {
        (str(path.relative_to(ROOT)), name)
        for path in ROOT.rglob("*.py")
        if path.parent.name != "settings"
        for name in numbers(path.read_text(encoding="utf-8"))
    }
    assert found == set(EXCEPTIONS)


def test_a_number_of_a_module_is_found_but_not_a_derived_one() -> None:
    source = "A: float = 3.0\nB, C = 1, (2.0,)\nD = 2 * TUNING.steps\nE = 'text'\nF = True\nG = [1] + SETTINGS.x\n"
    assert list(numbers(source)) == ["A", "B", "C"]


def test_every_setting_says_what_it_is() -> None:
    files = sorted((ROOT / "settings").glob("*.py"))
    assert len(files) == 8
    assert [n for path in files for n in undocumented(path.read_text(encoding="utf-8"))] == []


def test_a_setting_without_words_is_found() -> None:
    source = (
        "@dataclass(frozen=True)\nclass A:\n    x: int = 1  # s\n    # m: a length\n    y: int = 2\n    z: int = 3\n"
    )
    assert list(undocumented(source)) == ["A.x", "A.z"]


def test_settings_are_frozen_at_every_level() -> None:
    every = list(groups(SETTINGS))
    assert len(every) > 50
    for group in every:
        with pytest.raises(FrozenInstanceError):
            setattr(group, fields(group)[0].name, None)

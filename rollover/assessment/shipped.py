"""What a scenario keeps of the shipped one that it was made from, and what differs: told wherever its title stands.

A title is the name of a shipped scenario, and it stays when values are replaced: it finds the file again.
"""

from __future__ import annotations

import functools
from collections import Counter
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from rollover.scenario import Scenario, load
from rollover.spec import document

MOST_IN_WORDS = 12  # differences that are told one by one on a terminal
MOST_OF_A_PART = 6  # values of a part that only one of them has, told one by one; effects have up to six numbers
WHOLE = ("kind", "name")  # a part with another kind or name is another part, told as one
SAID = ("title", "provenance")  # words about the values


@dataclass(frozen=True, kw_only=True)
class Difference:
    """A value by its path, as shipped and now, in words; a part that was exchanged is told as one."""

    path: str
    shipped: str
    now: str


@dataclass(frozen=True, kw_only=True)
class Origin:
    """The shipped scenario by its name, and what differs from it."""

    name: str
    differences: tuple[Difference, ...]

    @property
    def in_words(self) -> str:
        """One line; empty where nothing differs."""
        if not self.differences:
            return ""
        changes = [f"{d.path}: {d.shipped} -> {d.now}" for d in self.differences[:MOST_IN_WORDS]]
        more = len(self.differences) - len(changes)
        return f"Differs from the shipped {self.name}: " + "; ".join(changes) + (f"; {more} more" if more else "")


def origin(scenario: Scenario) -> Origin | None:
    """The shipped scenario with this title and what differs; None for a scenario with a title of its own."""
    path = _file(scenario.title)
    if path is None:
        return None
    was, now = _leaves(_shipped(path)), _leaves(scenario)
    changed = [p for p in [*was, *(p for p in now if p not in was)] if was.get(p) != now.get(p)]
    parts = [p.rpartition(".")[0] for p in changed if p.rpartition(".")[2] in WHOLE and p in was and p in now]
    found: dict[str, Difference] = {}
    alone = _one_sided(was, now) | _one_sided(now, was)
    for p in changed:
        above = next((part for part in sorted(parts, key=len) if part and p.startswith(f"{part}.")), None)
        if above is None and (part := next((part for part in alone if p.startswith(f"{part}.")), None)):
            name, before, after = part, _elements(was, part), _elements(now, part)
        else:
            key = next((f"{above}.{word}" for word in WHOLE if f"{above}.{word}" in changed), p) if above else p
            name, before, after = above or p, _shown(was.get(key)), _shown(now.get(key))
            if before == after:  # to the last digit
                before, after = repr(was.get(key)), repr(now.get(key))
        found.setdefault(name, Difference(path=name, shipped=before, now=after))
    return Origin(name=path.stem, differences=tuple(found.values()))


def _one_sided(some: Mapping[str, Any], others: Mapping[str, Any]) -> set[str]:
    """Largest parts of more than a few values that the others have nothing of."""
    counts = Counter(part for path in some for part in _above(path))
    shared = {part for path in others for part in _above(path)}
    alone = {part for part, count in counts.items() if count > MOST_OF_A_PART and part not in shared}
    return {part for part in alone if alone.isdisjoint(_above(part))}


def _above(path: str) -> list[str]:
    words = path.split(".")
    return [".".join(words[:n]) for n in range(1, len(words))]


def _elements(values: Mapping[str, Any], part: str) -> str:
    """Names of what stands directly in a part."""
    inside = (path.removeprefix(f"{part}.").partition(".")[0] for path in values if path.startswith(f"{part}."))
    return ", ".join(dict.fromkeys(inside)) or "none"


def _leaves(scenario: Scenario) -> dict[str, Any]:
    """Every value by its path; what is not given and what is empty are one."""
    leaves = ((leaf.path, leaf.value) for leaf in document.paths(scenario) if not set(leaf.path.split(".")) & {*SAID})
    return {path: value for path, value in leaves if not _nothing(value)}


def _nothing(value: Any) -> bool:
    return value is None or (isinstance(value, (tuple, list, Mapping)) and not value)


def _shown(value: Any) -> str:
    if _nothing(value):
        return "none"
    if isinstance(value, (tuple, list)):
        return f"[{', '.join(_shown(v) for v in value)}]"
    if isinstance(value, float):
        return f"{value + 0.0:.6g}"
    return str(value)


@functools.cache
def _file(title: str) -> Path | None:
    """The shipped scenario of a title; each says its own on one line, so that most files need not be parsed."""
    files = sorted(document.shipped_folder().glob("*.yaml"))
    able = (path for path in files if title in path.read_text(encoding="utf-8"))
    return next((path for path in able if document.headings(path)["title"].plain == title), None)


@functools.cache
def _shipped(path: Path) -> Scenario:
    return load(path)

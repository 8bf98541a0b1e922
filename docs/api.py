"""Reference page of `import rollover`: every public name with its signature, what it takes, gives and raises."""

from __future__ import annotations

import dataclasses
import inspect
import re
from collections.abc import Callable, Iterator, Sequence
from typing import Any

import rollover

Escape = Callable[[str], str]
Table = Callable[[Sequence[str], Sequence[Sequence[str]]], str]
SECTION = re.compile(r"^(Parameters|Returns|Raises|Yields)\n-+\n", flags=re.MULTILINE)


def page(plain: Escape, code: Escape, table: Table) -> str:
    """Markdown; functions first, then the classes of what they give."""
    things = {name: getattr(rollover, name) for name in rollover.__all__ if name != "__version__"}
    text = [
        "# Python interface\n",
        plain(_lead(rollover)) + " The page [Python](../docs/python.md) shows it at work.\n",
    ]
    for name, thing in sorted(things.items(), key=lambda pair: (inspect.isclass(pair[1]), pair[0].lower())):
        lead, *sections = SECTION.split(inspect.getdoc(thing) or "")
        text.append(f"## {name}\n")
        if not inspect.isclass(thing):
            text.append(f"```text\n{_signature(name, thing)}\n```\n")
        text.append(plain(" ".join(lead.split())) + "\n")
        for title, body in zip(sections[::2], sections[1::2], strict=True):
            rows = [(code(entry), plain(meaning)) for entry, meaning in _entries(body)]
            text.append(table((title.lower(), "meaning"), rows))
        if inspect.isclass(thing) and (members := _members(thing)):
            text.append(table(("member", "what"), [(code(member), plain(what)) for member, what in members]))
    return "\n".join(text)


def _lead(thing: Any) -> str:
    return " ".join((inspect.getdoc(thing) or "").partition("\n")[0].split())


def _signature(name: str, function: Any) -> str:
    """Signature as it is written, an argument a line where it is long."""
    arguments = []
    parameters = inspect.signature(function).parameters.values()
    starred = False
    for p in parameters:
        if p.kind is p.KEYWORD_ONLY and not starred:
            starred = True
            arguments.append("*")
        mark = "*" if p.kind is p.VAR_POSITIONAL else "**" if p.kind is p.VAR_KEYWORD else ""
        starred = starred or p.kind is p.VAR_POSITIONAL
        kind = "" if p.annotation is p.empty else f": {p.annotation}"
        arguments.append(f"{mark}{p.name}{kind}" + ("" if p.default is p.empty else f" = {p.default!r}"))
    short = f"{name}({', '.join(arguments)})"
    return short if len(short) <= 100 else f"{name}(\n    " + ",\n    ".join(arguments) + ",\n)"


def _entries(body: str) -> Iterator[tuple[str, str]]:
    """Names and meanings of a section in numpy's form: a name at the margin, its meaning indented below."""
    for entry in re.split(r"\n(?=\S)", body.strip("\n")):
        name, _, meaning = entry.partition("\n")
        yield name.strip(), " ".join(meaning.split())


def _members(kind: type) -> list[tuple[str, str]]:
    """Fields, properties and methods that are public; of a field its type."""
    found = []
    if dataclasses.is_dataclass(kind):
        found += [(f.name, str(getattr(f.type, "__name__", f.type))) for f in dataclasses.fields(kind)]
    for name, member in inspect.getmembers(kind):
        own = any(name in vars(base) for base in kind.__mro__ if base.__module__.startswith("rollover"))
        if name.startswith("_") or not own or any(name == known for known, _ in found):
            continue
        if isinstance(member, property) or callable(member):
            found.append((name if isinstance(member, property) else f"{name}()", _lead(member)))
    return found

"""YAML text to nodes, as far as a text may go: what it stands for is counted, and rows of numbers are read as one.

ruamel takes 55 us for a value; a row of plain numbers becomes one scalar of style `ROW_STYLE`, 20 times faster.
"""

from __future__ import annotations

import re
from collections.abc import Iterator
from typing import Any

from ruamel.yaml import YAML
from ruamel.yaml.composer import Composer
from ruamel.yaml.nodes import MappingNode, ScalarNode, SequenceNode
from ruamel.yaml.scanner import Scanner
from ruamel.yaml.tokens import ScalarToken

from rollover.system import boundary, budget

ROW_STYLE = "["
LEAST = 2  # numbers in a row that is read as one
# numbers that every reader takes for the same: no base but ten, no zeros in front; atomic, so that no text takes long
_NUMBER = r"(?>-?(?>0|[1-9][0-9]{0,17})(?>\.[0-9]+)?(?>[eE][-+]?[0-9]{1,3})?)"
_ROW = re.compile(rf"\[\s*+(?:{_NUMBER}\s*+,\s*+){{{LEAST - 1},}}+{_NUMBER}\s*+\]")
DEEP = re.compile(r"(?:[\[{]\s*+){60}")  # the parser needs seconds to give up on brackets in brackets


class TooMuchError(ValueError):
    """A text stands for more than it may; `line` counts from 0."""

    def __init__(self, message: str, line: int = 0) -> None:
        super().__init__(message)
        self.line = line


def compose(text: str) -> Any:
    """Root node of a text, None of an empty one. Raises `TooMuchError`, ruamel's errors and ``RecursionError``."""
    budget.check_count(len(text), budget.ROWS, TooMuchError, "characters")
    if len(text) > budget.TEXT:
        rest = len(text) - sum(row.end() - row.start() for row in _ROW.finditer(text))
        budget.check_count(rest, budget.TEXT, TooMuchError, "characters beside rows of numbers")
    if deep := DEEP.search(text):
        raise TooMuchError("nested too deeply; a few levels are needed", _line(text, deep))
    yaml = YAML(typ="safe", pure=True)
    yaml.Scanner, yaml.Composer = _Scanner, _Composer
    with boundary.quiet():  # an anchor may be used again, of which ruamel warns: the later one counts
        root = yaml.compose(text)
    if root is not None:
        budget.check_count(_size(root, {}), budget.VALUES, TooMuchError, "values, aliases counted in full")
    return root


def numbers(node: Any) -> Iterator[tuple[int | float, int]]:
    """Numbers of a node of style `ROW_STYLE`, each with the line that it stands on, counted from 0."""
    line = node.start_mark.line
    for cell in node.value[1:-1].split(","):
        number = cell.strip()
        line += cell.count("\n", 0, cell.index(number))
        yield (int(number) if number.lstrip("-").isdecimal() else float(number)), line
        line += cell.count("\n", cell.index(number))


def _line(text: str, found: re.Match[str]) -> int:
    return text.count("\n", 0, found.start())


class _Scanner(Scanner):  # type: ignore[misc]  # ruamel has no types
    def fetch_flow_sequence_start(self) -> None:
        """A list, of which a row of numbers is one token."""
        reader = self.reader
        row = _ROW.match(reader.buffer, reader.pointer)
        if row is None:
            super().fetch_flow_sequence_start()
            return
        self.save_possible_simple_key()
        self.allow_simple_key = False
        start = reader.get_mark()
        reader.forward(row.end() - row.start())
        self.tokens.append(ScalarToken(row[0], False, start, reader.get_mark(), ROW_STYLE))


class _Composer(Composer):  # type: ignore[misc]
    def compose_node(self, parent: Any, index: Any) -> Any:
        """A node, counted before it is made."""
        self.nodes = getattr(self, "nodes", 0) + 1
        if self.nodes > budget.VALUES:  # what an alias stands for is counted once all is there
            line = self.parser.peek_event().start_mark.line

            def refuse(message: str) -> Exception:
                return TooMuchError(message, line)

            budget.check_count(self.nodes, budget.VALUES, refuse, "values")
        return super().compose_node(parent, index)


def _size(node: Any, known: dict[int, int]) -> int:
    """How many values a node stands for, aliases counted in full; each node is looked at once."""
    if id(node) not in known:
        known[id(node)] = 1  # should it contain itself
        if isinstance(node, ScalarNode):
            known[id(node)] += node.value.count(",") // budget.ROW if node.style == ROW_STYLE else 0
        elif isinstance(node, (MappingNode, SequenceNode)):
            children = [n for pair in node.value for n in pair] if isinstance(node, MappingNode) else node.value
            known[id(node)] += sum(_size(child, known) for child in children)
    return known[id(node)]

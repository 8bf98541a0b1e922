"""YAML text to a tree whose every value knows its file and line, and back. The only YAML home."""

from __future__ import annotations

import functools
import io
import re
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

from ruamel.yaml import YAML
from ruamel.yaml.comments import CommentedMap, CommentedSeq
from ruamel.yaml.error import MarkedYAMLError, YAMLError
from ruamel.yaml.nodes import MappingNode, ScalarNode, SequenceNode
from ruamel.yaml.representer import RoundTripRepresenter
from ruamel.yaml.scalarstring import DoubleQuotedScalarString, SingleQuotedScalarString

from rollover.spec.document import yaml_reader
from rollover.system import budget
from rollover.system.errors import Fault, InputError, cured

CURE = "plain values, lists and mappings of them are allowed"
SYNTAX = "quote text that holds : # [ ] { } & * ! %, and indent with blanks"
_TAG = "tag:yaml.org,2002:"
_PLAIN = (f"{_TAG}map", f"{_TAG}seq", f"{_TAG}str")  # of mappings, lists, and rows of numbers as they are read

Scalar = str | int | float | bool | None


@dataclass(frozen=True, kw_only=True)
class Place:
    """Where a value was written: the file as messages name it, and the folder that its includes start from."""

    file: str
    line: int | None
    folder: Path

    def fault(self, path: str, message: str) -> InputError:
        """Say that something is wrong here."""
        return InputError(cured(Fault(file=self.file, line=self.line, path=path, message=message), CURE))


@dataclass(frozen=True, kw_only=True)
class Node:
    """A value with its place; `key` is the place of the key that it stands under.

    Of a value in a mapping that lies over a base, `laid` is the place of its key there and `over` what it replaces.
    """

    value: Scalar | Mapping[str, Node] | tuple[Node, ...]
    place: Place
    key: Place
    laid: Place | None = None
    over: Node | None = None

    @property
    def plain(self) -> Any:
        """The bare value: dicts, lists and scalars."""
        if isinstance(self.value, Mapping):
            return {key: child.plain for key, child in self.value.items()}
        if isinstance(self.value, tuple):
            return [child.plain for child in self.value]
        return self.value

    @property
    def in_short(self) -> str:
        """What it is, and nothing of what stands in it: a file that somebody else names may be anything."""
        kinds = {Mapping: "a mapping", tuple: "a list"}
        return next((said for kind, said in kinds.items() if isinstance(self.value, kind)), "a single value")

    @property
    def kind(self) -> Scalar:
        """The scalar under the key `kind`, if there is one."""
        child = self.value.get("kind") if isinstance(self.value, Mapping) else None
        return None if child is None or isinstance(child.value, (Mapping, tuple)) else child.value


def read(path: Path) -> Node:
    """Read a file. Raises `InputError`."""
    start = Place(file=shown(path), line=1, folder=path.parent)

    def refuse(message: str) -> InputError:
        return replace(start, line=None).fault("", message)

    try:
        budget.check_count(path.stat().st_size, budget.ROWS, refuse, "bytes")
        data = path.read_bytes()
        text = data.decode("utf-8-sig")
    except OSError as e:
        raise replace(start, line=None).fault(
            "", f"cannot be read: {e.strerror}; a file that may be read is needed"
        ) from None
    except UnicodeDecodeError as e:
        line = data.count(b"\n", 0, e.start) + 1
        raise replace(start, line=line).fault(
            "", f"not UTF-8 text, got byte 0x{data[e.start]:02x}; save it as UTF-8"
        ) from None
    return parse(text, start)


def shown(path: Path) -> str:
    """How messages name a file: relative where it lies below the working folder."""
    try:
        return str(path.resolve().relative_to(Path.cwd()))
    except ValueError:
        return str(path)


def parse(text: str, start: Place) -> Node:
    """Read YAML 1.2 text; `start` names the file, without a line for text that is not from one. Raises `InputError`."""
    return _parsed(text, start, budget.factor())


@functools.lru_cache(maxsize=4)  # a command asks a file what it is before it reads it, and reads its base with it
def _parsed(text: str, start: Place, _factor: float) -> Node:

    def at(line: int) -> Place:
        return start if start.line is None else replace(start, line=line + 1)

    try:
        root = yaml_reader.compose(text)
        if root is None:
            raise at(0).fault("", "empty, got nothing but comments; a mapping is needed")
        builder = _Builder(at)
        node = builder.build(root, at(0), "", ())
    except yaml_reader.TooMuchError as e:
        raise at(e.line).fault("", str(e)) from None
    except MarkedYAMLError as e:
        mark = e.problem_mark or e.context_mark
        reason = ", ".join(str(part) for part in (e.context, e.problem) if part)
        raise at(mark.line if mark else 0).fault("", f"not valid YAML: {reason}; {SYNTAX}") from None
    except YAMLError as e:  # a character that YAML does not allow
        line = text.count("\n", 0, getattr(e, "position", 0))
        reason = getattr(e, "reason", str(e).splitlines()[0])
        raise at(line).fault("", f"not valid YAML: {reason}; printable text is needed") from None
    except RecursionError:
        raise at(0).fault("", "nested too deeply; a few levels are needed") from None
    if builder.faults:
        raise InputError(*builder.faults)
    return node


class _Builder:
    def __init__(self, at: Any) -> None:
        self.at = at
        self.faults: list[Fault] = []
        self.scalars = YAML(typ="safe", pure=True).constructor

    def build(self, node: Any, key: Place, path: str, inside: tuple[int, ...]) -> Node:
        place: Place = self.at(node.start_mark.line)
        if id(node) in inside:
            raise place.fault(path, "contains itself through an alias")
        inside = (*inside, id(node))
        listed = isinstance(node, (MappingNode, SequenceNode)) or node.style == yaml_reader.ROW_STYLE
        if listed and str(node.tag) not in _PLAIN:
            self._fault(place, path, f"unknown tag, got {node.tag}; plain values are allowed")
        if isinstance(node, MappingNode):
            return Node(value=self._mapping(node, path, inside), place=place, key=key)
        if isinstance(node, SequenceNode):
            children = [
                self.build(child, self.at(child.start_mark.line), _join(path, str(i)), inside)
                for i, child in enumerate(node.value)
            ]
            return Node(value=tuple(children), place=place, key=key)
        if node.style == yaml_reader.ROW_STYLE:
            return Node(value=tuple(self._row(node, place)), place=place, key=key)
        if not node.value and not node.style:
            place = key  # nothing written: the mark stands wherever the next token is
        return Node(value=self._scalar(node, place, path), place=place, key=key)

    def _row(self, node: Any, place: Place) -> Iterator[Node]:
        first = node.start_mark.line
        for number, line in yaml_reader.numbers(node):
            first, place = (first, place) if line == first else (line, self.at(line))
            yield Node(value=number, place=place, key=place)

    def _mapping(self, node: Any, path: str, inside: tuple[int, ...]) -> dict[str, Node]:
        found: dict[str, Node] = {}
        for key_node, child in node.value:
            place = self.at(key_node.start_mark.line)
            if not isinstance(key_node, ScalarNode) or key_node.style == yaml_reader.ROW_STYLE:
                raise place.fault(path, "a key is not text, got a list or mapping; keys are plain words")
            key = key_node.value
            below = _join(path, key)
            if key in found:
                first = found[key].key.line
                self._fault(place, below, f"given twice, first on line {first}; once is allowed")
            found[key] = self.build(child, place, below, inside)
        return found

    def _scalar(self, node: Any, place: Place, path: str) -> Scalar:
        tag = str(node.tag)
        name = tag.removeprefix(_TAG)
        if name in ("int", "float", "bool", "null"):
            try:
                value: Scalar = self.scalars.construct_object(node, deep=True)
                if isinstance(value, int):
                    str(value)  # a base of 16 has no most digits when it is read, but none of it can be written
            except (LookupError, ValueError):  # a stated tag that the text is none of, or that has none
                return str(node.value)
            return value
        if name not in ("str", "timestamp", "merge", "value"):
            self._fault(place, path, f"unknown tag, got {tag}; plain values are allowed")
        return str(node.value)

    def _fault(self, place: Place, path: str, message: str) -> None:
        self.faults.append(Fault(file=place.file, line=place.line, path=path, message=message))


def _join(path: str, key: str) -> str:
    return f"{path}.{key}" if path else key


def planted(value: Any, place: Place) -> Node:
    """A tree of bare values that all stand at one place; `Node`s among them keep their own."""
    if isinstance(value, Node):
        return value
    if isinstance(value, Mapping):
        return Node(value={str(k): planted(v, place) for k, v in value.items()}, place=place, key=place)
    if isinstance(value, (list, tuple)):
        return Node(value=tuple(planted(v, place) for v in value), place=place, key=place)
    return Node(value=value, place=place, key=place)


# what a reader of YAML 1.1 takes for something other than text, by its types bool, null, merge, value, int, float
# (base 60 among them) and timestamp (yaml.org/type)
_OTHER = re.compile(
    r"""y|Y|yes|Yes|YES|n|N|no|No|NO|true|True|TRUE|false|False|FALSE|on|On|ON|off|Off|OFF
    |~|null|Null|NULL|<<|=
    |[-+]?0b[01_]+ | [-+]?0x[0-9a-fA-F_]+ | [-+]?[0-9][0-9_]*(:[0-5]?[0-9])*
    |[-+]?([0-9][0-9_]*)?\.[0-9._]*([eE][-+]?[0-9]+)? | [-+]?[0-9][0-9_]*[eE][-+]?[0-9]+
    |[-+]?[0-9][0-9_]*(:[0-5]?[0-9])+\.[0-9_]*
    |[-+]?\.(inf|Inf|INF)|\.(nan|NaN|NAN)
    |[0-9]{4}-[0-9]{1,2}-[0-9]{1,2}(([Tt]|[ \t]+)[0-9]{1,2}:[0-9]{2}:[0-9]{2}(\.[0-9]*)?([ \t]*(Z|[-+][0-9:]+))?)?
    """,
    re.VERBOSE,
)


class _Representer(RoundTripRepresenter):  # type: ignore[misc]  # ruamel has no types
    """Numbers as readers of YAML 1.1 read them too: a float has its point, 1.0e-05."""

    def represent_float(self, data: Any) -> Any:
        """Scalar node of a float, every bit of it."""
        node = super().represent_float(data)
        node.value = node.value if "." in node.value else node.value.replace("e", ".0e", 1)
        return node


_Representer.add_representer(float, _Representer.represent_float)


def write(mapping: Mapping[str, Any]) -> str:
    """YAML text of a tree of bare values, alike in 1.1 and 1.2; lists of scalars on one line, floats in every bit."""
    yaml = YAML(typ="rt", pure=True)
    yaml.Representer = _Representer
    yaml.width = 120
    yaml.indent(mapping=2, sequence=4, offset=2)
    stream = io.StringIO()
    yaml.dump(_styled(mapping), stream)
    return stream.getvalue()


def _styled(value: Any) -> Any:
    if isinstance(value, Mapping):
        return CommentedMap({_styled(key): _styled(child) for key, child in value.items()})
    if isinstance(value, (list, tuple)):
        styled = CommentedSeq(_styled(child) for child in value)
        if not any(isinstance(child, (Mapping, list, tuple)) for child in value):
            styled.fa.set_flow_style()
        return styled
    if isinstance(value, str) and not value.isprintable():
        return DoubleQuotedScalarString(value)  # any other style takes some rare characters for line breaks
    if isinstance(value, str) and _OTHER.fullmatch(value):
        return SingleQuotedScalarString(value)
    return value

"""Changes to valid files that know what a file is made of: trees, tables, archives, columns, bytes."""

from __future__ import annotations

import io
import json
import random
import re
import zipfile
from collections.abc import Callable
from pathlib import PurePath
from typing import Any

# in the place of a value, as it is written in YAML; all of them harmless
RAW = (
    *("null", "~", "true", "''", "x", "-1", "0", "1e400", "-1e400", ".nan", ".inf", "-.inf", "1e-320", "1_000", "0x1F"),
    *("0x" + "f" * 5000, "0o" + "7" * 9000),
    *("0o17", "1:30", "2020-01-01", "9" * 400, "9" * 5000, "1." + "3" * 400, "'" + "n" * 300 + "'", "[]", "{}", "[1]"),
    *("[[1, 2], [3]]", "{kind: [a, b]}", "{kind: {}}", "[null]", "!!binary aGk=", "!thing 3", "!!set {a, b}", "*a"),
    *(
        "&a [1]",
        "&b {<<: *b}",
        "'../../elsewhere'",
        "'/nowhere/at/all.yaml'",
        '"\\e[31mred\\a"',
        '"\\u202e\\0"',
        "'é\u200b'",
    ),
    *(
        "side_overturn",
        "drop_test.yaml",
        "a.yaml",
        "'a: b'",
        "1 m",
        "'1'",
        "1e9",
        "1e30",
        "-0.0",
        "18446744073709551616",
    ),
    *("{name: a}", "[{name: a}, {name: a}]", "'%s %n {0}'", "!!int x", "!!float 1e", "!!timestamp 5", "!!null x", "|-"),
)
WORDS = ("kind", "base", "title", "format", "name", "vehicle", "ground", "law", "channels", "unit", "é", "", "a.b", "*")
NUMBERS = (
    "0x" + "f" * 5000,
    "nan",
    "inf",
    "-inf",
    "",
    "x",
    "1e400",
    "9" * 400,
    "-",
    "1,5",
    "0x10",
    "1 2",
    "=1+1",
    '"',
    "NaN",
    "1e-400",
)
ENCODINGS = ("utf-16", "utf-16-le", "utf-32", "cp1252", "utf-7", "utf-8-sig")
_MARK = "@@{}@@"
_TOKEN = re.compile(r'"@@(\d+)@@"')

Rng = random.Random


def changed(name: str, data: bytes, rng: Rng) -> bytes:
    """A file changed once to three times, by what its name says it is."""
    for _ in range(rng.choice((1, 1, 1, 2, 3))):
        data = _once(name, data, rng)
    return data


def _once(name: str, data: bytes, rng: Rng) -> bytes:
    suffix = PurePath(name).suffix.lower()
    if rng.random() < 0.12:
        return raw(data, rng)
    if suffix in (".yaml", ".yml"):
        return yaml(data, rng) if rng.random() < 0.6 else text(data, rng)
    if suffix == ".json":
        return tree(data, rng)
    if suffix == ".parquet" and rng.random() < 0.75:
        return parquet(data, rng)
    if data[:2] == b"PK" and rng.random() < 0.8:
        return archive(data, rng)
    if b"\0" not in data[:2000]:
        return table(data, rng) if rng.random() < 0.6 else text(data, rng)
    return raw(data, rng)


def raw(data: bytes, rng: Rng) -> bytes:
    """Bytes cut off, emptied, flipped, repeated, overwritten by numbers at the ends of their ranges."""
    if not data:
        return rng.randbytes(20)
    at, size = rng.randrange(len(data)), rng.choice((1, 2, 4, 8, 16, 100))
    if rng.random() < 0.5:
        at = min(at, rng.randrange(min(len(data), 600)))  # headers
    edges = (b"\0", b"\xff", b"\x7f", b"\x80", b"\x01")
    match rng.randrange(10):
        case 0:
            return data[:at]
        case 1:
            return data[:at] + data[at + size :]
        case 2:
            return data[:at] + rng.choice(edges) * size + data[at + size :]
        case 3:
            return data[:at] + rng.randbytes(size) + data[at:]
        case 4:
            return rng.choice(
                (b"", b"\0" * len(data), data[4:], b"PK\x03\x04" + data[4:], b"\x89HDF\r\n\x1a\n" + data[8:])
            )
        case 5:
            return data[:at] + data[at : at + size] * 3 + data[at + size :]
        case 6:
            number = rng.choice((0, 1, 2**31 - 1, 2**31, 2**32 - 1, 2**63 - 1, 2**63, 2**64 - 1))
            whole = number.to_bytes(8, rng.choice(("little", "big")))
            return data[:at] + whole + data[at + 8 :]
        case 7:  # a letter of a text in it
            words = list(re.finditer(rb"[A-Za-z_]{3,}", data[:20000]))
            if words:
                word = rng.choice(words)
                k = rng.randrange(word.start(), word.end())
                return data[:k] + bytes([rng.randrange(256)]) + data[k + 1 :]
            return data[:at]
        case _:
            flipped = bytearray(data)
            for _ in range(rng.choice((1, 1, 2, 8))):
                flipped[rng.randrange(len(data)) if rng.random() < 0.5 else at] ^= 1 << rng.randrange(8)
            return bytes(flipped)


def text(data: bytes, rng: Rng) -> bytes:
    """Lines lost, doubled, moved, shifted; another encoding; characters put in."""
    lines = data.decode("utf-8", "replace").split("\n")
    k = rng.randrange(len(lines))
    match rng.randrange(9):
        case 0:
            del lines[k]
        case 1:
            lines.insert(k, lines[k])
        case 2:
            other = rng.randrange(len(lines))
            lines[k], lines[other] = lines[other], lines[k]
        case 3:
            lines[k] = rng.choice((" ", "  ", "\t", "- ")) + lines[k]
        case 4:
            lines[k] = lines[k].strip()
        case 5:
            return "\n".join(lines).encode(rng.choice(ENCODINGS), "replace")
        case 6:
            at = rng.randrange(len(lines[k]) + 1)
            lines[k] = lines[k][:at] + rng.choice("\0\x1b\"':{}[],&*!|>%@`#\u2028é;\t-") + lines[k][at:]
        case 7:
            lines[k] = lines[k].replace(",", ";") if rng.random() < 0.5 else lines[k].replace(".", ",")
        case 8:
            found = list(re.finditer(r"[-+]?\d+(\.\d+)?([eE][-+]?\d+)?", lines[k]))
            if found:
                m = rng.choice(found)
                lines[k] = lines[k][: m.start()] + rng.choice((*NUMBERS, *RAW)) + lines[k][m.end() :]
    return "\n".join(lines).encode()


def table(data: bytes, rng: Rng) -> bytes:
    """Cells, rows and columns of a table of text."""
    lines = data.decode("utf-8", "replace").split("\n")
    mark = max(",;\t|:", key=lambda c: sum(line.count(c) for line in lines[:20]))
    k = rng.randrange(min(len(lines), rng.choice((3, 12, len(lines)))))
    cells = lines[k].split(mark)
    i = rng.randrange(len(cells))
    match rng.randrange(6):
        case 0:
            cells[i] = rng.choice(NUMBERS)
        case 1:
            cells.append(rng.choice(NUMBERS))
        case 2:
            del cells[i]
        case 3:
            cells[i] = rng.choice(
                ("n" * 300, "../x", "\x1b[2J", "a/b", "con", "NaN", "time", "é" * 200, "x\0y", cells[0])
            )
        case 4:
            cells = cells * rng.choice((2, 50))
        case 5:
            lines = lines[:k] + lines[k:][:: rng.choice((-1, 2))]
            return "\n".join(lines).encode()
    lines[k] = mark.join(cells)
    return "\n".join(lines).encode()


def _nodes(thing: Any, path: tuple[Any, ...] = ()) -> list[tuple[Any, ...]]:
    below = thing.items() if isinstance(thing, dict) else enumerate(thing) if isinstance(thing, list) else ()
    return [path, *(p for key, child in below for p in _nodes(child, (*path, key)))]


def _altered(thing: Any, rng: Rng, new: Callable[[], Any]) -> Any:
    """One value of a tree replaced, removed, doubled, renamed or moved."""
    paths = _nodes(thing)
    path = rng.choice(paths)
    if not path:
        return new() if rng.random() < 0.3 else thing
    part = thing
    for key in path[:-1]:
        part = part[key]
    last = path[-1]
    match rng.randrange(8):
        case 0:
            del part[last]
        case 1 if isinstance(part, dict):
            part[rng.choice((*WORDS, f"{last}x", "n" * 300))] = part.pop(last)
        case 2 if isinstance(part, dict):
            part[rng.choice(WORDS)] = new()
        case 3 if isinstance(part, list):
            part.insert(last, part[last])
        case 4:
            other = thing
            for key in rng.choice(paths):
                other = (
                    other[key]
                    if isinstance(other, (dict, list))
                    and (key in other if isinstance(other, dict) else key < len(other))
                    else other
                )
            part[last] = json.loads(json.dumps(other))
        case 5:
            part[last] = [part[last]]
        case _:
            part[last] = new()
    return thing


def yaml(data: bytes, rng: Rng) -> bytes:
    """A value of a tree, written as YAML allows and the project may not."""
    from ruamel.yaml import YAML

    try:
        thing = json.loads(json.dumps(YAML(typ="safe", pure=True).load(data.decode()), default=str))
    except Exception:
        return text(data, rng)
    used: list[str] = []

    def new() -> str:
        used.append(rng.choice(RAW))
        return _MARK.format(len(used) - 1)

    thing = _altered(thing, rng, new)
    whole = json.dumps(thing, indent=1, ensure_ascii=False)
    return _TOKEN.sub(lambda m: used[int(m[1])], whole).encode("utf-8", "replace")


VALUES: tuple[Any, ...] = (
    *(None, True, "", "x", -1, 0, 1e300, 10**400, -(10**19), 1e-320, float("nan"), float("inf"), [], {}, [1], [[]]),
    *({"kind": ["a"]}, "n" * 300, "../../x", "\x1b[31m", "\u202e", [None], {"": 0}, "</script>", "é", 2**64, [1, "a"]),
)


def tree(data: bytes, rng: Rng) -> bytes:
    """A value of a JSON file."""
    try:
        thing = json.loads(data)
    except ValueError:
        return raw(data, rng)
    text_ = json.dumps(_altered(thing, rng, lambda: rng.choice(VALUES)))
    return text_.encode()


def archive(data: bytes, rng: Rng) -> bytes:
    """A member of a zip: its content, its name, whether it is there at all."""
    try:
        with zipfile.ZipFile(io.BytesIO(data)) as old:
            members = {i.filename: old.read(i) for i in old.infolist()}
    except Exception:
        return raw(data, rng)
    if not members:
        return raw(data, rng)
    name = rng.choice(sorted(members))
    match rng.randrange(6):
        case 0:
            del members[name]
        case 1:
            other = rng.choice(("../x", "/x", "n" * 300, "a/b/c", "con", name.upper(), "x\x1b[31m", f"{name}.gz"))
            members[other] = members.pop(name)
        case _:
            members[name] = _once(name, members[name], rng)
    stream = io.BytesIO()
    with zipfile.ZipFile(stream, "w", rng.choice((zipfile.ZIP_STORED, zipfile.ZIP_DEFLATED))) as new:
        for key, value in members.items():
            new.writestr(key, value)
    return stream.getvalue()


def parquet(data: bytes, rng: Rng) -> bytes:
    """Columns of other types, gone, renamed; metadata of other types."""
    import pyarrow as pa
    import pyarrow.parquet as pq

    try:
        whole = pq.read_table(io.BytesIO(data))
        names = whole.column_names  # of bytes that are no text, where an earlier change met them
    except Exception:
        return raw(data, rng)
    if not names:
        return raw(data, rng)
    metadata = dict(whole.schema.metadata or {})
    i = rng.randrange(len(whole.column_names))
    name, n = whole.column_names[i], whole.num_rows
    others = (
        pa.array(["a"] * n), pa.array([None] * n), pa.array([[1.0]] * n), pa.array([{"a": 1}] * n),
        pa.array([True] * n),
        pa.array([b"\xff"] * n), pa.array([0] * n, pa.timestamp("ns")), pa.array([0] * n, pa.duration("s")),
        pa.array(["a"] * n).dictionary_encode(), pa.array([2**63 - 1] * n), pa.array([float("nan")] * n),
        pa.array([float("inf")] * n), pa.array([1.0] * n, pa.float16()), pa.array([0] * n, pa.date32()),
        pa.array([2**64 - 1] * n, pa.uint64()), pa.array([1.0] * n, pa.float32()),
        pa.array([1] * n, pa.decimal128(38, 2)),
    )  # fmt: skip
    match rng.randrange(6):
        case 0:
            whole = whole.remove_column(i)
        case 1:
            whole = whole.rename_columns(
                [
                    rng.choice((*WORDS, "n" * 300, "time", "../x", "\x1b[31m")) if k == i else c
                    for k, c in enumerate(whole.column_names)
                ]
            )
        case 2:
            whole = whole.slice(0, rng.choice((0, 1, 2)))
        case 3 | 4 if metadata.get(b"rollover"):
            metadata[b"rollover"] = rng.choice((tree, tree, tree, raw))(metadata[b"rollover"], rng)
        case _:
            whole = whole.set_column(i, name, rng.choice(others))
    stream = io.BytesIO()
    try:
        pq.write_table(whole.replace_schema_metadata(metadata), stream)
    except Exception:
        return raw(data, rng)
    return stream.getvalue()

"""One tensor from a `.pt` file of PyTorch, new (a zip) or old, without PyTorch and without running what is pickled.

A pickle is a program. Of its instructions only those are followed here that `torch.save` writes for a tensor, and of
the calls only those that rebuild one; whatever else stands there is refused before anything is looked up or called.
"""

from __future__ import annotations

import io
import math
import pickletools
import zipfile
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from rollover.recording.importers.importer import check_claim, reading, starts_with

Array = NDArray[np.float64]
MOST_PICKLED = 1 << 16  # bytes: that of a tensor has 156, the numbers are not in it
MAGIC = 0x1950A86A20F9469CFC6C  # what the old format begins with
VERSION = 1001  # of the old format
STORAGES = {"DoubleStorage": "f8", "FloatStorage": "f4", "LongStorage": "i8", "IntStorage": "i4"}
REBUILD, ORDERED = "torch._utils _rebuild_tensor_v2", "collections OrderedDict"
_MARK = object()


@dataclass(frozen=True, kw_only=True)
class _Name:
    """A global that a pickle names; it is never looked up."""

    name: str


@dataclass(frozen=True, kw_only=True)
class _Storage:
    """The numbers of a tensor, which stand elsewhere in the file: `count` of a `kind` under a `key`."""

    kind: str
    key: str
    count: int


@dataclass(frozen=True, kw_only=True)
class _Tensor:
    """How a tensor lies in its storage: all of `shape` and `strides` count numbers."""

    storage: _Storage
    offset: int
    shape: tuple[int, ...]
    strides: tuple[int, ...]


def read_tensor(path: Path) -> Array:
    """The one tensor of a file, float64. Raises `InputError` for anything that is none, and for pickled code."""
    with reading(path, "PyTorch tensor"):
        return (_from_zip if starts_with(path, b"PK\x03\x04") else _from_old)(path)


def _from_zip(path: Path) -> Array:
    with zipfile.ZipFile(path) as archive:
        parts = {info.filename.partition("/")[2]: info for info in archive.infolist()}
        for info in parts.values():
            if info.compress_type != zipfile.ZIP_STORED:
                raise ValueError(f"{info.filename} is compressed; PyTorch stores it as it is")
        if "data.pkl" not in parts:
            raise ValueError("no data.pkl inside")
        if parts["data.pkl"].file_size > MOST_PICKLED:
            raise ValueError(f"data.pkl has {parts['data.pkl'].file_size} bytes; at most {MOST_PICKLED} are allowed")
        tensor = _tensor(_followed(io.BytesIO(archive.read(parts["data.pkl"]))))
        order = archive.read(parts["byteorder"])[:8] if "byteorder" in parts else b"little"
        part = parts.get(f"data/{tensor.storage.key}")
        if part is None:
            raise ValueError(f"no data/{tensor.storage.key[:20]} inside")
        _check(path, tensor, part.file_size)
        return _laid_out(tensor, archive.read(part), "<" if order.strip() == b"little" else ">")


def _from_old(path: Path) -> Array:
    check_claim(path, path.stat().st_size)
    file = io.BytesIO(path.read_bytes())
    if _followed(file) != MAGIC or _followed(file) != VERSION:
        raise ValueError("no PyTorch file: its mark is missing")
    system = _followed(file)
    order = "<" if isinstance(system, dict) and system.get("little_endian") is True else ">"
    tensor = _tensor(_followed(file))
    if _followed(file) != [tensor.storage.key]:
        raise ValueError("numbers of several tensors; one is read")
    count = int.from_bytes(file.read(8), "little" if order == "<" else "big", signed=True)
    if count != tensor.storage.count:
        raise ValueError(f"{count} numbers follow, {tensor.storage.count} are claimed")
    rest = file.read()
    _check(path, tensor, len(rest))
    return _laid_out(tensor, rest, order)


def _tensor(found: Any) -> _Tensor:
    if not isinstance(found, _Tensor):
        raise ValueError("holds no single tensor")
    return found


def _check(path: Path, tensor: _Tensor, size: int) -> None:
    """Refuse a tensor that is larger than its storage, and a storage that is larger than its file."""
    storage, width = tensor.storage, np.dtype(STORAGES[tensor.storage.kind]).itemsize
    check_claim(path, storage.count, most_per_byte=1.0)
    if storage.count * width != size:
        raise ValueError(f"claims {storage.count} numbers of {width} bytes, got {size} bytes of them")
    if min((tensor.offset, *tensor.shape, *tensor.strides)) < 0 or math.prod(tensor.shape) > storage.count:
        raise ValueError(f"claims a shape of {list(tensor.shape)[:8]} in {storage.count} numbers")
    last = tensor.offset + sum((n - 1) * step for n, step in zip(tensor.shape, tensor.strides, strict=True))
    if 0 in tensor.shape or last >= storage.count:
        raise ValueError(f"a shape of {list(tensor.shape)[:8]} reaches beyond its {storage.count} numbers")


def _laid_out(tensor: _Tensor, data: bytes, order: str) -> Array:
    flat = np.frombuffer(data, dtype=order + STORAGES[tensor.storage.kind])[tensor.offset :]
    steps = tuple(step * flat.itemsize for step in tensor.strides)
    return np.lib.stride_tricks.as_strided(flat, tensor.shape, steps).astype(np.float64)


def _followed(file: io.BytesIO) -> Any:
    """What one pickle makes, of plain values, names and tensors alone. ``ValueError`` for any other instruction."""
    stack: list[Any] = []
    memo: dict[Any, Any] = {}
    start = file.tell()
    for op, arg, _ in pickletools.genops(file):
        if file.tell() - start > MOST_PICKLED:
            raise ValueError(f"a pickle of more than {MOST_PICKLED} bytes; that of a tensor is short")
        if op.name == "STOP":
            return stack.pop()
        if op.name in ("PROTO", "FRAME"):
            continue
        if op.name in _PLAIN:
            stack.append(arg if op.name in _WITH_VALUE else _PLAIN[op.name]())
        elif op.name in ("BINPUT", "LONG_BINPUT"):
            memo[arg] = stack[-1]
        elif op.name in ("BINGET", "LONG_BINGET"):
            stack.append(memo[arg])
        elif op.name == "GLOBAL":
            stack.append(_named(str(arg)))
        elif op.name in ("TUPLE", "TUPLE1", "TUPLE2", "TUPLE3"):
            items = _to_mark(stack) if op.name == "TUPLE" else _last(stack, int(op.name[-1]))
            stack.append(tuple(items))
        elif op.name == "SETITEMS":
            pairs = _to_mark(stack)
            stack[-1].update(zip(pairs[::2], pairs[1::2], strict=True))
        elif op.name == "APPEND":
            item = stack.pop()
            stack[-1].append(item)
        elif op.name == "BINPERSID":
            stack.append(_storage(stack.pop()))
        elif op.name == "REDUCE":
            given = stack.pop()
            stack.append(_called(stack.pop(), given))
        else:
            raise ValueError(f"the pickle has an instruction {op.name}, which no tensor needs; it was not followed")
    raise ValueError("the pickle has no end")


_PLAIN: dict[str, Callable[[], Any]] = {
    "MARK": lambda: _MARK,
    "NONE": lambda: None,
    "NEWTRUE": lambda: True,
    "NEWFALSE": lambda: False,
    "EMPTY_DICT": dict,
    "EMPTY_LIST": list,
    "EMPTY_TUPLE": tuple,
}
_WITH_VALUE = frozenset({"BININT", "BININT1", "BININT2", "LONG1", "BINUNICODE"})
_PLAIN |= dict.fromkeys(_WITH_VALUE, lambda: None)


def _named(name: str) -> _Name:
    if name not in (REBUILD, ORDERED) and name.removeprefix("torch ") not in STORAGES:
        raise ValueError(f"the pickle names {name.replace(' ', '.')[:60]}, which no tensor needs; it was not called")
    return _Name(name=name)


def _called(what: Any, given: Any) -> Any:
    if what == _Name(name=ORDERED) and given == ():
        return {}
    if what != _Name(name=REBUILD) or len(given) < 4:
        raise ValueError("the pickle has a call that rebuilds no tensor; it was not made")
    storage, offset, shape, strides = given[:4]
    numbers = (offset, *shape, *strides)
    if not isinstance(storage, _Storage) or any(type(n) is not int for n in numbers) or len(shape) != len(strides):
        raise ValueError("the pickle rebuilds no tensor of numbers")
    return _Tensor(storage=storage, offset=offset, shape=shape, strides=strides)


def _storage(about: Any) -> _Storage:
    """`about` is ("storage", type, key, device, count), and None in old files."""
    if (
        not isinstance(about, tuple)
        or len(about) not in (5, 6)
        or about[0] != "storage"
        or about[5:] not in ((), (None,))
    ):
        raise ValueError("the pickle refers to something that is no storage")
    kind = about[1].name.removeprefix("torch ") if isinstance(about[1], _Name) else ""
    if kind not in STORAGES or type(about[2]) is not str or type(about[4]) is not int:
        raise ValueError(f"a storage of another kind, got {kind or about[1]!r}; {', '.join(STORAGES)} are read")
    return _Storage(kind=kind, key=about[2], count=about[4])


def _to_mark(stack: list[Any]) -> list[Any]:
    at = max(i for i, item in enumerate(stack) if item is _MARK)
    items = stack[at + 1 :]
    del stack[at:]
    return items


def _last(stack: list[Any], many: int) -> list[Any]:
    items = stack[-many:]
    del stack[-many:]
    return items

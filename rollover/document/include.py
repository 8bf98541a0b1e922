"""Files inside files: a file name where a mapping belongs, and `base` with what is to differ from it."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path

import numpy as np

from rollover.document.slot import Slot
from rollover.document.tree import Node, planted, read, shown
from rollover.faults import Fault, InputError, excerpt, nearest

BASE = "base"
ENDINGS = (".yaml", ".yml")
GRIDS = (".csv", ".npy")
MOST_NODES = 500_000
MOST_ECHOED = 80  # characters of what a reader says of a file that is no grid: it may quote the file


def shipped_folder() -> Path:
    """Folder of the scenarios that come with the package, in an installed wheel and in a checkout alike."""
    package = Path(__file__).resolve().parent.parent
    inside = package / "scenarios"
    return inside if inside.is_dir() else package.parent / "scenarios"


def find(name: str | Path, folder: str = "") -> Path:
    """File of a scenario given by its path or by the name of a shipped one; `folder` says vehicles or soils."""
    path = Path(name)
    if path.is_file():
        return path
    shelf = shipped_folder() / folder
    for candidate in (shelf / path, shelf / f"{path}.yaml"):
        if candidate.is_file():
            return candidate
    if path.is_dir():
        raise InputError(Fault(file=str(name), message="a folder, not a file"))
    known = [p.stem for p in sorted(shelf.glob("*.yaml"))]
    here = [str(p) for p in sorted(path.parent.glob("*.yaml"))] if path.parent.is_dir() else []
    close = nearest(path.stem, known) or nearest(str(path), here)
    help_ = f"did you mean {close[0]!r}?" if close else f"shipped: {', '.join(known) or 'none'}"
    raise InputError(Fault(file=str(name), message=f"no such file; {help_}"))


def headings(path: Path) -> dict[str, Node]:
    """Top-level keys of a file and of those that it is based on, to see what it describes. Raises `InputError`."""
    found: dict[str, Node] = {}
    chain: list[Path] = []
    while path.resolve() not in chain:
        chain.append(path.resolve())
        root = read(path)
        below = root.value if isinstance(root.value, Mapping) else {}
        found = {**below, **found}
        base = below.get(BASE)
        if base is None or not isinstance(base.value, str):
            break
        folders = (base.place.folder, shipped_folder())
        path = next((f / base.value for f in folders if (f / base.value).is_file()), path)
    return found


def expand(node: Node, slot: Slot, chain: tuple[Path, ...], path: str = "", under: Node | None = None) -> Node:
    """Put the content of files in the place of their names, and lay mappings over what they are based on.

    `under` is what the node is laid over, key by key; a file name, a list and a different `kind` replace it whole.
    `chain` holds the files that are being read, to find one that includes itself.
    """
    if isinstance(node.value, str) and node.value.endswith(ENDINGS) and slot.kinds:
        return _included(node, slot, chain, path)
    if slot.grid and isinstance(node.value, str) and node.value.endswith(GRIDS):
        return _grid(node, path)
    if isinstance(node.value, tuple):
        elements = [
            expand(child, slot.element(i) or Slot(type=object), chain, _join(path, str(i)))
            for i, child in enumerate(node.value)
        ]
        return replace(node, value=tuple(elements))
    if not isinstance(node.value, Mapping):
        return node
    below = dict(node.value)
    if slot.kinds and BASE in below and BASE not in slot.keys(node.kind):
        base = below.pop(BASE)
        if not isinstance(base.value, str) or not base.value.endswith(ENDINGS):
            raise base.place.fault(_join(path, BASE), f"not a file name, got {base.plain!r}; a .yaml file is needed")
        under = _included(base, slot, chain, _join(path, BASE))
    if under is None or not isinstance(under.value, Mapping) or (node.kind or under.kind) != under.kind:
        under = replace(node, value={})
    assert isinstance(under.value, Mapping)
    kind = node.kind or under.kind
    merged = dict(under.value)
    for key, child in below.items():
        merged[key] = expand(
            child, slot.child(key, kind) or Slot(type=object), chain, _join(path, key), under.value.get(key)
        )
    return replace(node, value=merged)


def _grid(node: Node, path: str) -> Node:
    """Rows of numbers from a file beside the one that names it, or among the shipped ones."""
    name = Path(str(node.value))
    folders = (node.place.folder, shipped_folder())
    file = next((f / name for f in folders if (f / name).is_file()), None)
    if file is None:
        raise node.place.fault(path, f"no such file, got {node.value!r}; a .csv or .npy file beside this one is needed")
    try:
        if file.suffix == ".npy":
            found = np.load(file, allow_pickle=False)
        else:
            found = np.loadtxt(file, delimiter=",", comments="#", ndmin=2)
        rows = np.asarray(found, dtype=float)
    except (OSError, ValueError, EOFError) as e:
        what = f"{shown(file)} is no grid of numbers"
        raise node.place.fault(path, f"{what}: {excerpt(str(e).splitlines()[0], MOST_ECHOED)}") from None
    if rows.ndim != 2 or rows.size > MOST_NODES or not np.isfinite(rows).all():
        what = f"{shown(file)} is no grid of finite numbers, got shape {rows.shape}"
        raise node.place.fault(path, f"{what}; two dimensions and at most {MOST_NODES} numbers are allowed")
    return planted(rows.tolist(), node.place)


def _included(node: Node, slot: Slot, chain: tuple[Path, ...], path: str) -> Node:
    name = Path(str(node.value))
    folders = (node.place.folder, shipped_folder())
    file = next((f / name for f in folders if (f / name).is_file()), None)
    if file is None:
        known = {(name.parent / p.name).as_posix() for f in folders for p in (f / name).parent.glob("*.yaml")}
        known |= {p.relative_to(folders[1]).as_posix() for p in folders[1].glob("*/*.yaml")}
        close = nearest(name.as_posix(), sorted(known))
        help_ = f"; did you mean {close[0]!r}?" if close else ""
        raise node.place.fault(path, f"no such file, got {node.value!r}{help_}")
    if file.resolve() in chain:
        names = [shown(f) for f in (*chain[chain.index(file.resolve()) :], file)]
        raise node.place.fault(path, f"a file includes itself, got {' -> '.join(names)}; no circles")
    root = read(file)
    if not isinstance(root.value, Mapping):
        # a file that somebody else's scenario names may be anything: what it is, not what stands in it
        what = "a list" if isinstance(root.value, tuple) else "a single value"
        raise root.place.fault("", f"not a mapping, got {what}; {slot.allowed()} is needed")
    return expand(root, slot, (*chain, file.resolve()), path)


def _join(path: str, key: str) -> str:
    return f"{path}.{key}" if path else key

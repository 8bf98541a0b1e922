"""Files inside files: a file name where a mapping belongs, and `base` with what is to differ from it."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager, suppress
from dataclasses import replace
from pathlib import Path

from rollover.spec.document import grids
from rollover.spec.document.slot import Slot
from rollover.spec.document.tree import Node, read, shown
from rollover.system.errors import Fault, InputError, excerpt, hint, nearest

BASE = "base"
ENDINGS = (".yaml", ".yml")
GRIDS = (".csv", ".npy")
# of shipped files, whose names without an ending may be used anywhere
SHELVES = ("", "vehicles", "vehicles/rops", "soils", "steels", "studies")


def shipped_folder() -> Path:
    """Folder of the scenarios that come with the package, in an installed wheel and in a checkout alike."""
    package = Path(__file__).resolve().parents[2]
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
        raise InputError(Fault(file=str(name), message="a folder, not a file; name a YAML file in it"))
    known = [p.stem for p in sorted(shelf.glob("*.yaml"))]
    here = [str(p) for p in sorted(path.parent.glob("*.yaml"))] if path.parent.is_dir() else []
    close = nearest(path.stem, known) or nearest(str(path), here)
    help_ = f"did you mean {close[0]!r}?" if close else f"shipped: {', '.join(known) or 'none'}"
    raise InputError(Fault(file=str(name), message=f"no such file; {help_}"))


def headings(path: Path) -> dict[str, Node]:
    """Top-level keys of a file and of those that it is based on, to see what it describes.

    Raises `InputError`, for a base that is not there too: without it nobody knows what the file is.
    """
    found: dict[str, Node] = {}
    chain: list[Path] = []
    while True:
        chain.append(path)
        root = read(path)
        below = root.value if isinstance(root.value, Mapping) else {}
        found = {**below, **found}
        base = below.get(BASE)
        if base is None or not isinstance(base.value, str):
            break
        file = _file(base)
        if file is None:
            raise _missing(base, BASE)
        _check_no_circle(base, file, chain, BASE)
        path = file
    return found


def stated_kind(keys: Mapping[str, Node], allowed: Iterable[str]) -> str | None:
    """The word under `kind` in a file's `headings`, None if there is none. Raises `InputError` for what is no word."""
    said = keys["kind"].plain if "kind" in keys else None
    if said is None or isinstance(said, str):
        return said
    message = f"not a word, got {excerpt(repr(said))}; {', '.join(allowed)} are allowed"
    raise keys["kind"].place.fault("kind", message)


@contextmanager
def named(path: Path | None) -> Iterator[None]:
    """Within it, a fault that knows no file is one of the file `path`, if any, at the line of its value or its base."""
    try:
        yield
    except InputError as e:
        if path is None:
            raise
        raise InputError(*(f if f.file else _placed(f, path) for f in e.faults)) from None


def _placed(fault: Fault, path: Path) -> Fault:
    below: Mapping[str, Node] = headings(path)
    found: Node | None = None
    for step in fault.path.split("."):
        if step not in below:
            break
        found = below[step]
        below = found.value if isinstance(found.value, Mapping) else {}
    own = read(path).value
    base = own.get(BASE) if isinstance(own, Mapping) else None
    if found is not None and found.key.file != str(path):
        found = base  # it stands in a file that this one is based on
    return replace(fault, file=str(path), line=None if found is None else found.key.line)


def expand(node: Node, slot: Slot, chain: tuple[Path, ...], path: str = "", under: Node | None = None) -> Node:
    """Put the content of files in the place of their names, and lay mappings over what they are based on.

    `under` is what the node is laid over, key by key; a file name, a list and a different `kind` replace it whole, a
    mapping over a list goes to its elements by name or place. `chain` holds the files that are being read, to find one
    that includes itself.
    """
    if isinstance(node.value, str) and slot.kinds and _means_file(node):
        return _included(node, slot, chain, path)
    if slot.grid and isinstance(node.value, str) and node.value.endswith(GRIDS):
        return _grid(node, path)
    read_so: Node | None = None if slot.written is None else slot.written.read(node, path, slot.written.unit)
    if read_so is not None:
        return read_so
    if isinstance(node.value, tuple):
        elements = [
            expand(child, slot.element(i) or Slot(type=object), chain, _join(path, str(i)))
            for i, child in enumerate(node.value)
        ]
        return replace(node, value=tuple(elements))
    if not isinstance(node.value, Mapping):
        return node
    if slot.is_list and under is not None and isinstance(under.value, tuple):
        return _over_list(node, slot, chain, path, under.value)
    below = dict(node.value)
    if slot.kinds and BASE in below and BASE not in slot.keys(node.kind):
        base = below.pop(BASE)
        if not isinstance(base.value, str):
            message = f"not a file name, got {base.plain!r}; a .yaml file or the name of a shipped one is needed"
            raise base.place.fault(_join(path, BASE), message)
        under = _included(base, slot, chain, _join(path, BASE))
    has_base = under is not None
    if under is None or not isinstance(under.value, Mapping) or (node.kind or under.kind) != under.kind:
        under = replace(node, value={})
    assert isinstance(under.value, Mapping)
    kind = node.kind or under.kind
    merged = dict(under.value)
    for key, child in below.items():
        before = under.value.get(key)
        found = expand(child, slot.child(key, kind) or Slot(type=object), chain, _join(path, key), before)
        merged[key] = replace(found, laid=child.key, over=before) if has_base else found
    return replace(node, value=merged)


def index_of(names: Sequence[object], step: str) -> int | None:
    """Place of a list's element by its name or its place, or None; `names` has None where an element has no name."""
    if step in names:
        return names.index(step)
    return int(step) if step.isdecimal() and int(step) < len(names) else None


def _over_list(node: Node, slot: Slot, chain: tuple[Path, ...], path: str, elements: tuple[Node, ...]) -> Node:
    """Lay a mapping from names (or places) over a list's elements."""
    assert isinstance(node.value, Mapping)
    names = [_name(element) for element in elements]
    merged = list(elements)
    for key, child in node.value.items():
        index = index_of(names, key)
        if index is None:
            known = [str(i) if name is None else name for i, name in enumerate(names)]
            raise child.key.fault(_join(path, key), f"no such element, got {key!r}; {hint(key, known)}")
        inner = slot.element(index) or Slot(type=object)
        found = expand(child, inner, chain, _join(path, key), merged[index])
        merged[index] = replace(found, laid=child.key, over=merged[index])
    return replace(node, value=tuple(merged))


def _name(element: Node) -> str | None:
    found = element.value.get("name") if isinstance(element.value, Mapping) else None
    return found.value if found is not None and isinstance(found.value, str) else None


def beside(name: str, node: Node) -> Path | None:
    """The file that a node names: beside the one in which it stands, or a shipped one; None where there is none."""
    return next((f / name for f in (node.place.folder, shipped_folder()) if _is_file(f / name)), None)


def _is_file(path: Path) -> bool:
    """Whether a path leads to a file; a name that no file can have, or a folder that is closed, leads nowhere."""
    return _answer(path.is_file)


def _answer(of_path: Callable[[], bool]) -> bool:
    """What is asked of a path; no where it is a name that no file can have, or in a folder that is closed."""
    try:
        return of_path()
    except (OSError, ValueError):
        return False


def _grid(node: Node, path: str) -> Node:
    """Heights from a file beside the one that names it, or among the shipped ones."""
    file = beside(str(node.value), node)
    if file is None:
        raise node.place.fault(path, f"no such file, got {node.value!r}; a .csv or .npy file beside this one is needed")
    return grids.read(file, node, path)


def _file(node: Node) -> Path | None:
    """The file that a name means: beside the one that names it, a shipped one, or what `rollover list` calls so."""
    name = Path(str(node.value))
    folders: tuple[Path, ...] = (node.place.folder, shipped_folder())
    if not name.name.endswith(ENDINGS):
        if name.name != str(node.value) or not name.name:  # a bare name, as `rollover list` has them
            return None
        name = Path(f"{name}.yaml")
        folders = (node.place.folder, *(shipped_folder() / shelf for shelf in SHELVES))
    return next((f / name for f in folders if _is_file(f / name)), None)


def _means_file(node: Node) -> bool:
    """Whether a text is the name of a file, or nearly that of a shipped one: a slip of the pen is told as one."""
    said = str(node.value)
    if said.endswith(ENDINGS) or _file(node) is not None:
        return True
    return bool(nearest(said, [p.stem for shelf in SHELVES for p in (shipped_folder() / shelf).glob("*.yaml")]))


def _missing(node: Node, path: str) -> InputError:
    """The fault of a name that means no file, with the nearest that does."""
    name = Path(str(node.value))
    folders = (node.place.folder, shipped_folder())
    if any(_answer((f / name).exists) and not _is_file(f / name) for f in folders):
        message = f"not a file, got {node.value!r}, a folder, a device or a pipe; a plain YAML file is needed"
        return node.place.fault(path, message)
    known: set[str] = set()
    with suppress(OSError):  # of a folder that no name can be of
        known |= {(name.parent / p.name).as_posix() for f in folders for p in (f / name).parent.glob("*.yaml")}
    known |= {p.relative_to(folders[1]).as_posix() for p in folders[1].glob("*/*.yaml")}
    if not name.name.endswith(ENDINGS):
        known = {p.stem for shelf in SHELVES for p in (folders[1] / shelf).glob("*.yaml")}
    close = nearest(name.as_posix(), sorted(known))
    there = "a file beside this one or a name that `rollover list` shows is needed"
    cure = f"did you mean {close[0]!r}?" if close else there
    return node.place.fault(path, f"no such file, got {node.value!r}; {cure}")


def _check_no_circle(node: Node, file: Path, chain: Sequence[Path], path: str) -> None:
    """Refuse a file that is being read already. Raises `InputError`."""
    read_already = [f.resolve() for f in chain]
    if file.resolve() in read_already:
        names = [shown(f) for f in (*chain[read_already.index(file.resolve()) :], file)]
        raise node.place.fault(path, f"a file includes itself, got {' -> '.join(names)}; no circles")


def _included(node: Node, slot: Slot, chain: tuple[Path, ...], path: str) -> Node:
    file = _file(node)
    if file is None:
        raise _missing(node, path)
    _check_no_circle(node, file, chain, path)
    root = read(file)
    if not isinstance(root.value, Mapping):
        raise root.place.fault("", f"not a mapping, got {root.in_short}; {slot.allowed()} is needed")
    return expand(root, slot, (*chain, file.resolve()), path)


def _join(path: str, key: str) -> str:
    return f"{path}.{key}" if path else key

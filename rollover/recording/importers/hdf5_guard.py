"""An HDF5 file that stands for itself: numbers that would be fetched from other files are not followed."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from rollover.system.errors import Fault, InputError

CURE = "a file that holds its own numbers is needed; h5repack, or a copy made with h5py, puts them in"


def stands_alone(file: Any, path: Path) -> None:
    """Refuse an open ``h5py.File`` that names other files. Raises `InputError`.

    A link into another file, numbers kept beside it (external storage), and a data set put together from others
    (virtual, whose parts may lie in any file). A soft link stays inside: it can leave only by a link that is refused.
    """
    from h5py import h5d, h5l, h5o

    def look(name: bytes, info: Any) -> str | None:
        if info.type == h5l.TYPE_EXTERNAL:
            other, there = file.id.links.get_val(name)
            return f"a link into another file, {_shown(other)!r} at {_shown(there)!r}"
        if info.type != h5l.TYPE_HARD:
            return None
        thing = h5o.open(file.id, name)
        if not isinstance(thing, h5d.DatasetID):
            return None
        made = thing.get_create_plist()
        if made.get_external_count():
            return f"numbers kept in another file, {_shown(made.get_external(0)[0])!r}"
        if made.get_layout() == h5d.VIRTUAL:
            parts = {_shown(made.get_virtual_filename(k)) for k in range(made.get_virtual_count())}
            return f"a virtual data set, put together from {', '.join(map(repr, sorted(parts)[:3]))}"
        return None

    found: list[tuple[bytes, str]] = []

    def visit(name: bytes, info: Any) -> bool | None:
        if why := look(name, info):
            found.append((name, why))
            return True  # enough
        return None

    file.id.links.visit(visit, info=True)
    if found:
        name, why = found[0]
        raise InputError(Fault(file=str(path), path=_shown(name), message=f"{why}; {CURE}"))


def _shown(text: bytes | str) -> str:
    return text.decode("utf-8", "backslashreplace") if isinstance(text, bytes) else text

"""Names that come from data or the command line, and the files they may become: one plain name in one folder."""

from __future__ import annotations

import hashlib
import re
import unicodedata
from collections.abc import Iterable
from pathlib import Path

from rollover.system.errors import Fault, InputError, unseen

MOST_BYTES = 255  # of a file's name, on every file system in use
# devices of Windows, with any ending: what is written there is lost
_RESERVED = re.compile(r"(?:con|prn|aux|nul|com[0-9¹²³]|lpt[0-9¹²³])(?:\..*)?", re.IGNORECASE | re.DOTALL)
_BARRED = re.compile(r'[/\\:*?"<>|]')  # separators, and what one of the file systems in use refuses


def inside(folder: Path, name: str, *, file: str = "") -> Path:
    """Path of a file of this very name in a folder. Raises `InputError`, of which `file` says where the name is from.

    Nothing else is ever written to: a name that could lead elsewhere, or that a file system refuses, is refused here.
    """
    if why := _wrong(name):
        allowed = f"one plain name of at most {MOST_BYTES} bytes is allowed"
        raise InputError(Fault(file=file or str(folder), message=f"not a file's name ({why}), got {name!r}; {allowed}"))
    return folder / name


def spelt(name: str, ending: str = "") -> str:
    """A name from data as it can stand before `ending` in a folder: the same where that is possible.

    What may not stand in a file's name becomes ``_``; a name that is too long is cut and ends in eight digits of its
    hash.
    """
    made = "".join("_" if unseen(c) or _BARRED.match(c) else c for c in name).rstrip(". ")
    if made.startswith((".", " ")) or not made or _RESERVED.fullmatch(made):
        made = f"_{made.lstrip('. ')}"
    room = MOST_BYTES - len(ending.encode())
    if len(made.encode()) > room:
        mark = "-" + hashlib.sha256(name.encode("utf-8", "surrogatepass")).hexdigest()[:8]
        made = made.encode()[: room - len(mark)].decode(errors="ignore") + mark
    return made


def distinct(names: Iterable[str], ending: str = "", *, file: str) -> dict[str, str]:
    """Each name from data with that of its file, without the ending.

    Raises `InputError` for two that would share a file; capitals tell no files apart everywhere.
    """
    found: dict[str, str] = {}
    taken: dict[str, str] = {}
    for name in names:
        made = spelt(name, ending)
        key = unicodedata.normalize("NFC", made).casefold()
        if key in taken:
            both = f"two recordings would be one file, got {taken[key]!r} and {name!r}, both {made + ending!r}"
            raise InputError(Fault(file=file, message=f"{both}; take one of them by --select, or rename one"))
        found[name] = made
        taken[key] = name
    return found


def _wrong(name: str) -> str:
    if name in ("", ".", ".."):
        return "it names no file"
    if hidden := next((c for c in name if unseen(c)), ""):
        return f"it holds the character U+{ord(hidden):04X}"
    if barred := _BARRED.search(name):
        return f"it holds {barred[0]!r}"
    if name.startswith(".") or name.endswith((".", " ")):
        return "it begins with a dot, or ends in a dot or space"
    if _RESERVED.fullmatch(name):
        return "it is a device of Windows"
    return f"it has {len(name.encode())} bytes" if len(name.encode()) > MOST_BYTES else ""

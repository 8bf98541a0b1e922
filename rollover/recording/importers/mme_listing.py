"""What the list of channels of an ISO-MME test (.chn) promises, against the files that are there."""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Mapping, Sequence
from pathlib import PurePosixPath

WORDS = (".txt", ".md", ".pdf", ".doc", ".docx", ".html", ".rtf", ".xml")  # about a test, and no samples of it

_ENTRY = re.compile(r"name of channel\s*(\d+)")


def promised(name: str, head: Mapping[str, str], held: Sequence[tuple[str, str]]) -> list[str]:
    """Notes of what the list `name` has and the test has not, and the other way round.

    `head` is that of the list, keys in small letters; `held` the files of channels with their codes.
    """
    listed = [entry for key, entry in head.items() if _ENTRY.fullmatch(key)]
    there = Counter(code.upper() for _, code in held)
    missing = []
    for entry in listed:
        code = entry.partition("/")[0].strip().upper()
        if there[code]:
            there[code] -= 1
        else:
            missing.append(entry)
    notes = []
    claimed = head.get("number of channels", "").strip()
    total = max(int(claimed) if claimed.isdigit() else 0, len(listed))
    unnamed = max(0, total - max(len(listed), len(held) + len(missing)))
    if missing or unnamed:
        what = [*missing, *([f"{unnamed} that it does not name"] if unnamed else [])]
        notes.append(f"{len(missing) + unnamed} of {total} channels of {name} are not there: {', '.join(what)}")
    extra = []
    for file, code in reversed(held):
        if listed and there[code.upper()] > 0:
            there[code.upper()] -= 1
            extra.append(f"{file} ({code})")
    if extra:
        notes.append(f"{len(extra)} of {len(held)} files are not in {name}: {', '.join(reversed(extra))}")
    return notes


def unlisted(names: Sequence[str]) -> list[str]:
    """A note of the files of an archive that stand neither beside the file of a test nor in its folder of channels."""
    homes = {PurePosixPath(name).parent for name in names if name.lower().endswith(".mme")}
    left = []
    for name in names:
        path = PurePosixPath(name)
        is_channel = path.parent.name.lower() == "channel" and path.parent.parent in homes
        is_beside = path.parent in homes and path.suffix.lower() in (".mme", *WORDS)
        if not (is_channel or is_beside):
            left.append(name)
    shown = ", ".join(left[:12]) + (f" and {len(left) - 12} more" if len(left) > 12 else "")
    return [f"{len(left)} of {len(names)} files in it belong to no test: {shown}"] if left else []

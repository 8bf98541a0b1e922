"""An update of files in several places (baselines, and the report of what changed in them): all of it or nothing.

Everything is written beside its place first. Then a journal in each folder of baselines says what goes where, and from
there on the update holds: whoever starts next finishes it, if its process is killed before its end.
"""

from __future__ import annotations

import contextlib
import json
import os
from collections.abc import Callable, Iterator, Mapping
from pathlib import Path
from typing import Any

from rollover.system import writing
from rollover.system.boundary import worded
from rollover.system.errors import Fault, InputError
from rollover.system.own_json import read_json

JOURNAL = ".update.json"
FORMAT = "rollover-update/1"


@contextlib.contextmanager
def update(folder: Path, files: Mapping[Path, str]) -> Iterator[Path]:
    """Fill a temporary folder that takes the place of `folder` in one stroke with texts that go to `files`."""
    staged: list[tuple[Path, Path]] = []

    def prepare(part: Path, target: Path) -> Callable[[], None] | None:
        journals = [path.parent / JOURNAL for path, _ in _by_folder(files)]
        try:
            for path, text in files.items():
                staged.append((writing.staged(path, _writer(text)), path))
            told = {
                "format": FORMAT,
                "files": [[str(a), str(b)] for a, b in staged],
                "account": [str(part), str(target)],
                "journals": [str(j) for j in journals],
            }
            for journal in journals:
                writing.put(journal, _writer(json.dumps(told, indent=1)))
        except BaseException:
            for journal in journals:
                journal.unlink(missing_ok=True)
            for made, _ in staged:
                made.unlink(missing_ok=True)
            raise
        return (lambda: finish(journals[0])) if journals else None

    for path in files:
        path.parent.mkdir(parents=True, exist_ok=True)
    with writing.whole(folder, prepare) as part:
        yield part


def finish(journal: Path) -> None:
    """Bring what a journal names to its place, from wherever that stopped; nothing where there is no journal."""
    try:
        told = read_json(journal)
    except FileNotFoundError:
        return
    except (OSError, ValueError) as e:
        raise InputError(Fault(file=str(journal), message=f"cannot be read: {worded(e)}; remove it to go on")) from None
    moves = _checked(told, journal)
    for made, place in moves:
        with contextlib.suppress(FileNotFoundError):
            os.replace(made, place)
    part, target = map(Path, told["account"])
    if part.is_dir() and part.parent in (target, target.parent):
        writing.exchange(part, target)
    for other in {str(journal), *told["journals"]}:
        if Path(other).name == JOURNAL:
            Path(other).unlink(missing_ok=True)


def _checked(told: Any, journal: Path) -> list[tuple[Path, Path]]:
    """What goes where. Raises `InputError` for a journal that this did not write: its own folder's files at least."""
    try:
        moves = [(Path(a), Path(b)) for a, b in told["files"]]
        good = (
            told["format"] == FORMAT
            and len(told["account"]) == 2
            and all(isinstance(each, str) for each in told["journals"])
        )
        good = good and all(a.parent.resolve() == b.parent.resolve() and writing.own(b, a.name) for a, b in moves)
        good = good and journal.parent.resolve() in {b.parent.resolve() for _, b in moves}
        part, target = map(Path, told["account"])
        good = good and writing.own(target, part.name)
    except (KeyError, TypeError, ValueError):
        good, moves = False, []
    if not good:
        raise InputError(Fault(file=str(journal), message="not the journal of an update; remove it to go on"))
    return moves


def _by_folder(files: Mapping[Path, str]) -> list[tuple[Path, str]]:
    return list({path.parent: (path, text) for path, text in files.items()}.values())


def _writer(text: str) -> Callable[[Path], object]:
    return lambda at: at.write_text(text, encoding="utf-8")

"""What a campaign keeps beside its results until they stand there: the seal, and the answer of each case.

A file is there whole or not at all, so that a campaign that was ended at any moment goes on with the cases that are
left. Truths are not kept: they are made again, and must have the hash that was shown.
"""

from __future__ import annotations

import hashlib
import json
import shutil
from collections.abc import Mapping
from dataclasses import asdict, dataclass
from functools import partial
from importlib.util import find_spec
from pathlib import Path
from typing import Any

from rollover.proof.commitment import PRIVATE, Seal
from rollover.system.errors import Fault, InputError
from rollover.system.own_json import NUMBER, TEXT, read_json
from rollover.system.writing import put, sweep

FORMAT, CAMPAIGN = "rollover-campaign/1", "campaign.json"
PACKAGES = ("rollover", "ground")  # that cases and answers are made by
_CAMPAIGN = {"format": TEXT, "asked": {}, "seal": {"digest": TEXT, "salt": TEXT}}
_UNREADABLE = ("versions", "code")  # of what was asked
_ANSWER = {"diagnosis": ({},), "sentence": TEXT, "seconds": NUMBER}


@dataclass(frozen=True, kw_only=True)
class Answer:
    """What came of a case: diagnosis.json, or why there is none; wall time in s."""

    diagnosis: dict[str, Any] | None
    sentence: str
    seconds: float


@dataclass(frozen=True, kw_only=True)
class Kept:
    """A campaign's folder, hidden beside its results; `asked` is all that decides what comes of it."""

    folder: Path
    asked: Mapping[str, Any]

    def claim(self, out: Path, *, force: bool) -> None:
        """Refuse another campaign that was interrupted on its way to `out`, or clear it with `force`.

        Raises `InputError`.
        """
        before = self._campaign().get("asked", self.asked)
        others = [key for key in {**before, **self.asked} if before.get(key) != self.asked.get(key)]
        if others and force:
            self.clear()
        elif others:
            told = [
                f"{key} {before.get(key)!r} for {self.asked.get(key)!r}" for key in others if key not in _UNREADABLE
            ]
            told += [f"by other {key}" for key in others if key in _UNREADABLE]
            message = f"a campaign that was interrupted here is another one, got {', '.join(told)}"
            cure = f"--force loses its {self.answered()} answers, another --out leaves them"
            raise InputError(Fault(file=str(out), message=f"{message}; {cure}"))

    def seal(self) -> Seal | None:
        """The seal that was shown, None where none was."""
        if (found := self._campaign().get("seal")) is None:
            return None
        return Seal(digest=found["digest"], salt=found["salt"], cases=int(self.asked["cases"]))

    def begin(self, seal: Seal) -> None:
        """Keep a seal before it is shown, readable for its owner only as its salt is; whatever was here is gone.

        Raises `InputError` where another seal was shown of the same campaign.
        """
        if (before := self.seal()) is not None:
            if before.digest != seal.digest:
                message = f"truths that are made again have another hash, got {seal.digest}; {before.digest} was shown"
                raise InputError(Fault(file=str(self.folder), message=f"{message}; --force begins anew"))
            sweep(self.folder)
            return
        self.clear()
        self.folder.mkdir(parents=True)
        self.folder.chmod(0o700)
        shown = {"digest": seal.digest, "salt": seal.salt}
        text = json.dumps({"format": FORMAT, "asked": dict(self.asked), "seal": shown}, indent=1)
        try:
            put(self.folder / CAMPAIGN, partial(_written, text))
            (self.folder / CAMPAIGN).chmod(PRIVATE)
        except OSError:
            self.clear()
            raise

    def keep(self, case: str, answer: Answer) -> None:
        """Write what came of a case."""
        put(self._path(case), partial(_written, json.dumps(asdict(answer))))

    def answer(self, case: str) -> Answer | None:
        """What came of a case before, None if it was not diagnosed or its file is damaged."""
        try:
            found = read_json(self._path(case), _ANSWER)
        except (OSError, ValueError):
            return None
        return Answer(**{name: found[name] for name in _ANSWER})

    def answered(self) -> int:
        """Of how many cases something is kept."""
        return len([*self.folder.glob("case-*.json")])

    def clear(self) -> None:
        """Keep nothing any more."""
        shutil.rmtree(self.folder, ignore_errors=True)

    def _path(self, case: str) -> Path:
        return self.folder / f"{case}.json"

    def _campaign(self) -> dict[str, Any]:
        try:
            found = read_json(self.folder / CAMPAIGN, _CAMPAIGN)
        except (OSError, ValueError):
            return {}
        return found if found["format"] == FORMAT else {}


def _written(text: str, path: Path) -> None:
    path.write_text(text, encoding="utf-8")


def code() -> str:
    """SHA-256 over the files that cases and answers are made by: a campaign is of one state of them."""
    total = hashlib.sha256()
    for name in PACKAGES:
        spec = find_spec(name)
        root = Path(str(spec.origin)).parent if spec is not None else Path()
        for path in sorted(p for kind in ("*.py", "*.yaml") for p in root.rglob(kind)):
            total.update(
                path.relative_to(root).as_posix().encode() + b"\0" + hashlib.sha256(path.read_bytes()).digest()
            )
    return total.hexdigest()

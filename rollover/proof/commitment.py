"""The sealed truth: its hash is shown before the diagnosis starts, the truth itself only afterwards.

seal = sealed(truths)                  # {"digest": ...} goes to the reader now
write_truth(truths, seal, elsewhere)   # never into the folders that are diagnosed
truths = opened(seal.digest, elsewhere / "truth.json")
"""

from __future__ import annotations

import hashlib
import json
import os
import secrets
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from rollover.system.boundary import reading
from rollover.system.errors import Fault, InputError
from rollover.system.own_json import read_json

SEAL, TRUTH = "seal.json", "truth.json"
PRIVATE = 0o600  # of a truth: for its owner
CURE = "the file that `rollover prove` wrote is needed"
SEAL_FORMAT, TRUTH_FORMAT = "rollover-seal/1", "rollover-truths/1"


@dataclass(frozen=True, kw_only=True)
class Seal:
    """`digest` may be shown to everybody; `salt` stays with the truth, or guessing from the seed would open it."""

    digest: str
    salt: str
    cases: int

    def public(self) -> dict[str, Any]:
        """What seal.json says."""
        rule = "sha256 of salt, newline, and the truths as JSON with sorted keys and no spaces"
        return {"format": SEAL_FORMAT, "algorithm": rule, "digest": self.digest, "cases": self.cases}


def sealed(truths: Sequence[Mapping[str, Any]], salt: str | None = None) -> Seal:
    """Seal of truths (bare JSON values); the salt is drawn from the system unless given."""
    salt = secrets.token_hex(32) if salt is None else salt
    return Seal(digest=digest(truths, salt), salt=salt, cases=len(truths))


def digest(truths: Sequence[Mapping[str, Any]], salt: str) -> str:
    """SHA-256 in hex."""
    text = json.dumps(list(truths), sort_keys=True, separators=(",", ":"), allow_nan=False)
    return hashlib.sha256(f"{salt}\n{text}".encode()).hexdigest()


def write_truth(
    truths: Sequence[Mapping[str, Any]],
    seal: Seal,
    folder: Path,
    name: str = TRUTH,
    asked: Mapping[str, Any] | None = None,
) -> Path:
    """Write a truth, readable for its owner only, with what was `asked` for; returns its path."""
    folder.mkdir(parents=True, exist_ok=True)
    path = folder / name
    content = {"format": TRUTH_FORMAT, "salt": seal.salt, **({"asked": asked} if asked else {}), "truths": list(truths)}
    handle = os.open(path, os.O_WRONLY | os.O_CREAT | os.O_TRUNC, PRIVATE)
    with os.fdopen(handle, "w", encoding="utf-8") as file:
        json.dump(content, file, indent=1, allow_nan=False)
        file.write("\n")
    return path


def opened(shown: str, path: Path) -> list[dict[str, Any]]:
    """Truths of a truth.json whose seal was `shown` before. Raises `InputError` if it is not the same truth."""
    with reading(path, "truth that was sealed", CURE):
        found = read_json(path)
        if found.get("format") != TRUTH_FORMAT:
            raise ValueError(f"format {TRUTH_FORMAT!r} is missing")
        truths, salt = found.get("truths"), found.get("salt")
        if not isinstance(truths, list) or not isinstance(salt, str):
            raise ValueError("truths or salt are missing")
        got = digest(truths, salt)
    if got != shown:
        raise InputError(Fault(file=str(path), message=f"not the truth that was sealed, got {got}; {shown} was shown"))
    return truths

"""What a laboratory says of a channel's data as a whole: `Data status` of ISO/TS 13499, DASTAT of NHTSA's database."""

from __future__ import annotations

import re

_SOUND = ("", "OK", "AM", "CM", "AS MEASURED", "COMPUTED", "CALCULATED", "NOVALUE", "NO VALUE")
# codes of the database as recalled: CF channel failed, MD meaningless data, ND no data
_LOST = re.compile(r"CF|MD|ND|.*\b(FAIL|FAILED|FAILURE|MEANINGLESS|INVALID|DEFECTIVE|NO DATA)\b.*")


def judged(said: str) -> tuple[str, tuple[str, ...]]:
    """Why data of this status cannot be read, nothing where they can; and what is to be said of them then."""
    plain = " ".join(said.upper().replace("_", " ").split())
    if plain in _SOUND:
        return "", ()
    what = f"its data status is {said.strip()[:40]!r}"
    return (what, ()) if _LOST.fullmatch(plain) else ("", (what,))

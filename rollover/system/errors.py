"""What is wrong with an input, one line for each fault."""

from __future__ import annotations

import difflib
import re
import unicodedata
from collections.abc import Iterable
from dataclasses import dataclass, replace
from pathlib import Path

MOST_SHOWN = 300  # characters of a value in a message
THERE = "the path of a file that is there is needed"
MOST_SAID = 1500  # characters of a message, which holds a value or two, what is allowed and a cure
# what to do instead, behind what is wrong: what is allowed, needed or meant
_CURE = re.compile(r"; \S|\bdid you mean\b|\b(?:is|are) (?:needed|allowed)\b|\ballowed: |--[a-z]")
_JOINERS = "\u200c\u200d"  # without a picture of their own, but Persian and Hindi are not spelt without them
_QUOTED = re.compile(rf"'[^']{{{MOST_SHOWN},}}'|\"[^\"]{{{MOST_SHOWN},}}\"|[^\s'\"]{{{MOST_SHOWN - 1},}}[^\s'\";]")


def unseen(character: str) -> bool:
    """Whether a character is one that a terminal obeys instead of showing it, or that is no character at all."""
    return unicodedata.category(character) in ("Cc", "Cf", "Cs", "Zl", "Zp") and character not in _JOINERS


def seen(text: str) -> str:
    """A text in which a terminal obeys nothing: what is `unseen` stands as its number, as in a string of Python."""
    if text.isprintable():
        return text
    return "".join(c.encode("unicode_escape").decode("ascii") if unseen(c) else c for c in text)


def excerpt(text: str, most: int = MOST_SHOWN) -> str:
    """A value as it is shown: its beginning, and how long it is, where it is long."""
    text = seen(text)
    if len(text) <= most:
        return text
    end = f"... ({len(text)} characters)"
    return text[: most - len(end)] + end


def sentence(text: str) -> str:
    """A message as it is shown: one line, of each value in it an excerpt."""
    text = seen(text)
    if len(text) < MOST_SHOWN:
        return text
    before, got, rest = text.partition("got ")
    value, cure, allowed = rest.rpartition("; ") if "; " in rest else (rest, "", "")
    # each part by itself: a value that was cut has lost its closing quote, and would find another in what follows
    before, allowed = (_QUOTED.sub(lambda found: excerpt(found[0]), part) for part in (before, allowed))
    return excerpt(f"{before}{got}{excerpt(value)}{cure}{allowed}", MOST_SAID)


@dataclass(frozen=True, kw_only=True)
class Fault:
    """``file:line: path: what is wrong, got X; what is allowed``; parts that do not apply are left out."""

    message: str
    file: str | None = None
    line: int | None = None
    path: str = ""

    def __str__(self) -> str:
        file = self.file if self.file is None or self.file.strip() else repr(self.file)  # nothing to see is a name too
        where = file if self.line is None else f"{file}:{self.line}"
        return ": ".join(
            part for part in (where and excerpt(where, MOST_SAID), excerpt(self.path), sentence(self.message)) if part
        )


class InputError(ValueError):
    """The input is wrong: all faults that were found, each worth a line."""

    def __init__(self, *faults: Fault) -> None:
        super().__init__("\n".join(map(str, faults)))
        self.faults = list(faults)

    def __reduce__(self) -> tuple[type[InputError], tuple[Fault, ...]]:
        return type(self), tuple(self.faults)


def has_cure(message: str) -> bool:
    """Whether a message says what to do, besides what is wrong."""
    return _CURE.search(message) is not None


def cured(fault: Fault, cure: str) -> Fault:
    """A fault with a cure: its own where it has one."""
    return fault if has_cure(fault.message) else replace(fault, message=f"{fault.message.rstrip('.')}; {cure}")


def nearest(word: str, known: Iterable[str], most: int = 1) -> list[str]:
    """Which of the `known` words may have been meant, the likeliest first."""
    by_lower = {k.lower(): k for k in known}
    return [by_lower[m] for m in difflib.get_close_matches(word.lower(), by_lower, n=most, cutoff=0.6)]


def absent(path: str | Path) -> str:
    """That a path leads nowhere, and where it may have been meant to: the first part that is not there, put right."""
    path = Path(path)
    message = "no such file"
    for depth, part in enumerate(path.parts):
        folder = Path(*path.parts[:depth]) if depth else Path()
        if (folder / part).exists():
            continue
        try:
            beside = sorted(p.name for p in folder.iterdir())
        except OSError:  # not a folder, or not for us
            return message
        rest = path.parts[depth + 1 :]
        there = [Path(folder, name, *rest) for name in nearest(part, beside, most=3)]
        meant = next((str(p) for p in there if p.exists()), None)
        if meant is not None:
            return f"{message}; did you mean {meant!r}?"
        return f"{message}; the folder {str(folder)!r} is there, {part!r} in it is not" if rest else message
    return message


def hint(word: str, known: Iterable[str], most_listed: int = 16) -> str:
    """What to try instead of an unknown word: the nearest match, and all that is known where that is little."""
    known = list(known)
    close = nearest(word, known)
    parts = [f"did you mean {close[0]!r}?"] if close else []
    if len(known) <= most_listed or not close:
        parts.append(f"allowed: {', '.join(known) or 'none'}")
    return " ".join(parts)

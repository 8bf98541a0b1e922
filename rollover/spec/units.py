"""Spellings of units: m/(s*s), m / s2, m·s^-2 and M/S**2 are one, mN and MN are two."""

from __future__ import annotations

import functools
import re
from collections.abc import Mapping

Key = tuple[tuple[str, int], ...]  # symbols with their exponents, by name: what a unit is, however it is spelt

# words that mean one symbol whatever their case; symbols themselves are told by their case
_WORDS = {
    "s": "sec secs second seconds",
    "ms": "msec msecs millisecond milliseconds",
    "us": "usec usecs microsecond microseconds",
    "ns": "nsec nsecs nanosecond nanoseconds",
    "min": "min mins minute minutes",
    "N": "newton newtons",
    "kN": "kilonewton kilonewtons",
    "MN": "meganewton meganewtons",
    "m": "metre metres meter meters",
    "mm": "millimetre millimetres millimeter millimeters",
    "cm": "centimetre centimetres centimeter centimeters",
    "km": "kilometre kilometres kilometer kilometers",
    "in": "inch inches",
    "ft": "foot feet",
    "rad": "radian radians",
    "deg": "degree degrees degs ° º",
    "rev": "revolution revolutions",
    "g": "g's",
    "J": "joule joules",
    "kJ": "kilojoule kilojoules",
    "mph": "mph",
    "%": "percent pct",
}
_SYMBOL = {word: symbol for symbol, words in _WORDS.items() for word in words.split()}
_RAISED = str.maketrans("⁰¹²³⁴⁵⁶⁷⁸⁹⁻⁺", "0123456789-+")
_SAME = str.maketrans({"µ": "u", "μ": "u", "−": "-", "⋅": "*", "·": "*", "×": "*", "•": "*", "∙": "*", "’": "'"})
_TOKEN = re.compile(r"\s*(?:(\*|/|\(|\))|\^\(([-+]?\d+)\)|\^?([-+]?\d+)|([A-Za-z°º%'_]+))")


class _UnclearError(ValueError):
    """A spelling that is no unit, or may be two."""


@functools.lru_cache(maxsize=4096)
def key(spelling: str) -> Key | None:
    """What a unit is, however it is spelt; None for what is no product of powers, or is not clear (m/s*s)."""
    try:
        return _product(_tokens(_bare(spelling)))
    except _UnclearError:
        return None


def find(spelling: str, known: Mapping[str, float], others: Mapping[str, Mapping[str, float]]) -> float | None:
    """Factor of a unit among the `known` ones of its dimension, None if it is none of them or not clearly one.

    Case is let go where one unit of the dimension alone is left: KN is kN, mn may be mN and MN. Not so where the
    spelling as it stands is a unit of one of the `others` (Ns is no ns), or an M before a small letter means mega.
    """
    for text in (spelling.strip(), _bare(spelling)):
        if text in known:
            return known[text]
    wanted = key(spelling)
    if wanted is None:
        return None
    if wanted in (exact := _keys(known)):
        return exact[wanted]
    if any(wanted in _keys(other) for other in others.values()) or any(re.match("M[a-z]", word) for word, _ in wanted):
        return None
    fitting = {value for k, value in exact.items() if _folded(k) == _folded(wanted)}
    return fitting.pop() if len(fitting) == 1 else None


def _keys(known: Mapping[str, float]) -> dict[Key, float]:
    return dict(_keys_of(tuple(known.items())))


@functools.lru_cache(maxsize=64)
def _keys_of(known: tuple[tuple[str, float], ...]) -> tuple[tuple[Key, float], ...]:
    found = ((key(spelling), value) for spelling, value in known)
    return tuple((k, value) for k, value in found if k is not None)


def _folded(unit: Key) -> Key:
    return tuple(sorted((word.lower(), power) for word, power in unit))


def _bare(spelling: str) -> str:
    """Without brackets around the whole, and in the letters of the grammar."""
    text = spelling.translate(_SAME).strip()
    while len(text) > 1 and text[0] + text[-1] in ("[]", "()", "{}", "<>") and _closes_at_end(text):
        text = text[1:-1].strip()
    text = re.sub(r"[⁻⁺]?[⁰¹²³⁴⁵⁶⁷⁸⁹]+", lambda m: "^" + m[0].translate(_RAISED), text)
    text = re.sub(r"\bper\b", "/", text.replace("**", "^"), flags=re.IGNORECASE)
    text = re.sub(r"(?<=[A-Za-z°0-9)])\.(?=\s*[A-Za-z°])", "*", text.rstrip("."))  # N.m
    return re.sub(r"(?<=[A-Za-z°])-(?=[A-Za-z°])", "*", text)  # ft-lbf


def _closes_at_end(text: str) -> bool:
    """Whether the first bracket is closed by the last character, as in (m/s) and not in (m)/(s)."""
    depth = 0
    for i, character in enumerate(text):
        depth += (character == text[0]) - (character == text[-1])
        if depth == 0:
            return i == len(text) - 1
    return False


def _tokens(text: str) -> list[str]:
    found: list[str] = []
    at = 0
    while at < len(text):
        match = _TOKEN.match(text, at)
        if match is None:
            raise _UnclearError(text)
        operator, raised, plain, word = match.groups()
        number = raised or plain
        if number is not None:
            glued = text[at] != " " or text[at:].lstrip().startswith("^")
            number = f"^{int(number)}" if found and glued and found[-1] not in "*/(" else number
        found.append(operator or number or word)
        at = match.end()
        at = len(text) if not text[at:].strip() else at
    return found


def _product(tokens: list[str]) -> Key:
    powers: dict[str, int] = {}
    rest = _into(tokens, powers, 1)
    if rest or not tokens:
        raise _UnclearError(tokens)
    return tuple(sorted((word, power) for word, power in powers.items() if power))


def _into(tokens: list[str], powers: dict[str, int], sign: int) -> list[str]:
    """Multiply what stands up to the end or a closing bracket into `powers`; what is left."""
    divided = free = False
    first = True
    while tokens and tokens[0] != ")":
        over = False
        if tokens[0] in ("*", "/"):
            over = tokens[0] == "/"
            free = over and first  # /s is 1/s
            if (first and not over) or len(tokens) < 2:
                raise _UnclearError(tokens)
            tokens = tokens[1:]
        if divided and not over and not free:
            raise _UnclearError("a/b*c may be a/(b*c)")
        divided, first = divided or over, False
        tokens = _factor(tokens, powers, -sign if over else sign)
    return tokens


def _factor(tokens: list[str], powers: dict[str, int], sign: int) -> list[str]:
    head, tokens = tokens[0], tokens[1:]
    inner: dict[str, int] = {}
    if head == "(":
        tokens = _into(tokens, inner, 1)
        if not tokens or not inner:
            raise _UnclearError("a bracket that does not close")
        tokens = tokens[1:]
    elif head == "1":
        return tokens
    elif re.match(r"[A-Za-z°º%]", head):
        inner[_SYMBOL.get(head.lower(), head)] = 1
    else:
        raise _UnclearError(head)
    power = 1
    if tokens and tokens[0][0] == "^":
        power, tokens = int(tokens[0][1:]), tokens[1:]
    for word, exponent in inner.items():
        powers[word] = powers.get(word, 0) + sign * power * exponent
    return tokens

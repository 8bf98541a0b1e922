"""Arguments of the functions that scripts call: within which bounds, one of which words, one text or several."""

from __future__ import annotations

from collections.abc import Sequence
from math import inf, isfinite

from rollover.system.errors import Fault, InputError, hint

# how large a number may be that nothing else bounds: beyond, it is a slip
MOST_LATE = 1e10  # s: stamps of an epoch's seconds, now 1.8e9, until the year 2286
MOST_CLOCK = 1e3  # s: no recording of a rollover or a drop lasts so long, and no offset within it is longer
MOST_FORCE = 1e6  # N: the weight of 100 t, more than any striker's
LEAST_DEPTH, MOST_DEPTH = 1e-4, 10.0  # m: a grain of sand, and what no striker of a drop test goes down to
LONGEST = 1e7  # s: 116 days of wall time
LEAST_CFC, MOST_CFC = 60, 1000  # of the filter classes; here, where no numpy is needed to know them
MOST_WORKERS = 1024  # processes: more than the cores of any one machine
MOST_SEED = 2**63 - 1  # what every generator takes
MOST_CASES = 1_000_000  # of a campaign: a year at 30 s each
MOST_MEMORY = 1.4e14  # bytes: the 47 bits of address space that a process has
SEGMENTS = 12  # elements to a member of a frame: forces and energies within 0.5 % of four times as many (tested)


def is_finite_number(value: object) -> bool:
    """Whether something is a number that is finite as one of double precision; True and False are none."""
    try:
        return isinstance(value, (int, float)) and not isinstance(value, bool) and isfinite(value)
    except OverflowError:  # a whole number of 309 digits and more
        return False


def within(name: str, value: float, least: float, most: float = inf) -> None:
    """Refuse a number that is not finite or outside its bounds. Raises `InputError`."""
    if not is_finite_number(value) or not least <= value <= most:
        allowed = f"at least {least:g}" if most == inf else f"{least:g} to {most:g}"
        raise InputError(Fault(path=name, message=f"out of bounds, got {value!r}; {allowed} is allowed"))


def one_of(name: str, value: str | None, allowed: Sequence[str]) -> None:
    """Refuse a word that is none of those allowed; None stands for the usual one. Raises `InputError`."""
    if value is not None and value not in allowed:
        raise InputError(Fault(path=name, message=f"unknown, got {value!r}; {hint(str(value), allowed)}"))


def listed(given: str | Sequence[str]) -> list[str]:
    """The texts of a list, or the only one."""
    return [given] if isinstance(given, str) else list(given)

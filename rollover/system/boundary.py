"""Where something is read that others made: whatever a library raises there becomes file, place, cause and cure."""

from __future__ import annotations

import contextlib
import errno
import logging
import os
import re
import struct
import warnings
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Concatenate, ParamSpec, TypeVar

from rollover.system.errors import Fault, InputError, cured

P = ParamSpec("P")
R = TypeVar("R")

MOST_REASON = 160  # characters of what a library says
CURE = "a whole, undamaged one is needed: copy it again, or export it anew"
# what code raises that met something it was not written for: its words are about the code and not about the file
_UNFORESEEN = (
    *(ArithmeticError, AssertionError, AttributeError, BufferError, EOFError, LookupError, NameError),
    *(NotImplementedError, RecursionError, TypeError, UnicodeError, struct.error),
)
# what the machine refuses, whatever the file is
_MACHINE = (errno.ENOSPC, errno.EDQUOT, errno.EMFILE, errno.ENFILE, errno.EIO, errno.ESTALE, errno.EAGAIN)
_OF_CODE = re.compile(
    r"NoneType|\w+(?:Error|Exception)\b|\[Errno|\bobject\b|0x[0-9a-f]{6,}|<class|codec|\bbuffer\b|dtype|ndarray|\(\)"
    r"|\binvalid literal\b|could not convert|\barray element\b|\binhomogeneous\b"
)


@contextlib.contextmanager
def quiet() -> Iterator[None]:
    """Let no library write to standard error past this program: warnings of numbers, lines of a log."""
    disabled = logging.root.manager.disable
    logging.disable(logging.CRITICAL)
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            yield
    finally:
        logging.disable(disabled)


@contextlib.contextmanager
def reading(path: Path | str, what: str, cure: str = CURE) -> Iterator[None]:
    """Turn whatever is raised while a file is read into one line: ``not a readable {what}: reason; {cure}``.

    `what` names the kind of file. Faults of the machine stay what they are. Raises `InputError`.
    """
    try:
        with quiet():
            yield
    except InputError as e:
        raise InputError(*(cured(fault, cure) for fault in e.faults)) from None
    except MemoryError:
        message = f"needs more memory than there is, read as {what}; a smaller part of it is needed"
        raise InputError(Fault(file=str(path), message=message)) from None
    except Exception as e:  # every library has its own
        if isinstance(e, OSError) and e.errno in _MACHINE:
            raise
        raise unreadable(path, what, e, cure) from None


def unreadable(path: Path | str, what: str, e: Exception, cure: str) -> InputError:
    """The one line for what was raised while a file was read."""
    return InputError(Fault(file=str(path), message=f"not a readable {what}: {worded(e)}; {cure}"))


def bounded(function: Callable[Concatenate[Path, P], R], what: str) -> Callable[Concatenate[Path, P], R]:
    """A function that reads a path, its first argument, within `reading`."""

    def within(path: Path, /, *args: P.args, **kwargs: P.kwargs) -> R:
        with reading(path, what):
            return function(path, *args, **kwargs)

    return within


def worded(e: Exception) -> str:
    """What a library says, where it says something about the file."""
    if isinstance(e, OSError) and e.errno and e.strerror:
        return os.strerror(e.errno).lower()
    text = (str(e).strip().splitlines() or [""])[0][:MOST_REASON].strip().rstrip(".;:,")
    if not text or isinstance(e, _UNFORESEEN) or _OF_CODE.search(text):
        return "damaged, or of a kind that is not read"
    return text

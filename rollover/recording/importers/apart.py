"""Reading of foreign binary formats in a child process: a reader that hangs, crashes or eats memory costs its file.

One child reads file after file. It is there from the first such file on; text is read in this very process.
"""

from __future__ import annotations

import atexit
import importlib
import multiprocessing
import os
import threading
from collections.abc import Callable, Sequence
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path
from typing import Any, TypeVar

from rollover.system import budget
from rollover.system.boundary import quiet, unreadable
from rollover.system.errors import Fault, InputError
from rollover.system.processes import Children, Failure, limited, map_cases

V = TypeVar("V")

CURE = "a sound file is needed"

_children = Children(1, bare=True)
_alone = threading.Lock()  # the child has one file at a time
_ready: set[tuple[str, ...]] = set()  # modules that the child has
atexit.register(_children.stop)


@dataclass(frozen=True, kw_only=True)
class _Task:
    """What the child is to read, from which folder, and within which limits."""

    read: Callable[..., Any]
    path: Path
    more: tuple[Any, ...]
    what: str
    modules: tuple[str, ...]
    folder: str
    factor: str
    memory: float  # bytes
    processor: float  # s


def apart(read: Callable[..., V], path: Path, *more: Any, what: str, modules: Sequence[str] = ()) -> V:
    """``read(path, *more)`` in a child process; `read` is a top-level function of a module, its value can be pickled.

    `what` names the format; `modules` are imported first, outside the limits. Raises `InputError`, for what `read`
    raises too.
    """
    if multiprocessing.parent_process() is not None:  # this is a child itself, which may have none of its own
        return read(path, *more)
    files = [file for file in path.iterdir() if file.is_file()] if path.is_dir() else [path]
    size = sum(file.stat().st_size for file in files)
    folder = ""
    with suppress(OSError):  # it may be gone
        folder = os.getcwd()
    task = _Task(
        read=read,
        path=path,
        more=more,
        what=what,
        modules=tuple(modules),
        folder=folder,
        factor=f"{budget.factor()!r}",
        memory=budget.memory(size),
        processor=budget.processor(size),
    )
    wall = budget.wall(size)
    with _alone:
        if task.modules not in _ready:  # a library may take long to import where the machine is busy
            list(map_cases(_imported, [task.modules], children=_children))
            _ready.add(task.modules)
        (outcome,) = map_cases(_work, [task], children=_children, time_limit=wall)
        if outcome.failure is not None:  # the next child has none of them
            _ready.clear()
    if outcome.failure is not None:
        raise InputError(Fault(file=str(path), message=_message(outcome.failure, what, task, wall)))
    if isinstance(outcome.value, InputError):
        raise outcome.value
    return outcome.value  # type: ignore[return-value]


def _imported(modules: tuple[str, ...]) -> None:
    with quiet():
        for name in modules:
            with suppress(ImportError):  # the reader says so
                importlib.import_module(name)


def _work(task: _Task) -> Any:
    """In the child: the value, or the faults of the file."""
    _imported(task.modules)  # of a child that has been replaced
    os.environ[budget.VARIABLE] = task.factor
    if task.folder:
        os.chdir(task.folder)
    try:
        with quiet(), limited(task.memory, task.processor):  # what it writes to standard error would be seen
            return task.read(task.path, *task.more)
    except InputError as e:
        return e
    except MemoryError:
        raise
    except Exception as e:  # every library has its own
        return unreadable(task.path, f"{task.what} file", e, CURE)


def _message(failure: Failure, what: str, task: _Task, wall: float) -> str:
    again = budget.cure(2.0)
    if failure.kind == "memory-limit":
        return f"not read: the reader of {what} needs more than {budget.amount(task.memory)} of memory for it; {again}"
    if failure.kind == "time-limit":
        allowed = f"{task.processor:.3g} s of the processor, {wall:.3g} s in all"
        return f"not read: the reader of {what} takes too long; {allowed} are allowed; {again}"
    if failure.kind == "crash":
        cure = "the file is damaged, or of a kind that it does not know: write it anew, or as CSV"
        return f"not read: the reader of {what} crashed, {failure.sentence}; {cure}"
    return f"not a readable {what} file: {failure.sentence.splitlines()[0][:160]}; {CURE}"

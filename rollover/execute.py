"""Many cases at once in child processes: a case that fails, crashes or takes too long costs itself only.

The one seam between whoever has cases (ensembles, baselines, studies) and whatever works them off.
"""

from __future__ import annotations

import multiprocessing
import os
import pickle
import traceback
from collections.abc import Callable, Iterable, Iterator
from concurrent.futures import FIRST_COMPLETED, wait
from dataclasses import dataclass
from time import perf_counter
from typing import Any, Generic, Literal, TypeVar

C = TypeVar("C")
V = TypeVar("V")

AHEAD = 2  # cases handed out per worker: none idles, and an interrupt has little to throw away
TASKS = 256  # cases after which a worker is replaced, so that what a case leaks does not grow for ever


@dataclass(frozen=True, kw_only=True)
class Failure:
    """Why a case gave no value: an exception, the end of its process, or its time limit; `detail` for a log file."""

    kind: Literal["error", "crash", "time-limit"]
    sentence: str
    detail: str = ""


@dataclass(frozen=True, kw_only=True)
class Outcome(Generic[C, V]):
    """One case worked off: a value, or why there is none. `index` counts the cases in the order they were given."""

    index: int
    case: C
    value: V | None
    failure: Failure | None
    wall_time: float  # s, in the child


def cores() -> int:
    """How many cases make sense at once: the cores that this process may use."""
    if hasattr(os, "sched_getaffinity"):
        return len(os.sched_getaffinity(0))
    return os.cpu_count() or 1


def map_cases(
    function: Callable[[C], V],
    cases: Iterable[C],
    *,
    workers: int | None = None,
    time_limit: float | None = None,
) -> Iterator[Outcome[C, V]]:
    """Outcome of ``function(case)`` for each case, as they become ready; `Outcome.index` restores the order.

    `function` is a top-level function, `case` and value can be pickled. `cases` is read as needed, so it may be
    long. `workers` is the number of child processes (default: `cores`), 0 works in this very process, where a crash
    is a crash and no time limit holds. `time_limit` is in s of wall time for each case. Closing the iterator,
    an interrupt too, ends the children.
    """
    workers = cores() if workers is None else workers
    if workers < 0 or (time_limit is not None and time_limit <= 0.0):
        raise ValueError(f"workers, time_limit: got {workers!r}, {time_limit!r}; at least 0, and more than 0 s")
    if workers == 0:
        return (_done(i, case, _guarded(function, case)) for i, case in enumerate(cases))
    return _in_children(function, cases, workers, time_limit)


def _in_children(
    function: Callable[[C], V], cases: Iterable[C], workers: int, time_limit: float | None
) -> Iterator[Outcome[C, V]]:
    from pebble import ProcessPool

    # a fork would copy the locks of threads that it does not copy
    pool = ProcessPool(max_workers=workers, max_tasks=TASKS, context=multiprocessing.get_context("spawn"))
    todo, open_ = iter(enumerate(cases)), {}
    try:
        while True:
            for index, case in todo:
                open_[pool.schedule(_packed, args=(function, case), timeout=time_limit)] = (index, case)
                if len(open_) >= AHEAD * workers:
                    break
            if not open_:
                return
            for future in wait(open_, return_when=FIRST_COMPLETED).done:
                index, case = open_.pop(future)
                yield _done(index, case, _answer(future, time_limit))
    finally:
        pool.stop()
        pool.join()


def _guarded(function: Callable[[C], V], case: C) -> tuple[V | None, Failure | None, float]:
    began = perf_counter()
    try:
        return function(case), None, perf_counter() - began
    except Exception as e:
        sentence = f"{type(e).__name__}: {e}" if str(e) else type(e).__name__
        return None, Failure(kind="error", sentence=sentence, detail=traceback.format_exc()), perf_counter() - began


def _packed(function: Callable[[C], V], case: C) -> bytes:
    answer = _guarded(function, case)
    try:
        return pickle.dumps(answer)
    except Exception as e:  # which exception a value raises that cannot be pickled is its own affair
        failure = Failure(kind="error", sentence=f"its value cannot be sent back: {e}", detail=traceback.format_exc())
        return pickle.dumps((None, failure, answer[2]))


def _answer(future: Any, time_limit: float | None) -> tuple[Any, Failure | None, float]:
    from pebble import ProcessExpired

    try:
        answer: tuple[Any, Failure | None, float] = pickle.loads(future.result())
        return answer
    except TimeoutError:
        return None, Failure(kind="time-limit", sentence=f"took longer than {time_limit:g} s"), float(time_limit or 0.0)
    except ProcessExpired as e:
        return None, Failure(kind="crash", sentence=f"its process ended with exit code {e.exitcode}"), 0.0
    except Exception as e:  # a case that cannot be pickled, a module that the child cannot import
        return None, Failure(kind="error", sentence=f"{type(e).__name__}: {e}"), 0.0


def _done(index: int, case: C, answer: tuple[V | None, Failure | None, float]) -> Outcome[C, V]:
    value, failure, wall = answer
    return Outcome(index=index, case=case, value=value, failure=failure, wall_time=wall)

"""Many cases at once in child processes: a case that fails, crashes or takes too long costs itself only.

The one seam between whoever has cases (ensembles, baselines, studies) and whatever works them off.
"""

from __future__ import annotations

import multiprocessing
import os
import pickle
import signal
import sys
import tempfile
import threading
import traceback
import types
from collections import deque
from collections.abc import Callable, Iterable, Iterator, Mapping
from concurrent.futures import FIRST_COMPLETED, wait
from concurrent.futures.process import BrokenProcessPool
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from time import perf_counter
from typing import Any, Generic, Literal, TypeVar

from rollover.system import own_code

C = TypeVar("C")
V = TypeVar("V")

AHEAD = 2  # cases handed out per worker: none idles, and an interrupt has little to throw away
LONGEST_PATH = 60  # of the folder of temporary files, bytes: that of a socket in it may have a hundred
TASKS = 1000  # cases after which a worker is replaced, so that what a case leaks does not grow for ever
OWN = __name__.partition(".")[0]  # only of this package it is known that a server may import it
BROKEN = 3  # pools in a row that may break before a case has gone through
KILLED = -9  # exit code of a process that was ended from outside, as the operating system does when memory runs out
PROCESSOR_SPENT = -getattr(signal, "SIGXCPU", 1 << 30)  # exit code of a process whose time of the processor was up
# one thread for each child: cores are shared out among cases, and a sum does not depend on how many there are
THREADS = ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS", "NUMEXPR_NUM_THREADS")


@dataclass(frozen=True, kw_only=True)
class Failure:
    """Why a case gave no value: an exception, the end of its process, time or memory; `detail` for a log file."""

    kind: Literal["error", "crash", "time-limit", "memory-limit"]
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
    memory_limit: float | None = None,
    warm_up: Callable[[], None] | None = None,
    children: Children | None = None,
) -> Iterator[Outcome[C, V]]:
    """Outcome of ``function(case)`` for each case, as they become ready; `Outcome.index` restores the order.

    `function` is a top-level function, `case` and value can be pickled. `cases` is read as needed, so it may be
    long. `workers` is the number of child processes (default: `cores`), 0 works in this very process, where a crash
    is a crash and no limit holds. For each case, `time_limit` is in s of wall time, `memory_limit` in bytes that it may
    take beyond what its process has (address space; not on Windows). A child calls `warm_up` once, outside all limits.
    Closing the iterator, an interrupt too, ends the children; `children` that are given, instead of `workers`, outlive
    it if nothing is left open.
    """
    workers = cores() if workers is None else workers
    if workers < 0 or (time_limit is not None and time_limit <= 0.0):
        raise ValueError(f"workers, time_limit: got {workers!r}, {time_limit!r}; at least 0, and more than 0 s")
    if memory_limit is not None and memory_limit <= 0.0:
        raise ValueError(f"memory_limit: got {memory_limit!r}; more than 0 bytes")
    if workers == 0:
        return (_done(i, case, _guarded(function, case)) for i, case in enumerate(cases))
    if children is None and function.__module__.partition(".")[0] == OWN:
        begin_server(function.__module__)  # imported once, not by each child and whoever comes after one that crashed
    own = children or Children(workers, warm_up)
    return _in_children(function, cases, own, time_limit, memory_limit, keep=children is not None)


class Children:
    """Child processes that are begun with the first case and stay for more than one `map_cases`; see there.

    `bare` children do not know the user's script, which others run again to find the functions in it.
    """

    def __init__(self, workers: int, warm_up: Callable[[], None] | None = None, *, bare: bool = False) -> None:
        self.workers, self._warm_up, self._bare = workers, warm_up, bare
        self._pool: Any = None

    @property
    def pool(self) -> Any:
        """The pool of them."""
        if self._pool is None:
            self._pool = child_pool(self.workers, self._warm_up, self._bare)
        return self._pool

    def stop(self) -> None:
        """End them; a next case would begin new ones."""
        if self._pool is not None:
            self._pool.stop()
            self._pool.join()
            self._pool = None


def child_pool(workers: int, warm_up: Callable[[], None] | None = None, bare: bool = False) -> Any:
    """A pool of child processes that takes tasks by ``schedule(packed, ...)``; `bare` ones see `Children`."""
    from pebble import ProcessPool

    context = _Bare(_context()) if bare else _context()
    # a server that began earlier has the environment of then, without the files of one's own that were named since
    named = {name: os.environ[name] for name in own_code.KINDS.values() if name in os.environ}
    return ProcessPool(
        max_workers=workers, max_tasks=TASKS, context=context, initializer=_begin_child, initargs=(warm_up, named)
    )


def begin_server(*modules: str) -> None:
    """Begin to import `modules` in a process of its own, of which children are forked, while this one goes on.

    Children then have them at once. Only the first call counts; nothing happens where children are not forked.
    """
    context = _context()
    if context.get_start_method() != "forkserver":
        return
    from multiprocessing import forkserver

    context.set_forkserver_preload(list(modules))
    missing = [name for name in THREADS if name not in os.environ]
    os.environ.update(dict.fromkeys(missing, "1"))  # what is imported before the fork reads them then
    try:
        forkserver.ensure_running()
    finally:
        for name in missing:
            del os.environ[name]


def _context() -> Any:
    """How children begin: forked of a server with one thread, as a fork of this process copies locks that threads hold.

    Where there is none, or its socket's path would be too long, as new processes.
    """
    able = "forkserver" in multiprocessing.get_all_start_methods() and len(tempfile.gettempdir()) <= LONGEST_PATH
    return multiprocessing.get_context("forkserver" if able else "spawn")


class _Bare:
    """A context whose processes begin without the user's script: its main module is out of sight for a moment."""

    def __init__(self, context: Any) -> None:
        self._context = context

    def __getattr__(self, name: str) -> Any:
        return getattr(self._context, name)

    def Process(self, *args: Any, **kwargs: Any) -> Any:
        """A process of the context."""
        process = self._context.Process(*args, **kwargs)

        def start() -> None:
            del process.start  # the method of its class is back
            main = sys.modules["__main__"]
            sys.modules["__main__"] = types.ModuleType("__main__")
            try:
                process.start()
            finally:
                sys.modules["__main__"] = main

        process.start = start
        return process


def _begin_child(warm_up: Callable[[], None] | None, named: Mapping[str, str]) -> None:
    os.environ.update(named)
    for name in THREADS:
        os.environ.setdefault(name, "1")
    threading.Thread(target=_leave_with_parent, daemon=True).start()
    if warm_up is not None:
        with suppress(Exception):  # the first case will say what is wrong
            warm_up()


def _leave_with_parent() -> None:
    """End this process once the one that has the cases is gone: a case that hangs would go on for ever."""
    parent = multiprocessing.parent_process()
    if parent is not None:
        parent.join()
        os._exit(1)


def _in_children(
    function: Callable[[C], V],
    cases: Iterable[C],
    children: Children,
    time_limit: float | None,
    memory_limit: float | None,
    *,
    keep: bool,
) -> Iterator[Outcome[C, V]]:
    todo, again = iter(enumerate(cases)), deque[tuple[int, C]]()
    broken = 0
    while True:
        pool, ended = children.pool, False
        open_: dict[Any, tuple[int, C]] = {}
        try:
            while True:
                while len(open_) < AHEAD * children.workers:
                    following = again.popleft() if again else next(todo, None)
                    if following is None:
                        break
                    args = (function, following[1], memory_limit)
                    try:
                        task = pool.schedule(packed, args=args, timeout=time_limit)
                    except RuntimeError as e:  # the pool has gone
                        again.append(following)
                        raise BrokenProcessPool(str(e)) from e
                    open_[task] = following
                if not open_:
                    ended = True
                    return
                for future in wait(open_, return_when=FIRST_COMPLETED).done:
                    answer = answer_of(future, time_limit)
                    index, case = open_.pop(future)
                    broken = 0
                    yield _done(index, case, answer)
        except BrokenProcessPool:
            # a child that was ended between two cases breaks its whole pool: what was open is begun anew
            broken += 1
            if broken >= BROKEN:
                raise
            again.extend(open_.values())
        finally:
            if not (keep and ended):
                children.stop()


def _guarded(function: Callable[[C], V], case: C) -> tuple[V | None, Failure | None, float]:
    began = perf_counter()
    try:
        return function(case), None, perf_counter() - began
    except MemoryError:
        sentence = "needed more memory than it may have"
        failure = Failure(kind="memory-limit", sentence=sentence, detail=traceback.format_exc())
    except Exception as e:
        sentence = f"{type(e).__name__}: {e}" if str(e) else type(e).__name__
        failure = Failure(kind="error", sentence=sentence, detail=traceback.format_exc())
    return None, failure, perf_counter() - began


def packed(function: Callable[[C], V], case: C, memory_limit: float | None = None) -> bytes:
    """What a child sends back of one case, as bytes for `answer_of`; never raises."""
    with limited(memory_limit):
        answer = _guarded(function, case)
    try:
        return pickle.dumps(answer)
    except Exception as e:  # which exception a value raises that cannot be pickled is its own affair
        failure = Failure(kind="error", sentence=f"its value cannot be sent back: {e}", detail=traceback.format_exc())
        return pickle.dumps((None, failure, answer[2]))


@contextmanager
def limited(memory: float | None, processor: float | None = None) -> Iterator[None]:
    """Bound what a case takes beyond what this process has: bytes of address space, s of the processor.

    Memory that cannot be had is a `MemoryError`; the process ends where the processor's time is up. Windows has neither
    limit, macOS does not keep that of memory.
    """
    if sys.platform == "win32":
        yield
        return
    import resource

    wanted: dict[int, float] = {}
    if memory is not None and sys.platform != "darwin":
        wanted[resource.RLIMIT_AS] = _address_space() + memory
    if processor is not None:
        used = resource.getrusage(resource.RUSAGE_SELF)
        wanted[resource.RLIMIT_CPU] = used.ru_utime + used.ru_stime + processor + 1.0  # whole seconds
        wanted[resource.RLIMIT_CORE] = 0.0  # its end leaves no image of its memory
    before = {what: resource.getrlimit(what) for what in wanted}
    for what, most in wanted.items():
        hard = before[what][1]
        resource.setrlimit(what, (int(most) if hard == resource.RLIM_INFINITY else min(int(most), hard), hard))
    try:
        yield
    finally:
        for what, limits in before.items():
            resource.setrlimit(what, limits)


def _address_space() -> int:
    """Bytes of address space that this process has; where that is not told, what such a process usually has."""
    try:
        with open("/proc/self/statm", encoding="ascii") as file:
            return int(file.read().split()[0]) * os.sysconf("SC_PAGE_SIZE")
    except OSError:
        return 1 << 30


def answer_of(future: Any, time_limit: float | None) -> tuple[Any, Failure | None, float]:
    """Value, failure and wall time (s) of a task that is over. Raises ``BrokenProcessPool`` where its pool is gone."""
    from pebble import ProcessExpired

    try:
        answer: tuple[Any, Failure | None, float] = pickle.loads(future.result())
        return answer
    except TimeoutError:
        return None, Failure(kind="time-limit", sentence=f"took longer than {time_limit:g} s"), float(time_limit or 0.0)
    except ProcessExpired as e:
        if e.exitcode == PROCESSOR_SPENT:
            return None, Failure(kind="time-limit", sentence="took more of the processor's time than it may"), 0.0
        hint = ", as when the machine runs out of memory" if e.exitcode == KILLED else ""
        return None, Failure(kind="crash", sentence=f"its process ended with exit code {e.exitcode}{hint}"), 0.0
    except BrokenProcessPool:
        raise
    except Exception as e:  # a case that cannot be pickled, a module that the child cannot import
        return None, Failure(kind="error", sentence=f"{type(e).__name__}: {e}"), 0.0


def _done(index: int, case: C, answer: tuple[V | None, Failure | None, float]) -> Outcome[C, V]:
    value, failure, wall = answer
    return Outcome(index=index, case=case, value=value, failure=failure, wall_time=wall)

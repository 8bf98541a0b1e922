"""The same cases beyond this machine: dask.distributed hands them out, a child process of each worker works them off.

The only home of dask. A worker's thread waits for its child, so that a solver that holds the interpreter for minutes is
not taken for a dead worker, and a case that crashes or hangs costs its child and not the worker.
"""

from __future__ import annotations

import multiprocessing
import pickle
import threading
import time
import uuid
from collections.abc import Callable, Iterable, Iterator
from concurrent.futures.process import BrokenProcessPool
from contextlib import contextmanager, suppress
from importlib.util import find_spec
from multiprocessing.util import Finalize
from typing import Any, TypeVar

from rollover.system.errors import Fault, InputError
from rollover.system.processes import AHEAD, Failure, Outcome, answer_of, child_pool, packed

C = TypeVar("C")
V = TypeVar("V")

LOCAL, SLURM = "local", "slurm"
LOST = "its worker was lost"
REFRESH = 5.0  # s between two counts of the workers' threads
PATIENCE = 60.0  # s that a scheduler and its first worker may take to answer


def map_on_cluster(
    function: Callable[[C], V],
    cases: Iterable[C],
    *,
    address: str,
    workers: int | None = None,
    time_limit: float | None = None,
    memory_limit: float | None = None,
    warm_up: Callable[[], None] | None = None,
) -> Iterator[Outcome[C, V]]:
    """Like `execute.map_cases`, on the workers of a scheduler at `address` (``tcp://host:8786``).

    ``local`` starts `workers` single-threaded ones here, ``slurm`` asks Slurm for as many jobs by the settings of
    dask-jobqueue. A worker that is lost costs the case that kills it: all that it held
    are tried once more, each alone. Raises `InputError`.
    """
    with _client(address, workers) as client:
        yield from _handed_out(client, function, cases, time_limit, memory_limit, warm_up)


def _handed_out(
    client: Any,
    function: Callable[[C], V],
    cases: Iterable[C],
    time_limit: float | None,
    memory_limit: float | None,
    warm_up: Callable[[], None] | None,
) -> Iterator[Outcome[C, V]]:
    from distributed import as_completed

    token = uuid.uuid4().hex  # tells this study's children from those of others on the same workers
    todo = iter(enumerate(cases))
    open_: dict[str, tuple[int, C]] = {}
    lost: list[tuple[int, C]] = []  # with a worker that another case may have killed: each tried again, alone
    alone: set[int] = set()
    over = as_completed(loop=client.loop)
    threads, asked = 1, float("-inf")  # workers come and go
    try:
        while True:
            if time.monotonic() - asked > REFRESH:
                threads, asked = max(1, sum(client.nthreads().values())), time.monotonic()
            room = AHEAD * threads - len(open_)
            given = list(_first(todo, room))
            if not given and not open_ and lost:
                given = [lost.pop(0)]
                alone.add(given[0][0])
            for index, case in given:
                args = (token, function, case, time_limit, memory_limit, warm_up)
                task = client.submit(_in_child, *args, pure=False, retries=0, key=f"case-{token}-{index}-{len(alone)}")
                open_[task.key] = (index, case)
                over.add(task)
            if not open_:
                return
            for task in [next(over), *_ready(over)]:
                index, case = open_.pop(task.key)
                value, failure, wall = _brought(task)
                task.release()
                if failure is not None and failure.sentence == LOST and index not in alone:
                    lost.append((index, case))
                    continue
                yield Outcome(index=index, case=case, value=value, failure=failure, wall_time=wall)
    finally:
        with suppress(Exception):  # a worker that is lost has let go already
            client.run(_let_go, token)


def _first(todo: Iterator[tuple[int, C]], most: int) -> Iterator[tuple[int, C]]:
    for _ in range(most):
        following = next(todo, None)
        if following is None:
            return
        yield following


def _ready(over: Any) -> list[Any]:
    return list(over.next_batch(block=False)) if over.has_ready() else []


def _brought(task: Any) -> tuple[Any, Failure | None, float]:
    if task.status == "finished":
        answer: tuple[Any, Failure | None, float] = pickle.loads(task.result())
        return answer
    reason = task.exception()
    lost = type(reason).__name__ in ("KilledWorker", "CancelledError", "FutureCancelledError")
    sentence = LOST if lost else f"{type(reason).__name__}: {reason}"
    return None, Failure(kind="crash" if lost else "error", sentence=sentence, detail=str(reason)), 0.0


_own = threading.local()  # the pool of one child that each thread of a worker keeps, and whose it is
_pools: dict[str, list[Any]] = {}


def _in_child(
    token: str,
    function: Callable[[C], V],
    case: C,
    time_limit: float | None,
    memory_limit: float | None,
    warm_up: Callable[[], None] | None,
) -> bytes:
    """On a worker: one case in this thread's child process, its answer as `execute.packed` gives it."""
    for last in (False, True):
        pool = _pool(token, warm_up)
        try:
            task = pool.schedule(packed, args=(function, case, memory_limit), timeout=time_limit)
            return pickle.dumps(answer_of(task, time_limit))
        except (BrokenProcessPool, RuntimeError):  # its child was ended between two cases
            _own.pool = None
            if last:
                raise
    raise AssertionError  # the second round returns or raises


def _pool(token: str, warm_up: Callable[[], None] | None) -> Any:
    pool = getattr(_own, "pool", None)
    if pool is not None and pool.active and _own.token == token:
        return pool
    if pool is not None:
        pool.stop()  # of a study that is over: this thread works for another one now
    # a nanny's worker is daemonic, and those may have no children; ours are stopped when it ends
    multiprocessing.current_process()._config["daemon"] = False  # type: ignore[attr-defined]
    _own.pool, _own.token = child_pool(1, warm_up), token
    _pools.setdefault(token, []).append(_own.pool)
    Finalize(None, _own.pool.stop, exitpriority=100)
    return _own.pool


def _let_go(token: str) -> None:
    """On a worker: end the children of a study."""
    for pool in _pools.pop(token, []):
        pool.stop()
        pool.join()


@contextmanager
def _client(address: str, workers: int | None) -> Iterator[Any]:
    installed(address)
    from distributed import Client

    cluster: Any = None
    try:
        if address == LOCAL:
            cluster = _local(workers)
        elif address == SLURM:
            cluster = _slurm(workers)
        try:
            client = Client(cluster if cluster is not None else address, timeout=PATIENCE, set_as_default=False)
        except (OSError, ValueError) as e:
            message = f"no scheduler answers, got {type(e).__name__}: {e}; tcp://HOST:PORT, local or slurm"
            raise InputError(Fault(file=f"--scheduler {address}", message=message)) from None
        try:
            _await_workers(client, address, endless=cluster is not None)
            yield client
        finally:
            client.close()
    finally:
        if cluster is not None:
            cluster.close()


def _await_workers(client: Any, address: str, *, endless: bool) -> None:
    """Wait for the first worker; a queue may take its time."""
    began = time.monotonic()
    while not client.nthreads():
        if not endless and time.monotonic() - began > PATIENCE:
            message = (
                f"the scheduler has no workers after {PATIENCE:g} s; start some: dask worker {address} --nthreads 1"
            )
            raise InputError(Fault(file=f"--scheduler {address}", message=message))
        time.sleep(0.1)


def _local(workers: int | None) -> Any:
    import dask
    from distributed import LocalCluster

    from rollover.system.processes import cores

    # a case that takes its worker along is not tried on three others; nobody looks at the profile of a waiting thread
    dask.config.set({"distributed.scheduler.allowed-failures": 0, "distributed.worker.profile.enabled": False})
    return LocalCluster(n_workers=workers or cores(), threads_per_worker=1, dashboard_address=None, memory_limit=0)


def _slurm(workers: int | None) -> Any:
    from dask_jobqueue import SLURMCluster

    try:
        cluster = SLURMCluster()
    except ValueError as e:
        message = f"dask-jobqueue lacks settings, {e}; write them to ~/.config/dask/jobqueue.yaml under jobqueue.slurm"
        raise InputError(Fault(file="--scheduler slurm", message=message)) from None
    cluster.scale(jobs=workers or 1)
    return cluster


def installed(address: str) -> None:
    """Raise `InputError` with the cure where a package is missing that a scheduler at `address` needs."""
    extra = "slurm" if address == SLURM else "cluster"
    packages = {"distributed": "distributed", **({"dask-jobqueue": "dask_jobqueue"} if address == SLURM else {})}
    for package, module in packages.items():
        if find_spec(module) is None:
            message = f"{package} is not installed; pip install 'rollover[{extra}]' brings it"
            raise InputError(Fault(file="--scheduler", message=message))

"""The executor of fits: here or in child processes; results stay in a file until the diagnosis is done.

A task depends on nothing but the recordings, their noise and its own start, so that the answer is the same for any
number of workers, and a diagnosis that was interrupted takes up what it had fitted.
"""

from __future__ import annotations

import hashlib
import json
import os
import pickle
from collections.abc import Callable, Sequence
from contextlib import ExitStack
from pathlib import Path
from typing import Any, cast

from rollover.diagnosis.fit.levenberg_marquardt import Problem
from rollover.diagnosis.fit.linearisation import Fitted
from rollover.diagnosis.fit.local_search import linearised, polish, with_time_shift_search
from rollover.diagnosis.fit.model_variants import as_variant, with_fitted_secondary
from rollover.diagnosis.fit.tasks import Progress, R, T, Task, serial_map
from rollover.diagnosis.fit.threshold_scan import with_threshold_traced
from rollover.diagnosis.forward.interface import FailedModelError
from rollover.system.processes import Children, Failure, begin_server, map_cases
from rollover.system.writing import scratch

WARM = "rollover.diagnosis.fit.warmup"


class Executor:
    """Works off tasks: in this process, or in `workers` children where more than one is asked for.

    `notebook` is a file of finished fits by task key; `close` removes it.
    """

    def __init__(self, workers: int = 1, notebook: Path | None = None, about: str = "") -> None:
        self.workers, self.notebook, self.about = workers, notebook, about
        self.children = Children(workers)
        if workers > 1:
            begin_server(WARM)
        self._scratch = ExitStack()
        self._folder: Path | None = None  # what children read
        self._beginning: list[Any] = []  # what tells that the children are there
        self._done: dict[str, dict[str, Any] | None] = {}
        if notebook is not None and notebook.is_file() and not notebook.is_symlink():
            for line in notebook.read_text(encoding="utf-8").splitlines():
                try:
                    row = json.loads(line)
                    self._done[row["key"]] = row["fit"]
                except (ValueError, KeyError, TypeError):
                    continue  # the line at which it was interrupted

    def __enter__(self) -> Executor:
        return self

    def __exit__(self, *_: object) -> None:
        self.children.stop()
        self._scratch.close()

    def begin(self, problem: Problem) -> None:
        """Begin the children, if any, while this process goes on: each makes a run, so that it has all it needs."""
        if self.workers > 1 and not problem.effort.is_ensemble:
            shared = self._shared_file(problem, self._about(problem))
            self._beginning = [self.children.pool.schedule(_begun, args=(shared,)) for _ in range(self.workers)]

    def is_there(self) -> bool:
        """Whether the children have begun."""
        return bool(self._beginning) and all(b.done() for b in self._beginning)

    def close(self) -> None:
        """All is done: nothing needs to be taken up again."""
        if self.notebook is not None:
            self.notebook.unlink(missing_ok=True)

    def fits(self, problem: Problem, tasks: Sequence[Task], say: Progress = lambda _: None) -> list[Fitted | None]:
        """Fits in the order of the tasks; None where nothing could be simulated."""
        about = self._about(problem)
        found: list[Fitted | None] = [None] * len(tasks)
        keys = [task.key(about) for task in tasks]
        todo = [k for k, key in enumerate(keys) if key not in self._done]
        for k, key in enumerate(keys):
            if key in self._done:
                found[k] = _rebuilt(problem, tasks[k], self._done[key])
        done = 0

        def ended(k: int, fitted: Fitted | None) -> None:
            nonlocal done
            found[k], done = fitted, done + 1
            self._note(keys[k], fitted)
            say(f"fitted {tasks[k].candidates[-1].key}, {done} of {len(todo)}")

        # full runs are made side by side for each fit in turn, and kept here
        if problem.effort.is_ensemble:
            begun = [task for k, task in enumerate(tasks) if k in todo and task.how == "fit"]
            problem.made_ahead(point for task in begun for point in task.beginning(problem.effort.fd_steps))
        while done < len(todo) and not (len(todo) - done > 1 and self.is_there()):
            k = todo[done]
            ended(k, work(problem, tasks[k]))
        if done == len(todo):
            return found
        shared, rest = self._shared_file(problem, about), todo[done:]
        outcomes = map_cases(_worked, [(shared, tasks[k]) for k in rest], children=self.children)
        for outcome in outcomes:
            k = rest[outcome.index]
            if outcome.failure is not None:
                raise _failed(f"a fit of {tasks[k].candidates[-1].key}", outcome.failure)
            fitted, made = outcome.value if outcome.value is not None else (None, 0)
            problem.simulations += made
            ended(k, fitted)
        return found

    def parallel_map(self, problem: Problem, function: Callable[[Problem, T], R], items: Sequence[T]) -> list[R]:
        """`function(problem, item)` of each, in their order: here, or spread over the children once they are there.

        `function` and what it returns are sent to them: a function of a module, or a partial of one.
        """
        if problem.effort.is_ensemble or len(items) < 2 or not self.is_there():
            return serial_map(problem, function, items)
        shared = self._shared_file(problem, self._about(problem))
        shares = [list(items)[k :: 2 * self.workers] for k in range(2 * self.workers)]
        found: dict[int, R] = {}
        for start, (seen, made) in enumerate(
            self.each(_mapped, [(shared, function, share) for share in shares if share])
        ):
            problem.simulations += made
            found |= {start + 2 * self.workers * k: one for k, one in enumerate(seen)}
        return [found[k] for k in range(len(items))]

    def each(self, function: Callable[[T], R], items: Sequence[T]) -> list[R]:
        """`function(item)` of each, in their order: here, or in the children once there."""
        if not self.is_there():
            return [function(item) for item in items]
        found: dict[int, R] = {}
        for outcome in map_cases(function, items, children=self.children):
            if outcome.failure is not None:
                name = getattr(function, "__name__", "a child").strip("_")
                raise _failed(name, outcome.failure)
            found[outcome.index] = cast(R, outcome.value)
        return [found[k] for k in range(len(items))]

    def _about(self, problem: Problem) -> str:
        """What all fits depend on beside their tasks."""
        return f"{self.about} {_fingerprint(problem)}"

    def _shared_file(self, problem: Problem, about: str) -> Path:
        """A file with the problem, which each child reads once: megabytes for each of a thousand tasks take long."""
        if self._folder is None:
            self._folder = self._scratch.enter_context(scratch())
        path = Path(self._folder, hashlib.sha256(f"{about} {problem.shifts}".encode()).hexdigest())
        if not path.exists():
            path.write_bytes(pickle.dumps(problem.no_jacobian()))
        return path

    def _note(self, key: str, fitted: Fitted | None) -> None:
        row: dict[str, Any] | None = None
        if fitted is not None:
            variant = dict(fitted.candidates[-1].variant) if fitted.candidates else {}
            row = {"x": list(fitted.x), "shifts": [b.shift for b in fitted.blocks], "form": variant}
        self._done[key] = row
        if self.notebook is not None:
            self.notebook.parent.mkdir(parents=True, exist_ok=True)
            with open(self.notebook, "a", encoding="utf-8", opener=_no_link) as file:
                file.write(json.dumps({"key": key, "fit": row}) + "\n")


def _failed(what: str, failure: Failure) -> Exception:
    """What a child's failure is here: that of a model of one's own is that, its line as it stands."""
    kind, _, line = failure.sentence.partition(": ")
    if kind == FailedModelError.__name__:
        return FailedModelError(line)
    return RuntimeError(f"{what}: {failure.sentence}")


def _no_link(path: str, flags: int) -> int:
    return os.open(path, flags | getattr(os, "O_NOFOLLOW", 0), 0o644)


def work(problem: Problem, task: Task) -> Fitted | None:
    """The fit that a task asks for; None where nothing could be simulated."""
    if task.how == "fit":
        return problem.fit(
            task.candidates,
            task.start,
            rounds=task.rounds,
            only=task.only,
            shifts=task.shifts,
            width=task.width,
            fixed_shifts=task.fixed_shifts,
            no_jacobian=task.rounds is not None,
            reused=task.reused,
        )
    begun = linearised(problem, task.candidates, task.start, task.shifts, task.recordings)
    if begun is None:
        return None
    leaves = [b.total for b in begun.blocks] if task.leaves is None else task.leaves
    if task.how == "secondary":
        return (
            with_fitted_secondary(problem, begun, leaves)
            if task.variant is None
            else as_variant(problem, begun, task.variant, leaves)
        )
    if task.stretch is not None:
        return with_threshold_traced(problem, begun, task.stretch)
    ways: dict[str, Callable[[Problem, Fitted], Fitted | None]] = {"polish": polish, "time": with_time_shift_search}
    return ways[task.how](problem, begun)


def _fingerprint(problem: Problem) -> str:
    """Hash of the datasets: samples, noise, and whether a heavy tail is allowed for runs that diverge."""
    total = hashlib.sha256(repr(problem.heavy_tailed).encode())
    for e in problem.dataset:
        total.update(repr((e.name, e.shift_prior)).encode())
        total.update(b"" if e.nuisance is None else e.nuisance.tobytes())
        for s in e.signals:
            total.update(
                repr((s.channel, s.sigma, s.ar, s.zero_error)).encode() + s.values.tobytes() + s.rows.tobytes()
            )
            if s.weight is not None:
                total.update(s.weight.tobytes())
    return total.hexdigest()


_held: dict[Path, Problem] = {}  # in a child: the problem of its last task, with what it simulated


def _begun(shared: Path) -> None:
    _problem_of(shared).fit((), (), rounds=1)


def _worked(case: tuple[Path, Task]) -> tuple[Fitted | None, int]:
    shared, task = case
    problem = _problem_of(shared)
    before = problem.simulations
    return work(problem, task), problem.simulations - before


def _mapped(case: tuple[Path, Callable[[Problem, Any], Any], list[Any]]) -> tuple[list[Any], int]:
    shared, function, items = case
    problem = _problem_of(shared)
    before = problem.simulations
    return serial_map(problem, function, items), problem.simulations - before


def _problem_of(shared: Path) -> Problem:
    """The problem of a file, with what this child has simulated for it."""
    if shared not in _held:
        _held.clear()
        _held[shared] = pickle.loads(shared.read_bytes())
    return _held[shared]


def _rebuilt(problem: Problem, task: Task, row: dict[str, Any] | None) -> Fitted | None:
    if row is None:
        return None
    candidates = list(task.candidates)
    if candidates and row["form"] != candidates[-1].variant:
        candidates[-1] = next(c for c in candidates[-1].variants() if c.variant == row["form"])
    elif len(row["x"]) > len(task.start):
        candidates[-1] = candidates[-1].whole()
    has_no_jacobian = task.how == "fit" and task.rounds is not None  # it ended without slopes
    return linearised(problem, candidates, row["x"], row["shifts"], task.recordings, no_jacobian=has_no_jacobian)

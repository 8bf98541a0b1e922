"""Cases in child processes: values, and failures as values."""

from __future__ import annotations

import itertools
import multiprocessing
import os
import signal
import subprocess
import sys
import threading
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest

from rollover import studies
from rollover.studies import runner
from rollover.system import own_code, processes
from rollover.system.numbers import percent
from rollover.system.processes import map_cases
from tests.rollover.studies import drops


def odd(case: Any) -> Any:
    """What a case asks for."""
    match case:
        case "raise":
            raise ValueError("not today")
        case "die":
            os.kill(os.getpid(), signal.SIGKILL)
        case "hang":
            threading.Event().wait()
        case "eat":
            return len(bytearray(2_000_000_000))
        case "unpicklable":
            return lambda: None
    return case * case, os.getpid()


def test_what_goes_wrong_costs_one_case() -> None:
    cases = [2, "raise", "die", "hang", "unpicklable", 3]
    found = {o.index: o for o in map_cases(odd, cases, workers=2, time_limit=5.0)}
    assert [found[i].case for i in range(len(cases))] == cases
    assert [(f.kind if (f := found[i].failure) else None) for i in range(len(cases))] == [
        None,
        "error",
        "crash",
        "time-limit",
        "error",
        None,
    ]
    assert [found[i].value[0] for i in (0, 5)] == [4, 9]
    assert os.getpid() not in [found[i].value[1] for i in (0, 5)]
    sentences = [found[i].failure.sentence for i in (1, 2, 3)]  # type: ignore[union-attr]
    killed = "its process ended with exit code -9, as when the machine runs out of memory"
    assert sentences == ["ValueError: not today", killed, "took longer than 5 s"]
    assert "in odd" in found[1].failure.detail  # type: ignore[union-attr]


@pytest.mark.skipif(sys.platform == "win32", reason="platform: no limit of the address space")
def test_memory_beyond_the_limit_fails_but_the_child_goes_on() -> None:
    found = {o.index: o for o in map_cases(odd, [2, "eat", 3], workers=1, memory_limit=1e9)}
    assert found[1].failure is not None
    assert (found[1].failure.kind, found[1].failure.sentence) == ("memory-limit", "needed more memory than it may have")
    assert [found[i].value[0] for i in (0, 2)] == [4, 9]
    assert found[0].value[1] == found[2].value[1], "the same child"
    free = next(iter(map_cases(odd, ["eat"], workers=1, memory_limit=3e9)))
    assert free.value == 2_000_000_000


ORPHAN = """
import sys
from pathlib import Path
from rollover.system.processes import map_cases
from tests.rollover.odd import odd
if __name__ == "__main__":
    list(map_cases(odd, [Path(sys.argv[1])], workers=1))
"""


@pytest.mark.skipif(not Path("/proc/self").exists(), reason="platform: needs /proc")
def test_a_case_that_hangs_ends_with_its_parent(tmp_path: Path) -> None:
    script, told = tmp_path / "orphan.py", tmp_path / "pid"
    script.write_text(ORPHAN)
    root = Path(__file__).resolve().parents[2]
    parent = subprocess.Popen([sys.executable, str(script), str(told)], env={**os.environ, "PYTHONPATH": str(root)})
    while not told.exists() or not told.read_text():
        assert parent.poll() is None
        time.sleep(0.05)
    child = Path("/proc", told.read_text())
    assert child.exists()
    parent.kill()
    parent.wait()
    until = time.monotonic() + 60.0
    while child.exists() and time.monotonic() < until:
        time.sleep(0.1)
    assert not child.exists()


SERVED = """
import os
from rollover.system.processes import THREADS, begin_server, map_cases
from tests.rollover.odd import imported
if __name__ == "__main__":
    begin_server("colorsys")
    begin_server("stringprep")
    print({o.case: o.value for o in map_cases(imported, ["colorsys"], workers=1)})
    print({o.case: o.value for o in map_cases(imported, ["stringprep"], workers=1)})
    print([name for name in THREADS if name in os.environ])
"""


@pytest.mark.skipif("forkserver" not in multiprocessing.get_all_start_methods(), reason="platform: no forked children")
@pytest.mark.parametrize(("folder", "has"), [("", True), ("deep/" * 20, False)])
def test_children_have_what_their_server_imported_beside(tmp_path: Path, folder: str, has: bool) -> None:
    """The first call alone counts, and the environment is as it was; a socket has no place at so long a path."""
    script = tmp_path / "served.py"
    script.write_text(SERVED)
    if folder:
        (tmp_path / folder).mkdir(parents=True)
    usual = {name: value for name, value in os.environ.items() if name not in processes.THREADS}
    env = {**usual, "PYTHONPATH": str(Path(__file__).resolve().parents[2])}
    env |= {"TMPDIR": str(tmp_path / folder)} if folder else {}
    done = subprocess.run([sys.executable, str(script)], capture_output=True, text=True, env=env, check=True)
    assert done.stdout.splitlines() == [f"{{'colorsys': {has}}}", "{'stringprep': False}", "[]"]


def test_a_server_imports_what_is_the_packages_own(monkeypatch: pytest.MonkeyPatch) -> None:
    """Nobody knows what a user's module does as it is imported; children that are given have begun as they were to."""
    asked: list[str] = []
    monkeypatch.setattr(processes, "begin_server", lambda *modules: asked.extend(modules))
    map_cases(percent, [0.5], workers=1)
    map_cases(odd, [2], workers=1)
    map_cases(percent, [0.5], workers=0)
    map_cases(percent, [0.5], children=processes.Children(1))
    assert asked == ["rollover.system.numbers"]


def test_kernels_of_a_study_are_there_before_its_children() -> None:
    """And no file of one's own, which may be another one by the next study."""
    code = (
        "import rollover.studies.warm_drops as a\nfrom rollover.kernels import drop_integrator, time_loop\n"
        "print(bool(drop_integrator.fall.signatures), bool(time_loop.advance.signatures))\n"
        "import rollover.studies.warm_overturns as b\nprint(bool(time_loop.advance.signatures))\n"
        "import os, sys\nprint(os.environ['ROLLOVER_EFFECTS'][-16:])\n"
        "print(any(name.startswith('rollover_effects_') for name in sys.modules))\n"
    )
    own = {**os.environ, "ROLLOVER_EFFECTS": str(Path(__file__).with_name("faulty_effect.py"))}
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True, env=own)
    assert done.stdout.split() == ["True", "False", "True", "faulty_effect.py", "False"]


@pytest.mark.parametrize(
    ("changes", "module"),
    [((), "warm_drops"), ((("simulator: drop\n", ""),), "warm_overturns")],
)
def test_a_study_asks_for_a_server_of_its_kernels(
    changes: tuple[tuple[str, str], ...], module: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    asked: list[str] = []
    monkeypatch.setattr(runner, "begin_server", asked.append)
    monkeypatch.setattr(runner, "map_cases", lambda *_, **more: iter(()))
    study = studies.load(drops(tmp_path, *changes))
    for workers in (0, 2):
        assert list(runner._outcomes(iter(()), runner.Way(workers=workers), study)) == []
    assert asked == [f"rollover.studies.{module}"]


def warm() -> None:
    os.environ["WARM"] = str(os.getpid())


def warmed(case: int) -> str:
    return os.environ["WARM"]


def whoever(_: int) -> int:
    return os.getpid()


def test_a_child_is_warmed_up_before_its_first_case() -> None:
    found = [o.value for o in map_cases(warmed, [1, 2, 3], workers=1, warm_up=warm)]
    assert found[0] not in (None, str(os.getpid()))
    assert len(set(found)) == 1


def test_children_that_are_kept_work_off_a_second_batch() -> None:
    children = processes.Children(1)
    first, second = ([o.value for o in map_cases(whoever, [0], children=children)] for _ in range(2))
    assert first == second != [os.getpid()]
    children.stop()
    again = [o.value for o in map_cases(whoever, [0], children=children)]
    children.stop()
    assert again != first


def test_a_pool_whose_idle_child_is_ended_is_replaced(monkeypatch: pytest.MonkeyPatch) -> None:
    made = []
    pool_of = processes.child_pool
    monkeypatch.setattr(processes, "child_pool", lambda *given: made.append(pool_of(*given)) or made[-1])

    def slowly() -> Iterator[int]:
        yield 2
        for worker in list(made[0]._pool_manager.worker_manager.workers):
            os.kill(worker, signal.SIGKILL)
        while made[0].active:
            threading.Event().wait(0.05)
        yield 3

    found = {o.index: o.value[0] for o in map_cases(odd, slowly(), workers=1) if o.value}
    assert found == {0: 4, 1: 9}
    assert len(made) == 2


def test_children_find_a_file_named_after_their_server_began(monkeypatch: pytest.MonkeyPatch) -> None:
    variable = own_code.KINDS["models"]
    monkeypatch.delenv(variable, raising=False)
    assert [o.value for o in map_cases(os.getenv, [variable], workers=1)] == [None]
    monkeypatch.setenv(variable, "/mine.py")
    assert [o.value for o in map_cases(os.getenv, [variable], workers=1)] == ["/mine.py"]


def test_without_workers_in_this_process() -> None:
    found = list(map_cases(odd, [2, "raise"], workers=0))
    assert found[0].value == (4, os.getpid())
    assert found[1].failure is not None
    assert found[1].failure.sentence == "ValueError: not today"


def test_many_cases_are_read_as_needed_and_may_be_broken_off() -> None:
    read = []

    def endless() -> Iterator[int | str]:
        for case in itertools.chain([2, 3], itertools.repeat("hang")):
            read.append(case)
            yield case

    outcomes = map_cases(odd, endless(), workers=1)
    first = [next(outcomes).value for _ in range(2)]
    outcomes.close()  # type: ignore[attr-defined]  # and does not wait for what hangs
    assert sorted(v[0] for v in first if v) == [4, 9]
    assert len(read) <= 5


@pytest.mark.parametrize(("workers", "limit"), [(-1, None), (1, 0.0)])
def test_numbers_that_make_no_sense(workers: int, limit: float | None) -> None:
    with pytest.raises(ValueError, match=r"at least 0, and more than 0 s"):
        map_cases(odd, [], workers=workers, time_limit=limit)

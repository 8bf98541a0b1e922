"""Cases in child processes: values, and failures as values."""

from __future__ import annotations

import itertools
import os
import signal
import threading
from collections.abc import Iterator
from typing import Any

import pytest

from rollover.execute import map_cases


def odd(case: Any) -> Any:
    """What a case asks for."""
    match case:
        case "raise":
            raise ValueError("not today")
        case "die":
            os.kill(os.getpid(), signal.SIGKILL)
        case "hang":
            threading.Event().wait()
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
    assert sentences == ["ValueError: not today", "its process ended with exit code -9", "took longer than 5 s"]
    assert "in odd" in found[1].failure.detail  # type: ignore[union-attr]


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

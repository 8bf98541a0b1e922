"""What is said while kernels are compiled: that it comes once, and how far it is."""

from __future__ import annotations

import threading
import time as clock
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from rollover.cli.console.terminal import EVERY, say

SECONDS = 100  # 88 to 108 on idle cores of an AMD EPYC, by `rollover run side_overturn` with an empty cache
KERNELS = 195  # as many while `rollover run side_overturn` compiles into an empty cache


@contextmanager
def compiling(cold: bool, *, every: float = EVERY) -> Iterator[None]:
    """Say, if nothing is compiled yet, that it will be, and every so many s how many kernels are kept by now.

    They are counted by their files: child processes compile as well.
    """
    if not cold:
        yield
        return
    from ground.compiled import KEPT

    say(f"Compiling the contact kernels, once per installation and once per new law: about {SECONDS} s.")
    ended = threading.Event()
    watcher = threading.Thread(target=_watch, args=(KEPT, _kernels(KEPT), ended, every), daemon=True)
    watcher.start()
    try:
        yield
    finally:
        ended.set()
        watcher.join()


def _watch(kept: Path, before: int, ended: threading.Event, every: float) -> None:
    began, reported = clock.monotonic(), 0
    while not ended.wait(every):
        if (made := _kernels(kept) - before) > reported:
            reported = made
            say(f"{made} of about {KERNELS} kernels compiled in {clock.monotonic() - began:.0f} s")


def _kernels(kept: Path) -> int:
    return sum(1 for _ in kept.rglob("*.nbc"))

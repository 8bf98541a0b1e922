"""Interrupts that wait for the end of a step: what is raised within a callback, the engine takes for its failure."""

from __future__ import annotations

import contextlib
import signal
import threading
from collections.abc import Iterator

SIGNALS = (signal.SIGINT, signal.SIGTERM)


@contextlib.contextmanager
def held() -> Iterator[list[int]]:
    """Hold signals that have a Python handler; the list holds those that wait, the first is handed on at the end.

    Other threads than the main one are never interrupted: there nothing is held.
    """
    waiting: list[int] = []
    if threading.current_thread() is not threading.main_thread():
        yield waiting
        return
    usual = {number: handler for number in SIGNALS if callable(handler := signal.getsignal(number))}
    for number in usual:
        signal.signal(number, lambda n, _: waiting.append(n))
    try:
        yield waiting
    finally:
        for number, handler in usual.items():
            signal.signal(number, handler)
        if waiting:
            signal.raise_signal(waiting[0])

"""Ctrl-C and SIGTERM end a run, whatever it is doing; the engine takes what a callback raises for its own failure."""

from __future__ import annotations

import contextlib
import signal
import threading
from collections.abc import Callable, Iterator
from typing import Any

import pytest

from rollover.dynamics import interrupts, model
from rollover.dynamics.simulate import run
from tests.physics.scenes import shipped


class StoppedError(Exception):
    """What the handler of a test raises."""


@pytest.mark.parametrize("callback", ["generalised_forces", "stiffness", "added_mass"])
@pytest.mark.parametrize("number", interrupts.SIGNALS)
def test_a_signal_in_a_callback_ends_the_run_without_failure(
    callback: str, number: signal.Signals, monkeypatch: pytest.MonkeyPatch
) -> None:
    called, inner = [0], getattr(model, callback)

    def interrupted(*args: Any) -> Any:
        called[0] += 1
        if called[0] == 40:
            signal.raise_signal(number)
        return inner(*args)

    monkeypatch.setattr(model, callback, interrupted)
    with handled(number), pytest.raises(StoppedError):
        run(shipped("cube_toss"))
    assert 40 <= called[0] < 60, "within a step"


@contextlib.contextmanager
def handled(number: signal.Signals) -> Iterator[Callable[..., None]]:
    """A handler that raises; then whoever listened before again."""

    def stop(*_: object) -> None:
        raise StoppedError

    before = signal.signal(number, stop)
    try:
        yield stop
    finally:
        signal.signal(number, before)


def twice_within() -> None:
    with interrupts.held() as waiting:
        signal.raise_signal(signal.SIGINT)
        signal.raise_signal(signal.SIGINT)
        assert waiting == [signal.SIGINT, signal.SIGINT]


def test_who_listened_before_listens_again() -> None:
    with handled(signal.SIGINT) as stop:
        with interrupts.held() as waiting:
            assert signal.getsignal(signal.SIGINT) is not stop
        assert waiting == []
        assert signal.getsignal(signal.SIGINT) is stop
        with pytest.raises(StoppedError):
            twice_within()


def test_what_has_no_handler_stays_as_it_is() -> None:
    before = signal.signal(signal.SIGTERM, signal.SIG_IGN)
    try:
        with interrupts.held() as waiting:
            signal.raise_signal(signal.SIGTERM)
        assert waiting == []
        assert signal.getsignal(signal.SIGTERM) is signal.SIG_IGN
    finally:
        signal.signal(signal.SIGTERM, before)


def test_in_another_thread_nothing_is_held() -> None:
    found: list[object] = []

    def there() -> None:
        with interrupts.held():
            found.append(signal.getsignal(signal.SIGINT))

    thread = threading.Thread(target=there)
    thread.start()
    thread.join()
    assert found == [signal.getsignal(signal.SIGINT)]

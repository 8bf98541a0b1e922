"""Fixtures of the tests of `rollover`."""

from __future__ import annotations

import time
from collections.abc import Iterator

import pytest

from tests.rollover.bounds import largest


@pytest.fixture
def cheap() -> Iterator[None]:
    """What is done within takes less than 5 s of this processor and 250 MB more than was ever held."""
    began, before = time.process_time(), largest()
    yield
    assert time.process_time() - began < 5.0
    assert largest() - before < 250.0

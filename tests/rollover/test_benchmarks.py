"""Benchmarks are run by hand: that they can be at all is tested here."""

from __future__ import annotations

import importlib
from pathlib import Path

import pytest

import tests.benchmarks

NAMES = sorted(p.stem for p in Path(tests.benchmarks.__file__).parent.glob("*.py") if p.stem != "__init__")


@pytest.mark.parametrize("name", NAMES)
def test_a_benchmark_finds_all_that_it_uses(name: str) -> None:
    try:
        importlib.import_module(f"tests.benchmarks.{name}")
    except ModuleNotFoundError as missing:
        if str(missing.name).split(".")[0] in ("ground", "rollover", "tests", "viz"):
            raise
        pytest.skip(f"needs the benchmark group: {missing.name}")

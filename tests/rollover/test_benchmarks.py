"""Benchmarks are run by hand: that they can be at all is tested here."""

from __future__ import annotations

import importlib
import re
import sys
import tomllib
from importlib.util import find_spec
from pathlib import Path
from unittest.mock import MagicMock

import pytest

import tests.benchmarks

HERE = Path(tests.benchmarks.__file__).parent
NAMES = sorted(p.stem for p in HERE.glob("*.py") if p.stem != "__init__")
GROUPS = tomllib.loads((HERE.parents[1] / "pyproject.toml").read_text())["dependency-groups"]
OUTSIDE = [re.split(r"[<>=]", package)[0] for package in GROUPS["benchmark"]]


@pytest.mark.parametrize("name", NAMES)
def test_a_benchmark_finds_all_that_it_uses_of_ours(name: str, monkeypatch: pytest.MonkeyPatch) -> None:
    # what ours is held against (`make bench` installs it) is a stand-in where it is missing
    for package in OUTSIDE:
        if find_spec(package) is None:
            monkeypatch.setitem(sys.modules, package, MagicMock(__version__="0", __path__=[]))
    importlib.import_module(f"tests.benchmarks.{name}")

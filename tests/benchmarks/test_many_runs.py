"""Prints what a case costs by each integrator: ``pytest -m benchmark tests/benchmarks/test_many_runs.py -s``."""

from __future__ import annotations

import pytest

from tests.benchmarks import many_runs

pytestmark = [pytest.mark.benchmark, pytest.mark.timeout(3600)]


def test_a_case_of_many_costs_half_as_much() -> None:
    print()
    # 2.5 to 2.7 on a busy machine, both in turn: what lies between the two is Exudyn and its calls, not the case
    assert many_runs.report(40, 2).ratio > 2.0

"""Prints the costs of studies: ``pytest -m benchmark tests/benchmarks/test_studies.py -s``. Tables are asserted."""

from __future__ import annotations

import pytest

from tests.benchmarks import studies

pytestmark = [pytest.mark.benchmark, pytest.mark.timeout(3600)]


def test_store_table_and_page() -> None:
    print()
    found = studies.report_rows()
    few, many = found[0], found[-1]
    for name in ("key", "keep", "read", "table"):  # in proportion, but for what a start costs
        assert many[name] < 2.0 * few[name] + 0.05


def test_overturns() -> None:
    print()
    here, there = studies.report_overturns(1000, 2)
    assert here.case_cpu > 0.0
    assert there is None or here.table == there.table

"""Recordings of the made-up runs, written once."""

from __future__ import annotations

from pathlib import Path

import pytest

from rollover.dynamics.result import Run
from tests.viz import example


@pytest.fixture(scope="session")
def overturn() -> Run:
    return example.overturn()


@pytest.fixture(scope="session")
def drop() -> Run:
    return example.drop()


@pytest.fixture(scope="session")
def overturn_rrd(overturn: Run, tmp_path_factory: pytest.TempPathFactory) -> Path:
    log = pytest.importorskip("viz.recordings.log", reason="no rerun wheel for this platform", exc_type=ImportError)
    path = tmp_path_factory.mktemp("rrd") / "overturn.rrd"
    log.write_rrd(overturn, path, peaks=example.peaks(overturn))
    return path


@pytest.fixture(scope="session")
def drop_rrd(drop: Run, tmp_path_factory: pytest.TempPathFactory) -> Path:
    log = pytest.importorskip("viz.recordings.log", reason="no rerun wheel for this platform", exc_type=ImportError)
    path = tmp_path_factory.mktemp("rrd") / "drop.rrd"
    log.write_rrd(drop, path)
    return path

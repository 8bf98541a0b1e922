"""The same cases on a local dask cluster: the same table, and a worker that is lost costs one case."""

from __future__ import annotations

import sys
from pathlib import Path

import pytest

from rollover import studies
from rollover.studies import case_store
from rollover.studies.runner import Way, conduct
from rollover.system.errors import InputError
from tests.rollover.odd import odd
from tests.rollover.studies import drops


def test_without_the_extra_there_is_a_cure(monkeypatch: pytest.MonkeyPatch) -> None:
    from rollover.studies.cluster import map_on_cluster

    monkeypatch.setitem(sys.modules, "distributed", None)
    with pytest.raises(InputError, match=r"pip install 'rollover\[cluster\]'"):
        list(map_on_cluster(odd, [1], address="local"))


def test_slurm_without_its_extra_has_a_cure(monkeypatch: pytest.MonkeyPatch) -> None:
    pytest.importorskip("distributed", reason="the extra cluster is not installed")
    from rollover.studies.cluster import map_on_cluster

    monkeypatch.setitem(sys.modules, "dask_jobqueue", None)
    with pytest.raises(InputError, match=r"pip install 'rollover\[slurm\]'"):
        list(map_on_cluster(odd, [1], address="slurm"))


def test_an_address_without_a_scheduler(monkeypatch: pytest.MonkeyPatch) -> None:
    pytest.importorskip("distributed", reason="the extra cluster is not installed")
    from rollover.studies import cluster

    monkeypatch.setattr(cluster, "PATIENCE", 0.5)
    with pytest.raises(InputError, match=r"--scheduler tcp://127.0.0.1:9: no scheduler answers"):
        list(cluster.map_on_cluster(odd, [1], address="tcp://127.0.0.1:9"))


def test_a_fault_or_a_lost_worker_costs_one_case() -> None:
    pytest.importorskip("distributed", reason="the extra cluster is not installed")
    from rollover.studies.cluster import map_on_cluster

    cases = [2, "raise", "die", "hang", "worker", *range(10, 14)]
    found = {o.index: o for o in map_on_cluster(odd, cases, address="local", workers=2, time_limit=8.0)}
    assert [(f.kind if (f := found[i].failure) else None) for i in range(5)] == [
        None,
        "error",
        "crash",
        "time-limit",
        "crash",
    ]
    assert found[4].failure is not None
    assert found[4].failure.sentence == "its worker was lost"
    assert [found[i].value for i in (0, 5, 6, 7, 8)] == [4, 100, 121, 144, 169]


def test_cases_waiting_beside_a_killed_worker_are_done() -> None:
    pytest.importorskip("distributed", reason="the extra cluster is not installed")
    from rollover.studies.cluster import map_on_cluster

    found = {o.index: o for o in map_on_cluster(odd, ["worker", 10, 11], address="local", workers=1)}
    assert sorted(found) == [0, 1, 2]
    assert found[0].failure is not None
    assert found[0].failure.sentence == "its worker was lost"
    assert [found[i].value for i in (1, 2)] == [100, 121]


def test_the_same_study_gives_the_same_table(tmp_path: Path) -> None:
    pytest.importorskip("distributed", reason="the extra cluster is not installed")
    study = studies.load(drops(tmp_path))
    for name, way in (("here", Way(workers=0)), ("cluster", Way(workers=2, scheduler="local"))):
        assert conduct(study, tmp_path / name, way).ran == 20
    tables = [(tmp_path / name / case_store.TABLE).read_bytes() for name in ("here", "cluster")]
    assert tables[0] == tables[1]

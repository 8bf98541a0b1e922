"""A study whose cases end their process, hang, eat memory and raise; and one that is killed and goes on."""

from __future__ import annotations

import json
import os
import random
import signal
import subprocess
import sys
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from rollover import studies
from rollover.assessment.loads import magnitude
from rollover.dynamics.drop_test import DropModel
from rollover.recording import read_table
from rollover.scenario import load
from rollover.studies import case_store
from rollover.studies.runner import Way, conduct
from tests.rollover.studies import EFFECTS, ROOT, faulty

pytestmark = pytest.mark.skipif(not hasattr(os, "killpg"), reason="platform: needs process groups")

FAULTS = {7: 1, 23: 2, 31: 3, 52: 4}  # point -> abort, hang, memory, raise
LIMIT = 12  # s for a case
WAIT = 0.03  # s, that each case takes besides, twice, so that there is a moment to be killed in


def begun(study: Path, out: Path, *more: str) -> subprocess.Popen[str]:
    """The command in a process group of its own."""
    limits = ["--time-limit", str(LIMIT), "--memory-limit", "1000", "--workers", "1"]
    command = [sys.executable, "-m", "tests.rollover.command", "--effects", str(EFFECTS), "study", str(study)]
    return subprocess.Popen(
        [*command, "--out", str(out), *limits, *more],
        cwd=ROOT,
        env={**os.environ, "PYTHONPATH": str(ROOT)},
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
        start_new_session=True,
    )


def finished(process: subprocess.Popen[str]) -> dict[str, Any]:
    out, err = process.communicate(timeout=300)
    assert process.returncode == 0, err
    found: dict[str, Any] = json.loads(out)
    return found


def files(out: Path) -> dict[str, tuple[int, int]]:
    """Case files with what changes when one is written again."""
    found = {p.name: p.stat() for p in (out / case_store.CASES).glob("*/[!.]*.parquet")}
    return {name: (s.st_ino, s.st_mtime_ns) for name, s in found.items()}


@pytest.fixture(scope="module")
def sixty(tmp_path_factory: pytest.TempPathFactory) -> Iterator[tuple[Path, Path]]:
    """The study, and the folder of an undisturbed run."""
    folder = tmp_path_factory.mktemp("faulty")
    study = faulty(folder, FAULTS, wait=WAIT)
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("ROLLOVER_EFFECTS", str(EFFECTS))
        done = conduct(studies.load(study), folder / "out", Way(workers=2, time_limit=LIMIT, memory_limit=1e9))
        assert done.ran == 60
        yield study, folder / "out"


def test_four_faults_cost_four_rows(sixty: tuple[Path, Path]) -> None:
    _, out = sixty
    table, _ = read_table(out / case_store.TABLE)
    assert table["point"] == list(range(60))
    assert [k for k, status in enumerate(table["status"]) if status == "failed"] == sorted(FAULTS)
    assert [table["failure"][k] for k in sorted(FAULTS)] == ["crash", "time-limit", "memory-limit", "error"]
    sentences = [table["sentence"][k] for k in sorted(FAULTS)]
    assert sentences[0] == f"its process ended with exit code -{int(signal.SIGABRT)}"
    assert sentences[1:] == [
        f"took longer than {LIMIT} s",
        "needed more memory than it may have",
        "RuntimeError: a plug-in's own mistake",
    ]
    model = DropModel(scenario=load("drop_test"))
    for k in range(0, 60, 5):  # and the others are right, to the last bit
        recording = model.with_({"initiation.speed": table["speed"][k]}).run()
        assert table["ground/sinkage"][k] == np.abs(recording["ground/sinkage"]).max()
        assert table["ground/force_normal"][k] == magnitude(recording, ("ground/force_normal",), 60).max()
    assert [table["ground/sinkage"][k] for k in FAULTS] == [None] * 4


def test_killed_three_times_it_ends_with_the_same_table(sixty: tuple[Path, Path], tmp_path: Path) -> None:
    study, reference = sixty
    out, chance = tmp_path / "out", random.Random(5)
    seen: dict[str, tuple[int, int]] = {}
    for _ in range(3):
        process = begun(study, out)
        wanted = len(seen) + chance.randint(1, 15)
        # as long as it takes on a busy machine: one that stands still meets the time limit of the test
        while len(files(out)) < wanted and process.poll() is None:
            time.sleep(chance.uniform(0.001, 0.02))
        assert process.poll() is None, process.communicate()[1]
        os.killpg(process.pid, signal.SIGKILL)
        process.communicate()
        now = files(out)
        assert len(now) >= wanted
        assert {name: now[name] for name in seen} == seen, "a case that was there was run again"
        seen = now
    assert len(seen) < 60
    report = finished(begun(study, out, "--json"))
    assert report["ran"] == 60 - len(seen)
    assert {name: files(out)[name] for name in seen} == seen
    assert read_table(out / case_store.TABLE) == read_table(reference / case_store.TABLE)
    assert (out / case_store.TABLE).read_bytes() == (reference / case_store.TABLE).read_bytes()
    assert report["cases"] == {"all": 60, "done": 56, "failed": 4}
    assert conduct(studies.load(study), out, Way(workers=0)).ran == 0

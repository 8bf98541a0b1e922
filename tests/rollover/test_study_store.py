"""The store of a study: what is damaged there, or somebody else's, is run again."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from rollover import studies
from rollover.recording import read_pairs, write_pairs
from rollover.studies import case_store
from rollover.studies.runner import Conducted, Way, conduct
from tests.rollover.studies import drops


def conducted(tmp_path: Path) -> Conducted:
    return conduct(studies.load(drops(tmp_path)), tmp_path / "out", Way(workers=0))


def cut(path: Path) -> None:
    path.write_bytes(path.read_bytes()[:100])


def turned(path: Path) -> None:
    """One bit of a stored number."""
    measures, _ = read_pairs(path)
    whole = bytearray(path.read_bytes())
    whole[whole.index(np.float64(measures["ground/sinkage"]).tobytes())] ^= 2
    path.write_bytes(whole)


def foreign(path: Path) -> None:
    measures, about = read_pairs(path)
    write_pairs({f"grotnd/{name}": value for name, value in measures.items()}, about, path)


@pytest.mark.parametrize("damage", [cut, turned, foreign])
def test_a_damaged_file_is_run_again(damage: Callable[[Path], None], tmp_path: Path) -> None:
    done = conducted(tmp_path)
    path = case_store.path_of(tmp_path / "out", done.keys[4])
    damage(path)
    before = (tmp_path / "out" / case_store.TABLE).read_bytes()
    assert conducted(tmp_path).ran == 1
    assert (tmp_path / "out" / case_store.TABLE).read_bytes() == before

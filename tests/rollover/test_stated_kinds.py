"""What stands under `kind` and is no word: one line with its place, whichever command asks what a file is."""

from __future__ import annotations

from pathlib import Path

import pytest

from rollover.spec import document
from tests.rollover.machines import WRONG, rollover

VEHICLE = document.shipped_folder() / "vehicles" / "vineyard_tractor.yaml"


@pytest.mark.parametrize("said", ["[0.8, 0.0]", "{a: 1}", "3", "true", "[[tractor]]", "[tractor]"])
@pytest.mark.parametrize("command", ["stability", "rolling", "check", "rops"])
def test_a_kind_that_is_no_word_is_one_line(command: str, said: str, tmp_path: Path) -> None:
    lines = VEHICLE.read_text(encoding="utf-8").splitlines()
    at = next(k for k, line in enumerate(lines) if line.startswith("kind:"))
    lines[at] = f"kind: {said}"
    file = tmp_path / "mine.yaml"
    file.write_text("\n".join(lines), encoding="utf-8")
    result = rollover(command, file, *(["--out", tmp_path / "out"] if command != "check" else []))
    assert result.exit_code == WRONG, result.output
    first, *more = result.stderr.splitlines()
    assert more == []
    assert first.startswith(f"{file}:{at + 1}: kind: not a word, got ")
    assert "are allowed" in first
    assert not (tmp_path / "out").exists()


def test_the_kind_of_a_base_counts_as_well(tmp_path: Path) -> None:
    (tmp_path / "under.yaml").write_text("kind: [tractor]\n", encoding="utf-8")
    (tmp_path / "over.yaml").write_text("base: under.yaml\n", encoding="utf-8")
    result = rollover("stability", tmp_path / "over.yaml", "--out", tmp_path / "out")
    assert result.exit_code == WRONG
    assert result.stderr.startswith(f"{tmp_path / 'under.yaml'}:1: kind: not a word, got ")

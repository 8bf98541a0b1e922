"""What is said while kernels are compiled."""

from __future__ import annotations

import time
from pathlib import Path

import pytest

from rollover.cli import console


def test_kernels_are_counted_while_they_are_compiled(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr("ground.compiled.KEPT", tmp_path)
    (tmp_path / "old.nbc").touch()
    with console.compiling(True, every=0.01):
        for name in ("a", "b"):
            (tmp_path / name).mkdir()
            (tmp_path / name / "kernel.nbc").touch()
        time.sleep(0.3)
    said = capsys.readouterr().err.splitlines()
    assert "2 of about 195 kernels compiled in " in said[-1]
    assert len(said) <= 3, "nothing new, nothing said"
    with console.compiling(False):
        pass
    assert not capsys.readouterr().err

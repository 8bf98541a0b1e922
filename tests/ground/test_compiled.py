"""Kernels on disk must never outlive the sources they were made from."""

from __future__ import annotations

import importlib.util
import shutil
from pathlib import Path

import pytest

SOURCES = Path(__file__).parents[2]


def folder_of(root: Path) -> str:
    """Name of the kernel folder that a copy of the sources would use."""
    spec = importlib.util.spec_from_file_location("compiled_of_a_copy", root / "ground" / "compiled.py")
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return str(module.cache_folder().name)


@pytest.mark.parametrize("name", ["law.py", "ye.py", "kernel.py"])
def test_another_source_is_another_folder_of_kernels(tmp_path: Path, name: str) -> None:
    """`law.py` compiles nothing itself, but its places in the memory are constants inside every kernel."""
    for folder in ("ground", "rollover"):
        shutil.copytree(SOURCES / folder, tmp_path / folder, ignore=shutil.ignore_patterns("__pycache__"))
    before = folder_of(tmp_path)
    assert folder_of(tmp_path) == before
    path = tmp_path / "ground" / name
    path.write_bytes(path.read_bytes() + b"\nHIDDEN = 4\n")
    assert folder_of(tmp_path) != before

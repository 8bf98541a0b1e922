"""Kernels on disk must never outlive the sources they were made from, and must outlive changes of all other sources."""

from __future__ import annotations

import importlib.util
import os
import shutil
import subprocess
import sys
from pathlib import Path
from typing import Any

import pytest

SOURCES = Path(__file__).parents[2]
LOOP = "rollover/kernels/time_loop.py"
MARKS = "rollover/diagnosis/forward/discontinuities.py"


def module_of(file: Path) -> Any:
    """A module of a copy of the sources, as a process that runs the copy would have it."""
    spec = importlib.util.spec_from_file_location(f"{file.stem}_of_a_copy", file)
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


@pytest.fixture
def copy(tmp_path: Path) -> Path:
    for folder in ("ground", "rollover"):
        shutil.copytree(SOURCES / folder, tmp_path / folder, ignore=shutil.ignore_patterns("__pycache__"))
    return tmp_path


def kept(root: Path, *names: str) -> tuple[str, ...]:
    """Under which hashes a copy keeps the machine code of some files."""
    sources = module_of(root / "ground" / "sources.py")
    return tuple(sources.hash_of([root / name]) for name in names)


@pytest.mark.parametrize(
    ("changed", "anew", "stays"),
    [
        # its places in the memory are constants inside every kernel, though it compiles nothing itself
        ("ground/law.py", ["ground/ye.py", "ground/kernel.py", LOOP], ["rollover/kernels/vectors.py"]),
        ("ground/ye.py", ["ground/ye.py"], [LOOP, "ground/kernel.py", "ground/bekker.py"]),
        # by way of others: whose functions the loop has laid out in it
        ("rollover/kernels/vectors.py", [LOOP, "rollover/kernels/impact.py"], ["rollover/kernels/dense.py"]),
        ("rollover/kernels/record.py", [LOOP], ["rollover/kernels/step.py", "rollover/kernels/forces.py"]),
        # numbers of settings are frozen into the kernels of a diagnosis
        ("rollover/diagnosis/settings/forward.py", [MARKS], [LOOP, "rollover/diagnosis/data/whitening.py"]),
        ("ground/compiled.py", [LOOP, MARKS, "ground/ye.py"], []),
        # these ask whether kernels are compiled, and hold none
        ("rollover/cli/commands/run.py", [], [LOOP, MARKS]),
        ("rollover/dynamics/simulate.py", [], [LOOP, "rollover/dynamics/posture.py"]),
        ("rollover/__init__.py", [], [LOOP]),
    ],
)
def test_a_changed_source_compiles_anew_what_it_is_part_of(
    copy: Path, changed: str, anew: list[str], stays: list[str]
) -> None:
    names = [*anew, *stays]
    before = kept(copy, *names)
    assert kept(copy, *names) == before
    path = copy / changed
    path.write_bytes(path.read_bytes() + b"\nHIDDEN = 4\n")
    after = kept(copy, *names)
    assert [name for name, a, b in zip(names, before, after, strict=True) if a != b] == anew


def test_every_way_to_import_is_followed(tmp_path: Path) -> None:
    sources = module_of(SOURCES / "ground" / "sources.py")
    (tmp_path / "ground").mkdir()
    for name in ("alone", "bare", "bracketed", "deep", "eye", "late", "named", "unused", "wide"):
        (tmp_path / "ground" / f"{name}.py").write_text("X = 1\n")
    (tmp_path / "ground" / "__init__.py").write_text("")
    (tmp_path / "ground" / "alone.py").write_text("from .deep import X\n")
    file = tmp_path / "ground" / "kernel.py"
    file.write_text(
        "import numpy as np\nimport os, ground.bare as b\nfrom ground import (\n    bracketed,  # a comment, of two\n"
        "    named as other,\n)\nfrom ground.alone import X\nfrom . \\\n    import wide\n"
        "from typing import TYPE_CHECKING\nif TYPE_CHECKING:\n    from ground.eye import X\n\n    import ground.eye\n\n"
        "def f():\n    from ground.late import X\n    return X\n"
    )
    sources.ROOT = tmp_path
    found: set[Path] = set()
    ahead = [file]
    while ahead:
        one = ahead.pop()
        if one not in found:
            found.add(one)
            ahead += sources._read(one)[1]
    assert {path.stem for path in found} == {"kernel", "alone", "bare", "bracketed", "deep", "late", "named", "wide"}


@pytest.mark.parametrize("where", ["NUMBA_CACHE_DIR", ""])
def test_a_number_from_another_file_is_never_stale(tmp_path: Path, where: str) -> None:
    """Also where a user says in which folder kernels are kept; the file of the kernel itself stays as it is."""
    (tmp_path / "numbers_of_mine.py").write_text("TWICE = 2.0\n")
    (tmp_path / "kernel_of_mine.py").write_text(
        "from ground.compiled import compiled\nfrom numbers_of_mine import TWICE\n\n\n"
        "@compiled\ndef times(x):\n    return TWICE * x\n\n\nprint(times(3.0))\nprint(times.stats.cache_hits)\n"
    )
    folder = tmp_path / "kept"
    variables = {**os.environ, "PYTHONDONTWRITEBYTECODE": "1"}
    variables |= {where: str(folder)} if where else {}

    def printed() -> list[str]:
        done = subprocess.run(
            [sys.executable, "kernel_of_mine.py"],
            cwd=tmp_path,
            env=variables,
            capture_output=True,
            text=True,
            check=True,
        )
        return done.stdout.splitlines()

    assert printed() == ["6.0", "Counter()"]
    assert printed() == ["6.0", "Counter({(float64,): 1})"]  # kept: the second run compiled nothing
    (tmp_path / "numbers_of_mine.py").write_text("TWICE = 5.0\n")
    assert printed() == ["15.0", "Counter()"]

"""Disks that are really full, at ten places of four commands: `python -m tests.benchmarks.full_disk` (Linux, as root).

The results of `run`, `study`, `diagnose` and `import` go to a file system in memory that has room for one to ten
elevenths of what the command writes. Each must end with one line that says so and leave nothing but, of a study, its
finished cases. `tests/rollover/test_machine.py` asks it of every command, with
writes that are refused.
"""

from __future__ import annotations

import os
import subprocess
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from tests.benchmarks.kills import ROOT, line
from tests.rollover import machines
from tests.rollover.machines import MACHINE, PROGRESS, WRONG

COMMANDS = ("run", "study", "diagnose", "import")
PLACES = 10


@contextmanager
def disk(at: Path, size: int) -> Iterator[None]:
    """A file system in memory with room for `size` bytes."""
    at.mkdir(parents=True, exist_ok=True)
    subprocess.run(["mount", "-t", "tmpfs", "-o", f"size={size}", "tmpfs", str(at)], check=True)
    try:
        yield
    finally:
        subprocess.run(["umount", str(at)], check=True)


def used(folder: Path) -> int:
    """Bytes that are taken of the file system of a folder."""
    of = os.statvfs(folder)
    return (of.f_blocks - of.f_bfree) * of.f_frsize


def faults(name: str, words: list[object], out: Path, size: int) -> tuple[str, list[str]]:
    """The last line that a command says on a disk of `size` bytes, and what is wrong with how it ended."""
    with disk(out, size):
        done = subprocess.run(line(*words), capture_output=True, text=True, cwd=ROOT)
        left = [p for p in out.rglob("*") if p.is_file()]
        left = [p for p in left if name != "study" or p.name.startswith(".")]
    lines = done.stderr.splitlines() or ["nothing"]
    wrong = [f"status {done.returncode}"] if done.returncode not in (WRONG, MACHINE) else []
    wrong += ["says it has results"] if "Results" in done.stdout else []
    wrong += [f"left: {[str(p.relative_to(out)) for p in left]}"] if left else []
    wrong += [] if "o space left on device" in lines[-1] else [f"does not say why: {lines[-1][:200]}"]
    more = [line for line in lines[:-1] if not any(word in line for word in PROGRESS)]
    return lines[-1], wrong + ([f"says more than one line: {more[:3]}"] if more else [])


def main() -> int:
    """Print a line for each command; 1 if one of them does not end as it should."""
    anything = False
    with tempfile.TemporaryDirectory() as folder:
        given = machines.commands(Path(folder))
        machines.as_it_is(Path(folder))
        out = Path(folder, "out")
        for name in COMMANDS:
            words, _ = given[name]
            with disk(out, 1 << 30):
                subprocess.run(line(*words), check=True, cwd=ROOT, capture_output=True)
                whole = used(out)
            for place in range(1, PLACES + 1):
                said, wrong = faults(name, words, out, whole * place // (PLACES + 1))
                anything = anything or bool(wrong)
                found = "; ".join(wrong) or "as it should"
                print(
                    f"{name}, room for {place}/{PLACES + 1} of {whole / 1024:.0f} kB: {found} | {said[:160]}",
                    flush=True,
                )
    return int(anything)


if __name__ == "__main__":
    raise SystemExit(main())

"""Make the corpus: each entry in a process of its own, each kept in the file as soon as it is finished."""

from __future__ import annotations

import hashlib
import json
import os
import platform
import subprocess
import sys
import tempfile
from collections.abc import Sequence
from concurrent.futures import ThreadPoolExecutor, as_completed
from importlib.metadata import version
from pathlib import Path
from typing import Any

from tests.corpus.plan import Job, plan

FORMAT = "rollover-corpus/1"
ROOT = Path(__file__).resolve().parents[2]
SOURCES = ("ground", "rollover", "viz", "scenarios")
LIBRARIES = ("exudyn", "numba", "numpy", "pyarrow", "scipy")
# one thread, as `rollover prove` gives each of its children: the last bit of a sum hangs on how many there are
THREADS = ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS", "NUMEXPR_NUM_THREADS")


class CorpusError(Exception):
    """A file that is no corpus, or one that other sources made."""


def sources() -> str:
    """SHA-256 over the program and its scenarios: entries of two versions never share a file."""
    total = hashlib.sha256()
    files = [p for name in SOURCES for p in (ROOT / name).rglob("*") if p.is_file() and "__pycache__" not in p.parts]
    for path in sorted(files):
        total.update(path.relative_to(ROOT).as_posix().encode() + b"\0" + hashlib.sha256(path.read_bytes()).digest())
    return total.hexdigest()


def head(share: float) -> dict[str, Any]:
    """What made a corpus."""
    versions = {name: version(name) for name in LIBRARIES}
    machine = f"{platform.system()} {platform.machine()}, python {platform.python_version()}"
    return {"format": FORMAT, "share": share, "sources": sources(), "machine": machine, "versions": versions}


def read(path: Path) -> dict[str, Any]:
    """A corpus by its head and `entries` by id. Raises `CorpusError`."""
    try:
        found = json.loads(path.read_text(encoding="utf-8"))
        if found["format"] != FORMAT:
            raise ValueError(f"format: got {found['format']!r}; {FORMAT!r} is allowed")
        return {**found, "entries": {entry["id"]: entry for entry in found["entries"]}}
    except (OSError, ValueError, KeyError, TypeError) as e:
        raise CorpusError(f"{path}: no corpus: {type(e).__name__}: {e}") from None


def write(path: Path, corpus: dict[str, Any]) -> None:
    """Write a corpus whole or not at all, in the order of the plan, one line for each entry."""
    order = {job.id: k for k, job in enumerate(plan())}
    ordered = sorted(corpus["entries"].values(), key=lambda entry: order[entry["id"]])
    top = json.dumps({key: value for key, value in corpus.items() if key != "entries"})[:-1]
    lines = ",\n".join(json.dumps(entry, separators=(",", ":")) for entry in ordered)
    path.parent.mkdir(parents=True, exist_ok=True)
    part = path.with_name(path.name + ".part")
    part.write_text(f'{top}, "entries": [\n{lines}\n]}}\n', encoding="utf-8")
    os.replace(part, path)


def begun(path: Path, share: float) -> dict[str, Any]:
    """The corpus that `path` holds so far, or an empty one. Raises `CorpusError` if other sources made it."""
    new = {**head(share), "entries": {}}
    if not path.exists():
        return new
    found = read(path)
    if other := [key for key in ("sources", "machine", "versions") if found[key] != new[key]]:
        raise CorpusError(f"{path}: made with other {', '.join(other)}; choose another file, or delete it")
    return {**found, "share": max(share, found["share"])}


def worked_off(ids: Sequence[str]) -> list[dict[str, Any]]:
    """Entries of jobs, one after another in one new process. Raises ``RuntimeError`` with its last words."""
    with tempfile.TemporaryDirectory() as folder:
        lines = Path(folder) / "lines"
        words = [sys.executable, "-m", "tests.corpus.work", str(lines), *ids]
        one = {**os.environ, **dict.fromkeys(THREADS, "1")}
        done = subprocess.run(words, cwd=ROOT, env=one, stdout=subprocess.DEVNULL, stderr=subprocess.PIPE, text=True)
        if done.returncode:
            last = done.stderr.strip().rpartition("\n")[2]
            raise RuntimeError(f"{', '.join(ids)}: exit status {done.returncode}: {last}")
        return [json.loads(line) for line in lines.read_text(encoding="utf-8").splitlines()]


def make(path: Path, *, share: float = 1.0, workers: int = 1) -> list[str]:
    """Work off what `path` has not yet, in the order of the plan; why entries could not be made. Raises `CorpusError`.

    An entry that could not be made is tried again by the next call.
    """
    corpus = begun(path, share)
    todo = [job for job in plan(share) if job.id not in corpus["entries"]]
    of, faults = len(plan(share)), []
    write(path, corpus)
    with ThreadPoolExecutor(workers) as pool:
        waiting = {pool.submit(worked_off, [job.id]): job for job in todo}
        try:
            for future in as_completed(waiting):
                try:
                    (entry,) = future.result()
                except RuntimeError as e:
                    faults.append(str(e))
                    print(e, file=sys.stderr, flush=True)
                    continue
                corpus["entries"][entry["id"]] = entry
                write(path, corpus)
                print(f"{len(corpus['entries'])} of {of}: {_line(waiting[future], entry)}", file=sys.stderr, flush=True)
        finally:
            pool.shutdown(cancel_futures=True)
    return faults


def _line(job: Job, entry: dict[str, Any]) -> str:
    said = entry.get("verdict") or entry.get("status") or entry.get("failure")
    names = ", ".join(name["id"] for name in entry.get("names", []))
    return f"{job.id} {' + '.join(job.effects)}: {said} {names}, {entry['cpu']:.1f} s of CPU"

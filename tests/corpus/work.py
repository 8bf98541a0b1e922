"""A process that works off entries of the corpus: `python -m tests.corpus.work LINES ID...`, one line for each."""

from __future__ import annotations

import json
import sys
import tempfile
from pathlib import Path

from tests.corpus.adapter import made
from tests.corpus.plan import plan


def main(lines: Path, ids: list[str]) -> None:
    """Append the entries of the jobs `ids` to the file `lines`."""
    jobs = {job.id: job for job in plan()}
    for id in ids:
        with tempfile.TemporaryDirectory() as folder:
            entry = {"id": id, **made(jobs[id], Path(folder))}
        with lines.open("a", encoding="utf-8") as file:
            file.write(json.dumps(entry) + "\n")


if __name__ == "__main__":
    main(Path(sys.argv[1]), sys.argv[2:])

"""Inputs by the thousand over all entry points: `python -m tests.fuzz --inputs 100000 --seed 1`.

The same seed gives the same inputs. Prints figures by entry point and class; each find of another kind is kept.
"""

from __future__ import annotations

import argparse
import sys
import tempfile
from pathlib import Path

from tests.fuzz.campaign import campaign, report


def main() -> int:
    parser = argparse.ArgumentParser(prog="python -m tests.fuzz", description=__doc__)
    parser.add_argument("--inputs", type=int, default=2000)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument(
        "--entry-point", action="append", default=[], help="only those whose name holds this; may be repeated"
    )
    parser.add_argument("--keep", type=Path, help="folder for one input of each kind of find")
    parser.add_argument("--seconds", type=float, default=float("inf"), help="stop after so much wall time")
    given = parser.parse_args()
    with tempfile.TemporaryDirectory(prefix="fuzz-") as folder:
        done = campaign(
            Path(folder),
            given.inputs,
            given.seed,
            only=given.entry_point,
            keep=given.keep,
            seconds=given.seconds,
            say=sys.stderr,
        )
    print(report(done))
    return int(any(done.finds.values()))


if __name__ == "__main__":
    raise SystemExit(main())

"""`python -m tests.corpus make --out FILE` and `python -m tests.corpus compare OLD NEW`."""

from __future__ import annotations

import argparse
import sys
from pathlib import Path

from tests.corpus.compare import compared
from tests.corpus.make import CorpusError, make, read


def _share(text: str) -> float:
    value = float(text)
    if not 0.0 < value <= 1.0:
        raise argparse.ArgumentTypeError(f"got {text}; more than 0, at most 1")
    return value


def _count(text: str) -> int:
    value = int(text)
    if value < 1:
        raise argparse.ArgumentTypeError(f"got {text}; at least 1")
    return value


def main(words: list[str] | None = None) -> int:
    """Exit status: 0 made, or the same; 1 not all made, or a difference; 2 wrong input."""
    parser = argparse.ArgumentParser(prog="python -m tests.corpus", description=__doc__)
    commands = parser.add_subparsers(dest="command", required=True)
    making = commands.add_parser("make", help="make the corpus, or what of it is not made yet")
    making.add_argument("--out", type=Path, required=True, metavar="FILE")
    making.add_argument("--share", type=_share, default=1.0, help="of the entries (default: 1)")
    making.add_argument("--workers", type=_count, default=1, help="entries at once (default: 1)")
    comparing = commands.add_parser("compare", help="compare two corpora; 1 if anything but times differs")
    comparing.add_argument("old", type=Path, metavar="OLD")
    comparing.add_argument("new", type=Path, metavar="NEW")
    given = parser.parse_args(words)
    try:
        if given.command == "make":
            return 1 if make(given.out, share=given.share, workers=given.workers) else 0
        text, is_same = compared(read(given.old), read(given.new))
    except CorpusError as e:
        print(e, file=sys.stderr)
        return 2
    print(text)
    return 0 if is_same else 1


if __name__ == "__main__":
    sys.exit(main())

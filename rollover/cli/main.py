"""Entry point of the command `rollover`; the commands are in the folder `commands`."""

from __future__ import annotations

import io
import signal
import sys
import traceback

import rollover.cli.commands  # noqa: F401  # puts the commands into app
from rollover.cli.commands.common import BUG, app

__all__ = ["app", "main"]


def main() -> None:
    """Entry point of the command `rollover`."""
    for stream in (sys.stdout, sys.stderr):
        if isinstance(stream, io.TextIOWrapper):
            stream.reconfigure(errors="backslashreplace")  # a file's name may be no text
    sys.unraisablehook = lambda _: None  # a library's half-made object that is thrown away: no fault of the user's
    signal.signal(signal.SIGTERM, lambda *_: sys.exit(128 + signal.SIGTERM))  # so that half-written folders go
    try:
        app()
    except Exception:  # a bug: show all of it, under a status of its own
        traceback.print_exc()
        sys.exit(BUG)

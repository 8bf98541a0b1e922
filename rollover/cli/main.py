"""Entry point of the command `rollover`; the commands are in the folder `commands`."""

from __future__ import annotations

import io
import os
import signal
import sys
import traceback
import warnings

import rollover.cli.commands  # noqa: F401  # puts the commands into app
from rollover.cli.commands.common import BUG, app

__all__ = ["app", "main"]


def main() -> None:
    """Entry point of the command `rollover`."""
    for stream in (sys.stdout, sys.stderr):
        if isinstance(stream, io.TextIOWrapper):
            stream.reconfigure(errors="backslashreplace")  # a file's name may be no text
    sys.unraisablehook = lambda _: None  # a library's half-made object that is thrown away: no fault of the user's
    if not sys.warnoptions:  # what a library warns of is written for its programmers; whoever asks with -W sees it
        warnings.simplefilter("ignore")
        os.environ["PYTHONWARNINGS"] = "ignore"  # of child processes
    signal.signal(signal.SIGTERM, lambda *_: sys.exit(128 + signal.SIGTERM))  # so that half-written folders go
    try:
        app()
    except Exception:  # a bug: show all of it, under a status of its own
        traceback.print_exc()
        sys.exit(BUG)

"""A case that does what it is asked for; children import nothing else for it."""

from __future__ import annotations

import multiprocessing
import os
import signal
import sys
import threading
from pathlib import Path
from typing import Any


def imported(name: str) -> bool:
    """Whether a child has a module that it was not asked for."""
    return name in sys.modules


def odd(case: Any) -> Any:
    """What a case asks for, of the child that works it off or of the worker above it."""
    match case:
        case Path():
            case.write_text(str(os.getpid()))
            threading.Event().wait()
        case "raise":
            raise ValueError("not today")
        case "die":
            os.kill(os.getpid(), signal.SIGKILL)
        case "hang":
            threading.Event().wait()
        case "worker":
            worker = multiprocessing.parent_process()  # not who forked it
            assert worker is not None
            assert worker.pid is not None
            os.kill(worker.pid, signal.SIGKILL)
            threading.Event().wait()
    return case * case

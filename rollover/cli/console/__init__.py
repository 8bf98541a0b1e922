"""What people read while a command works and when it is done: progress, tables, sentences. The only home of rich."""

from rollover.cli.console.compiling import compiling
from rollover.cli.console.frames import rops
from rollover.cli.console.pairs import pair
from rollover.cli.console.plans import plan
from rollover.cli.console.recordings import calibration, comparison, diagnosis, rolling, stability
from rollover.cli.console.runs import regression, report
from rollover.cli.console.terminal import EVERY, QUIET, Plain, counting, progress, readable, say, tell

__all__ = [
    "EVERY",
    "QUIET",
    "Plain",
    "calibration",
    "comparison",
    "compiling",
    "counting",
    "diagnosis",
    "pair",
    "plan",
    "progress",
    "readable",
    "regression",
    "report",
    "rolling",
    "rops",
    "say",
    "stability",
    "tell",
]

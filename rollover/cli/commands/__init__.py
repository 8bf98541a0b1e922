"""The commands, one file each; each puts itself into `door.app` when it is imported."""
# ruff: noqa: I001

from __future__ import annotations

from rollover.cli.commands import root
from rollover.cli.commands import run
from rollover.cli.commands import view
from rollover.cli.commands import listing
from rollover.cli.commands import check
from rollover.cli.commands import importing
from rollover.cli.commands import exporting
from rollover.cli.commands import new
from rollover.cli.commands import schema
from rollover.cli.commands import regress
from rollover.cli.commands import identify
from rollover.cli.commands import compare
from rollover.cli.commands import calibrate
from rollover.cli.commands import synthesize
from rollover.cli.commands import diagnose
from rollover.cli.commands import plan
from rollover.cli.commands import prove
from rollover.cli.commands import score
from rollover.cli.commands import stability
from rollover.cli.commands import rolling
from rollover.cli.commands import rops
from rollover.cli.commands import study

__all__ = [
    "calibrate",
    "check",
    "compare",
    "diagnose",
    "exporting",
    "identify",
    "importing",
    "listing",
    "new",
    "plan",
    "prove",
    "regress",
    "rolling",
    "root",
    "rops",
    "run",
    "schema",
    "score",
    "stability",
    "study",
    "synthesize",
    "view",
]

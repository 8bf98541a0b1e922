"""The commands, one file each; each puts itself into `door.app` when it is imported."""
# ruff: noqa: I001

from __future__ import annotations

from rollover.commands import root
from rollover.commands import run
from rollover.commands import view
from rollover.commands import listing
from rollover.commands import check
from rollover.commands import importing
from rollover.commands import schema
from rollover.commands import regress
from rollover.commands import identify
from rollover.commands import compare
from rollover.commands import calibrate
from rollover.commands import synthesize
from rollover.commands import diagnose
from rollover.commands import prove
from rollover.commands import stability
from rollover.commands import study

__all__ = [
    "calibrate",
    "check",
    "compare",
    "diagnose",
    "identify",
    "importing",
    "listing",
    "prove",
    "regress",
    "root",
    "run",
    "schema",
    "stability",
    "study",
    "synthesize",
    "view",
]

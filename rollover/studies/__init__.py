"""Load studies: many cases of one scenario, and what they say together."""

from __future__ import annotations

from rollover.studies.study import FOLDER, Output, Study, find, load, schema

__all__ = ["FOLDER", "Output", "Study", "find", "load", "schema"]

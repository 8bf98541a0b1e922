"""Recordings from files: our own format and those of instruments and viewers."""

from __future__ import annotations

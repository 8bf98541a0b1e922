"""The blind proof of the diagnosis: an independent generator of cases, a sealed truth, a score."""

from __future__ import annotations

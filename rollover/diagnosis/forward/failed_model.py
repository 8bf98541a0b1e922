"""A model of one's own that failed: no value without a solution, which a fit goes around, but a fault of its file."""

from __future__ import annotations


class FailedModelError(RuntimeError):
    """What is wrong with a model, as the line that names its file; an ``InputError`` once the diagnosis has ended."""

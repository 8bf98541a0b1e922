"""Checks against real recordings, which stay where ROLLOVER_DATA says; nothing of them is in the project."""

"""Recordings for the viewer: layouts, scenes, columns."""

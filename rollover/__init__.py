"""Vehicle rollover load studies: a multibody tractor with its ROPS rolls onto an array of ground impact elements."""

from __future__ import annotations

import importlib.util
from pathlib import Path

__version__ = "0.1.0"


def _own(name: str) -> None:
    """Make sure that ``import name`` finds the package that belongs to this one: others own these names too."""
    spec = importlib.util.find_spec(name)
    places = [spec.origin] if spec and spec.origin else list(spec.submodule_search_locations or []) if spec else []
    ours = Path(__file__).resolve().parent.parent / name / "__init__.py"
    if spec and spec.origin and Path(spec.origin).resolve() == ours:
        return
    try:
        marked = 'DISTRIBUTION = "rollover"' in Path(places[0]).read_text(encoding="utf-8")
    except (OSError, IndexError, UnicodeDecodeError):
        marked = False
    if not marked:
        raise ImportError(
            f"import {name}: taken by another package, got {places[0] if places else 'nothing'}; "
            f"install rollover into an environment of its own, or take that package (or folder) off the import path"
        )


for _name in ("ground", "viz"):
    _own(_name)

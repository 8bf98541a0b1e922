"""The import names `ground` and `viz`: others own them too, and what is imported must be ours."""

from __future__ import annotations

import importlib.util
from importlib.machinery import ModuleSpec
from pathlib import Path

MARKER = 'DISTRIBUTION = "rollover"'  # a line of the `__init__.py` that is ours


def require_own(*names: str) -> None:
    """Make sure that ``import name`` finds the package that belongs to this one. Raises ``ImportError``."""
    for name in names:
        try:
            spec = importlib.util.find_spec(name)
        except ValueError:  # something without a specification was put into `sys.modules`
            spec = None
        if spec is None or not _is_marked(spec):
            raise ImportError(_taken(name, spec), name=name)


def _is_marked(spec: ModuleSpec) -> bool:
    """Whether the source says that it is ours: where it stands does not tell, others may have been put over it."""
    try:
        source = spec.loader.get_source(spec.name)  # type: ignore[union-attr]
    except (AttributeError, ImportError, OSError, SyntaxError):  # a folder without __init__, a binary module, no text
        return False
    return source is not None and any(line.startswith(MARKER) for line in source.splitlines())


def _taken(name: str, spec: ModuleSpec | None) -> str:
    """One line: what is found instead, and what to do."""
    places = [] if spec is None else [spec.origin or "", *(spec.submodule_search_locations or [])]
    place = next(filter(None, places), "nothing")
    ours = Path(__file__).resolve().parents[2] / name
    message = f"import {name}: taken by another package, got {place}"
    if spec is None:
        return f"import {name}: not there, got nothing; install rollover anew"
    if Path(place).resolve() in (ours, ours / "__init__.py"):
        by = [d for d in _distributions(name) if d != "rollover"]
        whose = f" of the distribution {', '.join(by)}" if by else ""
        message = f"{message}{whose} in the place of rollover's own"
        return f"{message}; take that package out of this environment and install rollover anew"
    if Path(place).name in (f"{name}.py", "__init__.py"):
        found = "file" if Path(place).name == f"{name}.py" else "folder"
        cure = f"install rollover into an environment of its own, or rename that {found} or take it off the import path"
        return f"{message}; {cure}"
    return f"{message}; install rollover into an environment of its own, or take that off the import path"


def _distributions(name: str) -> list[str]:
    """Names of the installed distributions that ship a package."""
    from importlib.metadata import packages_distributions

    return sorted(set(packages_distributions().get(name, [])))

"""What the tests of bounds share: how much a call may cost, and the line that it is refused with."""

from __future__ import annotations

import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from rollover.system import budget
from rollover.system.errors import InputError

RAISED = f"{budget.VARIABLE}="


def largest() -> float:
    """MB that this process has held at most."""
    resource = pytest.importorskip("resource", reason="platform: memory held at most is not told")
    return float(resource.getrusage(resource.RUSAGE_SELF).ru_maxrss) / (1e6 if sys.platform == "darwin" else 1e3)


def line_of(call: Callable[[], Any], *, cure: str = RAISED) -> str:
    with pytest.raises(InputError) as caught:
        call()
    (line,) = str(caught.value).splitlines()
    assert cure in line
    return line


def yaml(folder: Path, text: str) -> Path:
    path = folder / "a.yaml"
    path.write_text(text)
    return path

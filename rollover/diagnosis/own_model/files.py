"""A model out of a file of one's own, found, loaded once and hashed like effects and laws are."""

from __future__ import annotations

from pathlib import Path
from types import ModuleType

from rollover.diagnosis.own_model.declaration import ForwardModel, declared
from rollover.spec.document import shipped_folder
from rollover.system import own_code
from rollover.system.errors import Fault, InputError, hint

KIND, NAME = "models", "model"


def found_at(name: str | Path) -> Path:
    """Path of a model's file, or of a shipped one by its name. Raises `InputError` where there is none."""
    path = Path(name)
    if path.is_file() or path.suffix == ".py":
        return path
    shipped = {p.stem: p for p in sorted((shipped_folder() / KIND).glob("*.py"))}
    if str(name) in shipped:
        return shipped[str(name)]
    message = f"no such model, got {str(name)!r}; a Python file is needed, or a shipped one: {hint(str(name), shipped)}"
    raise InputError(Fault(file="--model", message=message))


def load_model(path: Path) -> ForwardModel:
    """The object `model` of a Python file, checked. Raises `InputError`."""
    return declared(getattr(own_code.load_one(KIND, path, _examined), NAME), str(path))


def hashes(path: Path) -> dict[str, str]:
    """SHA-256 of a model's file by its name, as a result states it."""
    known = own_code.hashes(KIND)
    return {name: known[name] for name in (path.name, str(path.resolve())) if name in known}


def _examined(module: ModuleType) -> str:
    """What is wrong with a module that should hold a model."""
    return (
        ""
        if hasattr(module, NAME)
        else f"holds no model; an object named {NAME!r} is needed, see rollover.ForwardModel"
    )

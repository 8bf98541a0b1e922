"""The table of ground laws: those of `ground`, and those of one's own files.

A law of one's own is one Python file with a class derived from `ground.law.GroundLaw`, named by ``--laws FILE`` or the
environment variable ROLLOVER_LAWS (several files as in PATH); it then stands beside those of the folder `ground`.
"""

from __future__ import annotations

from dataclasses import MISSING, fields
from types import ModuleType

from ground.law import GroundLaw
from ground.law import laws as known_laws
from ground.promises import broken_by_law
from rollover.system import own_code


def laws() -> dict[str, type[GroundLaw]]:
    """Every ground law that exists, by its kind. Raises `InputError` for a file of one's own that holds none."""
    own_code.load("laws", _wrong)
    return known_laws()


def _wrong(module: ModuleType) -> str:
    """What is wrong with a file of laws; nothing if it is well."""
    own = [
        thing
        for thing in vars(module).values()
        if isinstance(thing, type) and issubclass(thing, GroundLaw) and thing.__module__ == module.__name__
    ]
    if not own:
        return "no ground law, got no class derived from GroundLaw; one is needed (`rollover new law` writes one)"
    for law in own:
        if not isinstance(getattr(law, "kind", None), str):
            return f"{law.__name__}: no name, got no `kind`; kind: Literal[NAME] = NAME is needed"
        if "__dataclass_fields__" not in vars(law):
            return f"{law.__name__}: no parameters; @parameters is needed above the class"
        if not hasattr(getattr(law, "force", None), "ctypes"):
            return f"{law.__name__}: no compiled `force`; @staticmethod and @force_law are needed above it"
    try:
        known_laws()
    except TypeError as e:
        return f"{e}; another `kind` is needed"
    wrong = ((law, broken_by_law(law())) for law in own if _has_defaults(law))
    return next((f"{law.__name__}: {why}" for law, why in wrong if why), "")


def _has_defaults(law: type[GroundLaw]) -> bool:
    """Whether a law can be tried without numbers of a soil."""
    return all(f.default is not MISSING or f.default_factory is not MISSING for f in fields(law) if f.init)

"""Choices in files: which parameter class a mapping stands for."""

from __future__ import annotations

import types
import typing
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any


@dataclass(frozen=True)
class ByKind:
    """Classes told apart by `kind`: ``Annotated[Plane | Slope, ByKind()]``; `table` gives those of an open set.

    `usual` is the kind of what does not say which it is; without it each has to.
    """

    table: Callable[[], Mapping[str, type]] | None = None
    usual: str | None = None

    def classes(self, union: Any) -> dict[str, type]:
        """Map each kind to its class; `union` is the annotated type."""
        if self.table is not None:
            return dict(self.table())
        is_union = typing.get_origin(union) in (typing.Union, types.UnionType)
        return {member.kind: member for member in (typing.get_args(union) if is_union else (union,))}

    def __get_pydantic_core_schema__(self, source: Any, handler: Any) -> dict[str, Any]:
        """Let the validator of files choose by `kind`, so that faults are told for the class that was meant."""
        choices = {kind: handler.generate_schema(member) for kind, member in self.classes(source).items()}
        by: Any = "kind" if self.usual is None else self.kind_of
        return {"type": "tagged-union", "discriminator": by, "choices": choices}

    def kind_of(self, value: Any) -> Any:
        """The kind that a mapping says it is, or the usual one; None for what is no mapping."""
        return value.get("kind", self.usual) if isinstance(value, Mapping) else None


@dataclass(frozen=True)
class ByKey:
    """A mapping whose keys, each a `noun`, say which class their values are: ``{soil-adhesion: {stress: 500}}``."""

    noun: str
    table: Callable[[], Mapping[str, type]]
    elsewhere: str = ""  # how a key is made known that the table does not hold

    def __get_pydantic_core_schema__(self, source: Any, handler: Any) -> dict[str, Any]:
        """Let the validator of files look the class up by the key."""
        fields = {
            key: {"type": "typed-dict-field", "schema": handler.generate_schema(member), "required": False}
            for key, member in self.table().items()
        }
        return {"type": "typed-dict", "fields": fields, "extra_behavior": "forbid"}

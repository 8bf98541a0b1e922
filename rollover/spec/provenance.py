"""Where the numbers of a data file come from."""

from __future__ import annotations

from typing import Annotated, Literal

from ground.quantity import parameters


@parameters
class Provenance:
    """Where numbers come from: every number of a vehicle or ROPS file is covered by one of these."""

    of: Annotated[tuple[str, ...], "paths that begin like this"]
    source: str
    confidence: Literal["measured", "published", "derived", "estimate"]

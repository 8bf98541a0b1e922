"""What the kernel is told of the ground: a law's settings and numbers, and behind them those of the effects."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from ground import kernel as k
from ground.law import GroundLaw

# numbers at which no effect changes a force by one bit
NULL = np.zeros(k.EFFECT_PLACES)
NULL[[k.DAMPING_EXPONENT, k.SLOW, k.SLOWEST, k.REBOUND_DAMPING, k.REACH, k.LAYER_RATIO, k.CRUST_RATIO, k.STIFFNESS]] = (
    1.0
)
NULL[[k.LAYER_DEPTH, k.GROWTH_END]] = np.inf


class ForceTerm(NamedTuple):
    """A compiled ``force(p, s, z, v)`` (see `ground.compiled.force_law`) that is added to the loading curve.

    N on the reference face; `p` are its own numbers, at most `kernel.TERM_PLACES`, `s` the element's memory.
    """

    force: Any
    p: tuple[float, ...]


def settings(
    law: GroundLaw, effects: Mapping[int, float] | None = None, terms: Sequence[ForceTerm] = ()
) -> tuple[NDArray[np.int64], NDArray[np.float64]]:
    """Settings (integers) and numbers for the kernel; `effects` gives those places that are not null.

    Raises ``ValueError`` for a term with more numbers than it has places.
    """
    own = law.p
    numbers = NULL.copy()
    numbers[[k.UNLOADING_STIFFNESS, k.UNLOADING_GROWTH]] = law.unloading_line
    for place, value in (effects or {}).items():
        numbers[place] = value
    tail = np.zeros(k.TERM_PLACES * len(terms))
    for i, term in enumerate(terms):
        if len(term.p) > k.TERM_PLACES:
            raise ValueError(f"p: too long, got {len(term.p)} numbers of a force term; at most {k.TERM_PLACES}")
        tail[k.TERM_PLACES * i : k.TERM_PLACES * i + len(term.p)] = term.p
    integers = [
        int(law.plastic),
        int(law.unloads_at_rest_stiffness),
        law.force.address,
        law.advance.address if law.advance is not None else 0,
        law.begin.address if law.begin is not None else 0,
        len(own),
        len(terms),
        *(term.force.address for term in terms),
    ]
    return np.array(integers, dtype=np.int64), np.concatenate([own, numbers, tail])

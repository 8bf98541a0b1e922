"""Worlds that the example models are diagnosed by: published equations written out again, with solvers of their own.

A world is drawn by a seed: values of its parameters, and what is concealed in it, listed by the model or not. Nothing
here is taken from the models' files.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from tests.own_model.axis import axis_world
from tests.own_model.duffing import duffing_world
from tests.own_model.hysteresis import hysteretic_world
from tests.own_model.recorded import World
from tests.own_model.tanks import tanks_world

KINDS = (*["single"] * 12, *["null"] * 4, *["unlisted"] * 4)
WORLDS: dict[str, Callable[[str, int, np.random.Generator], World]] = {
    "friction_axis": axis_world,
    "duffing": duffing_world,
    "hysteretic_oscillator": hysteretic_world,
    "cascaded_tanks": tanks_world,
}


def drawn(model: str, seed: int, case: int) -> World:
    """The case of a seed, of 20: 12 with one listed effect, 4 without any, 4 with one that is not listed."""
    rng = np.random.default_rng([seed, case, sum(map(ord, model))])
    return WORLDS[model](KINDS[case], case, rng)

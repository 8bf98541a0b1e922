"""A model whose answer is known in closed form: y = gain u + offset (+ bend u^2), least squares of a straight line."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray

from ground.quantity import Quantity
from rollover import Parameter, Recording, Term

Array = NDArray[np.float64]
IN, OUT = "bench/load", "bench/reading"


class Line:
    """A straight line, and a parabola that it may lack."""

    title = "A straight line"
    inputs: Mapping[str, Quantity] = {IN: Quantity("N", "what is put on")}
    outputs: Mapping[str, Quantity] = {OUT: Quantity("V", "what is read")}
    parameters: Mapping[str, Parameter] = {
        "slope": Parameter(unit="V/N", low=0.0, high=10.0, start=1.0),
        "level": Parameter(unit="V", low=-5.0, high=5.0, start=0.0),
    }
    terms: tuple[Term, ...] = (
        Term(
            id="bend",
            family="a curved characteristic",
            equation="y = coefficient u^2",
            parameters={"coefficient": Parameter(unit="V/N2", low=-2.0, high=2.0, start=0.5, null=0.0)},
        ),
    )
    sensors: tuple[str, ...] = ()

    def simulate(self, time: Array, inputs: Mapping[str, Array], values: Mapping[str, float]) -> Mapping[str, Array]:
        u = inputs[IN]
        return {OUT: values["slope"] * u + values["level"] + values["bend.coefficient"] * u * u}


model = Line()


def measured(
    slope: float, level: float, bend: float = 0.0, wave: float = 0.0, *, seed: int = 1, count: int = 4
) -> dict[str, Recording]:
    """Recordings of a line, with white noise of 0.01 V; `wave` is a sine over the input that no term has."""
    rng, found = np.random.default_rng(seed), {}
    for k in range(count):
        time = np.arange(400) / 100.0
        u = np.sin(2.0 * np.pi * (0.3 + 0.1 * k) * time + rng.uniform(0.0, 6.0)) * (1.0 + 0.2 * k)
        y = slope * u + level + bend * u * u + wave * np.sin(6.0 * u) + 0.01 * rng.standard_normal(u.size)
        found[f"r{k + 1}"] = Recording(title=f"line {k + 1}", time=time, channels={IN: u, OUT: y})
    return found

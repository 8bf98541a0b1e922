"""Draws of a posterior on a page: pair by pair, and what they say of each value."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from rollover.calibration.posterior import Posterior, summary
from viz.content.blocks import Block, Cell, Figure, Note, Table
from viz.figures.corner import corner

COLUMNS = (
    "parameter",
    "mean",
    "deviation",
    "2.5 %",
    "median",
    "97.5 %",
    "R-hat",
    "autocorrelation time, steps",
    "effective samples",
)
NUMBERS = ("mean", "deviation", "low", "median", "high")


def open_values(
    names: Sequence[str],
    units: Sequence[str],
    values: NDArray[np.float64],
    fitted: Sequence[float],
    drawn: Posterior,
    prior: str,
) -> list[Block]:
    """Blocks for draws (n, p), SI, with the `fitted` values (p,); `prior` is a sentence."""
    axes = [f"{name}, {unit}" if unit else name for name, unit in zip(names, units, strict=True)]
    figure = Figure(
        svg=corner(axes, values, fitted),
        caption="Samples of the posterior: 68 % and 95 % lie within the shades; lines are the fitted values.",
    )
    told, rows = summary(names, values, drawn, prior)["parameters"], list[list[str | Cell]]()
    for name in names:
        one = told[name]
        agree = Cell(f"{one['r_hat']:.3f}", "" if drawn.is_mixed else "warn")
        length = f"{one['autocorrelation_time']:.2g}", f"{one['effective_draws']:.0f}"
        rows.append([name, *(f"{one[key]:.5g}" for key in NUMBERS), agree, *length])
    text = (
        f"{len(values)} samples by {drawn.sampler}: {drawn.walkers} walkers, {drawn.steps} steps after "
        f"{drawn.warm_up}, {drawn.acceptance:.0%} of the jumps accepted. {prior} The samples are posterior.csv."
    )
    return [figure, Table(columns=COLUMNS, rows=rows, numeric=range(1, 9)), Note(text=text)]

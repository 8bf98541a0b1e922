"""Draws of a posterior on a page: pair by pair, and what they say of each value."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from rollover.calibration.posterior import Posterior
from viz.content.blocks import Block, Cell, Figure, Note, Table
from viz.figures.corner import corner

COLUMNS = ("parameter", "mean", "deviation", "2.5 %", "median", "97.5 %", "R-hat", "steps worth one", "independent")


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
        caption="Draws of the posterior: 68 % and 95 % lie within the shades; lines are the fitted values.",
    )
    rows: list[list[str | Cell]] = []
    for k, name in enumerate(names):
        low, median, high = np.quantile(values[:, k], [0.025, 0.5, 0.975])
        numbers = (values[:, k].mean(), values[:, k].std(ddof=1), low, median, high)
        each = drawn.r_hat[k], drawn.autocorrelation[k], drawn.effective[k]
        agree = Cell(f"{each[0]:.3f}", "" if drawn.is_mixed else "warn")
        rows.append([name, *(f"{v:.5g}" for v in numbers), agree, f"{each[1]:.2g}", f"{each[2]:.0f}"])
    text = (
        f"{len(values)} draws by {drawn.sampler}: {drawn.walkers} walkers, {drawn.steps} steps after {drawn.warm_up}, "
        f"{drawn.acceptance:.0%} of the jumps accepted. {prior} The draws are posterior.csv."
    )
    warnings: list[Block] = [Note(text=f"{w[:1].upper()}{w[1:]}.", warning=True) for w in drawn.warnings]
    return [figure, Table(columns=COLUMNS, rows=rows, numeric=range(1, 9)), Note(text=text), *warnings]

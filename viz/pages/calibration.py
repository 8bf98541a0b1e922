"""The page of a calibration: values with intervals, what stays open, and the recordings that were held out."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from rollover.calibration.calibrate import Calibration, Estimate, Score
from rollover.calibration.posterior import Posterior
from viz.content.blocks import Block, Cell, Figure, Footer, Headline, Note, Section, Table
from viz.content.differences import differences_section
from viz.figures.corner import corner
from viz.pages.page import render


def page(c: Calibration, *, command: str, scenario_hash: str = "", versions: Mapping[str, str] | None = None) -> str:
    """HTML of a calibration."""
    columns = ["parameter", "unit", "was", "is", "from", "to", "interval", "if the others were known", ""]
    table = Table(
        columns=columns,
        rows=[_row(e) for e in c.estimates],
        numeric=(2, 3, 4, 5),
        caption="95 % intervals: quadratic, from the Jacobian, or by profile likelihood where that disagrees.",
    )
    blocks: list[Block] = [*differences_section(c.scenario), Section(title="Parameters", blocks=[table])]
    blocks += [Note(text=f"{w[:1].upper()}{w[1:]}.", warning=True) for w in c.warnings]
    scores = [("fitted", c.training), *([("held out", c.held_out)] if c.held_out is not None else [])]
    rows: list[list[str | Cell]] = [
        [which, ", ".join(s.recordings), when, *_scores(score)]
        for which, s in scores
        for when, score in (("before", s.before), ("after", s.after))
    ]
    heads = ["", "recordings", "", "RMS / noise", "RMS / range, %", "ISO/TS 18571", "peak force error, %"]
    blocks.append(
        Section(
            title="How well the recordings are followed", blocks=[Table(columns=heads, rows=rows, numeric=(3, 4, 5, 6))]
        )
    )
    names = [e.path for e in c.estimates]
    if len(names) > 1:
        cells: list[list[str | Cell]] = [
            [name, *(f"{v:+.2f}" for v in row)] for name, row in zip(names, c.correlation, strict=True)
        ]
        caption = f"Condition number of the Jacobian with columns scaled to one: {c.condition:.3g}."
        correlations = Table(columns=["", *names], rows=cells, numeric=range(1, len(names) + 1), caption=caption)
        blocks.append(Section(title="Correlations", blocks=[correlations]))
    if c.posterior is not None:
        blocks.append(Section(title="What stays open", blocks=_posterior(c, c.posterior)))
    clocks: list[list[str | Cell]] = [
        [name, f"{1e3 * late:+.{12 if abs(late) > 1.0 else 3}g}", f"{1e3 * c.clock_errors[name]:.2g}"]
        for name, late in c.clocks.items()
    ]
    text = (
        f"{c.samples} samples, worth {c.independent:.0f} independent ones; {c.outliers} outliers held down; "
        f"{c.starts_agreeing[0]} of {c.starts_agreeing[1]} starts ended here. Clock offsets are profiled out under a "
        f"prior of {1e3 * c.clock_sigma:g} ms."
    )
    clock = Table(columns=["recording", "clock late, ms", "1 sigma, ms"], rows=clocks, numeric=(1, 2))
    zeros = [Note(text=f"{name}: {zero.sentence}.") for name, zero in c.zeros.items()]
    blocks.append(Section(title="Basis of the fit", blocks=[Note(text=text), *zeros, clock]))
    return render(
        title=c.scenario.title,
        subtitle="Calibration",
        headline=headline(c),
        blocks=blocks,
        footer=Footer(command=command, scenario_hash=scenario_hash, versions=versions),
    )


def headline(c: Calibration) -> Headline:
    """How many parameters are determined, and what the held-out recordings say."""
    known = [e for e in c.estimates if e.determined]
    judged = c.held_out if c.held_out is not None else c.training
    which = "Held-out recordings" if c.held_out is not None else "The fitted recordings, none held out,"
    return Headline(
        sentence=f"{len(known)} of {len(c.estimates)} parameters are determined by the recordings.",
        detail=f"{which} went from {judged.before.over_noise:.3g} to {judged.after.over_noise:.3g} times the noise.",
        state="pass" if len(known) == len(c.estimates) and not c.warnings else "warn",
    )


def _posterior(c: Calibration, drawn: Posterior) -> list[Block]:
    """The draws pair by pair, and what they say of each value."""
    values = c.draws
    names = [f"{p.path}, {p.unit}" if p.unit else p.path for p in c.parameters]
    figure = Figure(
        svg=corner(names, values, [e.value for e in c.estimates]),
        caption="Draws of the posterior: 68 % and 95 % lie within the shades; lines are the fitted values.",
    )
    columns = ["parameter", "mean", "deviation", "2.5 %", "median", "97.5 %", "R-hat", "steps worth one", "independent"]
    rows: list[list[str | Cell]] = []
    for k, p in enumerate(c.parameters):
        low, median, high = np.quantile(values[:, k], [0.025, 0.5, 0.975])
        told = (values[:, k].mean(), values[:, k].std(ddof=1), low, median, high)
        each = drawn.r_hat[k], drawn.autocorrelation[k], drawn.effective[k]
        agree = Cell(f"{each[0]:.3f}", "" if drawn.is_mixed else "warn")
        rows.append([p.path, *(f"{v:.5g}" for v in told), agree, f"{each[1]:.2g}", f"{each[2]:.0f}"])
    text = (
        f"{len(values)} draws by {drawn.sampler}: {drawn.walkers} walkers, {drawn.steps} steps after {drawn.warm_up}, "
        f"{drawn.acceptance:.0%} of the jumps accepted. Prior: uniform between the bounds, of the logarithm where they "
        "are spaced logarithmically. The draws are posterior.csv."
    )
    return [figure, Table(columns=columns, rows=rows, numeric=range(1, 9)), Note(text=text)]


def _row(e: Estimate) -> list[str | Cell]:
    low, high = (f"{v:.5g}{' (bound)' if open_ else ''}" for v, open_ in ((e.low, e.open_low), (e.high, e.open_high)))
    alone = f"{e.alone_low:.5g} to {e.alone_high:.5g}"
    verdict = Cell("determined", "pass") if e.determined else Cell(f"not determined: {e.why}", "warn")
    return [e.path, e.unit, f"{e.start:.5g}", f"{e.value:.5g}", low, high, e.method, alone, verdict]


def _scores(s: Score) -> list[str]:
    return [
        f"{s.over_noise:.3g}",
        "" if s.nrmse is None else f"{100.0 * s.nrmse:.3g}",
        "" if s.iso18571 is None else f"{s.iso18571:.3f}",
        "" if s.peak_force_error is None else f"{100.0 * s.peak_force_error:.3g}",
    ]

"""The page of a calibration: values with intervals, what stays open, and the recordings that were held out."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from types import MappingProxyType

import numpy as np
from numpy.typing import NDArray
from scipy.interpolate import pchip_interpolate

from rollover.calibration.calibrate import Calibration, Estimate, Score
from rollover.calibration.posterior import Posterior
from rollover.comparison.misfit import Misfit
from rollover.system.numbers import Z95
from viz.content.blocks import Block, Cell, Details, Figure, Footer, Headline, Note, Section, Table, as_sentence
from viz.content.differences import differences_section
from viz.content.entities import series
from viz.figures import plots
from viz.figures.heat_map import heat_map
from viz.figures.intervals import spans
from viz.figures.plots import Curve, Level
from viz.pages.page import render
from viz.pages.posterior import open_values

Array = NDArray[np.float64]
SPOKEN = 3  # values that a headline still has room for
OPEN = 4  # figures of curves that are not folded away
BELOW = 0.1  # of chi-squared: less is the roughness of contacts that fall between two steps or not
CHI2_95 = 3.841458820694124  # 1.96^2, of chi-squared with one degree of freedom


def page(
    c: Calibration,
    *,
    curves: Sequence[tuple[Misfit, Misfit]] = (),
    open_by: Mapping[tuple[str, str], Array] = MappingProxyType({}),
    command: str,
    scenario_hash: str = "",
    versions: Mapping[str, str] | None = None,
) -> str:
    """HTML of a calibration; `curves` are the comparisons of each recording before and after.

    `open_by` is 1 sigma (n,) of the calibrated curve of a recording and channel, SI, that the values leave open.
    """
    columns = ["parameter", "unit", "was", "is", "from", "to", "interval", "if the others were known", ""]
    table = Table(
        columns=columns,
        rows=[_row(e) for e in c.estimates],
        numeric=(2, 3, 4, 5),
        caption="95 % intervals: quadratic, from the Jacobian, or by profile likelihood where that disagrees.",
    )
    blocks: list[Block] = [
        *differences_section(c.scenario),
        *_curves(curves, open_by),
        Section(title="Parameters", blocks=[*_spans(c), table]),
    ]
    blocks += [Note(text=f"{as_sentence(w)}.", warning=True) for w in c.warnings]
    blocks += _profiles(c)
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
        blocks.append(Section(title="Correlations", blocks=[_correlation(c, names), correlations]))
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


def _curves(curves: Sequence[tuple[Misfit, Misfit]], open_by: Mapping[tuple[str, str], Array]) -> list[Block]:
    """Each channel of each recording before and after; the first few at once, the others folded away."""
    figures: list[Block] = []
    for before, after in curves:
        later = {channel.channel: channel for channel in after.channels}
        for was in before.channels:
            s, now = series(was.channel), later.get(was.channel)
            curve = None
            if now is not None:
                simulated = np.interp(was.time, now.time, now.simulated)
                sigma = open_by.get((before.recording, was.channel))
                wide = None if sigma is None or sigma.shape != now.time.shape else Z95 * s.factor * sigma
                spread = None if wide is None else np.interp(was.time, now.time, wide)
                curve = Curve(name="after", x=was.time, y=simulated * s.factor, spread=spread)
            svg = plots.before_after(
                Curve(name="measured", x=was.time, y=was.measured * s.factor),
                Curve(name="before", x=was.time, y=was.simulated * s.factor),
                curve,
                label=f"{s.name}, {s.unit}" if s.unit else was.channel,
                noise=s.factor * (was.noise or 0.01 * float(np.ptp(was.measured)) or 1.0),
                phases=before.phases,
            )
            over = "noise" if was.noise else "1 % of the range, as no noise is known"
            band = f"; band: {_widest(curve, s.unit)}" if curve is not None and curve.spread is not None else ""
            text = f"{before.recording}, {was.channel}{band}; below, measured less simulated over the {over}."
            figures.append(Figure(svg=svg, caption=text))
    if not figures:
        return []
    rest = [Details(summary=f"{len(figures) - OPEN} more channels", blocks=figures[OPEN:])] if figures[OPEN:] else []
    return [Section(title="Before and after", blocks=[*figures[:OPEN], *rest])]


def _widest(curve: Curve, unit: str) -> str:
    """What a band is, and how wide it becomes."""
    assert curve.spread is not None
    at = int(np.argmax(curve.spread))
    return f"95 %, by what the fitted values leave open, at most {curve.spread[at]:.2g} {unit} at {curve.x[at]:.3g} s"


def _spans(c: Calibration) -> list[Block]:
    """What is known of each parameter, in its allowed range."""
    if not c.estimates:
        return []

    def share(e: Estimate, *values: float) -> list[float]:
        low, high = e.bounds
        return [100.0 * min(max((v - low) / (high - low), 0.0), 1.0) for v in values]

    svg = spans(
        [e.path for e in c.estimates],
        np.array([share(e, e.low, e.high) for e in c.estimates]),
        np.array([share(e, e.alone_low, e.alone_high) for e in c.estimates]),
        np.array([share(e, e.start)[0] for e in c.estimates]),
        np.array([share(e, e.value)[0] for e in c.estimates]),
        label="place in the allowed range, %",
    )
    ranges = "; ".join(f"{e.path} {e.bounds[0]:.4g} to {e.bounds[1]:.4g} {_unit(e.unit)}".strip() for e in c.estimates)
    return [Figure(svg=svg, caption=f"Value and 95 % interval of each parameter in its allowed range ({ranges}).")]


def _profiles(c: Calibration) -> list[Block]:
    """Of each parameter how the misfit rises beside its value, the others fitted anew, and the parabola of it."""
    figures: list[Block] = []
    for p, e, found in zip(c.parameters, c.estimates, c.profiles, strict=False):
        places = np.linspace(found.places[0], found.places[-1], 81)
        profile = pchip_interpolate(found.places, found.rises, places) if len(found.places) > 1 else 0.0 * places
        values = np.array([p.value(float(u)) for u in places])
        parabola = ((places - found.fit) / found.sigma) ** 2
        shown = parabola <= max(
            1.2 * float(profile.max()), 2.0 * CHI2_95
        )  # where the two part, the profile is to be seen
        svg = plots.xy(
            [
                Curve(name="others fitted anew", x=values, y=profile),
                Curve(name="quadratic", x=values[shown], y=parabola[shown], role="muted"),
            ],
            across=f"{p.path}{', ' if _unit(p.unit) else ''}{_unit(p.unit)}",
            label="rise of the squared misfit",
            levels=[Level(name="95 %", value=CHI2_95)],
            points=[("", p.value(float(u)), float(y)) for u, y in zip(found.places, found.rises, strict=True)],
        )
        text = f"{e.path}: {e.low:.5g} to {e.high:.5g} {_unit(e.unit)}".strip()
        lowest = int(np.argmin(found.rises))
        below = ""
        if found.rises[lowest] < -BELOW:
            below = f" At {p.value(float(found.places[lowest])):.5g} it lies below the fit, which is not the best one."
        figures.append(Figure(svg=svg, caption=f"{text}, {e.method} interval; dots were calculated.{below}"))
    if not figures:
        return []
    note = (
        "Squared misfit above its least, over the squared noise, widened as the intervals are; a 95 % interval "
        "ends where it reaches 3.84."
    )
    rest = [Details(summary=f"{len(figures) - OPEN} more values", blocks=figures[OPEN:])] if figures[OPEN:] else []
    title = "Profile likelihood"
    return [Section(title=title, blocks=[*figures[:OPEN], *rest, Note(text=note)])]


def _unit(unit: str) -> str:
    return "" if unit == "1" else unit


def _correlation(c: Calibration, names: list[str]) -> Figure:
    """Correlation of every two estimates as a map."""
    labels = np.array([name for name in names for _ in names], dtype=object)
    across = np.array(names * len(names), dtype=object)
    svg = heat_map(across, labels, c.correlation.ravel(), across="", up="", label="correlation", signed=True)
    return Figure(svg=svg, caption="Correlation of the estimates: near +1 or -1, two of them are known together only.")


def headline(c: Calibration) -> Headline:
    """The values with their intervals or, of many, how many are determined; and what the held-out recordings say."""
    known = [e for e in c.estimates if e.determined]
    counted = f"{len(known)} of {len(c.estimates)} parameters determined"
    values = "; ".join(f"{e.path} {_between(e)}" for e in c.estimates)
    few = 0 < len(c.estimates) <= SPOKEN
    judged = c.held_out if c.held_out is not None else c.training
    which = "Held-out recordings" if c.held_out is not None else "The fitted recordings, none held out,"
    return Headline(
        sentence=f"{values if few else counted}.",
        detail=f"{f'In brackets 95 % intervals; {counted}. ' if few else ''}{which} went from "
        f"{judged.before.over_noise:.3g} to {judged.after.over_noise:.3g} times the noise.",
        state="pass" if len(known) == len(c.estimates) and not c.warnings else "warn",
    )


def _between(e: Estimate) -> str:
    return f"{e.value:.4g} {_unit(e.unit)}".rstrip() + f" ({e.low:.4g} to {e.high:.4g})"


def _posterior(c: Calibration, drawn: Posterior) -> list[Block]:
    """The draws pair by pair, and what they say of each value."""
    prior = "Prior: uniform between the bounds, of the logarithm where they are spaced logarithmically."
    names, units = [p.path for p in c.parameters], [p.unit for p in c.parameters]
    return open_values(names, units, c.draws, [e.value for e in c.estimates], drawn, prior)


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

"""The page of a study: the answer, quantiles, responses, what matters most, what failed, every case."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from rollover.assessment.ledger import of_cases
from rollover.studies import failures, reference
from rollover.studies.runner import Conducted
from rollover.studies.study import Study
from rollover.studies.summary import values_of
from viz.content.blocks import Block, Cases, Cell, Figure, Footer, Headline, Note, Section, Table
from viz.content.differences import differences_section
from viz.content.verdict import standing
from viz.figures import plots
from viz.figures.plots import Level
from viz.figures.study_figures import in_order, labels, responses
from viz.pages.page import render
from viz.pages.report import series_unit

Array = NDArray[np.float64]
MOST_FIGURES = 3  # outputs that are drawn
MOST_SENTENCES = 30
COLUMNS_OF_FLAGS = ("flag", "cases", "share", "share at the peak load")


def page(study: Study, done: Conducted, report: Mapping[str, Any], *, command: str) -> str:
    """HTML of a study's report."""
    blocks: list[Block] = differences_section(study.scenario)
    if given := report.get("set"):
        blocks.append(Note(text=f"Set for this study: {', '.join(given)}."))
    for output in report["outputs"][:MOST_FIGURES]:
        blocks.append(_output(study, done, report, output))
    if rest := report["outputs"][MOST_FIGURES:]:
        blocks.append(Section(title="Further outputs", blocks=[_quantiles(o, drawn=report["drawn"]) for o in rest]))
    if report["reliability"]:
        blocks.append(_reliability(report["reliability"]))
    if report["worst"] is not None:
        blocks.append(_worst(report["worst"]))
    if said := failures.sentence(report["failures_along"]):
        blocks.insert(0, Note(text=f"{said}.", warning=True))
    if said := reference.sentence(report.get("reference_check")):
        blocks.append(Note(text=f"Integrator: {report['integrator']}. {said}."))
    if count := report["from_rest"]:
        blocks.append(Note(text=f"{count} cases had no static balance on their surface and began from rest."))
    if (ledger := report.get("ledger")) and ledger["open"]:
        blocks.insert(0, Note(text=f"{of_cases(ledger)}.", warning=True))
    blocks.append(_failures(report))
    blocks.append(_flags(report))
    blocks.append(Section(title="Every case", blocks=[_cases(study, done)]))
    return render(
        title=report["title"],
        subtitle="Load study",
        headline=headline(report),
        blocks=blocks,
        footer=Footer(command=command, scenario_hash=report["scenario_hash"], versions=report["versions"]),
    )


def headline(report: Mapping[str, Any]) -> Headline:
    """What the first output comes to: how often it lies beyond its limit or, without one, how far it goes."""
    n, first = report["cases"], report["outputs"][0]
    unit, factor = series_unit(first["unit"])
    failed = f"{n['failed']} of {n['all']} cases failed. " if n["failed"] else f"{n['all']} cases. "
    flags = {f["flag"] for f in report["flags"]}
    state: Any = "warn" if n["failed"] or flags else ""
    worth = f" {_sentence(standing(flags))}" if flags else ""
    if not first["cases"]:
        return Headline(sentence="No case has an answer.", detail=failed, state="fail")
    if (e := first["exceedance"]) is not None:
        limit = f"{e['limit'] * factor:.4g} {unit}"
        interval = f"{_percent(e['low_of_all'])} to {_percent(e['high_of_all'])}"
        sentence = f"{first['name']} lies {e['beyond']} {limit} in {_percent(e['probability'])} of cases ({interval})."
        if e["failed"]:
            failed += f"{_percent(e['least'])} to {_percent(e['most'])} of all, as the failed ones lie on either side. "
    else:
        low, high = (f"{first[key] * factor:.4g}" for key in ("least", "largest"))
        known = "" if unit == "1" else f" {unit}"
        sentence = f"{first['name']} goes from {low} to {high}{known}"
        if (b := first["beyond_limit"]) is not None:
            sentence += f", {b['beyond']} {b['limit'] * factor:.4g}{known} in {b['hits']} of {b['cases']} cases"
        sentence += "."
    return Headline(
        sentence=sentence, detail=f"{failed}{_sentence(report['meaning_of_quantiles'])}{worth}", state=state
    )


def _output(study: Study, done: Conducted, report: Mapping[str, Any], output: Mapping[str, Any]) -> Section:
    unit, factor = series_unit(output["unit"])
    chosen = next(o for o in study.outputs if o.name == output["name"] and o.limit == output["limit"])
    y = values_of(chosen, done.rows) * factor
    label = f"{output['name']}, {unit}" if unit != "1" else output["name"]
    levels = [] if output["limit"] is None else [Level(name="limit", value=output["limit"] * factor)]
    blocks: list[Block] = [_quantiles(output, drawn=report["drawn"])]
    if np.isfinite(y).any():
        blocks.append(in_order(y, label, levels, drawn=report["drawn"]))
        if output["ends"]:
            blocks.append(_tornado(output, factor, label))
        blocks += _indices(output, factor, unit)
        along = responses(study, done, y, label, levels)
        blocks = [*along, *blocks] if study.plan.kind == "grid" else [*blocks, *along]  # a grid is asked for its map
    return Section(title=output["name"], blocks=blocks)


def _quantiles(output: Mapping[str, Any], *, drawn: bool) -> Table:
    unit, factor = series_unit(output["unit"])
    known = "" if unit == "1" else f" {unit}"
    rows: list[list[str | Cell]] = [["mean", _number(output["mean"], factor), "", ""]]
    rows.append(["standard deviation", _number(output["deviation"], factor), "", ""])
    rows.append(["least", _number(output["least"], factor), "", ""])
    for q in output["quantiles"]:
        bounds = [_number(q[key], factor, "not bounded") for key in ("low", "high")]
        rows.append([f"{100.0 * q['q']:g} %", _number(q["value"], factor), *bounds])
    rows.append(["largest", _number(output["largest"], factor), "", ""])
    if (e := output["exceedance"]) is not None:
        name = f"probability {e['beyond']} {e['limit'] * factor:.4g}{known}: {e['hits']} of {e['cases']}"
        rows.append([name, _percent(e["probability"]), _percent(e["low"]), _percent(e["high"])])
        if e["failed"]:
            counted = f"the same, {e['failed']} failed cases counted as"
            rows.append([f"{counted} not {e['beyond']}", _percent(e["least"]), _percent(e["low_of_all"]), ""])
            rows.append([f"{counted} {e['beyond']}", _percent(e["most"]), "", _percent(e["high_of_all"])])
    if (e := output["beyond_limit"]) is not None:
        failed = f", {e['failed']} failed" if e["failed"] else ""
        rows.append([f"{e['beyond']} {e['limit'] * factor:.4g}{known}", f"{e['hits']} of {e['cases']}{failed}", "", ""])
    how = "Intervals by order statistics and Clopper-Pearson." if drawn else "The cases of a plan are no random sample."
    missing = f"; {output['missing']} have no such measure" if output["missing"] else ""
    return Table(
        columns=(f"{output['name']}{known and ','}{known}", "", "interval from", "to")[: 4 if drawn else 2],
        rows=rows if drawn else [row[:2] for row in rows],
        numeric=(1, 2, 3) if drawn else (1,),
        caption=f"{output['cases']} cases{missing}. {how}",
    )


def _tornado(output: Mapping[str, Any], factor: float, label: str) -> Figure:
    ends = output["ends"]
    svg = plots.tornado(
        [e["axis"] for e in ends],
        [e["low"] * factor for e in ends],
        [e["high"] * factor for e in ends],
        centre=output["mean"] * factor,
        label=label,
    )
    ends_by_axis = "; ".join(f"{e['axis']} {_end(e['at_low'])} to {_end(e['at_high'])}" for e in ends)
    caption = f"Mean over the lowest and the highest fifth of each axis ({ends_by_axis}), about the mean of all."
    return Figure(svg=svg, caption=caption)


def _indices(output: Mapping[str, Any], factor: float, unit: str) -> list[Block]:
    found: list[Block] = []
    if rows := output["sobol"]:
        svg = plots.bars({r["axis"]: r["total"] for r in rows}, label="total Sobol index")
        found.append(Figure(svg=svg, caption="Share of the variance that an axis has a part in."))
        cells = [
            [
                r["axis"],
                f"{r['first']:.3f}",
                f"{r['first_half_width']:.3f}",
                f"{r['total']:.3f}",
                f"{r['total_half_width']:.3f}",
            ]
            for r in rows
        ]
        table = Table(
            columns=("axis", "first", "+-", "total", "+-"),
            rows=cells,
            numeric=range(1, 5),
            caption=f"Sobol indices from {rows[0]['base']} base points, bootstrap intervals.",
        )
        found.append(table)
    if rows := output["morris"]:
        cells = [
            [r["axis"], *(_number(r[key], factor) for key in ("magnitude", "magnitude_half_width", "mean", "spread"))]
            for r in rows
        ]
        effects = ("axis", f"mean magnitude, {unit}", "+-", "mean", "spread")
        caption = f"Elementary effects over the whole range of an axis, {rows[0]['trajectories']} trajectories."
        found.append(Table(columns=effects, rows=cells, numeric=range(1, 5), caption=caption))
    if rows := output["rank_correlation"]:
        cells = [[r["axis"], f"{r['correlation']:+.3f}", f"{r['low']:+.3f}", f"{r['high']:+.3f}"] for r in rows]
        heads = ("axis", "rank correlation", "from", "to")
        found.append(Table(columns=heads, rows=cells, numeric=(1, 2, 3), caption="Spearman, Fisher's z."))
    return found


def _reliability(found: Mapping[str, Any]) -> Section:
    if "reason" in found:
        return Section(title="Reliability", blocks=[Note(text=f"No design point: {found['reason']}", warning=True)])
    head = Table(
        columns=("method", "probability", "from", "to", "cases"),
        rows=[
            ["importance sampling", *(f"{found[k]:.3g}" for k in ("probability", "low", "high")), f"{found['cases']}"],
            ["FORM", f"{found['form_probability']:.3g}", "", "", f"{found['search_cases']}"],
        ],
        numeric=(1, 2, 3, 4),
        caption=f"Beyond {found['limit']:g} for {found['output']}; beta = {found['beta']:.3g}. FORM takes the limit as "
        "a plane at the design point: where the two differ, believe the sampling.",
    )
    point, factors = found["design_point"], found["importance_factors"]
    rows = [
        [name, f"{value:.6g}", f"{point[name]:+.3f}", _percent(factors[name])]
        for name, value in found["design_values"].items()
    ]
    columns = ("axis", "at the design point", "in standard normals", "importance")
    return Section(title="Reliability", blocks=[head, Table(columns=columns, rows=rows, numeric=(1, 2, 3))])


def _worst(worst: Mapping[str, Any]) -> Section:
    said = ", ".join(f"{name} = {_end(value)}" for name, value in worst["axes"].items())
    text = f"Point {worst['point']}: {said}. It stands in {worst['file']}; rollover run {worst['file']} repeats it."
    return Section(title="The worst case", blocks=[Note(text=text)])


def _failures(report: Mapping[str, Any]) -> Section:
    rows = [
        [f["failure"], str(f["cases"]), ", ".join(map(str, f["points"][:8])), f["sentence"]]
        for f in report["failures"][:MOST_SENTENCES]
    ]
    if not rows:
        return Section(title="Failures", blocks=[Note(text="No case failed.")])
    columns = ("by", "cases", "points", "in words")
    more = len(report["failures"]) - MOST_SENTENCES
    caption = f"{more} further sentences stand in cases.parquet." if more > 0 else ""
    blocks: list[Block] = [Table(columns=columns, rows=rows, numeric=(1,), caption=caption)]
    if tests := report["failures_along"]:
        cells = [
            [
                t["axis"],
                *(" to ".join(map(_end, t[k])) for k in ("failed", "done")),
                t["more"],
                f"{t['p']:.2g}",
                t["test"],
            ]
            for t in tests
        ]
        heads = ("axis", "failed cases", "cases done", "failures more frequent", "p", "test")
        caption = f"Failed against other cases, along each axis; level {100 * failures.LEVEL:g} % for all (Bonferroni)."
        blocks.append(Table(columns=heads, rows=cells, numeric=(4,), caption=caption))
    return Section(title="Failures", blocks=blocks)


def _flags(report: Mapping[str, Any]) -> Section:
    rows = [[f["flag"], str(f["cases"]), _percent(f["share"]), _percent(f["share_at_peak"])] for f in report["flags"]]
    known = all(f["flag"] != "uncalibrated" for f in report["flags"])
    title = "Outside the ground law's calibrated domain" if known else "The ground law is not calibrated"
    if not rows:
        return Section(title=title, blocks=[Note(text="No case carries a domain flag.")])
    caption = "Of the finished cases: anywhere in the run, and within 50 ms of the peak of the leading load."
    return Section(title=title, blocks=[Table(columns=COLUMNS_OF_FLAGS, rows=rows, numeric=(1, 2, 3), caption=caption)])


def _cases(study: Study, done: Conducted) -> Cases:
    n = done.points.count
    columns: list[tuple[str, Sequence[Any]]] = [("point", list(range(n)))]
    label_of = labels(study)
    for axis in study.axes:
        column = done.points.columns[axis.name]
        columns.append((label_of[axis.name], [v if isinstance(v, str) else float(v) for v in column]))
    for name in dict.fromkeys(output.name for output in study.outputs):
        output = next(o for o in study.outputs if o.name == name)
        unit, factor = series_unit(output.unit)
        y = values_of(output, done.rows) * factor
        columns.append((f"{name}, {unit}", [float(v) if np.isfinite(v) else None for v in y]))
    open_by = [row.measures.get("ledger/residual") for row in done.rows]
    if any(share is not None for share in open_by):
        columns.append(("ledger open by, %", [None if share is None else 100.0 * share for share in open_by]))
    columns.append(("status", [row.failure or row.status for row in done.rows]))
    if any(row.sentence for row in done.rows):
        columns.append(("in words", [row.sentence for row in done.rows]))
    if any(row.peak_flags for row in done.rows):
        columns.append(("flags at the peak", [", ".join(row.peak_flags) for row in done.rows]))
    caption = "Click a heading to sort; filter with a part of a word, or >12, <=3, 2..4. All measures: cases.parquet."
    return Cases(columns=columns, caption=caption)


def _number(value: float | None, factor: float, none: str = "-") -> str:
    return none if value is None else f"{value * factor:.4g}"


def _percent(share: float) -> str:
    return f"{100.0 * share:.3g} %"


def _end(value: Any) -> str:
    return value if isinstance(value, str) else f"{value:.4g}"


def _sentence(text: str) -> str:
    return f"{text[0].upper()}{text[1:]}."

"""The page of a blind proof: how often the diagnosis was right, when nothing was there, and every case it failed."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

from rollover.effects import spoken
from rollover.system.numbers import percent
from viz.content.blocks import (
    Block,
    Cell,
    Details,
    Figure,
    Footer,
    Headline,
    Note,
    Pairs,
    Section,
    State,
    Table,
    as_sentence,
)
from viz.figures.counts import Share, confusion, shares
from viz.pages.page import render
from viz.pages.proof_real import sections

WRONG = 0.10  # share of false alarms, at the upper end of its interval, from which on the page warns
COVERAGE = (0.90, 0.99)  # where the share of 95 % intervals that hold the truth should lie
FIRST = {
    "named_first": "of those, named first",
    "in_set": "of those, in the set offered",
    "alone_and_right": "of those, alone and right",
    "verdict_right": "verdict right (all cases)",
    "channel_right": "channel right",
    "place_right": "place right",
}
LINES = {"by_strength": "signal to noise", "by_noise": "noise, share of range", "by_recordings": "recordings"}
KINDS = {"unexplained": "unexplained", "near": "a near name", "wrong": "a wrong name", "missed": "nothing"}


def page(report: Mapping[str, Any], *, command: str, versions: Mapping[str, str]) -> str:
    """HTML of a proof from its prove.json, or of answers to sealed cases from their score.json."""
    summary = report["summary"]
    is_proof = "seed" in report
    title = f"Blind proof of the diagnosis: {summary['cases']} concealed cases, seed {report.get('seed')}"
    if not is_proof:
        title = f"Answers by {report['by'] or 'somebody'} to {summary['cases']} sealed cases"
    blocks = [*_answers(summary), *_false_alarms(summary), *_confusion(summary), *_groups(summary)]
    blocks += [*sections(summary), *_values(summary), *_failures(report), *_seal(report)]
    seal = report["seal"]["digest"]
    return render(
        title=title,
        subtitle="Cases made by an independent solver, sealed before the first "
        + ("diagnosis" if is_proof else "answer"),
        headline=headline(summary),
        blocks=blocks,
        footer=Footer(command=command, scenario_hash=seal, hash_of="Seal", versions=versions),
    )


def headline(summary: Mapping[str, Any]) -> Headline:
    """What was detected and named alone and right, against what was called although nothing was there."""
    seen, alarms, failed = summary["detected"], summary["false_alarms"], summary["failed"]
    right = summary["alone_and_right"]["hits"]
    parts = (
        [f"{_fraction(seen)} single effects were detected, {right} of them named alone and right"] if seen["of"] else []
    )
    parts += [f"{_fraction(alarms)} cases without an effect were false alarms"] if alarms["of"] else []
    detail = [f"{len(failed)} diagnos{'is' if len(failed) == 1 else 'es'} failed"] if failed else []
    if alarms["of"]:
        detail.append(f"with {alarms['of']} such cases the rate of false alarms is at most {percent(alarms['high'])}")
    state: State = "fail" if failed else ""
    if not failed and alarms["of"]:
        state = "warn" if alarms["high"] > WRONG else "pass"
    sentence = "; ".join(parts) or f"{summary['cases']} cases"
    text = "; ".join(detail)
    return Headline(sentence=f"{sentence}.", detail=f"{as_sentence(text)}." if text else "", state=state)


def _answers(summary: Mapping[str, Any]) -> list[Block]:
    rows = {"detected": "detected", **FIRST}
    found = [_share(name, summary[key]) for key, name in rows.items()]
    pairs = summary["two_effects"]
    found += [_share("two effects: both named", pairs["both"]), _share("two: both in sets", pairs["both_in_sets"])]
    figure = Figure(
        svg=shares([s for s in found if s.of]),
        caption="Of the cases each row applies to, with exact binomial 95 % intervals. Single effects, unless it says "
        "otherwise.",
    )
    return [Section(title="How often it was right", blocks=[figure])]


def _false_alarms(summary: Mapping[str, Any]) -> list[Block]:
    if not summary["false_alarms"]["of"]:
        return []
    found = [_share("all without an effect", summary["false_alarms"])]
    found += [_share(kind, share) for kind, share in summary["false_alarms_by_kind"].items()]
    blocks: list[Block] = [
        Figure(
            svg=shares([s for s in found if s.of]),
            caption="False alarms: null has nothing hidden, decoy an effect that no channel shows, negligible an "
            "effect far below the noise, background nothing but a background.",
        )
    ]
    p = summary["p_values"]
    if p["p_value"] is not None:
        text = f"p-values where nothing was, against the uniform distribution: KS {p['statistic']:.3f} over {p['of']}"
        blocks.append(Note(text=f"{text}, p = {p['p_value']:.2g}."))
    return [Section(title="Cases without an effect", blocks=blocks)]


def _confusion(summary: Mapping[str, Any]) -> list[Block]:
    table = summary["confusion"]
    if not table:
        return []
    caption = "Truth down, what was named first across; green is right. Cases with two effects are left out."
    rows: list[list[str | Cell]] = [
        [
            truth,
            str(sum(n for said, n in line.items() if _right(truth, said))),
            ", ".join(f"{said} {n}" for said, n in line.items() if not _right(truth, said)),
        ]
        for truth, line in table.items()
    ]
    listed = Table(columns=["truth", "right", "named instead"], rows=rows, numeric=(1,))
    blocks: list[Block] = [
        Figure(svg=confusion(table, _right), caption=caption),
        Details(summary="As a list", blocks=[listed]),
    ]
    return [Section(title="Confusion matrix", blocks=blocks)]


def _groups(summary: Mapping[str, Any]) -> list[Block]:
    columns = ["cases", "detected", "first", "in set", "alone", "value error", "coverage"]
    found: list[Block] = []
    for key, name in {**LINES, "by_effect": "effect"}.items():
        rows: list[list[str | Cell]] = [
            [
                group.replace("to inf", "and more"),
                str(line["cases"]),
                *(_fraction(line[part]) for part in ("detected", "first", "in_set", "alone")),
                "" if line["parameter_error"] is None else percent(line["parameter_error"]),
                _fraction(line["coverage"]),
            ]
            for group, line in sorted(summary[key].items(), key=lambda item: _place(item[0]))
        ]
        if rows:
            found.append(Table(columns=[name, *columns], rows=rows, numeric=range(1, 8)))
    caption = "Single effects. Value error: median of |found - true| / |true|; coverage: 95 % intervals with the truth."
    return (
        [Section(title="By strength, noise, recordings and effect", blocks=[*found, Note(text=caption)])]
        if found
        else []
    )


def _place(group: str) -> tuple[float, str]:
    """Bins in the order of their numbers, names in that of the alphabet."""
    first = group.split()[0]
    try:
        return float(first), group
    except ValueError:
        return 0.0, group


def _right(truth: str, said: str) -> bool:
    """Whether a name is right; physics that no list has is to be called unexplained."""
    return said == truth or (truth.startswith("outside:") and said == "unexplained")


def _values(summary: Mapping[str, Any]) -> list[Block]:
    rows: list[tuple[str, str]] = []
    cover, error, held = summary["coverage"], summary["parameter_error"], summary["held_out"]
    outside = summary["outside"]
    if error["of"]:
        rows.append(
            ("error of the values", f"median {percent(error['median'])}, 9 of 10 below {percent(error['p90'])}")
        )
    if held["of"]:
        gain = f"median ratio after / before {held['median_ratio']:.3g} over {held['of']} cases, {held['worse']} worse"
        rows.append(("misfit on what was held out", gain))
    if outside["unexplained"]["of"]:
        said = ", ".join(f"{words} {outside[key]['hits']}" for key, words in KINDS.items())
        rows.append(("physics that no list has", f"of {outside['unexplained']['of']}: {said}"))
    if outside["dependence_right"]["of"]:
        rows.append(("  what it depends on", _fraction(outside["dependence_right"])))
    seconds = summary["seconds"]
    if seconds["median"] is not None:
        rows.append(("time", f"median {seconds['median']:.3g} s, at most {seconds['most']:.3g} s for each diagnosis"))
    blocks: list[Block] = [Pairs(rows=rows)] if rows else []
    if cover["of"]:
        aimed = Share(
            name="intervals with the truth", aim=COVERAGE, **{k: cover[k] for k in ("hits", "of", "low", "high")}
        )
        blocks.append(Figure(svg=shares([aimed]), caption="Coverage of the stated 95 % intervals; shaded: 90 to 99 %."))
    return [Section(title="Values, held-out data, unlisted physics", blocks=blocks)] if blocks else []


def _failures(report: Mapping[str, Any]) -> list[Block]:
    blocks: list[Block] = []
    failed = [row for row in report["rows"] if row["failed"]]
    if failed:
        rows: list[list[str | Cell]] = [
            [row["case"], row["kind"], _listed(row["truth"]), row["failure"]] for row in failed
        ]
        blocks.append(Table(columns=["failed", "kind", "truth", "why"], rows=rows))
    wrong = [m for m in report["summary"]["misses"] if m["case"] not in report["summary"]["failed"]]
    if wrong:
        cells: list[list[str | Cell]] = [
            [
                m["case"],
                m["kind"],
                _listed(m["truth"]),
                Cell(str(m["verdict"]), "fail"),
                _listed(m["named"]) or "nothing",
                spoken(m["signal_to_noise"]),
            ]
            for m in wrong
        ]
        columns = ["wrong", "kind", "truth", "verdict", "named", "signal to noise"]
        blocks.append(Table(columns=columns, rows=cells, numeric=(5,)))
    return [Section(title="Every case that went wrong", blocks=blocks or [Note(text="None.")])]


def _seal(report: Mapping[str, Any]) -> list[Block]:
    rule = f"{report['seal']['algorithm']}: {report['seal']['digest']}."
    text = f"It was shown before the first diagnosis; truth.json beside this page has salt and truths. {rule}"
    if "seed" not in report:
        text = f"It stands beside the cases; the truth that was read for this page has the salt. {rule}"
    return [Section(title="The seal", blocks=[Note(text=text)])]


def _share(name: str, found: Mapping[str, Any]) -> Share:
    low, high = found["low"] or 0.0, 1.0 if found["high"] is None else found["high"]
    return Share(name=name, hits=found["hits"], of=found["of"], low=low, high=high)


def _fraction(found: Mapping[str, Any]) -> str:
    return f"{found['hits']} of {found['of']}" if found["of"] else ""


def _listed(names: Sequence[str]) -> str:
    return ", ".join(names)

"""The part of a proof's page on what is real: foreign forms, backgrounds, grades, probabilities."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from rollover.effects import spoken
from viz.content.blocks import Block, Cell, Figure, Note, Section, Table
from viz.figures.counts import Share, shares
from viz.figures.reliability import reliability

COUNTS = {
    ("of_all", "in_set"): "one effect: in the set",
    ("of_all", "first"): "named first",
    ("of_all", "alone"): "alone",
    ("stronger_than_background", "in_set"): "in the set, larger than the background",
    ("called", "another_name"): "called by another name",
    ("called", "another_name_whole"): "of these said to be the whole",
    ("called", "unexplained"): "unexplained",
    ("background_alone", "false_name"): "background alone: a name",
    ("background_alone", "unexplained"): "background alone: unexplained",
    ("unlisted", "wrong_name"): "unlisted: a wrong name",
    ("unlisted", "wrong_name_whole"): "unlisted: a wrong name as the whole",
}
GROUPS = {"by_form": "effect, form", "by_background": "background", "by_over_background": "effect over background"}


def sections(summary: Mapping[str, Any]) -> list[Block]:
    """Sections of the page; none where no case had a foreign form or a background and no probability was given."""
    return [*_real(summary.get("real")), *_probabilities(summary.get("probabilities"))]


def _real(real: Mapping[str, Any] | None) -> list[Block]:
    if real is None:
        return []
    rows = [
        Share(name=name, **{k: real[part][key][k] for k in ("hits", "of", "low", "high")})
        for (part, key), name in COUNTS.items()
        if real[part][key]["of"]
    ]
    blocks: list[Block] = []
    if rows:
        caption = "Of all such cases, detected or not; exact binomial 95 % intervals."
        blocks.append(Figure(svg=shares(rows), caption=caption))
    for key, name in GROUPS.items():
        lines: list[list[str | Cell]] = [
            [
                group.replace("to inf", "and more"),
                str(line["cases"]),
                *(str(line[part]["hits"]) for part in ("detected", "in_set", "first", "alone", "another_name")),
                "" if line["signal_to_noise"] is None else spoken(line["signal_to_noise"]),
            ]
            for group, line in real[key].items()
        ]
        if lines:
            columns = [name, "cases", "detected", "in set", "first", "alone", "another name", "signal to noise"]
            blocks.append(Table(columns=columns, rows=lines, numeric=range(1, 8)))
    if real["grades"]:
        graded: list[list[str | Cell]] = [
            [grade, str(line["right"]), str(line["wrong"])] for grade, line in sorted(real["grades"].items())
        ]
        blocks.append(Table(columns=["said to be", "right", "wrong"], rows=graded, numeric=(1, 2)))
    cover = real["explained"]["coverage"]
    if cover["of"]:
        blocks.append(Note(text=f"Shares explained: {cover['hits']} of {cover['of']} intervals hold the true one."))
    return [Section(title="Foreign forms and backgrounds", blocks=blocks)] if blocks else []


def _probabilities(given: Mapping[str, Any] | None) -> list[Block]:
    if given is None:
        return []
    blocks: list[Block] = []
    if given["bins"]:
        slope = "" if given["slope"] is None else f", slope {given['slope']:.2f}"
        text = f"{given['cases']} cases: Brier score {given['brier']:.3f}, log score {given['log']:.3f}{slope}."
        caption = "Probability given against the share that came true, by tenths, with exact binomial 95 % intervals."
        blocks += [Note(text=text), Figure(svg=reliability(given["bins"]), caption=caption)]
    if given["flawed"]:
        blocks.append(Note(text=f"Not scored, for they are no probabilities: {'; '.join(given['flawed'])}."))
    return [Section(title="Probabilities over names", blocks=blocks)] if blocks else []

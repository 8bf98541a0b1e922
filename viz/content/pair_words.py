"""What separates two runs, in words: the same for the page and for the viewer."""

from __future__ import annotations

from rollover.comparison.run_pair import Change, LoadChange, Pair
from rollover.system.numbers import percent
from viz.content.entities import series
from viz.content.verdict import amount

MOST = 20  # changed values that are listed in the viewer


def answer(found: Pair) -> str:
    """The leading load in both runs, or why there is none."""
    for side, result in (("baseline", found.baseline), ("candidate", found.candidate)):
        if result.answer["status"] != "done":
            return f"The {side} failed: {result.answer['sentence']}."
    load = found.leading
    if load is None:
        return "No load was recorded in both runs."
    return f"{named(load.channel)}: {value(load, load.was)} before, {value(load, load.now)} now: {relative(load)}."


def detail(found: Pair) -> str:
    """How sure that is, how many loads changed, and how many values of the scenario."""
    parts = []
    load = found.leading
    if load is not None and load.change:
        known = "what half the step changes was examined in neither run"
        parts.append(known if load.step is None else f"half the step changes it by {percent(load.step)}")
    moved = sum(x.verdict.startswith("changed") for x in found.loads)
    parts.append(f"{moved} of {len(found.loads)} loads changed by more than the step's error as far as that is known")
    count = len(found.changes)
    parts.append(f"{count} value{'s' * (count != 1)} of the scenario differ{'s' * (count == 1)}")
    parts += [f"{v.name}: {v.was} before, {v.now} now" for v in found.verdicts]
    text = "; ".join(parts)
    return f"{text[0].upper()}{text[1:]}."


def markdown(found: Pair) -> str:
    """The answer, the loads and what was changed, for the viewer."""
    lines = [f"# {answer(found)}", "", detail(found), ""]
    lines += ["| load | baseline | candidate | change | |", "|---|---|---|---|---|"]
    for x in found.loads:
        cells = (named(x.channel), value(x, x.was), value(x, x.now), relative(x), x.verdict)
        lines.append("| " + " | ".join(cells) + " |")
    lines += ["", f"Baseline: {found.baseline.folder}, orange. Candidate: {found.candidate.folder}, blue.", ""]
    if found.changes:
        lines += ["| value | baseline | candidate |", "|---|---|---|"]
        lines += [f"| `{c.path}` | {was} | {now} |" for c in found.changes[:MOST] for was, now in [both(c)]]
    if len(found.changes) > MOST:
        lines += ["", f"and {len(found.changes) - MOST} more, see the page."]
    return "\n".join(lines)


def named(channel: str) -> str:
    """Name of a load, as a heading begins."""
    name = series(channel).name
    return name[:1].upper() + name[1:]


def value(load: LoadChange, peak: float | None) -> str:
    """A peak in the unit for people."""
    s = series(load.channel)
    return "none" if peak is None else amount(peak, s.unit or load.unit, s.factor if s.unit else 1.0)


def relative(load: LoadChange) -> str:
    """The relative change."""
    return "" if load.change is None else f"{100.0 * load.change:+.3g} %"


def both(change: Change) -> tuple[str, str]:
    """Both values of the scenario, as a file would have them, with their unit."""
    texts = []
    for given in (change.was, change.now):
        text = "none" if given is None else " ".join(str(given).split())
        text = text if len(text) <= 40 else text[:37] + "..."
        texts.append(text if given is None or change.unit == "1" else f"{text} {change.unit}".rstrip())
    return texts[0], texts[1]

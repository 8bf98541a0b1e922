"""Two corpora side by side: counts with their intervals, and every entry that says anything else."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from statistics import median
from typing import Any

from tests.corpus.plan import plan

Entry = Mapping[str, Any]
TIMES = ("cpu", "wall")
NOTHING = ("null", "decoy", "negligible")


def compared(old: Mapping[str, Any], new: Mapping[str, Any]) -> tuple[str, bool]:
    """Text of a comparison, and whether nothing but times differs: an entry that one of the two lacks differs too.

    What both were not asked for (`share`) is left out.
    """
    asked = [job.id for job in plan(min(old["share"], new["share"]))]
    before, after = old["entries"], new["entries"]
    both = [id for id in asked if id in before and id in after]
    text = [f"{len(both)} of {len(asked)} entries compared"]
    text += [
        f"made with other {key}: {old[key]} -> {new[key]}" for key in ("machine", "versions") if old[key] != new[key]
    ]
    text += _table([before[id] for id in both], [after[id] for id in both])
    changed = {id: lines for id in both if (lines := list(differences(before[id], after[id])))}
    text += [f"{id}\n" + "\n".join(f"    {line}" for line in lines) for id, lines in changed.items()]
    lacking = [(id, which) for which, one in (("OLD", before), ("NEW", after)) for id in asked if id not in one]
    text += [f"{id}: not in {which}" for id, which in lacking]
    text.append(f"{len(changed)} of {len(both)} entries changed, {len(lacking)} are lacking")
    return "\n".join(text), bool(both) and not changed and not lacking


def differences(old: Any, new: Any, path: str = "") -> Iterator[str]:
    """What differs between two entries, times left out: exactly, with the relative size of a number's change."""
    if isinstance(old, Mapping) and isinstance(new, Mapping):
        for key in [*old, *(key for key in new if key not in old)]:
            if path or key not in TIMES:
                yield from differences(old.get(key), new.get(key), f"{path}.{key}" if path else key)
    elif path == "names" and [_name(n) for n in old] != [_name(n) for n in new]:
        yield f"names: {[_name(n) for n in old]} -> {[_name(n) for n in new]}"
    elif isinstance(old, list) and isinstance(new, list) and len(old) == len(new):
        for k, (one, other) in enumerate(zip(old, new, strict=True)):
            yield from differences(one, other, f"{path}[{_name(one) or k}]")
    elif old != new or type(old) is not type(new):
        yield f"{path}: {old} -> {new}{_relative(old, new)}"


def _name(entry: Any) -> str:
    """How a named effect, or a load, is called in a list; nothing for all else."""
    if isinstance(entry, Mapping) and "id" in entry:
        return entry["id"] + (f" of {entry['channel']}" if entry.get("channel") else "")
    if isinstance(entry, list) and len(entry) == 5 and isinstance(entry[0], str):
        return f"{entry[0]}, {entry[1]}"
    return ""


def _relative(old: Any, new: Any) -> str:
    if not all(isinstance(x, (int, float)) and not isinstance(x, bool) for x in (old, new)) or old == new:
        return ""
    return f" ({(new - old) / max(abs(old), abs(new)):+.2g})"


def share(hits: int, of: int) -> str:
    """A count with its exact binomial (Clopper-Pearson) interval at 95 %."""
    from scipy.stats import binomtest

    if not of:
        return "none"
    found = binomtest(hits, of).proportion_ci(0.95, method="exact")
    return f"{hits} of {of} ({100 * found.low:.0f} to {100 * found.high:.0f} %)"


def _table(old: Sequence[Entry], new: Sequence[Entry]) -> list[str]:
    """Lines of what was found, by rig, old beside new."""
    lines = [f"{'':44} {'old':>26} {'new':>26}"]
    for rig in ("drop", "overturn"):
        mine = [[e for e in one if e.get("rig") == rig] for one in (old, new)]
        if not mine[0]:
            continue
        for what, count in COUNTS.items():
            lines.append(f"{f'{rig}: {what}':44} {share(*count(mine[0])):>26} {share(*count(mine[1])):>26}")
        for what, number in MEDIANS.items():
            lines.append(f"{f'{rig}: {what}':44} {number(mine[0]):>26} {number(mine[1]):>26}")
    return lines


def _of(key: str, *kinds: str) -> Callable[[Sequence[Entry]], tuple[int, int]]:
    """Counts entries of some kinds whose score is true, of those to which it applies."""

    def count(entries: Sequence[Entry]) -> tuple[int, int]:
        applies = [e["score"][key] for e in entries if e["kind"] in kinds and key in e["score"]]
        return sum(applies), len(applies)

    return count


def _claimed(claim: str) -> Callable[[Sequence[Entry]], tuple[int, int]]:
    def count(entries: Sequence[Entry]) -> tuple[int, int]:
        unlisted = [str(e["score"].get("claim")) for e in entries if e["kind"] == "outside"]
        return sum(c.partition(",")[0] == claim for c in unlisted), len(unlisted)

    return count


def _covered(entries: Sequence[Entry]) -> tuple[int, int]:
    held = [is_held for e in entries for _, is_held in e["covers"]]
    return sum(held), len(held)


COUNTS: dict[str, Callable[[Sequence[Entry]], tuple[int, int]]] = {
    "nothing there, a false alarm": _of("false_alarm", *NOTHING),
    "one effect, detected": _of("detected", "single"),
    "of those, named first": _of("first", "single"),
    "of those, in the set": _of("in_set", "single"),
    "of those, alone and right": _of("alone", "single"),
    "two effects, both named": _of("both", "pair"),
    "two effects, both in the sets": _of("both_in_sets", "pair"),
    "unlisted, unexplained": _claimed("unexplained"),
    "unlisted, a near name": _claimed("near"),
    "unlisted, a wrong name": _claimed("wrong"),
    "unlisted, missed": _claimed("missed"),
    "cases with a false name": lambda entries: (sum(bool(e["false_names"]) for e in entries), len(entries)),
    "intervals that hold the truth": _covered,
    "diagnoses that failed": lambda entries: (sum(bool(e["failure"]) for e in entries), len(entries)),
}
MEDIANS: dict[str, Callable[[Sequence[Entry]], str]] = {
    "median CPU time with start and making, s": lambda entries: f"{median(e['cpu'] for e in entries):.1f}",
    "median wall time of the diagnosis, s": lambda entries: f"{median(e['wall'] for e in entries):.1f}",
    "median number of simulations": lambda entries: f"{median(e['simulations'] or 0 for e in entries):.0f}",
}

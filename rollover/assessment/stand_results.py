"""What a test stand found, as a table and a sentence that people read on the terminal and on a page."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

Entry = Mapping[str, Any]


@dataclass(frozen=True, kw_only=True)
class Findings:
    """Rows under headings, the first columns of `words` being text, and the answer in a sentence."""

    headings: tuple[str, ...]
    rows: tuple[tuple[str, ...], ...]
    sentence: str
    words: int = 1


def findings(tests: Sequence[Entry]) -> Findings | None:
    """Of a run's `tests`; None where there were none."""
    return _OF[tests[0]["kind"]](tests) if tests else None


def _loads(tests: Sequence[Entry]) -> Findings:
    headings = (
        "load",
        "from",
        "status",
        "energy kJ",
        "force kN",
        "peak kN",
        "deflection mm",
        "permanent set mm",
        "overload test",
    )
    rows = []
    for e in tests:
        over = e["overload"]
        due = "" if not over else "not due" if not over["required"] else "passed" if over["passed"] else "not passed"
        rows.append(
            (
                e["name"],
                e["come_from"],
                e["status"],
                *(_number(e.get(k), f) for k, f in (("energy", 1e-3), ("force", 1e-3), ("peak_force", 1e-3))),
                *(_number(e.get(k), 1e3) for k in ("deflection", "permanent_set")),
                due,
            )
        )
    reached = sum(e["status"].startswith(("reached", "pushed on")) for e in tests)
    begun = sum(e["status"] != "not a step of the code" for e in tests)
    sentence = f"{reached} of {begun} loads that began reached what they were given"
    return Findings(headings=headings, rows=tuple(rows), sentence=sentence, words=3)


def _pendulum(tests: Sequence[Entry]) -> Findings:
    e = tests[0]
    if e["status"] == "not struck":
        return Findings(headings=("blow", "status"), rows=((e["name"], e["status"]),), sentence="The block missed")
    when = (("at_turning_point", "when the block turned, kJ"), ("at_end_of_contact", "when contact ended, kJ"))
    given = [(key, heading) for key, heading in when if key in e]
    names = [name for name in e[given[0][0]] if any(e[key][name] for key, _ in given)] if given else []
    sentence = (
        f"The block struck at {e['block_speed']:.2f} m/s with {1e-3 * e['block_energy']:.2f} kJ and gave away at most "
        f"{1e-3 * e['given_most']:.2f} kJ; the struck point deflected {1e3 * e['deflection']:.0f} mm, tractor and all"
    )
    return Findings(
        headings=("taken by", *(heading for _, heading in given)),
        rows=tuple((name, *(_number(e[key][name], 1e-3) for key, _ in given)) for name in names),
        sentence=sentence,
    )


def _tilt(tests: Sequence[Entry]) -> Findings:
    e = tests[0]
    rows = [(f"wheel {name.replace('_', ' ')} lifts", _number(angle)) for name, angle in e["lift_off_deg"].items()]
    rows += [("front axle meets its stop", _number(e["stop_contact_deg"]))]
    rows += [
        ("no uphill wheel touches any more", _number(e["unstable_deg"])),
        ("table stopped", _number(e["table_deg"])),
    ]
    over = e["unstable_deg"]
    sentence = f"Stood up to {e['table_deg']:.2f} deg" if over is None else f"Goes over at {over:.2f} deg"
    if e["first_lift_off_deg"] is not None:
        sentence += f"; the first wheel lifts at {e['first_lift_off_deg']:.2f} deg"
    return Findings(headings=("event", "table, deg"), rows=tuple(rows), sentence=sentence)


def _shaker(tests: Sequence[Entry]) -> Findings:
    e = tests[0]
    sentence = (
        f"{e['turns']:.0f} turns at {e['frequency']:g} Hz with {1e-3 * e['force_amplitude']:.2f} kN: swings by "
        f"+-{1e3 * e['deflection_amplitude']:.2f} mm in the end, work of the exciter {1e-3 * e['work']:.3f} kJ"
    )
    rows = tuple((str(s["turns"]), _number(s["settlement"], 1e3)) for s in e["settlement"])
    return Findings(headings=("turns", "settlement mm"), rows=rows, sentence=sentence)


def _hammer(tests: Sequence[Entry]) -> Findings:
    headings = ("blow", "at s", "energy kJ", "into the pile kJ", "set mm", "deepest mm", "on the soil kJ")
    keys = (("struck_at", 1.0), ("blow_energy", 1e-3), ("into_striker", 1e-3), ("set", 1e3), ("deepest", 1e3))
    rows = [(e["name"], *(_number(e.get(k), f) for k, f in (*keys, ("work_on_soil", 1e-3)))) for e in tests]
    driven = sum(e.get("set") or 0.0 for e in tests)
    sentence = (
        f"{len(tests)} blows drive it {1e3 * driven:.0f} mm, the last one {_number(tests[-1].get('set'), 1e3)} mm"
    )
    return Findings(headings=headings, rows=tuple(rows), sentence=sentence)


def _number(value: float | None, factor: float = 1.0) -> str:
    return "-" if value is None else f"{round(value * factor, 3) + 0.0:.4g}"


_OF: Mapping[str, Callable[[Sequence[Entry]], Findings]] = {
    "static-load": _loads,
    "pendulum-blow": _pendulum,
    "tilt-table": _tilt,
    "harmonic": _shaker,
    "blow": _hammer,
}

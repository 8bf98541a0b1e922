"""Drops with what every rig adds and no model has, diagnosed by a user who states nothing, and by some who state more.

    python -m tests.benchmarks.background --cases 16 --seed 1 --kind single [--background 0.03] [--own] [--out FILE]

Six drops each by the proof's own solver, on each case a smooth discrepancy of a family that the engine does not know
(`rollover.proof.background`), or none. `null` has nothing else in it, `single` one effect by a law of the literature
that is not the product's, or with `--own` by the product's, `unlisted` what no table of effects holds. Fits that two
ways have in common are made once: the CPU time of each way is what it takes beyond those before it. `--quick` looks for
one effect before the second opinion too, where three are looked for otherwise: a fifth of the time, and what two
effects explain is not found.
"""

from __future__ import annotations

import argparse
import itertools
import json
import math
import tempfile
import time
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any
from unittest.mock import patch

from rollover.diagnosis import conclusion, diagnose, json_of
from rollover.diagnosis.alone import fit_single_effect
from rollover.diagnosis.fit.jobs import Executor
from rollover.diagnosis.io import recordings_in
from rollover.proof.counts import share
from rollover.proof.generator import Case, Order, extent, make, plan
from rollover.proof.handover import write_case
from rollover.proof.score import score
from rollover.scenario import load

DROPS = 6  # of each case
PLANNED = 1800  # cases, of which the first are taken: those of fewer cases begin those of more
WAYS: dict[str, dict[str, Any]] = {
    "--no-estimate": {"estimate": False},
    "--second-opinion": {"estimate": "unexplained"},  # as with nothing stated
    "--estimate": {"estimate": True},
    "--tolerance 0.05": {"tolerance": 0.05},
}
KINDS = ("null", "single", "unlisted")
COUNTED = ("in the set", "first", "another name", "that called whole", "unexplained", "no-mismatch", "broken rules")


def cases(
    count: int, seed: int, kind: str, background: float | str | None, *, own: bool, most: float = math.inf
) -> Iterator[Case]:
    """The first `count` cases of a kind that have six drops, and no more than `most` samples."""

    def is_able(order: Order) -> bool:
        drops, samples = extent(order)
        return drops == DROPS and samples < most

    called = {"null": "background" if background else "null", "unlisted": "outside"}
    called["single"] = "single" if own else "foreign-form"
    return map(make, itertools.islice(filter(is_able, plan(PLANNED, seed, [called[kind]], (), background)), count))


def diagnosed(case: Case, ways: Sequence[str]) -> Iterator[dict[str, Any]]:
    """A row of each way: what it says against the truth, and its CPU time, s."""
    with tempfile.TemporaryDirectory() as folder:
        write_case(case, Path(folder, case.name))
        scenario, recordings = load(Path(folder, case.name, "scenario.yaml")), recordings_in(Path(folder, case.name))
    with Executor(1) as executor:
        for way in ways:
            began = time.process_time()
            said = json_of(diagnose(scenario, recordings, executor=executor, **WAYS[way]))
            yield counted(case, said) | {"way": way, "cpu": time.process_time() - began}


def counted(case: Case, said: dict[str, Any]) -> dict[str, Any]:
    """What is counted of one answer, and what it is worth reading again for."""
    row = score(case.truth, said)
    named = list(row["named"])
    if case.truth["kind"] == "outside":
        wrong = str(row["claim"]).startswith("wrong")
    else:
        wrong = bool(named) and not row["in_set"]
    return {
        "case": case.name,
        "truth": row["truth"],
        "over_noise": row["over_noise"],
        "over_background": row["over_background"],
        "named": named,
        "set": row["set"],
        "verdict": said["verdict"],
        "answer": said.get("answer"),
        "explained": row["explained"],
        "broken": said["invariants"]["broken"],
        "in the set": bool(row["in_set"]),
        "first": bool(row["first"]),
        "another name": wrong,
        "that called whole": wrong and said.get("answer") == "whole",
        "unexplained": said["verdict"] == "unexplained",
        "no-mismatch": said["verdict"] == "no-mismatch",
        "broken rules": bool(said["invariants"]["broken"]),
    }


def table(rows: Sequence[dict[str, Any]]) -> str:
    """Counts of each way with exact 95 % intervals."""
    lines = []
    for way in dict.fromkeys(r["way"] for r in rows):
        mine = [r for r in rows if r["way"] == way]
        cpu = sorted(r["cpu"] for r in mine)[len(mine) // 2]
        lines.append(f"{way}: {len(mine)} cases, {cpu:.0f} s of CPU each (median)")
        for what in COUNTED:
            found = share(sum(r[what] for r in mine), len(mine))
            ends = f"{100 * found['low']:.0f} to {100 * found['high']:.0f} %"
            lines.append(f"    {what:18} {found['hits']:3d} of {found['of']} ({ends})")
    return "\n".join(lines)


def main() -> None:
    """Make, diagnose, count."""
    asked = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    asked.add_argument("--cases", type=int, default=16)
    asked.add_argument("--seed", type=int, default=1)
    asked.add_argument("--kind", choices=KINDS, default="single")
    asked.add_argument("--background", default="0.03", help="share of the force's range, drawn, or none")
    asked.add_argument("--own", action="store_true", help="effects by the product's own laws")
    asked.add_argument("--ways", nargs="+", choices=list(WAYS), default=list(WAYS))
    asked.add_argument("--most", type=float, default=math.inf, help="samples of a case")
    asked.add_argument("--quick", action="store_true", help="one effect is looked for before the second opinion too")
    asked.add_argument("--out", type=Path, help="a line of JSON for each answer, as they come")
    given = asked.parse_args()
    named = {"none": None, "drawn": "drawn"}
    behind = named[given.background] if given.background in named else float(given.background)
    rows: list[dict[str, Any]] = []
    search = fit_single_effect if given.quick else conclusion.explained
    with patch.object(conclusion, "explained", search):
        for case in cases(given.cases, given.seed, given.kind, behind, own=given.own, most=given.most):
            for row in diagnosed(case, given.ways):
                rows.append(row)
                if given.out is not None:
                    with given.out.open("a", encoding="utf-8") as file:
                        file.write(json.dumps(row) + "\n")
    print(table(rows))


if __name__ == "__main__":
    main()

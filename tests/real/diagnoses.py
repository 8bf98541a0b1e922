"""Real recordings, imported as published and diagnosed with a known effect left out: which is named, with what value.

    python -m tests.real.diagnoses $ROLLOVER_DATA/published [--only whiffle-ball-1 ...] [--show] [--write] [--workers 1]

A list of commands and what runs them: nothing here touches a recording. {data} is the folder with the owners' files,
{out} one for the results. `--show` prints the commands and runs nothing; `--write` puts what they answer into
tests/real/diagnoses.json, beside that of the sets not asked for.
"""

from __future__ import annotations

import argparse
import json
import math
import shlex
import subprocess
import sys
import tempfile
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

RESULTS = Path(__file__).with_suffix(".json")
FINAL = "diagnosis"  # folder of the last command of a set


@dataclass(frozen=True, kw_only=True)
class Set:
    """Commands of `rollover`, the last one a diagnosis; what they leave out, and what is published of it."""

    left_out: str
    commands: tuple[str, ...]
    published: str = ""


def balls(*names: str, more: str = "") -> tuple[str, ...]:
    """Drops of balls, which the scenario lets fall without air."""
    chosen = " ".join(f"--select '{name}-?'" for name in names)
    return (
        f"import {{data}}/balls --as falling-balls {chosen} --out {{out}}/recordings",
        f"diagnose ball_drop {{out}}/recordings{more} --out {{out}}/{FINAL}",
    )


def cones(*patterns: str) -> tuple[str, ...]:
    """Cones on water: a scenario without water that moves along, and rigid."""
    chosen = " ".join(f"--select '{pattern}'" for pattern in patterns)
    return (
        f"import {{data}}/cones --as cone-drops {chosen} --out {{out}}/recordings",
        f"diagnose cone_drop {{out}}/recordings --tolerance 0.05 --out {{out}}/{FINAL}",
    )


def cubes(pattern: str) -> tuple[str, ...]:
    """Tosses of a cube onto a table without friction."""
    return (
        f"import {{data}}/cubes --as cube-tosses --select '{pattern}' --out {{out}}/recordings",
        f"diagnose cube_toss {{out}}/recordings --set ground.friction.coefficient=0 --tolerance 0.01"
        f" --out {{out}}/{FINAL}",
    )


def penetrometer(rate: str) -> tuple[str, ...]:
    """Drops into a sea bed on the stand-in soil, with or without its gain of strength with speed."""
    return (
        "import {data}/penetrometer --as soil-penetrometer --out {out}/recordings",
        f"diagnose penetrometer_drop {{out}}/recordings{rate} --tolerance 0.05 --out {{out}}/{FINAL}",
    )


SETS: dict[str, Set] = {
    "whiffle-ball-1": Set(left_out="air-drag", commands=balls("whiffle-ball-1")),
    "yellow-whiffle-ball": Set(left_out="air-drag", commands=balls("yellow-whiffle-ball")),
    "whiffle balls, one held out": Set(
        left_out="air-drag",
        commands=balls(
            "whiffle-ball-1",
            "yellow-whiffle-ball",
            more=" --hold-out yellow-whiffle-ball-1 --hold-out yellow-whiffle-ball-2",
        ),
    ),
    "volleyball": Set(left_out="air-drag", commands=balls("volleyball")),
    "baseball": Set(left_out="air-drag", commands=balls("baseball")),
    "golf-ball": Set(left_out="air-drag", commands=balls("golf-ball")),
    "tennis-ball": Set(left_out="air-drag", commands=balls("tennis-ball")),
    "blue-basketball": Set(left_out="air-drag", commands=balls("blue-basketball")),
    "cones, rigid, 45 deg": Set(
        left_out="soil-added-mass-growth", commands=cones("SR45???[12]"), published="k 0.67, or 0.6 to 1.7"
    ),
    "cones, firm spring, 60 deg": Set(
        left_out="structural-compliance", commands=cones("SF60???[1-4]"), published="7800 N/m"
    ),
    "cones, soft spring, 25 deg": Set(
        left_out="structural-compliance", commands=cones("SS25???[12]"), published="1700 N/m"
    ),
    "cube tosses, 0 to 4": Set(left_out="ground-friction", commands=cubes("toss00[0-4]"), published="mu 0.15 to 0.18"),
    "cube tosses, 5 to 9": Set(left_out="ground-friction", commands=cubes("toss00[5-9]"), published="mu 0.15 to 0.18"),
    "penetrometer, no rate": Set(
        left_out="soil-rate-hardening", commands=penetrometer(" --set ground.law.rate_per_decade=0")
    ),
    "penetrometer": Set(left_out="", commands=penetrometer("")),
}


def study(data: Path, name: str, *, workers: int = 1) -> dict[str, Any]:
    """Run the commands of a set; what the last one answers. ``CalledProcessError`` if one of them fails."""
    one = SETS[name]
    with tempfile.TemporaryDirectory() as out:
        for command in one.commands:
            words = [word.format(data=data, out=out) for word in shlex.split(command)]
            if words[0] == "diagnose":
                words += ["--workers", str(workers)]
            subprocess.run([Path(sys.executable).with_name("rollover"), *words], check=True, stdout=subprocess.DEVNULL)
        found = json.loads(Path(out, FINAL, "diagnosis.json").read_text(encoding="utf-8"))
    return json_of(one, found)


def json_of(one: Set, found: Mapping[str, Any]) -> dict[str, Any]:
    """Numbers of a diagnosis that are worth keeping."""

    def score(which: str) -> dict[str, float | None]:
        held = (found["fit"] or {}).get("held_out", {}).get(which) or {}
        keys = {"nrmse": "nrmse", "iso18571": "iso18571", "peak": "peak_force_error"}
        return {short: rounded(held.get(key)) for short, key in keys.items()}

    return {
        "left_out": one.left_out,
        "published": one.published,
        "commands": [f"rollover {command}" for command in one.commands],
        "verdict": found["verdict"],
        "effects": [
            {
                "id": e["id"],
                **({} if e.get("channel") is None else {"channel": e["channel"]}),
                "parameters": {
                    n: [rounded(p[k]) for k in ("value", "low", "high")] for n, p in e["parameters"].items()
                },
                "indistinguishable_from": e["indistinguishable_from"],
            }
            for e in found["effects"]
        ],
        "before": score("before"),
        "after": score("after"),
        "remaining": found["remaining"]["significant"],
        "depends_on": found["depends_on"],
        "recordings": found["recordings"],
        "next_best": [[c["id"], c["channel"], rounded(c["held_out_gain"])] for c in found["candidates"][:5]],
        "simulations": found["simulations"],
    }


def rounded(x: float | None) -> float | None:
    """Three figures; None for what is no number."""
    return None if x is None or not math.isfinite(x) else float(f"{x:.3g}")


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").partition("\n")[0])
    parser.add_argument("data", type=Path)
    parser.add_argument("--only", nargs="*", default=list(SETS), choices=list(SETS))
    parser.add_argument("--show", action="store_true")
    parser.add_argument("--write", action="store_true")
    parser.add_argument("--workers", type=int, default=1)
    given = parser.parse_args()
    for name in given.only:
        if given.show:
            print(f"# {name}", *(f"rollover {command}" for command in SETS[name].commands), sep="\n")
            continue
        found = study(given.data, name, workers=given.workers)
        named = ", ".join(e["id"] for e in found["effects"]) or "-"
        values = "; ".join(f"{n} {v}" for e in found["effects"] for n, v in e["parameters"].items())
        before, after = (found[k]["nrmse"] for k in ("before", "after"))
        print(f"{name:28s} {found['left_out']:24s} {found['verdict']:16s} {named:30s} {before} -> {after}  {values}")
        if given.write:
            known = json.loads(RESULTS.read_text(encoding="utf-8")) if RESULTS.exists() else {}
            known[name] = found
            ordered = {k: known[k] for k in SETS if k in known}
            RESULTS.write_text(json.dumps(ordered, indent=2) + "\n", encoding="utf-8")


if __name__ == "__main__":
    main()

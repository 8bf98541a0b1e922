"""The study over the static limit against brute force: independent draws by NumPy, each run by itself, counted by hand.

    python -m tests.benchmarks.exceedance [RUNS] [WORKERS] [CASES]

RUNS (1000) brute-force runs beside CASES (256, as shipped) of `slope_side_overturn`, on WORKERS (2) processes.
Nothing of a study is used for them: no plan, no axes, no store, no statistics; an error of these is a difference.
"""

from __future__ import annotations

import sys
import tempfile
import time
from collections.abc import Sequence
from concurrent.futures import ProcessPoolExecutor
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
from scipy.stats import binomtest, fisher_exact

from rollover import studies
from rollover.assessment.loads import peak_loads
from rollover.dynamics import simulate
from rollover.recording import as_numbers, read_table
from rollover.scenario import load
from rollover.studies import case_store
from rollover.studies.plan import Random
from rollover.studies.runner import Way, conduct
from rollover.studies.summary import answers

SLOPES, SCATTER, FRICTION, DURATION = (25.0, 40.0), 0.2714, (0.13, 0.5, 0.85), 2.6  # as the study's file says them
LIMIT = 25e3  # N
SEED = 20261129


def drawn(count: int) -> list[tuple[float, float, float]]:
    """Slope (deg), factor on the soil's stiffness, friction."""
    random = np.random.default_rng(SEED)
    slope, soil = random.uniform(*SLOPES, count), random.lognormal(0.0, SCATTER, count)
    friction = random.triangular(*FRICTION, count)
    return [(float(a), float(b), float(c)) for a, b, c in zip(slope, soil, friction, strict=True)]


def peak(values: tuple[float, float, float]) -> tuple[float, bool, float]:
    """Filtered peak force (N) on the ROPS of one run, whether it began from rest, CPU seconds; NaN for a failed run."""
    slope, soil, friction = values
    began, base = time.process_time(), load("side_overturn_slope")
    law = base.ground.law
    changes = {
        "ground.surface.angle_deg": slope,
        "ground.law.stiffness_scale": law.stiffness_scale * soil,  # type: ignore[attr-defined]
        "ground.friction.coefficient": friction,
        "simulation.duration": DURATION,
    }
    try:
        run = simulate.run(base.replaced(changes))
    except (ValueError, ArithmeticError) as e:
        print(f"{values}: {e}", file=sys.stderr)
        return float("nan"), False, time.process_time() - began
    found = next((p.filtered for p in peak_loads(run) if p.channel == "rops/force"), 0.0)
    return found if run.status == "done" else float("nan"), bool(run.sentence), time.process_time() - began


def by_study(folder: Path, workers: int, cases: int) -> tuple[dict[str, Any], float]:
    """Answers of the study, and its CPU seconds."""
    study = replace(studies.load("slope_side_overturn"), plan=Random(count=cases, seed=1))
    done = conduct(study, folder, Way(workers=workers))
    told, _ = read_table(folder / case_store.PROVENANCE)
    return answers(study, done), float(as_numbers(told["cpu_time"]).sum())


def report(report: dict[str, Any], brute: Sequence[tuple[float, bool, float]]) -> str:
    """Both side by side, and how likely a difference of that size is if there is none."""
    force, rest = (next(o for o in report["outputs"] if o["name"] == n) for n in ("rops/force", "start/from_rest"))
    y = np.array([b[0] for b in brute])
    good = y[np.isfinite(y)]
    lines = [
        f"study: {report['cases']}; brute force: {len(good)} of {len(y)} done",
    ]
    for name, e, hits in (
        ("rops/force above 25 kN", force["exceedance"], int((good > LIMIT).sum())),
        ("overturns from rest", rest["exceedance"], sum(b[1] for b in brute)),
    ):
        by_hand = binomtest(hits, len(good)).proportion_ci(method="exact")
        p = fisher_exact([[e["hits"], e["cases"] - e["hits"]], [hits, len(good) - hits]]).pvalue
        lines.append(
            f"{name}: study {e['probability']:.3f} ({e['low']:.3f} to {e['high']:.3f}), brute force "
            f"{hits / len(good):.3f} ({by_hand.low:.3f} to {by_hand.high:.3f}); p = {p:.2g}"
        )
    for q in force["quantiles"]:
        ends = " to ".join("?" if v is None else f"{1e-3 * v:.1f}" for v in (q["low"], q["high"]))
        exact = 1e-3 * float(np.quantile(good, q["q"]))
        lines.append(f"quantile {q['q']:g}: study {1e-3 * q['value']:.2f} ({ends}), brute force {exact:.2f} kN")
    return "\n".join(lines)


def main() -> None:
    """Run both and print the comparison."""
    given = [int(v) for v in sys.argv[1:]]
    runs, workers, cases = (*given, *(1000, 2, 256)[len(given) :])
    with tempfile.TemporaryDirectory() as folder:
        report, spent = by_study(Path(folder), workers, cases)
    with ProcessPoolExecutor(workers) as pool:
        brute = list(pool.map(peak, drawn(runs), chunksize=5))
    print(report(report, brute))
    print(f"CPU: study {spent:.0f} s, brute force {sum(b[2] for b in brute):.0f} s")


if __name__ == "__main__":
    main()

"""The plain choice beside a diagnosis: each effect alone by least squares with white noise, and the least BIC.

    python -m tests.benchmarks.plain_bic --cases 10 --seed 1 --kinds foreign-form [--background 0.03]

BIC = chi2 + k ln n, with the noise of each channel from before contact and a time shift for each recording; weights
exp(-BIC/2) are its probabilities over names. It is run and scored by the same proof as the diagnosis.
"""

from __future__ import annotations

import argparse
import json
import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from rollover.cli.commands.prove import sentences
from rollover.dynamics.drop_test import DropFailedError, DropModel
from rollover.proof.runner import prove
from rollover.recording import Recording
from rollover.recording.filters import filtered
from rollover.recording.importers import read_recording
from rollover.scenario import load

Array = NDArray[np.float64]
PHYSICS: dict[str, dict[str, tuple[float, ...]]] = {  # parameter -> where a search starts; the first is varied most
    "soil-viscous-damping": {"damping": (30.0, 300.0)},
    "soil-rate-hardening": {"per_decade": (0.02, 0.1)},
    "soil-inertial-drag": {"coefficient": (2.0, 15.0)},
    "soil-added-mass-growth": {"rate": (5.0, 40.0)},
    "soil-elastic-rebound": {"recovery": (0.05, 0.15), "damping_ratio": (0.3,)},
    "soil-adhesion": {"stress": (5e3, 4e4)},
    "soil-layer": {"depth": (0.05, 0.1, 0.15, 0.2), "stiffness_ratio": (1.2,)},
    "soil-crust": {"thickness": (0.02, 0.04, 0.07), "stiffness_ratio": (1.2,)},
    "structural-compliance": {"stiffness": (2e5, 1e6, 3e6), "damping": (500.0,)},
    "guide-friction": {"force": (30.0, 150.0)},
    "air-drag": {"area": (0.1, 2.0)},
    "mass": {"added": (1.0,)},
    "impact-speed": {"scale": (1.01,)},
    "soil-stiffness": {"scale": (1.05,)},
    "co-moving-mass": {"fraction": (0.12,)},
}
SIGNED = ("added", "bias", "offset", "drift")  # the others are positive, and fitted by their logarithm
CHANNELS: dict[str, tuple[str, float, float]] = {  # parameter, start, of which unit (of the channel's range where 0)
    "sensor-gain": ("gain", 1.02, 1.0),
    "sensor-scale": ("scale", 1.02, 1.0),
    "sensor-bias": ("bias", 0.01, 0.0),
    "sensor-lag": ("time", 0.002, 1.0),
    "sensor-clock-offset": ("offset", 0.001, 1.0),
    "sensor-clock-drift": ("drift", 0.01, 1.0),
    "sensor-clipping": ("limit", 0.8, 0.0),
}
LENGTHS = ("ground/sinkage", "striker/position_z")
QUIET = 0.006  # s before the stated contact, up to which nothing has happened
STEP = 2.5e-4  # s of a simulation's rows
EVALUATIONS = 40  # of one fit
FAR = 1e6  # in standard deviations: where a drop could not be solved


@dataclass(frozen=True, kw_only=True)
class Heard:
    """One recording as it is weighed: times, channels over their noise, the simulation's own times."""

    recording: Recording
    noise: dict[str, float]
    grid: Array
    model: DropModel

    def residual(self, changes: Mapping[str, float | str]) -> Array:
        """(Recorded - simulated)/noise of all finite samples, at the time shift that leaves least, (n,)."""
        try:
            run = self.model.with_(changes).run(self.grid) if changes else self.model.run(self.grid)
        except (DropFailedError, ValueError):
            return np.full(self.count, FAR)
        shift = 0.0
        for _ in range(3):
            found, slopes = self._at(run, shift)
            weight = float(slopes @ slopes)
            shift = float(np.clip(shift - float(slopes @ found) / weight if weight else shift, -0.025, 0.025))
        return self._at(run, shift)[0]

    @property
    def count(self) -> int:
        """Finite samples."""
        return sum(int(np.isfinite(self.recording[c]).sum()) for c in self.noise)

    def _at(self, run: Recording, shift: float) -> tuple[Array, Array]:
        t, rows, slopes = self.recording.time - shift, [], []
        even = np.arange(self.grid[0], self.grid[-1], STEP)
        for c, sigma in self.noise.items():
            fine = np.isfinite(self.recording[c])
            at, values = self.grid, run[c]
            if c in self.recording.cfc:
                at, values = even, filtered(np.interp(even, at, values), STEP, self.recording.cfc[c])
            simulated = np.interp(t[fine], at, values)
            later = np.interp(t[fine] - 2e-5, at, values)
            rows.append((self.recording[c][fine] - simulated) / sigma)
            slopes.append(-(later - simulated) / 2e-5 / sigma)
        return np.concatenate(rows), np.concatenate(slopes)


def heard(folder: Path) -> list[Heard]:
    """All recordings of a case."""
    scenario = load(folder / "scenario.yaml")
    recordings = [read_recording(path) for path in sorted(folder.glob("r*.parquet"))]
    pooled: dict[str, list[Array]] = {}
    for recording in recordings:
        quiet = recording.time < -QUIET
        for c in recording.channels:
            rest = recording[c][quiet & np.isfinite(recording[c])]
            if rest.size > 8:  # what rises or falls before contact is no noise
                t = recording.time[quiet & np.isfinite(recording[c])]
                pooled.setdefault(c, []).append(rest - np.polyval(np.polyfit(t, rest, 2), t))
    noise = {c: max(float(np.std(np.concatenate(parts))), 1e-12) for c, parts in pooled.items()}
    found = []
    for recording in recordings:
        model = DropModel(scenario=scenario.replaced(dict(recording.conditions)))
        grid = np.arange(recording.time[0] - 0.03, recording.time[-1] + 0.03, STEP)
        grid = np.union1d(grid, [-1e-9, 1e-9])
        found.append(Heard(recording=recording, noise=noise, grid=grid, model=model))
    return found


def fitted(every: Sequence[Heard], id: str, starts: Mapping[str, Sequence[float]], fixed: Mapping[str, str]) -> float:
    """Chi2 of the best fit of one effect from all starts of its first parameter."""
    from scipy.optimize import least_squares

    names = list(starts)

    def residual(q: Array) -> Array:
        values = [
            float(v) if n in SIGNED else float(np.exp(np.clip(v, -30.0, 30.0))) for n, v in zip(names, q, strict=True)
        ]
        changes: dict[str, float | str] = {f"effects.{id}.{n}": v for n, v in zip(names, values, strict=True)}
        changes |= {f"effects.{id}.{n}": v for n, v in fixed.items()}
        return np.concatenate([h.residual(changes) for h in every])

    best = math.inf
    for first in starts[names[0]]:
        start = [first if n in SIGNED else math.log(first) for n in names[:1]]
        start += [starts[n][0] if n in SIGNED else math.log(starts[n][0]) for n in names[1:]]
        scale = [abs(s) if n in SIGNED else 0.1 for n, s in zip(names, start, strict=True)]
        found = least_squares(residual, start, x_scale=scale, diff_step=1e-3, max_nfev=EVALUATIONS)
        best = min(best, 2.0 * float(found.cost))
    return best


def by_bic(folder: Path, out: Path, workers: int = 1) -> dict[str, Any]:
    """The effect of least BIC, "nothing" among them, and the weights of all."""
    every = heard(folder)
    chi2 = {("nothing", ""): sum(float(np.sum(h.residual({}) ** 2)) for h in every)}
    parameters = {("nothing", ""): 0}
    for id, starts in PHYSICS.items():
        chi2[id, ""] = fitted(every, id, starts, {})
        parameters[id, ""] = len(starts)
    for id, (name, start, unit) in CHANNELS.items():
        for c in every[0].noise:
            if (id == "sensor-scale") != (c in LENGTHS) and id in ("sensor-scale", "sensor-gain"):
                continue
            values = np.concatenate([h.recording[c] for h in every])
            largest = float(np.nanmax(np.abs(values)))
            chi2[id, c] = fitted(every, id, {name: (start * (unit or largest),)}, {"channel": c})
            parameters[id, c] = 1
    count = sum(h.count for h in every)
    bic = {key: value + parameters[key] * math.log(count) for key, value in chi2.items()}
    least = min(bic, key=lambda key: bic[key])
    weights = {key: math.exp(-0.5 * min(value - bic[least], 1e3)) for key, value in bic.items()}
    total = sum(weights.values())
    probabilities: dict[str, float] = {}
    for (id, _), weight in weights.items():
        probabilities[id] = probabilities.get(id, 0.0) + weight / total
    effects = [] if least[0] == "nothing" else [{"id": least[0], **({"channel": least[1]} if least[1] else {})}]
    left = math.sqrt(chi2[least] / count)
    verdict = "missing-physics" if effects else "no-mismatch"
    return {"verdict": verdict, "effects": effects, "probabilities": probabilities, "left": left}


def main() -> None:
    """Prove it as a diagnosis is proved."""
    asked = argparse.ArgumentParser(description=__doc__)
    asked.add_argument("--cases", type=int, default=10)
    asked.add_argument("--seed", type=int, default=1)
    asked.add_argument("--kinds", action="append", default=[])
    asked.add_argument("--background", default=None)
    asked.add_argument("--out", type=Path, default=None)
    given = asked.parse_args()
    behind = given.background if given.background in (None, "drawn") else float(given.background)
    proof = prove(
        given.cases, given.seed, kinds=given.kinds, background=behind, workers=0,
        diagnosis="tests.benchmarks.plain_bic:by_bic",
    )  # fmt: skip
    print("\n".join(sentences(proof.report["summary"])))
    if given.out is not None:
        given.out.write_text(json.dumps(proof.report, indent=1), encoding="utf-8")


if __name__ == "__main__":
    main()

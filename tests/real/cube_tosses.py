"""Friction and restitution of a tumbling cube, fitted to real tosses (Pfrommer, Halm, Posa, ContactNets, CoRL 2020).

    python -m tests.real.cube_tosses FOLDER [--tosses 40] [--json]

FOLDER holds the owners' files, 0.pt and so on; all tosses in one .npz will do too.

Every second toss is fitted, the others are held out, whole. A toss begins with the state at its first row, estimated
from all rows before its first contact: a parabola under gravity for the centre; for the orientation a constant turn,
which is exact for a cube, whose inertia is the same about every axis. What is compared are the eight corners, so that
metres serve for position and orientation alike. Tumbling is chaotic: the fit sees a short window after the first
contact first, then a longer one from there; nothing is asked of what comes later. To be replaced by
`rollover calibrate` once that reads tracked poses.
"""

from __future__ import annotations

import argparse
import json
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import least_squares
from scipy.spatial.transform import Rotation

from rollover.dynamics.simulate import run
from rollover.recording.importers.cube_tosses import METRES, WIDTH
from rollover.recording.importers.tosses import read_toss, toss_files
from rollover.scenario import Scenario, load

Array = NDArray[np.float64]
RATE, HALF, GRAVITY = 148.0, 0.0524, 9.81  # Hz, m, m/s2
CORNERS = HALF * (np.array(np.meshgrid(*[(-1.0, 1.0)] * 3)).reshape(3, -1).T)
WINDOWS = (0.05, 0.15)  # s after the first contact
PUBLISHED = (0.15, 0.125)  # mu, e: estimates made by other tools for these tosses (mu 0.15 to 0.18)
OUTLIER = 0.005  # m, of a corner: beyond it a residual counts linearly
LEAST_FLIGHT = 5  # rows before the first contact


@dataclass(frozen=True, kw_only=True)
class Toss:
    """Tracked poses from the start, and the state there as estimated from the flight."""

    number: int
    time: Array  # (n,)
    centre: Array  # (n, 3)
    turn: Rotation  # n
    contact: float  # s, of the first row that touches
    velocity: Array
    spin: Array  # rad/s, body axes
    velocity_error: float  # m/s, one standard deviation
    spin_error: float  # rad/s

    @property
    def corners(self) -> Array:
        """Tracked corners, (n, 8, 3)."""
        return corners(self.centre, self.turn)


def corners(centre: Array, turn: Rotation) -> Array:
    """Corners of the cube at n poses, (n, 8, 3), world, m."""
    return np.asarray(centre[:, None] + np.einsum("nij,kj->nki", turn.as_matrix(), CORNERS))


def tosses(path: str) -> list[Toss]:
    """All tosses with a flight long enough to begin from."""
    if Path(path).is_dir():
        found_files = [file for _, file in toss_files(Path(path), "toss", ["*"])]
        rows = [read_toss(file, WIDTH, "a toss of the cube")[:, :13] * METRES for file in found_files]
    else:
        file = np.load(path)
        rows = np.split(file["data"], np.cumsum(file["length"])[:-1])
    found = [_toss(number, part) for number, part in enumerate(rows)]
    return [toss for toss in found if toss is not None]


def _toss(number: int, rows: Array) -> Toss | None:
    time = np.arange(len(rows)) / RATE
    turn = Rotation.from_quat(rows[:, [4, 5, 6, 3]])
    lowest = corners(rows[:, :3], turn)[:, :, 2].min(axis=1)
    flight = int(np.argmax(lowest < 0.002))
    if flight < LEAST_FLIGHT:
        return None
    t = time[:flight]
    fallen = rows[:flight, :3] + 0.5 * GRAVITY * t[:, None] ** 2 * [0.0, 0.0, 1.0]
    line, position_noise = _line(t, fallen)
    # R(t) = exp(w t) R(0) in the world: the logarithm of what has been turned since the first row is a line
    turned, turn_noise = _line(t, (turn[:flight] * turn[0].inv()).as_rotvec())
    first = Rotation.from_rotvec(turned[0]) * turn[0]
    spread = np.sqrt(np.sum((t - t.mean()) ** 2))
    return Toss(
        number=number,
        time=time,
        centre=np.concatenate([line[:1], rows[1:, :3]]),
        turn=Rotation.concatenate([first, turn[1:]]),
        contact=float(time[flight]),
        velocity=line[1],
        spin=first.inv().apply(turned[1]),
        velocity_error=position_noise / spread,
        spin_error=turn_noise / spread,
    )


def _line(t: Array, y: Array) -> tuple[Array, float]:
    """Offset and slope of each column, (2, 3), and the standard deviation about them."""
    A = np.stack([np.ones_like(t), t], axis=1)
    found = np.linalg.lstsq(A, y, rcond=None)[0]
    return np.asarray(found), float(np.sqrt(np.sum((y - A @ found) ** 2) / (3 * (len(t) - 2))))


def begun(scenario: Scenario, toss: Toss, duration: float) -> Scenario:
    """The scenario with this toss's start."""
    x, y, z, w = toss.turn[0].as_quat()
    return scenario.replaced(
        {
            "initiation.position": toss.centre[0].tolist(),
            "initiation.velocity": toss.velocity.tolist(),
            "initiation.quaternion": [float(w), float(x), float(y), float(z)],
            "initiation.angular_velocity": toss.spin.tolist(),
            "simulation.duration": duration,
        }
    )


def errors(scenario: Scenario, toss: Toss, window: float) -> Array:
    """Simulated less tracked corners, m, at the rows from the first contact to `window` (s) after it, flat."""
    rows = (toss.time >= toss.contact) & (toss.time <= toss.contact + window + 1e-9)
    at = toss.time[rows]
    found = run(begun(scenario, toss, float(at[-1]) + 0.002)).recording
    centre = np.stack([np.interp(at, found.time, found[f"chassis/position_{k}"]) for k in "xyz"], axis=1)
    # the quaternion has no jumps of sign and is interpolated between rows 0.5 ms apart
    turn = np.stack([np.interp(at, found.time, found[f"chassis/quaternion_{k}"]) for k in "xyzw"], axis=1)
    return np.asarray((corners(centre, Rotation.from_quat(turn)) - toss.corners[rows]).ravel())


def residuals(scenario: Scenario, group: Sequence[Toss], mu: float, e: float, window: float) -> list[Array]:
    """Errors of each toss of a group at given friction and restitution."""
    changed = scenario.replaced({"ground.friction.coefficient": mu, "ground.law.restitution": e})
    return [errors(changed, toss, window) for toss in group]


def fit(scenario: Scenario, group: Sequence[Toss], window: float, starts: Sequence[tuple[float, float]]) -> Any:
    """Robust least squares over ln mu and ln e from each start, the best one; steps well above contact roughness."""

    def cost(x: Array) -> Array:
        mu, e = np.exp(x)
        parts = residuals(scenario, group, float(mu), float(e), window)
        return np.concatenate(parts) / OUTLIER

    box = np.log([0.02, 0.01]), np.log([1.0, 0.95])
    found = [
        least_squares(
            cost, np.log(start), bounds=box, loss="soft_l1", diff_step=0.03, x_scale=[0.3, 0.5], max_nfev=12, xtol=1e-3
        )
        for start in starts
    ]
    return min(found, key=lambda f: float(f.cost))


def rms(parts: Sequence[Array]) -> float:
    """Median over tosses of the root mean square distance of a corner, m."""
    return float(np.median([np.sqrt(np.mean(np.sum(part.reshape(-1, 3) ** 2, axis=1))) for part in parts]))


STARTS = ((0.08, 0.3), (0.16, 0.125), (0.4, 0.05))  # mu, e


def study(
    path: str, count: int, starts: Sequence[tuple[float, float]] = STARTS, scenario: Scenario | None = None
) -> dict[str, Any]:
    """Fit every second of `count` tosses spread over all, judge the others."""
    scenario = scenario or load("cube_toss")
    every = tosses(path)
    chosen = [every[k] for k in np.linspace(0, len(every) - 1, min(count, len(every))).astype(int)]
    training, held_out = chosen[::2], chosen[1::2]
    for window in WINDOWS:
        best = fit(scenario, training, window, starts)
        starts = [tuple(np.exp(best.x).tolist())]
    mu, e = np.exp(best.x)
    low, high = _interval(best, [part.size for part in residuals(scenario, training, float(mu), float(e), window)])
    return {
        "tosses": {"usable": len(every), "fitted": len(training), "held_out": len(held_out)},
        "start": {
            "velocity_error": float(np.median([toss.velocity_error for toss in chosen])),
            "spin_error": float(np.median([toss.spin_error for toss in chosen])),
        },
        "friction": {"value": float(mu), "low": low[0], "high": high[0]},
        "restitution": {"value": float(e), "low": low[1], "high": high[1]},
        "held_out_corner_error": {
            f"{window:g} s": {
                "fitted": rms(residuals(scenario, held_out, float(mu), float(e), window)),
                "published": rms(residuals(scenario, held_out, *PUBLISHED, window)),
                "far_off": rms(residuals(scenario, held_out, 0.5, 0.5, window)),
            }
            for window in WINDOWS
        },
    }


def _interval(best: Any, sizes: Sequence[int]) -> tuple[list[float], list[float]]:
    """95 % by the sandwich over tosses: each toss is one independent block of residuals."""
    # scipy hands back J sqrt(rho' + 2 rho'' r^2) = J (1 + r^2)^(-3/4) for this loss, with J'J the Hessian
    J, r = best.jac, best.fun
    bread = np.linalg.inv(J.T @ J)
    pull = r * (1.0 + r**2) ** 0.25  # so that J' pull is the gradient
    blocks = np.split(np.arange(len(r)), np.cumsum(sizes)[:-1])
    scores = np.array([J[block].T @ pull[block] for block in blocks])
    spread = 1.96 * np.sqrt(np.diag(bread @ (scores.T @ scores) @ bread))
    return np.exp(best.x - spread).tolist(), np.exp(best.x + spread).tolist()


def main() -> None:
    """Print what the tosses give."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").partition("\n")[0])
    parser.add_argument("file")
    parser.add_argument("--tosses", type=int, default=40)
    parser.add_argument("--json", action="store_true")
    given = parser.parse_args()
    found = study(given.file, given.tosses)
    if given.json:
        print(json.dumps(found, indent=2))
        return
    for name in ("friction", "restitution"):
        value, low, high = (found[name][k] for k in ("value", "low", "high"))
        print(f"{name:12s} {value:.3f}  (95 %: {low:.3f} to {high:.3f})")
    for window, error in found["held_out_corner_error"].items():
        print(f"held-out corner error to {window}:", {k: f"{1e3 * v:.1f} mm" for k, v in error.items()})
    print(found["tosses"], found["start"])


if __name__ == "__main__":
    main()

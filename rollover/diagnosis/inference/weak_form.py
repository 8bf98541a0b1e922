"""The residual force in weak form: its means over windows of time, without a derivative of what was measured.

With test functions phi_j(t), smooth, positive, zero with three derivatives at both ends, and integral phi_j dt = 1,

    r_j = integral phi_j F_s dt - integral phi_j K'(z; v_s) z dt - m_b1 integral phi_j z'' dt                  (D4)

where integral phi z'' = integral phi'' z: where only the depth was measured the derivatives fall on phi. Without a
load cell F_s = m (g - z''). A law sum_i c_i T_i is linear in the means of its terms, S_ji = integral phi_j T_i dt.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ground.empirical import TERMS, shape
from ground.law import REFERENCE_AREA, along
from rollover.diagnosis.data.dataset import Dataset
from rollover.diagnosis.inference.bases import motion
from rollover.diagnosis.settings import SETTINGS
from rollover.scenario import Scenario
from rollover.spec.initiation import Drop
from rollover.spec.vehicle import Striker

Array = NDArray[np.float64]
TUNING = SETTINGS.inference.weak_form


@dataclass(frozen=True, kw_only=True)
class Balance:
    """One recording: means of the residual force, (k,) N; depth (m), rate and touch speed (m/s) at rows (n,)."""

    condition: str
    force: Array
    depth: Array
    speed: Array
    touch: Array
    weights: Array  # (k, n): the means of what is given at the rows

    def terms(self, depth: float, speed: float) -> Array:
        """S of every term of the table, (k, terms), over scales of depth (m) and speed (m/s)."""
        x, u, w = self.depth / depth, self.speed / speed, self.touch / speed
        return self.weights @ np.stack([shape(name, x, u, w) for name in TERMS], axis=1)


def balances(scenarios: Sequence[Scenario], dataset: Sequence[Dataset]) -> list[Balance]:
    """(D4) of each recording that has what it takes, force on the reference face; scenarios under their conditions."""
    found = [_balance(s, e) for s, e in zip(scenarios, dataset, strict=True)]
    return [one for one in found if one is not None]


def _balance(scenario: Scenario, e: Dataset) -> Balance | None:
    striker, start, r = scenario.vehicle, scenario.initiation, e.recording
    if not isinstance(striker, Striker) or not isinstance(start, Drop) or striker.nose == "cone":
        return None
    share, touch = scenario.ground.co_moving_mass.share, float(start.speed)
    state = motion(r, touch / (1.0 + share))
    if state is None:
        return None
    time, z, v, a = state
    rows = np.flatnonzero((z > 0.0) & (v > 0.02 * touch) & (time > 0.0))
    if rows.size < TUNING.least_rows:
        return None
    rows = rows[rows <= rows[0] + int(np.argmax(np.append(np.diff(rows) > 1, True)))]  # the first way down alone
    if rows.size < TUNING.least_rows:
        return None
    rows = rows[:: max(1, rows.size // TUNING.most_rows)]
    t, dt = time[rows], np.gradient(time[rows])
    dispersion, curved = _tests(t)
    weights = dispersion * dt
    area = striker.face_length * striker.face_width / REFERENCE_AREA
    spring = area * along(scenario.ground.law, z[rows], v[rows], speed=touch)
    seen = "striker/acceleration_z" in r.channels
    mean_a = weights @ a[rows] if seen else (curved * dt) @ z[rows]
    if "ground/force_normal" in r.channels:
        force = weights @ np.interp(t, *r.samples("ground/force_normal"))
    else:
        force = striker.mass * (scenario.gravity - mean_a)
    residual = force - weights @ spring - share * striker.mass * mean_a
    return Balance(
        condition=e.condition or e.name,
        force=residual / area,
        depth=z[rows],
        speed=v[rows],
        touch=np.full(rows.size, touch),
        weights=weights,
    )


def _tests(t: Array) -> tuple[Array, Array]:
    """phi and phi'' of the windows at times t, (k, n) each: cos^4 of half a turn, short after the contact."""
    marks = t[0] + (t[-1] - t[0]) * np.linspace(0.0, 1.0, TUNING.windows + 2 * TUNING.overlap) ** TUNING.window_power
    centres = marks[TUNING.overlap : -TUNING.overlap]
    half = np.minimum(marks[2 * TUNING.overlap :] - centres, centres - marks[: -2 * TUNING.overlap])
    wide = half > TUNING.least_half_width * float(np.median(np.diff(t)))
    centres, half = centres[wide, None], half[wide, None]
    c = np.cos(0.5 * np.pi * np.clip((t[None] - centres) / half, -1.0, 1.0))
    rate = 0.5 * np.pi / half
    scale = 4.0 / (3.0 * half)  # integral of cos^4 over the window: 3/4 half
    dispersion = scale * c**4
    curved = scale * rate**2 * (12.0 * c**2 * (1.0 - c**2) - 4.0 * c**4)
    return dispersion, curved

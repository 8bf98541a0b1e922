"""How well the energy ledger of a run closes: its largest residual over the energy released, and what cures it."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from rollover.dynamics.equilibrium import TOLERANCE
from rollover.dynamics.result import Run
from rollover.spec.vehicle import Striker, Vehicle
from rollover.system.numbers import percent

LIMIT = 0.005  # a load goes with the root of an energy at most linearly: 0.5 % of it is 0.25 to 0.5 % of a load


@dataclass(frozen=True, kw_only=True)
class Closure:
    """Shares of the energy released: the largest residual at any time, `at` (s), and that at the end; `step` in s.

    Not a number where no ledger was kept, and where what was released is no more than the numbers' own error: see
    `resolution`.
    """

    largest: float
    at: float
    end: float
    step: float

    @property
    def is_wide(self) -> bool:
        """Whether the ledger stays open by more than `LIMIT`."""
        return self.largest > LIMIT

    @property
    def sentence(self) -> str:
        """In words; empty where there is no number."""
        if not math.isfinite(self.largest):
            return ""
        return (
            f"Energy ledger: at most {percent(self.largest)} of the energy released is unaccounted for "
            f"(at {self.at:.3f} s; {percent(self.end)} at the end)"
        )

    @property
    def warning(self) -> str:
        """What is wrong and its cure; empty where nothing is."""
        if not self.is_wide:
            return ""
        return (
            f"the energy ledger does not close: {percent(self.largest)} of the energy released is unaccounted for at "
            f"{self.at:.3f} s, more than {percent(LIMIT)}; a smaller simulation.step than {self.step:g} s is needed"
        )


def closure(run: Run) -> Closure:
    """How well the ledger of a run closes; of one that failed, as far as it came."""
    step = run.scenario.simulation.step
    if not run.released > 0.0 or "energy/residual" not in run.recording.channels:
        return Closure(largest=math.nan, at=math.nan, end=math.nan, step=step)
    left = np.abs(run.recording["energy/residual"])
    share = left / run.released
    is_resolved = LIMIT * run.released > (least := resolution(run)) or float(np.nanmax(left, initial=0.0)) > least
    if not is_resolved or not np.isfinite(share).any():
        return Closure(largest=math.nan, at=math.nan, end=math.nan, step=step)
    k = int(np.nanargmax(np.where(np.isfinite(share), share, np.nan)))
    return Closure(largest=float(share[k]), at=float(run.recording.time[k]), end=float(share[-1]), step=step)


def resolution(run: Run) -> float:
    """Energy below which the ledger of a run tells nothing, J.

    A vehicle begins in balance to `TOLERANCE` of its weight W, on tyres of K in all that W presses in by W/K: of the
    work W^2/K of that way a share of `TOLERANCE` is open. What has weight is lifted in numbers of 53 bits: W z is
    rounded to eps of it in each step.
    """
    vehicle, simulation = run.scenario.vehicle, run.scenario.simulation
    weight = run.scenario.gravity * (vehicle.mass if isinstance(vehicle, Striker) else vehicle.whole.mass)
    height = max((float(np.abs(motion.origin[:, 2]).max()) for motion in run.pose.values()), default=0.0)
    rounded = np.finfo(float).eps * weight * height * (simulation.duration / simulation.step)
    wheels = vehicle.wheels if isinstance(vehicle, Vehicle) else ()
    stiffness = sum(w.tyre.vertical_stiffness for w in wheels)
    return float(rounded + (TOLERANCE * weight**2 / stiffness if wheels else 0.0))


def of_cases(ledger: Mapping[str, Any]) -> str:
    """In how many cases of a study the ledger stays open, by what its report says, and the cure."""
    most = percent(ledger["largest_residual"])
    return (
        f"The energy ledger does not close in {ledger['open']} cases: up to {most} of the "
        f"energy released is unaccounted for (point {ledger['at_point']}), more than {percent(ledger['limit'])}; "
        "a smaller simulation.step is needed"
    )

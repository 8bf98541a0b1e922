"""What a recording's conditions leave uncertain, profiled out of the comparison.

With N (n, q) what one standard deviation of each uncertain condition does to the whitened samples, a misfit has the
covariance 1 + N N' in place of 1. With N = U S V',

    w -> (1 + N N')^-1/2 w = w - U (1 - (1 + S^2)^-1/2) U'w                                                    (D5)

has the covariance 1 again: what an error of the conditions would do counts little, all else as before. A measured
condition is at least as uncertain as the digits in which it is written.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from rollover.diagnosis.settings import SETTINGS
from rollover.recording import Recording, StandardUncertainty
from rollover.scenario import Scenario
from rollover.spec.document import paths
from rollover.system.errors import Fault, InputError, hint

MEASURED = ("initiation.speed", "vehicle.mass")  # what is read off an instrument
Array = NDArray[np.float64]
TUNING = SETTINGS.data.condition_uncertainty
ROUNDING = SETTINGS.data.rounding


@dataclass(frozen=True, kw_only=True)
class Marginalised:
    """(D5): directions U (n, q) of unit length, and the share of each that is taken out (q,)."""

    directions: Array
    shares: Array

    def __call__(self, values: Array) -> Array:
        """Whitened misfit or its derivatives, (n,) or (n, m), freed of what the conditions leave uncertain."""
        if self.shares.size == 0:
            return values
        inside = self.shares[:, None] * (self.directions.T @ values.reshape(values.shape[0], -1))
        return np.asarray(values - (self.directions @ inside).reshape(values.shape))

    def undone(self, values: Array) -> Array:
        """The whitened misfit (n,) that was freed of them."""
        inside = (1.0 / (1.0 - self.shares) - 1.0) * (self.directions.T @ values)
        return np.asarray(values + self.directions @ inside)


def pulls(columns: Array, misfit: Array, samples_per_error: float) -> Array:
    """How far a misfit pulls each condition from what is stated of it, in its standard deviations, (q,).

    The mean of z given w = N z + e with z ~ N(0, 1), e of unit variance and k samples to an error:

        z = (k 1 + N'N)^-1 N' w                                                                               (D22)

    `columns` are N (n, q), `misfit` is w (n,), whitened and not freed of the conditions.
    """
    normal = columns.T @ columns + samples_per_error * np.eye(columns.shape[1])
    return np.asarray(np.linalg.solve(normal, columns.T @ misfit))


def marginalised(columns: Array) -> Marginalised:
    """From N (n, q), columns of what 1 sigma of each condition does."""
    if columns.shape[1] == 0:
        return Marginalised(directions=columns, shares=np.zeros(0))
    U, S, _ = np.linalg.svd(columns, full_matrices=False)
    retained = TUNING.least_singular_value * max(float(S.max(initial=0.0)), 1e-300) < S
    return Marginalised(directions=U[:, retained], shares=1.0 - 1.0 / np.sqrt(1.0 + S[retained] ** 2))


def nuisance_parameters(
    scenario: Scenario, uncertainty: Mapping[str, StandardUncertainty], origin: str = ""
) -> list[dict[str, Any]]:
    """Values to exchange for an error of one standard deviation, one mapping for each uncertain number.

    Raises `InputError` for a path that the scenario does not have, or that is no number or list of as many.
    """
    if not uncertainty:
        return []
    known = {leaf.path: leaf.value for leaf in paths(scenario)}
    found: list[dict[str, Any]] = []
    for path, sigma in uncertainty.items():
        value = known.get(path)
        each = sigma if isinstance(sigma, tuple) else (sigma,)
        many = value if isinstance(value, list) else [value]
        if len(many) != len(each) or not all(isinstance(v, (int, float)) for v in many):
            message = f"uncertainty: not a number of the scenario, or not as many, got {value!r}; {hint(path, known)}"
            raise InputError(Fault(file=origin, path=path, message=message))
        for k, one in enumerate(each):
            moved = [v + one * (j == k) for j, v in enumerate(many)]
            found.append({path: tuple(moved) if isinstance(value, list) else moved[0]})
    return found


def with_rounding_uncertainty(
    recordings: Sequence[tuple[str, Recording]],
) -> tuple[list[tuple[str, Recording]], list[str]]:
    """The recordings with the rounding of what was measured as its uncertainty, and a line for each such condition.

    1 sigma is 10^-d/sqrt(12), d the most decimals in which any recording states that condition: 1.9 beside 2.19 is
    1.90. Left as they are: what a sidecar gives an uncertainty, and what may as well be nominal, see `most_rounding`.
    """
    known: dict[str, float] = {}
    for path in MEASURED:
        open_ = [r.conditions[path] for _, r in recordings if path in r.conditions and path not in r.uncertainty]
        values = [float(v) for v in open_ if isinstance(v, (int, float))]
        sigma = 10.0 ** -max(map(decimals, values), default=ROUNDING.most_decimals) / math.sqrt(12.0)
        shares = [sigma / abs(v) if v else math.inf for v in values]
        if values and max(shares) <= ROUNDING.most_rounding and max(shares) > ROUNDING.least_rounding:
            known[path] = sigma
    rounded = [
        (name, replace(r, uncertainty={**{p: s for p, s in known.items() if p in r.conditions}, **r.uncertainty}))
        for name, r in recordings
    ]
    return rounded, [
        f"{path} is taken as rounded, +-{s:.2g}: state it as `uncertainty` in the sidecar" for path, s in known.items()
    ]


def decimals(value: float) -> int:
    """Digits behind the point of a number as it is written: 2 of 1.25, none of 130.0."""
    text = f"{value:.{ROUNDING.most_decimals}g}"
    if "e" in text:
        return ROUNDING.most_decimals if abs(value) < 1.0 else 0
    return len(text.partition(".")[2])

"""Points of a study: a value of every axis for each case, by the plan. Same study, same points, to the last bit."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from rollover.studies import plan as plans
from rollover.studies import sensitivity
from rollover.studies.axis import EDGE, Array
from rollover.studies.study import Correlation, Study
from rollover.system import budget
from rollover.system.boundary import worded
from rollover.system.errors import Fault, InputError, hint


@dataclass(frozen=True, kw_only=True)
class Points:
    """`columns` (n,) by name of the axis; `unit` (n, d) are the u behind drawn points, None for grids and tables."""

    columns: Mapping[str, NDArray[Any]]
    unit: Array | None = None

    @property
    def count(self) -> int:
        """Number of cases."""
        return len(next(iter(self.columns.values())))

    def row(self, k: int) -> dict[str, Any]:
        """Values of one point by axis: numbers and words."""
        return {name: v if isinstance(v := column[k], str) else float(v) for name, column in self.columns.items()}


def points(study: Study) -> Points:
    """All points of a study's plan. Raises `InputError`, for its table too."""
    plan, d = study.plan, len(study.axes)
    if isinstance(plan, plans.Table):
        return Points(columns=_read(Path(plan.file), [axis.name for axis in study.axes]))
    if isinstance(plan, plans.Grid):
        count = math.prod(axis.how_many(plan.levels) for axis in study.axes)
        _bounded(count, d)  # before a single level is made
        levels = [axis.levels(plan.levels) for axis in study.axes]
        at = np.unravel_index(np.arange(count), [len(each) for each in levels])
        return Points(columns={axis.name: v[k] for axis, v, k in zip(study.axes, levels, at, strict=True)})
    u = _unit(plan, d)
    if study.correlation is not None:
        u = _coupled(u, study.correlation, [axis.name for axis in study.axes])
    return from_unit(study, u)


def from_unit(study: Study, u: Array) -> Points:
    """Points of given u (n, d) in [0, 1]."""
    return Points(columns={axis.name: axis.at(u[:, j]) for j, axis in enumerate(study.axes)}, unit=u)


def _unit(plan: plans.AnyPlan, d: int) -> Array:
    from scipy.stats import qmc

    if isinstance(plan, plans.SobolIndices):
        _bounded(plan.count * (d + 2), d)
        return sensitivity.sobol_sample(d, plan.count, plan.seed)
    if isinstance(plan, plans.Morris):
        _bounded(plan.count * (d + 1), d)
        return sensitivity.morris_sample(d, plan.count, plan.levels, plan.seed)
    assert isinstance(plan, (plans.Random, plans.Lhs, plans.Sobol))
    _bounded(plan.count, d)
    if isinstance(plan, plans.Random):
        return np.random.default_rng(plan.seed).random((plan.count, d))
    if isinstance(plan, plans.Lhs):
        return np.asarray(qmc.LatinHypercube(d, rng=np.random.default_rng(plan.seed)).random(plan.count))
    sequence = qmc.Sobol(d, rng=np.random.default_rng(plan.seed))
    drawn = sequence.random_base2((plan.count - 1).bit_length())  # a count that is no power of two warns
    return np.asarray(drawn[: plan.count])


def _bounded(count: int, axes: int) -> None:
    def refuse(message: str) -> InputError:
        return InputError(Fault(path="plan", message=message))

    budget.check_count(count, budget.CASES, refuse, "cases")
    budget.check_count(count * axes, budget.POINTS, refuse, f"values, of {count} cases on {axes} axes")


def _coupled(u: Array, correlation: Correlation, names: list[str]) -> Array:
    """Gaussian copula: z = L Phi^-1(u), R = L L^T, u' = Phi(z); the distributions of the axes stay."""
    from scipy.special import ndtr, ndtri

    at = [names.index(name) for name in correlation.axes]
    L = np.linalg.cholesky(correlation.normals)
    found = u.copy()
    found[:, at] = ndtr(ndtri(np.clip(u[:, at], EDGE, 1.0 - EDGE)) @ L.T)
    return found


def _read(path: Path, names: list[str]) -> dict[str, NDArray[Any]]:
    """Columns of a table, numbers or words. Raises `InputError`."""
    from rollover.recording import UnreadableError, as_numbers, read_table
    from rollover.recording.tables import csv_heading, read_csv, read_words

    if path.suffix == ".parquet":
        try:
            there, _ = read_table(path)
        except UnreadableError as e:
            raise InputError(
                Fault(file=str(path), message=f"cannot be read: {worded(e)}; a table of the cases is needed")
            ) from None
        _present(path, names, list(there))
        found = {
            name: np.array(v, dtype=object) if any(isinstance(x, str) for x in v) else as_numbers(v)
            for name, v in ((n, there[n]) for n in names)
        }
    else:
        _present(path, names, csv_heading(path)[0])
        found = {}
        for name in names:
            words = read_words(path, [name])[name]
            found[name] = np.array(words, dtype=object) if _are_words(words) else read_csv(path, [name])[name]
    count = len(found[names[0]])
    if count == 0:
        raise InputError(Fault(file=str(path), message="empty, got a table without rows"))
    _bounded(count, len(names))
    for name, column in found.items():
        filled = np.array([bool(w.strip()) for w in column]) if column.dtype == object else np.isfinite(column)
        if not filled.all():
            row = int(np.argmin(filled))
            raise InputError(
                Fault(file=str(path), message=f"column {name}: no number in row {row + 1}; every cell filled")
            )
    return found


def _are_words(words: list[str]) -> bool:
    """Whether a column holds words: no cell of it is a number."""

    def number(text: str) -> bool:
        try:
            float(text)
        except ValueError:
            return False
        return True

    written = [w for w in words if w.strip()]
    return bool(written) and not any(number(w) for w in written)


def _present(path: Path, names: list[str], there: list[str]) -> None:
    for name in names:
        if name not in there:
            raise InputError(Fault(file=str(path), message=f"no column {name!r} for the axis; {hint(name, there)}"))

"""Study: a scenario, what of it varies, at which points, and what is asked; from a YAML file or from Python."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from functools import cache
from pathlib import Path
from typing import Annotated, Any, Literal

import numpy as np
from numpy.typing import NDArray

from ground.quantity import Grid as Rows
from ground.quantity import Quantity, parameters
from rollover.scenario import Scenario
from rollover.spec import document
from rollover.spec.channels import describe, is_known
from rollover.spec.vehicle import Striker
from rollover.studies import plan as plans
from rollover.studies.axis import AnyAxis, Column
from rollover.studies.plan import AnyPlan
from rollover.system import budget
from rollover.system.errors import Fault, InputError, hint

FOLDER = "studies"
RESERVED = ("point", "case", "status", "failure", "sentence", "domain_flags", "peak_flags")
# what a case gives besides peaks: unit, meaning
SPECIAL: dict[str, tuple[str, str]] = {
    "clearance/structure": ("m", "least distance of the structure from the clearance zone, negative inside"),
    "clearance/ground": ("m", "least height of the clearance zone above the ground, negative inside"),
    "rops/share": ("1", "energy that the ROPS took over the kinetic energy at its landing"),
    "ledger/residual": ("1", "largest residual of the energy ledger over the energy released"),
    "start/from_rest": ("1", "1 where a tip-over had no static balance and began from rest, else 0"),
    "time/stop": ("s", "simulated time at the end"),
}
ENDINGS = {"raw": "unfiltered", "impulse": "collision impulse"}


@parameters
class Correlation:
    """Gaussian copula: a matrix of the correlations between some axes, which stay distributed as they are."""

    axes: Annotated[tuple[str, ...], "names, in the order of the matrix"]
    matrix: Annotated[tuple[tuple[float, ...], ...], Rows("1", "symmetric, ones on its diagonal")]
    of: Annotated[Literal["normals", "ranks"], "of the normals beneath, or Spearman's of the values"] = "normals"

    def validate(self) -> None:
        """Refuse what is no matrix of correlations."""
        n = len(self.axes)
        if any(len(row) != n for row in self.matrix) or len(self.matrix) != n or n < 2:
            raise ValueError(f"matrix: not {n} x {n}, one row and column for each of the axes; at least 2 axes")
        R = self.normals
        if not np.allclose(R, R.T, atol=1e-12) or not np.allclose(np.diag(R), 1.0, atol=1e-12):
            raise ValueError("matrix: not symmetric with ones on its diagonal; R_ij = R_ji, R_ii = 1")
        least = float(np.linalg.eigvalsh(R).min())
        if least <= 1e-10:
            raise ValueError(
                f"matrix: no such correlations can be together, got least eigenvalue {least:.3g}; all positive"
            )

    @property
    def normals(self) -> Any:
        """Correlations of the normals beneath, (n, n): 2 sin(pi rho_s/6) where Spearman's are given."""
        R = np.array(self.matrix, dtype=float)
        if self.of == "ranks":
            R = 2.0 * np.sin(np.pi / 6.0 * R)
            np.fill_diagonal(R, 1.0)
        return R


@parameters
class Output:
    """A number of each case that is asked for: a peak load by its channel (filtered by the scenario's class), or more.

    ``rops/force/raw`` is unfiltered, ``rops/force/impulse`` its collision impulse; deflection, energy and sinkage are
    largest magnitudes; ``clearance/structure``, ``clearance/ground``, ``rops/share``, ``ledger/residual``,
    ``start/from_rest`` and ``time/stop`` are no peaks. With a `limit` the probability of lying beyond it is asked for
    too.
    """

    name: Annotated[str, "channel of a load, or another measure of a case"]
    limit: Annotated[float | None, "in the SI unit of the measure"] = None
    beyond: Annotated[Literal["above", "below"], "which side of the limit, and which end is the worst"] = "above"

    def validate(self) -> None:
        """Refuse a measure that no case can have."""
        known = [*SPECIAL, "rops/force", "ground/force_normal", "rops/deflection", "rops/energy", "ground/sinkage"]
        if self.name not in SPECIAL and not _is_peak(self.name):
            raise ValueError(f"name: no such measure, got {self.name!r}; {hint(self.name, known)}")

    @property
    def unit(self) -> str:
        """SI unit."""
        return unit_of(self.name)

    @property
    def worst_sign(self) -> float:
        """1 where large is bad, -1 where small is."""
        return 1.0 if self.beyond == "above" else -1.0


@parameters
class Reliability:
    """Probability of lying beyond the first output's limit by FORM and importance sampling (extra `reliability`)."""

    count: Annotated[int, Quantity("1", "cases of the importance sampling about the design point", least=10)] = 200
    step: Annotated[float, Quantity("1", "of the gradient, in standard normals: larger than chance", above=0)] = 0.2
    iterations: Annotated[int, Quantity("1", "of the search for the design point, at most", least=1)] = 15
    seed: Annotated[int, Quantity("1", least=0)] = 0


@parameters
class Study:
    """A scenario, axes that vary, a plan of points, outputs."""

    format: Literal["rollover-study/1"] = "rollover-study/1"
    title: Annotated[str, "one line that says what is asked"]
    scenario: Annotated[Scenario, "what every case is but for the axes"]
    axes: tuple[AnyAxis, ...]
    correlation: Correlation | None = None
    plan: AnyPlan
    outputs: Annotated[tuple[Output, ...], "the first one decides which case is the worst"]
    simulator: Annotated[Literal["full", "drop"], "drop: a drop test by itself, in 2 ms"] = "full"
    quantiles: tuple[float, ...] = (0.05, 0.5, 0.9, 0.95, 0.99)
    confidence: Annotated[float, Quantity("1", "of all intervals", above=0, below=1)] = 0.95
    reliability: Reliability | None = None

    def validate(self) -> None:
        """Refuse parts that do not fit together."""
        names = [axis.name for axis in self.axes]
        if not names:
            raise ValueError("axes: none given; at least one")
        if not self.outputs:
            raise ValueError("outputs: none given; at least one, such as {name: rops/force}")
        for i, axis in enumerate(self.axes):
            if axis.name in (*names[:i], *RESERVED):
                raise ValueError(f"axes.{i}.name: taken, got {axis.name!r}; another name")
            if isinstance(axis, Column) != isinstance(self.plan, plans.Table):
                raise ValueError(
                    f"axes.{i}.kind: got {axis.kind!r} with a plan of kind {self.plan.kind!r}; "
                    "'column' goes with 'table', and nothing else does"
                )
        paths = [path for axis in self.axes for path in axis.paths]
        if twice := next((p for i, p in enumerate(paths) if p in paths[:i]), None):
            raise ValueError(f"axes: {twice} is set twice; by one axis only")
        for i, q in enumerate(self.quantiles):
            if not 0.0 < q < 1.0:
                raise ValueError(f"quantiles.{i}: not inside 0 to 1, got {q!r}; such as 0.95")
        if isinstance(self.plan, plans.Table) and not self.plan.file.endswith((".csv", ".parquet")):
            raise ValueError(f"plan.file: got {self.plan.file!r}; a .csv or .parquet file")
        if self.simulator == "drop" and not isinstance(self.scenario.vehicle, Striker):
            raise ValueError("simulator: 'drop' drops a striker, got another vehicle; 'full'")
        self._check_correlation(names)
        if self.reliability is not None:
            if self.outputs[0].limit is None:
                raise ValueError("reliability: the first output has no limit; outputs.0.limit is needed")
            if words := [axis.name for axis in self.axes if not axis.drawn]:
                raise ValueError(f"reliability: {words[0]} is no distribution; every axis has to be one")
        for i, axis in enumerate(self.axes):
            self._check_values(i, axis)

    def _check_correlation(self, names: list[str]) -> None:
        if self.correlation is None:
            return
        if not isinstance(self.plan, (plans.Random, plans.Lhs, plans.Sobol)):
            raise ValueError(
                f"correlation: cannot be kept by a plan of kind {self.plan.kind!r}; 'random', 'lhs' or 'sobol' can"
            )
        for i, name in enumerate(self.correlation.axes):
            if name not in names or name in self.correlation.axes[:i]:
                raise ValueError(f"correlation.axes: no such axis, or given twice, got {name!r}; {hint(name, names)}")
            if not self.axes[names.index(name)].drawn:
                raise ValueError(f"correlation.axes: {name!r} is no distribution, only those can be correlated")

    def _check_values(self, i: int, axis: AnyAxis) -> None:
        """The scenario with the axis at its ends and in its middle, or at its levels: where they are many, at some."""
        if isinstance(axis, Column):
            return
        base = base_values(self.scenario, axis)
        for value in axis.at(np.array([1e-3, 0.5, 1.0 - 1e-3])) if axis.drawn else _tried(axis.levels(2)):
            try:
                self.scenario.replaced(changes(base, axis, value))
            except InputError as e:
                fault = e.faults[0]
                what = f"{fault.path}: {fault.message}" if fault.path else fault.message
                raise ValueError(f"axes.{i}: {axis.name} = {value}: {what}") from None


def _tried(levels: NDArray[Any]) -> NDArray[Any]:
    """Levels without those that are there twice; of many the ends, and `budget.LEVELS_TRIED` between them."""
    each = np.array(list(dict.fromkeys(levels.tolist())), dtype=levels.dtype)
    if len(each) <= budget.LEVELS_TRIED:
        return each
    each = np.sort(each)  # words too: what is wrong with one of them is told at its case
    return np.asarray(each[np.linspace(0, len(each) - 1, budget.LEVELS_TRIED).astype(int)])


def unit_of(measure: str) -> str:
    """SI unit of a measure of a case."""
    if measure in SPECIAL:
        return SPECIAL[measure][0]
    channel, _, ending = measure.rpartition("/")
    if ending == "impulse":
        return "N s"
    return describe(_described(channel if ending == "raw" else measure)).unit


@cache
def is_measure(name: str) -> bool:
    """Whether a case is measured by this."""
    try:
        unit_of(name)
    except ValueError:
        return False
    return True


def axis_unit(scenario: Scenario, axis: AnyAxis) -> str:
    """Unit of an axis' numbers: "1" for a factor, else that of what stands at its paths; empty where none is known."""
    if axis.apply == "factor":
        return "1"
    return next(filter(None, (document.unit_at(scenario, path) for path in axis.paths)), "")


def meaning_of(measure: str) -> str:
    """What a measure of a case is."""
    if measure in SPECIAL:
        return SPECIAL[measure][1]
    channel, _, ending = measure.rpartition("/")
    if ending in ENDINGS:
        return f"peak of {channel}, {ENDINGS[ending]}"
    return f"largest magnitude of {measure}"


def _described(channel: str) -> str:
    return channel if is_known(channel) else f"{channel}_x"


def _is_peak(name: str) -> bool:
    channel, _, ending = name.rpartition("/")
    channel = channel if ending in ENDINGS else name
    return is_known(channel) or is_known(f"{channel}_x")


def base_values(scenario: Scenario, axis: AnyAxis) -> dict[str, Any]:
    """What stands at the paths of an axis, as bare values; None where nothing does."""
    tree = document.to_mapping(scenario)
    return {path: _there(tree, path) for path in axis.paths}


def changes(base: Mapping[str, Any], axis: AnyAxis, value: Any) -> dict[str, Any]:
    """What an axis at a value sets, by path; `base` are `base_values`. Raises `InputError`."""
    found: dict[str, Any] = {}
    for path in axis.paths:
        if isinstance(value, str):
            found[path] = str(value)
            continue
        number = float(value)
        there = base[path]
        if axis.apply != "value":
            found[path] = _combined(there, number, axis.apply, path)
        elif isinstance(there, int) and not isinstance(there, bool) and number.is_integer():
            found[path] = int(number)
        else:
            found[path] = number
    return found


def _combined(there: Any, number: float, apply: str, path: str) -> Any:
    if isinstance(there, (list, tuple)):
        return tuple(None if v is None else _combined(v, number, apply, path) for v in there)
    if isinstance(there, bool) or not isinstance(there, (int, float)):
        raise InputError(Fault(path=path, message=f"no number to apply a {apply} to, got {there!r}; apply: value"))
    return there * number if apply == "factor" else there + number


def _there(tree: Mapping[str, Any], path: str) -> Any:
    part: Any = tree
    for step in path.split("."):
        if isinstance(part, Mapping):
            part = part.get(step)
        elif isinstance(part, list):
            named = next((p for p in part if isinstance(p, Mapping) and p.get("name") == step), None)
            at = int(step) if step.isdecimal() and int(step) < len(part) else None
            part = named if named is not None else part[at] if at is not None else None
        else:
            return None
    return part


def load(path: str | Path) -> Study:
    """Study from a file or, by its name, one of the shipped ones. Raises `InputError`."""
    file = find(path)
    study: Study = document.load(file, Study)
    if isinstance(study.plan, plans.Table):
        table = Path(study.plan.file)
        table = table if table.is_absolute() else file.resolve().parent / table
        study = replace(study, plan=replace(study.plan, file=str(table)))
    return study


def find(path: str | Path) -> Path:
    """File of a study given by its path or by the name of a shipped one. Raises `InputError`."""
    return document.find(path, FOLDER)


def schema() -> dict[str, Any]:
    """JSON Schema of a study file."""
    return document.schema(Study, "rollover study")

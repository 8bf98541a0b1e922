"""Peak loads against baselines: what changed, beyond what a step, chance and another machine can do.

A scenario's baseline stands in the folder ``baselines`` beside it. Each load carries a tolerance and the reason for
it, and a tolerance below the discretisation error is refused: it would pass or fail by luck.
"""

from __future__ import annotations

import math
import os
import shlex
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path
from typing import Annotated, Literal

from ground.quantity import Quantity, parameters
from rollover.assessment.results import versions
from rollover.scenario import Scenario
from rollover.spec import document
from rollover.studies.ensemble import Extreme, Spread, spreads
from rollover.system.errors import Fault, InputError, hint
from rollover.system.numbers import percent
from rollover.system.writing import staged

FOLDER, EXCLUDED = "baselines", "excluded.yaml"
STARTS = 5  # of an ensemble; one is enough where the loads are smooth
CHAOTIC = 1e-3  # scatter of a load above which the mean over the starts is compared
DIGITS = 10  # of a value in a file
FLOOR = 1e-6  # relative, what another processor or mathematical library may change in a smooth load
QUIET = 1e-6  # a load below this share of the scenario's largest of its unit is as good as none
LOOSE = 0.1  # a tolerance above this guards little, and is said to
CHANCE = 1e-3  # that two ensembles of the same physics differ by more than the tolerance, for one load


@parameters
class Load:
    """What one load was, and how far it may move. `value` is the mean over the baseline's starts."""

    load: str
    filter: Annotated[str, "raw, CFC 60 or another class, or impulse"]
    unit: str
    value: float
    time: Annotated[float, Quantity("s", "of the peak in the first start")]
    half_step_change: Annotated[float, Quantity("1", "relative change of the mean at half the step", least=0)]
    scatter: Annotated[float, Quantity("1", "standard deviation over starts, at this step and at half of it", least=0)]
    tolerance: Annotated[float, Quantity("1", "relative", least=0)]
    reason: Annotated[str, "for the tolerance"]

    def validate(self) -> None:
        """Refuse a tolerance below the discretisation error."""
        error = max(self.half_step_change, self.scatter)
        if self.tolerance < error:
            raise ValueError(
                f"tolerance: below the discretisation error of {self.load}, {self.filter}, got {self.tolerance:.3g}; "
                f"at least {error:.3g}, what half the step or another start changes"
            )

    @property
    def key(self) -> tuple[str, str]:
        """What tells it from the others of its scenario."""
        return self.load, self.filter


@parameters
class Former:
    """A baseline that was replaced: why it had been set, by which version, and its values."""

    reason: str
    versions: tuple[str, ...]
    scenario_hash: str
    values: tuple[str, ...]


@parameters
class Baseline:
    """The peak loads of one scenario as they ought to be."""

    format: Literal["rollover-baseline/1"] = "rollover-baseline/1"
    scenario: Annotated[str, "name of its file"]
    scenario_hash: str
    versions: tuple[str, ...]
    reason: Annotated[str, "for these values"]
    starts: Annotated[int, Quantity("1", "over which values are the mean", least=1)]
    loads: tuple[Load, ...]
    history: Annotated[tuple[Former, ...], "what stood here before, the latest first"] = ()


@parameters
class Exclusion:
    """A scenario without a baseline, and why."""

    name: str
    reason: str


@parameters
class Exclusions:
    """The file of all scenarios that have no baseline."""

    format: Literal["rollover-excluded/1"] = "rollover-excluded/1"
    scenarios: tuple[Exclusion, ...] = ()


@dataclass(frozen=True, kw_only=True)
class Difference:
    """One load against its baseline; `change` is relative, `was` or `now` None where there is no such load."""

    load: str
    filter: str
    unit: str
    was: float | None
    now: float | None
    time_was: float | None
    time_now: float | None
    change: float | None
    tolerance: float | None
    same: bool


@dataclass(frozen=True, kw_only=True)
class Answer:
    """One scenario against its baseline. `same`, `excluded` and `updated` are good; all else is a failure."""

    scenario: str
    verdict: Literal["same", "changed", "failed", "missing", "unknown", "excluded", "updated"]
    sentence: str
    starts: int = 0
    wall_time: float = 0.0
    differences: tuple[Difference, ...] = ()
    notes: tuple[str, ...] = ()
    largest_residual: float | None = None  # of the energy ledger over the energy released, over all runs

    @property
    def ok(self) -> bool:
        """Whether nothing speaks against this scenario."""
        return self.verdict in ("same", "excluded", "updated")


def path_of(scenario: Path) -> Path:
    """File of a scenario's baseline."""
    return scenario.parent / FOLDER / f"{scenario.stem}.yaml"


def called(scenario: Path) -> str:
    """How a command line names a scenario: a shipped one by its name, another by its file, quoted for a shell."""
    shipped = scenario.resolve().parent == document.shipped_folder().resolve()
    return shlex.quote(scenario.stem if shipped else str(scenario))


def read(path: Path) -> Baseline:
    """Read a baseline. Raises `InputError`, for a tolerance below the discretisation error too."""
    found: Baseline = document.load(path, Baseline)
    if found.scenario != path.stem:
        message = f"got {found.scenario!r}; the file's name, {path.stem!r}, is needed"
        raise InputError(Fault(file=str(path), path="scenario", message=message))
    return found


def excluded(folder: Path) -> dict[str, str]:
    """Why each scenario of a folder has no baseline, by its name. Raises `InputError`."""
    path = folder / FOLDER / EXCLUDED
    if not path.is_file():
        return {}
    found: Exclusions = document.load(path, Exclusions)
    return {e.name: e.reason for e in found.scenarios}


def without_scenario(folder: Path) -> list[Answer]:
    """Baselines and exclusions of a folder that belong to no scenario, or to one that has both."""
    known = [p.stem for p in sorted(folder.glob("*.yaml"))]
    kept = [p.stem for p in sorted((folder / FOLDER).glob("*.yaml")) if p.name != EXCLUDED]
    left_out = excluded(folder)
    found = []
    for name in [*kept, *left_out]:
        file = f"{FOLDER}/{name}.yaml" if name in kept else f"{FOLDER}/{EXCLUDED}"
        if name not in known:
            sentence = f"{file}: no scenario of that name; {hint(name, known)}"
            found.append(Answer(scenario=name, verdict="unknown", sentence=sentence))
    for name in sorted({*kept} & {*left_out}):
        sentence = f"has a baseline and stands in {FOLDER}/{EXCLUDED} as well; one of the two"
        found.append(Answer(scenario=name, verdict="unknown", sentence=sentence))
    return found


def against(baseline: Baseline, scenario: Scenario, ensemble: Sequence[Sequence[Extreme]]) -> Answer:
    """Judge what an ensemble of `baseline.starts` gave."""
    now = {(s.load, s.filter): s for s in spreads(ensemble)}
    was = {load.key: load for load in baseline.loads}
    largest: dict[str, float] = {}
    for load in baseline.loads:
        largest[load.unit] = max(largest.get(load.unit, 0.0), abs(load.value))
    differences = tuple(
        _difference(was.get(key), now.get(key), largest) for key in [*was, *(key for key in now if key not in was)]
    )
    notes = []
    if baseline.scenario_hash != document.content_hash(scenario):
        notes.append("the scenario's own values have changed since its baseline")
    if (mine := _versions(scenario)) != baseline.versions:
        new, old = set(mine) - set(baseline.versions), set(baseline.versions) - set(mine)
        notes.append(f"made with {', '.join(sorted(old))}, compared with {', '.join(sorted(new))}")
    changed = [d for d in differences if not d.same]
    if changed:
        worst = max(changed, key=lambda d: math.inf if d.change is None else abs(d.change) / (d.tolerance or FLOOR))
        sentence = f"{len(changed)} of {len(differences)} loads changed, {sentence_of(worst)}"
    else:
        sentence = f"{len(differences)} loads as they were"
    return Answer(
        scenario=baseline.scenario,
        verdict="changed" if changed else "same",
        sentence=sentence,
        starts=baseline.starts,
        differences=differences,
        notes=tuple(notes),
    )


def sentence_of(difference: Difference) -> str:
    """One load's change in words."""
    name = f"{difference.load}, {difference.filter}"
    if difference.was is None:
        return f"{name}: a load that the baseline lacks"
    if difference.now is None:
        return f"{name}: a load that is gone"
    if difference.change is None:
        return f"{name}: was none, is {difference.now:.4g} {difference.unit}"
    return f"{name}: {100 * difference.change:+.2g} %, {percent(difference.tolerance or 0)} allowed"


def _difference(was: Load | None, now: Spread | None, largest: Mapping[str, float]) -> Difference:
    one = was or now
    assert one is not None
    change, same = None, False
    if was is not None and now is not None:
        quiet = QUIET * largest[was.unit]
        if abs(was.value) > quiet:
            change = (now.mean - was.value) / abs(was.value)
            same = abs(change) <= was.tolerance
        else:
            same = abs(now.mean) <= quiet
    return Difference(
        load=one.load,
        filter=one.filter,
        unit=one.unit,
        was=was.value if was else None,
        now=now.mean if now else None,
        time_was=was.time if was else None,
        time_now=now.time if now else None,
        change=change,
        tolerance=was.tolerance if was else None,
        same=same,
    )


def baseline_from(
    name: str,
    scenario: Scenario,
    ensemble: Sequence[Sequence[Extreme]],
    half_step: Sequence[Sequence[Extreme]],
    reason: str,
    before: Baseline | None = None,
) -> Baseline:
    """The baseline of a scenario from its ensemble and that of half the step.

    A tolerance that was set by hand in `before` is kept with its reason. Raises `InputError` where it would now lie
    below the discretisation error.
    """
    found = spreads(ensemble)
    finer = {(s.load, s.filter): s for s in spreads(half_step)}
    scatters = {(s.load, s.filter): _pooled(s, finer.get((s.load, s.filter))) for s in found}
    starts = len(ensemble) if any(v > CHAOTIC for v in scatters.values()) else 1
    kept = {load.key: load for load in before.loads if by_hand(load, before.starts)} if before else {}
    loads, faults = [], []
    for s in found:
        half = finer.get((s.load, s.filter))
        value = float(f"{s.mean if starts > 1 else s.values[0]:.{DIGITS}g}")
        change = abs(half.mean - s.mean) / abs(s.mean) if half is not None and s.mean != 0.0 else 0.0
        change, scatter = _rounded(change), _rounded(scatters[s.load, s.filter])
        tolerance, why = allowed(change, scatter, starts)
        if old := kept.get((s.load, s.filter)):
            tolerance, why = old.tolerance, old.reason
        try:
            loads.append(
                Load(
                    load=s.load,
                    filter=s.filter,
                    unit=s.unit,
                    value=value,
                    time=s.time,
                    half_step_change=change,
                    scatter=scatter,
                    tolerance=tolerance,
                    reason=why,
                )
            )
        except ValueError as e:
            faults.append(Fault(file=f"{FOLDER}/{name}.yaml", message=str(e)))
    if faults:
        raise InputError(*faults)
    new = Baseline(
        scenario=name,
        scenario_hash=document.content_hash(scenario),
        versions=_versions(scenario),
        reason=reason,
        starts=starts,
        loads=tuple(loads),
        history=(_former(before), *before.history) if before else (),
    )
    if before is not None and new == replace(before, reason=new.reason, history=new.history):
        return before  # nothing to have a reason for
    return new


def _pooled(s: Spread, half: Spread | None) -> float:
    return s.scatter if half is None else math.sqrt(0.5 * (s.scatter**2 + half.scatter**2))


def allowed(half_step_change: float, scatter: float, starts: int) -> tuple[float, str]:
    """Tolerance of a load and the reason for it: the largest of three, never below the discretisation error.

    Another processor changes a smooth load by less than 1e-6; half the step, by `half_step_change`; two ensembles of
    the same physics, n starts each, differ by more than t s sqrt(2/n) once in a thousand. s is pooled over the ensemble
    and that of half the step, five starts each, so t is Student's with 8 degrees of freedom.
    """
    from scipy.special import stdtrit

    chance = float(stdtrit(2 * (STARTS - 1), 1.0 - 0.5 * CHANCE)) * scatter * math.sqrt(2.0 / starts)
    what = "single starts" if starts == 1 else f"means of {starts} starts"
    return max(
        (FLOOR, "another processor or mathematical library"),
        (half_step_change, "what half the step changes"),
        (_rounded(max(chance, scatter)), f"chance: {what} differ by more once in {1 / CHANCE:.0f} times"),
    )


def by_hand(load: Load, starts: int) -> bool:
    """Whether somebody set this tolerance, rather than the rule."""
    return (load.tolerance, load.reason) != allowed(load.half_step_change, load.scatter, starts)


def texts(folder_of: Mapping[Path, Baseline]) -> dict[Path, str]:
    """What the files of baselines hold."""
    return {path: document.dump(b, HEAD.format(name=b.scenario, called=_called(path))) for path, b in folder_of.items()}


def _called(path: Path) -> str:
    """How the scenario of a baseline's file is named on a command line, from the baseline's folder."""
    name = called(path.parent.parent / path.name)
    return name if name == path.stem else shlex.quote(f"../{path.name}")


def write(folder_of: Mapping[Path, Baseline]) -> None:
    """Write baselines to their files: none before all stand beside their places, and each whole or not at all."""
    parts: list[tuple[Path, Path]] = []
    try:
        for path, text in texts(folder_of).items():
            path.parent.mkdir(parents=True, exist_ok=True)
            parts.append((staged(path, partial(Path.write_text, data=text, encoding="utf-8")), path))
        for part, path in parts:
            os.replace(part, path)
    finally:
        for part, _ in parts:
            part.unlink(missing_ok=True)


HEAD = """Peak loads of {name} as they ought to be.
`rollover regress {called}` compares them, `--update --reason TEXT` rewrites them. Tolerances are relative. Raise
one by hand, with the reason, and an update keeps it; below the change at half the step or the scatter it is refused."""


def _former(before: Baseline) -> Former:
    return Former(
        reason=before.reason,
        versions=before.versions,
        scenario_hash=before.scenario_hash,
        values=tuple(f"{x.load}, {x.filter}: {x.value:.10g} {x.unit}" for x in before.loads),
    )


def _rounded(value: float) -> float:
    """Up to three figures, so that nobody reads more into it and no bound is undercut."""
    if value == 0.0:
        return 0.0
    digit = 10.0 ** (math.floor(math.log10(value)) - 2)
    return float(f"{math.ceil(value / digit) * digit:.3g}")


def _versions(scenario: Scenario) -> tuple[str, ...]:
    """Of all that loads depend on: of files of one's own, which have no version, a part of their hash."""
    own = [(f, h) for files in scenario.own_code.get("own_code", {}).values() for f, h in files.items()]
    return (*(f"{name} {version}" for name, version in versions().items()), *(f"{f} {h[:12]}" for f, h in own))

"""The regression of peak loads: which scenarios, their runs in child processes, their answers, their new baselines."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

from rollover.scenario import Scenario, load
from rollover.spec import document
from rollover.studies import baseline as baselines
from rollover.studies.baseline import Answer, Baseline
from rollover.studies.ensemble import Extreme, Observed, observed, perturbed_starts
from rollover.system.arguments import LONGEST, within
from rollover.system.errors import Fault, InputError
from rollover.system.processes import Outcome, map_cases

TIME_LIMIT = 600.0  # s of wall time, for one run


@dataclass(frozen=True, kw_only=True)
class Start:
    """One run that is needed: of which scenario, at half its step or not."""

    file: Path
    scenario: Scenario
    half_step: bool


@dataclass(frozen=True, kw_only=True)
class Chosen:
    """Scenario files to work on, and the answers that need no run: folders judged as wholes."""

    files: tuple[Path, ...]
    answers: tuple[Answer, ...] = ()
    left_out: tuple[Path, ...] = ()  # files of a folder that are no scenarios, such as vehicles


Show = Callable[[int, int], None]  # runs done, of all


def regress(
    scenarios: str | Path | Sequence[str | Path] = (), *, workers: int = 0, time_limit: float = TIME_LIMIT
) -> tuple[Answer, ...]:
    """Compare peak loads with their baselines, which stay as they are.

    Parameters
    ----------
    scenarios
        Names or paths of scenarios, or folders of them; none: all that are shipped.
    workers
        Child processes that run them; 0 works in this one, where no limit holds.
    time_limit
        Wall time for each run in a child process, s.

    Returns
    -------
    tuple of Regression
        One for each scenario; `ok` where nothing has changed.

    Raises
    ------
    InputError
        For scenarios and baselines that cannot be read.
    """
    within("time_limit", time_limit, 1.0, LONGEST)
    names = [scenarios] if isinstance(scenarios, (str, Path)) else scenarios
    return tuple(compared(chosen([str(name) for name in names]), workers=workers, time_limit=time_limit))


def chosen(names: Sequence[str]) -> Chosen:
    """Scenarios by name or file, all of a folder for a folder, all shipped ones for nothing. Raises `InputError`."""
    files: dict[Path, None] = {}
    answers: list[Answer] = []
    left_out: list[Path] = []
    for name in names or [str(document.shipped_folder())]:
        if (folder := Path(name)).is_dir():
            there = sorted(folder.glob("*.yaml"))
            found = [file for file in there if is_scenario(file)]
            left_out += [file for file in there if file not in found]
            if not found:
                raise InputError(
                    Fault(file=name, message="no scenario there; a folder with scenarios, .yaml files, is needed")
                )
            files.update(dict.fromkeys(found))
            answers += baselines.without_scenario(folder)
        else:
            files[document.find(name)] = None
    stems = [f.stem for f in files]
    if twice := next((s for s in stems if stems.count(s) > 1), None):
        raise InputError(
            Fault(file=twice, message="two scenarios of that name, and results go by names; one at a time")
        )
    return Chosen(files=tuple(files), answers=tuple(answers), left_out=tuple(left_out))


def is_scenario(file: Path) -> bool:
    """Whether a file is a scenario by its keys; one that cannot be read is taken for one, so that its fault is told."""
    try:
        keys = document.headings(file)
    except InputError:
        return True
    form = keys["format"].plain if "format" in keys else "rollover-scenario/"
    known = {*document.slot_of(Scenario).keys()} - {"format", "title"}
    return "kind" not in keys and str(form).startswith("rollover-scenario/") and not known.isdisjoint(keys)


def compared(
    choice: Chosen, *, workers: int | None = None, time_limit: float = TIME_LIMIT, show: Show | None = None
) -> list[Answer]:
    """Each chosen scenario against its baseline, in the order of the files. Raises `InputError`."""
    answers = list(choice.answers)
    known: dict[Path, tuple[Baseline, Scenario]] = {}
    starts: list[Start] = []
    faults: list[Fault] = []
    for file in choice.files:
        answer, kept = _without_runs(file)
        if answer is not None:
            answers.append(answer)
            continue
        try:
            found, scenario = baselines.read(kept), load(file)
        except InputError as e:
            faults += e.faults
            continue
        known[file] = (found, scenario)
        starts += [Start(file=file, scenario=s, half_step=False) for s in perturbed_starts(scenario, found.starts)]
    if faults:
        raise InputError(*faults)
    outcomes = _worked_off(starts, workers, time_limit, show)
    for file, (found, scenario) in known.items():
        mine = outcomes[file]
        failed = _failed(mine)
        ensemble = [o.value.extremes for o in mine if o.value is not None]
        answer = (
            Answer(scenario=file.stem, verdict="failed", sentence=failed, starts=found.starts)
            if failed
            else baselines.against(found, scenario, ensemble)
        )
        answers.append(replace(_with_ledger(answer, mine), wall_time=sum(o.wall_time for o in mine)))
    order = {f.stem: k for k, f in enumerate(choice.files)}
    return sorted(answers, key=lambda a: order.get(a.scenario, len(order)))


def unchanged(answers: Sequence[Answer]) -> str:
    """That nothing has changed in the scenarios that have a baseline, in words; and which have none on purpose."""
    held = sum(a.verdict != "excluded" for a in answers)
    which = "" if held == 1 else f" of {held} scenarios"
    moved = f"no peak load{which} has moved beyond its tolerance" if held else "nothing was compared"
    return "; ".join(filter(None, (moved, without_baseline(answers))))


def without_baseline(answers: Sequence[Answer]) -> str:
    """Which scenarios are excluded, and what gives them a baseline; empty where none is."""
    names = [a.scenario for a in answers if a.verdict == "excluded"]
    if not names:
        return ""
    line = "its line" if len(names) == 1 else "their lines"
    return f"excluded, {line} in {baselines.FOLDER}/{baselines.EXCLUDED} removed gives a baseline: {', '.join(names)}"


class FailedUpdateError(Exception):
    """No baseline was written, as a run failed; `answers` say which."""

    def __init__(self, answers: Sequence[Answer]) -> None:
        super().__init__("\n".join(f"{a.scenario}: {a.sentence}" for a in answers))
        self.answers = list(answers)


def updated(
    choice: Chosen,
    reason: str,
    *,
    workers: int | None = None,
    time_limit: float = TIME_LIMIT,
    show: Show | None = None,
    write: Callable[[Mapping[Path, Baseline]], None] = baselines.write,
) -> list[Answer]:
    """Draw up and write the baselines of all chosen scenarios that are not excluded, or of none.

    `write` is handed those that are new, by their files.
    Raises `InputError`, also for a tolerance set by hand that has become too small, and `FailedUpdateError`.
    """
    answers: list[Answer] = []
    known: dict[Path, Scenario] = {}
    starts: list[Start] = []
    for file in choice.files:
        answer, _ = _without_runs(file)
        if answer is not None and answer.verdict == "excluded":
            answers.append(answer)
            continue
        known[file] = scenario = load(file)
        for again in perturbed_starts(scenario, baselines.STARTS):
            half = again.replaced({"simulation.step": 0.5 * scenario.simulation.step})
            starts += [
                Start(file=file, scenario=again, half_step=False),
                Start(file=file, scenario=half, half_step=True),
            ]
    outcomes = _worked_off(starts, workers, time_limit, show)
    failed = [
        Answer(scenario=file.stem, verdict="failed", sentence=sentence)
        for file in known
        if (sentence := _failed(outcomes[file]))
    ]
    if failed:
        raise FailedUpdateError(failed)
    new: dict[Path, Baseline] = {}
    for file, scenario in known.items():
        path = baselines.path_of(file)
        before = baselines.read(path) if path.is_file() else None
        mine = [(o.case.half_step, o.value.extremes) for o in outcomes[file] if o.value is not None]
        plain, half_ = ([v for h, v in mine if h is finer] for finer in (False, True))
        drawn = baselines.baseline_from(file.stem, scenario, plain, half_, reason, before)
        if drawn is not before:
            new[path] = drawn
        answer = _written(drawn, before, scenario, plain, sum(o.wall_time for o in outcomes[file]))
        answers.append(_with_ledger(answer, outcomes[file]))
    write(new)
    return answers


def _written(
    new: Baseline, before: Baseline | None, scenario: Scenario, ensemble: list[tuple[Extreme, ...]], wall: float
) -> Answer:
    """What an update changed, and which of its tolerances guard little; `new` is `before` where that stays."""
    loose = [x for x in new.loads if x.tolerance > baselines.LOOSE]
    notes = [
        f"{x.load}, {x.filter}: a tolerance of {100 * x.tolerance:.0f} % guards little ({x.reason})" for x in loose
    ]
    stays = new is before
    sentence = "nothing new to write" if stays else f"{len(new.loads)} loads written"
    differences = baselines.against(new, scenario, ensemble[: new.starts]).differences
    if before is not None:
        old = baselines.against(before, scenario, ensemble[: before.starts])
        sentence, differences = f"{sentence}; {old.sentence}", old.differences
    return Answer(
        scenario=new.scenario,
        verdict="same" if stays else "updated",
        sentence=sentence,
        starts=new.starts,
        wall_time=wall,
        differences=differences,
        notes=tuple(notes),
    )


def _without_runs(file: Path) -> tuple[Answer | None, Path]:
    path = baselines.path_of(file)
    reason = baselines.excluded(file.parent).get(file.stem)
    if path.is_file():
        return None, path
    if reason is not None:
        return Answer(scenario=file.stem, verdict="excluded", sentence=reason), path
    advice = (
        f"`rollover regress {baselines.called(file)} --update --reason TEXT` makes one, "
        f"or {baselines.FOLDER}/{baselines.EXCLUDED} says why there is none"
    )
    return Answer(scenario=file.stem, verdict="missing", sentence="no baseline", notes=(advice,)), path


def _work(start: Start) -> Observed:
    return observed(start.scenario)


def _with_ledger(answer: Answer, outcomes: Sequence[Outcome[Start, Observed]]) -> Answer:
    """The answer with the largest residual of the energy ledger in any run, and a note where it is too large."""
    found = [o.value.ledger for o in outcomes if o.value is not None and math.isfinite(o.value.ledger.largest)]
    if not found:
        return answer
    worst = max(found, key=lambda closure: closure.largest)
    notes = (*answer.notes, worst.warning) if worst.is_wide else answer.notes
    return replace(answer, notes=notes, largest_residual=worst.largest)


def _worked_off(
    starts: Sequence[Start], workers: int | None, time_limit: float, show: Show | None
) -> Mapping[Path, list[Outcome[Start, Observed]]]:
    found: list[Outcome[Start, Observed]] = []
    for outcome in map_cases(_work, starts, workers=workers, time_limit=time_limit):
        found.append(outcome)
        if show is not None:
            show(len(found), len(starts))
    by_file: dict[Path, list[Outcome[Start, Observed]]] = {}
    for outcome in sorted(found, key=lambda o: o.index):
        by_file.setdefault(outcome.case.file, []).append(outcome)
    return by_file


def _failed(outcomes: Sequence[Outcome[Start, Observed]]) -> str:
    """Why there is no ensemble, or nothing."""
    for k, outcome in enumerate(outcomes):
        if outcome.failure is not None:
            which = f"start {k + 1} of {len(outcomes)}" if len(outcomes) > 1 else "the run"
            half = " at half the step" if outcome.case.half_step else ""
            return f"{which}{half} failed: {outcome.failure.sentence}"
    return ""

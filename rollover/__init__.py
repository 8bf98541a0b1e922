"""Vehicle rollover load studies: a multibody tractor with its ROPS rolls onto an array of ground impact elements.

    import rollover as ro
    run = ro.run(ro.load("side_overturn").replaced({"vehicle.whole.mass": 2300.0}))
    run.peaks, run.to_pandas()

All values are in SI. A scenario is given as a `Scenario`, or as the path of a file or the name of a shipped one;
recordings as a `Recording`, a path, a folder, several of these, or a mapping of names to them. Wrong input raises
`InputError`, a ``ValueError`` with a line for each fault. `workers` are child processes, 0 works in this one: a script
that asks for some calls under ``if __name__ == "__main__":``.
"""

from __future__ import annotations

import importlib
from pathlib import Path
from typing import TYPE_CHECKING, Literal

from rollover.system.import_names import require_own

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    from rollover.assessment.assessed import AssessedRun as Run
    from rollover.assessment.loads import PeakLoad
    from rollover.assessment.standing import Stability, stability
    from rollover.calibration.calibrate import Calibration
    from rollover.calibration.identification import Identification, identify
    from rollover.comparison.compared import Comparison
    from rollover.comparison.recordings import Recordings
    from rollover.comparison.synthesis import synthesize
    from rollover.diagnosis.own_model.declaration import ForwardModel, Parameter, Term
    from rollover.diagnosis.result import Diagnosis
    from rollover.recording.record import Recording
    from rollover.scenario import Scenario
    from rollover.studies.baseline import Answer as Regression
    from rollover.studies.regression import regress
    from rollover.system.errors import InputError

    __version__: str

__all__ = ["Calibration", "Comparison", "Diagnosis", "ForwardModel", "Identification", "InputError", "Parameter"]
__all__ += ["PeakLoad", "Recording", "Regression", "Run", "Scenario", "Stability", "Term", "__version__"]
__all__ += ["calibrate", "compare", "diagnose", "identify", "load", "read", "regress", "run", "stability", "study"]
__all__ += ["synthesize"]

_ELSEWHERE = {  # what stands in a package by itself, imported when it is asked for
    "Calibration": "calibration.calibrate",
    "Comparison": "comparison.compared",
    "Diagnosis": "diagnosis.result",
    "ForwardModel": "diagnosis.own_model.declaration",
    "Identification": "calibration.identification",
    "InputError": "system.errors",
    "Parameter": "diagnosis.own_model.declaration",
    "PeakLoad": "assessment.loads",
    "Recording": "recording.record",
    "Regression": "studies.baseline:Answer",
    "Run": "assessment.assessed:AssessedRun",
    "Scenario": "scenario",
    "Term": "diagnosis.own_model.declaration",
    "Stability": "assessment.standing",
    "identify": "calibration.identification",
    "regress": "studies.regression",
    "stability": "assessment.standing",
    "synthesize": "comparison.synthesis",
}

require_own("ground", "viz")


def load(scenario: str | Path) -> Scenario:
    """Scenario from a file, or a shipped one by its name.

    Parameters
    ----------
    scenario
        Path of a YAML file, or a name such as "side_overturn".

    Returns
    -------
    Scenario
        Frozen and checked; its `replaced` gives another with values replaced by path.

    Raises
    ------
    InputError
        A line for each fault of the file.
    """
    from rollover import scenario as scenarios

    return scenarios.load(scenario)


def read(recording: str | Path, *, profile: str | Path | None = None, test: str = "") -> Recording:
    """Recording from any file that an importer knows, or from a run's results.

    Parameters
    ----------
    recording
        Path of a file or folder.
    profile
        File that says what the columns of foreign files are.
    test
        Which of several in the file.

    Returns
    -------
    Recording
        Channels over time (SI), with the conditions that they were measured under.

    Raises
    ------
    InputError
        For what is no recording, or holds several without `test`.
    """
    from rollover.comparison.profiles import profile_of
    from rollover.recording.importers import read_recording

    return read_recording(recording, profile=profile_of(None if profile is None else Path(profile)), test=test)


def run(scenario: str | Path | Scenario, *, half_step: bool = True, ensemble: int = 1, workers: int = 0) -> Run:
    """Simulate one scenario, with its peak loads and the criteria that it is held against.

    Parameters
    ----------
    scenario
        What to run.
    half_step
        Whether to run again at half the step, to see what that changes.
    ensemble
        Starts that nobody could tell apart, 1 to 100, for mean and scatter of each load.
    workers
        Child processes that run the other starts.

    Returns
    -------
    Run
        Also of a run that failed: see `status` and `sentence`.

    Raises
    ------
    InputError
        For wrong input, or a start that cannot be.
    RuntimeError
        Where another start of the ensemble failed.
    """
    from rollover.assessment.assessed import assessed
    from rollover.scenario import given
    from rollover.spec.document import named
    from rollover.studies.ensemble import with_scatter
    from rollover.system.arguments import within

    within("ensemble", ensemble, 1, 100)
    chosen, file = given(scenario)
    with named(file):
        found = assessed(chosen, half_step=half_step, page=_page)
    if ensemble == 1 or not found.peaks:
        return found
    return with_scatter(found, ensemble, workers)


def _page(of: Run) -> str:
    from viz.pages.report import page

    command = "rollover.run(scenario)"
    rows, near, bands = of.criteria, of.approaches, of.bands
    return page(of.result, of.peaks, of.as_dict, rows=rows, near=near, bands=bands, command=command)


def compare(
    scenario: str | Path | Scenario,
    recordings: Recordings,
    *,
    cfc: int | None = None,
    profile: str | Path | None = None,
) -> Comparison:
    """Compare recordings with runs under their conditions, rated by channel and phase.

    Parameters
    ----------
    scenario, recordings
        What is simulated, and what was measured.
    cfc
        Filter class (SAE J211) for both sides, refused where one is too slow; None: `loads.cfc` where possible.
    profile
        File that says what the columns of foreign files are.

    Returns
    -------
    Comparison
        A run and a misfit for each recording.

    Raises
    ------
    InputError
        For wrong input, an unknown condition, recordings of which nothing can be compared.
    """
    from rollover.comparison.compared import compared
    from rollover.comparison.recordings import measured
    from rollover.scenario import given

    chosen, file = given(scenario)
    return compared(chosen, measured(recordings, profile), file=file, cfc=cfc)


def calibrate(
    scenario: str | Path | Scenario,
    recordings: Recordings,
    fit: str | Sequence[str],
    *,
    hold_out: str | Sequence[str] = (),
    channels: str | Sequence[str] = (),
    clock_sigma: float = 1e-3,
    starts: int = 8,
    seed: int = 0,
    posterior: bool | int = False,
    profile: str | Path | None = None,
    workers: int = 0,
) -> Calibration:
    """Fit values of a scenario to recordings, with intervals, and say what they cannot determine.

    Parameters
    ----------
    scenario, recordings, profile
        As in `compare`.
    fit
        What to fit: PATH, or PATH=LOW:HIGH (SI).
    hold_out
        Names of recordings to judge by.
    channels
        Use these only; none: all that both sides have.
    clock_sigma
        Prior of each recording's clock offset, 1 sigma, s.
    starts, seed
        Random starts that are looked at, and their seed.
    posterior
        Whether to sample what the recordings leave open (`Calibration.draws`), or how many draws; 3000.
    workers
        Child processes that follow the starts.

    Returns
    -------
    Calibration
        Estimates with 95 % intervals; `calibrated` is the scenario with them.

    Raises
    ------
    InputError
        For wrong input, and recordings of which nothing can be compared.
    """
    from rollover.calibration.posterior import draws_of
    from rollover.calibration.request import Request
    from rollover.comparison.recordings import measured
    from rollover.scenario import given
    from rollover.system.arguments import MOST_CLOCK, listed, within

    within("clock_sigma", clock_sigma, 0.0, MOST_CLOCK)
    within("starts", starts, 0)
    chosen, file = given(scenario)
    request = Request.of(chosen, measured(recordings, profile), listed(fit), listed(hold_out))
    return request.calibrated(
        file=file,
        channels=listed(channels) or None,
        clock_sigma=clock_sigma,
        starts=starts,
        seed=seed,
        posterior=draws_of(posterior),
        workers=workers,
    )


def diagnose(
    scenario: str | Path | Scenario | ForwardModel,
    recordings: Recordings,
    *,
    hold_out: str | Sequence[str] = (),
    tolerance: float | Mapping[str, float] = 0.0,
    reference: str | Sequence[str] = (),
    estimate: bool | Literal["unexplained"] = "unexplained",
    posterior: bool | int = False,
    profile: str | Path | None = None,
    workers: int = 0,
) -> Diagnosis:
    """Say what separates a scenario from recordings: which physics, value or sensor, where, and how sure that is.

    Parameters
    ----------
    scenario, recordings, profile
        As in `compare`; or a model of one's own that recorded inputs drive: the path of its Python file, or the object.
    hold_out
        Names of recordings to judge by; none: each condition in turn.
    tolerance
        Share of a channel's range, 0 to 0.5, by which a scenario that lacks nothing may miss it: of all, or by channel.
    reference
        Names of recordings of the same rig in which nothing is suspected: they teach that share.
    estimate
        Estimate that share where nothing explains the recordings, and diagnose again beside it: in place of
        "unexplained" where no share is stated; True: whatever is stated, dropping what is doubtful then; False: never.
    posterior
        Whether to sample the numbers of what is named (`Diagnosis.posterior`), or how many draws; 3000. Of drops only.
    workers
        Child processes that fit at once; the answer is the same.

    Returns
    -------
    Diagnosis
        Verdict, effects with 95 % intervals, what the fit gains.

    Raises
    ------
    InputError
        For wrong input, an unknown condition, recordings without any channel that is simulated.
    """
    from rollover.diagnosis.asked import diagnosed

    return diagnosed(
        scenario,
        recordings,
        hold_out=hold_out,
        tolerance=tolerance,
        reference=reference,
        estimate=estimate,
        posterior=posterior,
        profile=profile,
        workers=workers,
    )


def study(
    study: str | Path,
    out: str | Path | None = None,
    *,
    workers: int = 0,
    time_limit: float = 600.0,
    memory_limit: float = 4e9,
    retry: Literal["", "failed"] = "",
    force: bool = False,
) -> Mapping[str, object]:
    """Run what is missing of a study and write its results: cases, their table, the answer, a report.

    Parameters
    ----------
    study
        Path of a study file, or the name of a shipped one.
    out
        Results folder; None: out/study/NAME. A study that was interrupted goes on there.
    workers
        Child processes that run cases.
    time_limit, memory_limit
        Of each case in a child process, s and bytes.
    retry
        "failed" runs failed cases again.
    force
        Whether another study's results there are replaced.

    Returns
    -------
    Mapping
        What study.json says: ranges, quantiles, probabilities beyond a limit, sensitivities, the worst case.

    Raises
    ------
    InputError
        For wrong input, and a folder that holds anything else.
    """
    from rollover import studies
    from rollover.assessment.results import plain
    from rollover.studies.carry_out import prepared
    from rollover.studies.runner import Way
    from rollover.system.arguments import LONGEST, MOST_MEMORY, one_of, within
    from viz.pages.study import page

    within("time_limit", time_limit, 0.1, LONGEST)
    within("memory_limit", memory_limit, 1e6, MOST_MEMORY)
    one_of("retry", retry, ("", "failed"))
    ready = prepared(studies.find(study), None if out is None else Path(out), force=force)
    way = Way(workers=workers, time_limit=time_limit, memory_limit=memory_limit, retry=retry)
    report = ready.carried_out(way, page=lambda done, table: page(ready.study, done, table, command="rollover.study()"))
    return {str(key): value for key, value in plain(report).items()}


def __getattr__(name: str) -> object:
    if name == "__version__":
        from importlib.metadata import version

        return version("rollover")
    if name not in _ELSEWHERE:
        raise AttributeError(f"module 'rollover' has no attribute {name!r}")
    module, _, own = _ELSEWHERE[name].partition(":")
    globals()[name] = found = getattr(importlib.import_module(f"rollover.{module}"), own or name)
    return found


def __dir__() -> list[str]:
    return sorted(__all__)

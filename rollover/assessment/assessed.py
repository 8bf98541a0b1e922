"""A run with its peak loads and criteria: what `rollover run` does between reading and writing."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from contextlib import AbstractContextManager, nullcontext
from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal

from rollover.assessment import results
from rollover.assessment.bands import Band
from rollover.assessment.clearance import Approach, approaches
from rollover.assessment.criteria import criteria, with_half_step
from rollover.assessment.criterion import Criterion
from rollover.assessment.ledger import closure
from rollover.assessment.loads import PeakLoad, peak_loads, unconverged
from rollover.dynamics import simulate
from rollover.dynamics.result import Run
from rollover.recording import Recording, arrow_table, data_frame
from rollover.scenario import Scenario
from rollover.system.notebook import card
from rollover.system.numbers import percent

if TYPE_CHECKING:
    from rollover.recording.runs import DataFrame, Table

Progress = Callable[[float, float], None]
Watch = Callable[[str, Scenario], AbstractContextManager[Progress | None]]


@dataclass(frozen=True, kw_only=True)
class AssessedRun:
    """A run, the same at half the step if that was asked for, its peak loads, and what it was held against.

    `approaches` say how near the clearance zone was come to; `peaks` are empty for a run that failed: the peak until
    then is not the peak. `bands` are those of an ensemble. `page` gives the report's HTML.
    """

    result: Run
    half_step: Run | None
    peaks: tuple[PeakLoad, ...]
    criteria: tuple[Criterion, ...]
    approaches: tuple[Approach, ...] = ()
    bands: tuple[Band, ...] = ()
    page: Callable[[AssessedRun], str] | None = field(default=None, repr=False, compare=False)

    @property
    def scenario(self) -> Scenario:
        """What was run."""
        return self.result.scenario

    @property
    def status(self) -> Literal["done", "failed"]:
        """How it ended; `sentence` says why it failed."""
        return self.result.status

    @property
    def sentence(self) -> str:
        """Why it failed; of one that is done what is special about its start."""
        return self.result.sentence

    @property
    def recording(self) -> Recording:
        """Its channels over time, SI."""
        return self.result.recording

    @property
    def as_dict(self) -> Mapping[str, Any]:
        """What run.json says."""
        rows = [asdict(row) for row in self.criteria]
        return results.json_of(self.result, self.peaks, rows, self.half_step)

    def to_arrow(self) -> Table:
        """Channels as an Arrow table: `time` (s) and a column for each channel (SI), units and meanings as metadata.

        Returns
        -------
        pyarrow.Table
            What channels.parquet holds.
        """
        return arrow_table(self.recording)

    def to_pandas(self) -> DataFrame:
        """Channels as a data frame: a column for each channel (SI) over the index `time` (s).

        Returns
        -------
        pandas.DataFrame

        Raises
        ------
        ImportError
            Where pandas is not installed.
        """
        return data_frame(self.recording)

    def report(self, path: str | Path | None = None) -> str:
        """The page of the run, one HTML file with all its figures.

        Parameters
        ----------
        path
            File that it is written to as well.

        Returns
        -------
        str
            HTML.
        """
        if self.page is None:
            raise ValueError("page: none was given with this run; one of `rollover.run` has one")
        text = self.page(self)
        if path is not None:
            Path(path).write_text(text, encoding="utf-8")
        return text

    def _repr_html_(self) -> str:
        """What a notebook shows: status and peak loads (SI)."""
        run, closed = self.result, closure(self.result)
        said = [
            f"FAILED: {run.sentence}" if run.status == "failed" else f"{run.stop_time:g} s simulated. {run.sentence}"
        ]
        said += [text for text in (unconverged(self.peaks), closed.warning if closed.is_wide else "") if text]
        if run.domain_flags:
            said.append(f"Outside the ground law's calibrated domain: {', '.join(run.domain_flags)}")
        said += [f"{row.requirement.standard}: {row.requirement.name}: {row.verdict}" for row in self.criteria]
        cfc = run.scenario.loads.cfc
        headings = ("peak load", "unit", "raw", "at s", f"CFC {cfc}", "at s", "change at half step")
        rows = [
            (
                peak.channel,
                peak.unit,
                f"{peak.raw:.5g}",
                f"{peak.raw_time:.3f}",
                f"{peak.filtered:.5g}",
                f"{peak.filtered_time:.3f}",
                "" if peak.half_step_change is None else percent(peak.half_step_change),
            )
            for peak in self.peaks
            if peak.raw != 0.0  # a wheel that never touched
        ]
        return card(run.scenario.title, said, headings, rows, words=(0, 1))


def assessed(
    scenario: Scenario,
    *,
    half_step: bool = True,
    watch: Watch | None = None,
    page: Callable[[AssessedRun], str] | None = None,
) -> AssessedRun:
    """Simulate, at half the step too unless the run fails, and judge.

    `watch(what, scenario)` gives what is told the progress (s simulated, s of wall time) of each run. Raises
    `InputError` for a start that cannot be.
    """
    with nullcontext() if watch is None else watch("simulating", scenario) as show:
        done = simulate.run(scenario, progress=show)
    again = None
    if half_step and done.status != "failed":
        finer = scenario.replaced({"simulation.step": 0.5 * scenario.simulation.step})
        with nullcontext() if watch is None else watch("again at half the step", scenario) as show:
            again = simulate.run(finer, progress=show)
    finished = again if again is not None and again.status == "done" else None
    near = approaches(done) if done.status == "done" else ()
    rows = criteria(done, near)
    return AssessedRun(
        result=done,
        half_step=again,
        # what a run that broke off reached is in its channels; a peak of it would pass for the peak
        peaks=peak_loads(done, finished) if done.status == "done" else (),
        criteria=with_half_step(rows, criteria(finished)) if rows and finished is not None else rows,
        approaches=near,
        page=page,
    )

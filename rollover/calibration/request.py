"""What a calibration is asked for, checked before anything long begins: values to fit, recordings, held-out ones."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

from rollover.calibration.calibrate import STARTS, Calibration, calibrate
from rollover.calibration.objective import Parameter, parameter
from rollover.calibration.posterior import installed
from rollover.comparison.misfit import estimated_noise
from rollover.comparison.recordings import held_out
from rollover.recording import Recording
from rollover.scenario import Scenario
from rollover.system.errors import Fault, InputError


@dataclass(frozen=True, kw_only=True)
class Request:
    """A scenario, recordings by name, the parameters to fit to them, and the names of those that are only judged by."""

    scenario: Scenario
    recordings: Mapping[str, Recording]
    parameters: tuple[Parameter, ...]
    held_out: list[str]

    @classmethod
    def of(
        cls,
        scenario: Scenario,
        recordings: Mapping[str, Recording],
        fit: Sequence[str],
        hold_out: Sequence[str] = (),
        *,
        by: tuple[str, str] = ("fit", "hold_out"),
    ) -> Request:
        """Read `fit`, texts PATH or PATH=LOW:HIGH (SI); `by` names where `fit` and `hold_out` were given.

        Raises `InputError` for a path that is no number of the scenario, one given twice and an unknown recording.
        """
        parameters = tuple(parameter(scenario, text) for text in fit)
        if not parameters:
            raise InputError(Fault(file=by[0], message="nothing to fit, got none; at least one path is needed"))
        if len({p.path for p in parameters}) < len(parameters):
            raise InputError(Fault(file=by[0], message="a path given twice; once is allowed"))
        held = held_out(list(recordings), hold_out, by[1])
        return cls(scenario=scenario, recordings=recordings, parameters=parameters, held_out=held)

    def calibrated(
        self,
        *,
        file: Path | None = None,
        clock_sigma: float = 1e-3,
        channels: Sequence[str] | None = None,
        starts: int = STARTS,
        seed: int = 0,
        workers: int = 0,
        posterior: int = 0,
    ) -> Calibration:
        """Fit, see `calibrate`. Raises `InputError`, for what cannot be fitted about `file`, the scenario's."""
        if posterior:
            installed()
        every = self.recordings.items()
        try:
            return calibrate(
                self.scenario,
                {name: r for name, r in every if name not in self.held_out},
                self.parameters,
                held_out={name: r for name, r in every if name in self.held_out},
                noise=estimated_noise,
                clock_sigma=clock_sigma,
                channels=channels,
                starts=starts,
                seed=seed,
                workers=workers,
                posterior=posterior,
            )
        except InputError:
            raise
        except ValueError as e:
            raise InputError(Fault(file=None if file is None else str(file), message=str(e))) from None

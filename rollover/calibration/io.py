"""A calibration as its file: calibrate.json."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from rollover.assessment.results import versions
from rollover.calibration import posterior
from rollover.calibration.calibrate import Calibration
from rollover.calibration.posterior import Posterior
from rollover.comparison.misfit import summary

FORMAT = "rollover-calibrate/1"


def json_of(c: Calibration, about: Mapping[str, Any] | None = None) -> dict[str, Any]:
    """What calibrate.json says; `about` names what was asked."""
    return {
        "format": FORMAT,
        **(about or {}),
        "versions": versions(),
        "parameters": {e.path: summary(e) for e in c.estimates},
        "correlation": c.correlation,
        "condition": c.condition,
        "combinations": list(c.combinations),
        "clock_offsets": dict(c.clocks),
        "clock_errors": dict(c.clock_errors),
        "clocks": {name: zero.answer for name, zero in c.zeros.items()},
        "clock_sigma": c.clock_sigma,
        "noise": {name: dict(of) for name, of in c.noise.items()},
        "fit": {"training": summary(c.training), "held_out": None if c.held_out is None else summary(c.held_out)},
        "samples": c.samples,
        "independent_samples": c.independent,
        "outliers": c.outliers,
        "widening": c.widening,
        "starts_agreeing": list(c.starts_agreeing),
        "warnings": list(c.warnings),
        "override": c.override,
        **({} if c.posterior is None else {"posterior": _posterior(c, c.posterior)}),
    }


def _posterior(c: Calibration, drawn: Posterior) -> dict[str, Any]:
    """Summary of the draws; the draws themselves are posterior.csv."""
    prior = "uniform between the bounds, of the logarithm where these are spaced logarithmically"
    return posterior.summary([p.path for p in c.parameters], c.draws, drawn, prior)


def table(c: Calibration) -> str:
    """posterior.csv: a column for each value, SI, a row for each draw."""
    return posterior.table([p.path for p in c.parameters], c.draws)

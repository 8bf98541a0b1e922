"""A calibration as its file: calibrate.json."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from rollover.assessment.results import versions
from rollover.calibration.calibrate import Calibration
from rollover.comparison.misfit import summary

FORMAT = "rollover-calibrate/1"


def account(c: Calibration, about: Mapping[str, Any] | None = None) -> dict[str, Any]:
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
    }

"""All numbers of the diagnosis that are chosen, stage by stage.

Each field says its unit, its meaning and where its value comes from. "chosen" means that no derivation and no study of
its sensitivity is recorded. Misfits "over the noise" are square roots of the mean square of residuals in noise units.
"""

from __future__ import annotations

from dataclasses import dataclass, field

from rollover.diagnosis.settings.data import Data
from rollover.diagnosis.settings.fit import Fit
from rollover.diagnosis.settings.forward import Forward
from rollover.diagnosis.settings.inference import Inference
from rollover.diagnosis.settings.noise import Noise
from rollover.diagnosis.settings.report import Planning, Report
from rollover.diagnosis.settings.selection import Selection


@dataclass(frozen=True, kw_only=True)
class Settings:
    """Settings of a diagnosis, gathered from its stages."""

    data: Data = field(default_factory=Data)  # recordings: their signals, clocks, conditions and faults
    noise: Noise = field(default_factory=Noise)  # what is not explained by physics: noise, drift, scatter of runs
    forward: Forward = field(default_factory=Forward)  # simulation of what a recording should have shown
    fit: Fit = field(default_factory=Fit)  # least-squares fits of parameters
    inference: Inference = field(default_factory=Inference)  # tests, intervals and what a mismatch depends on
    selection: Selection = field(default_factory=Selection)  # which effects explain a mismatch
    report: Report = field(default_factory=Report)  # verdicts, grades and sentences
    planning: Planning = field(default_factory=Planning)  # tests that are planned


SETTINGS = Settings()

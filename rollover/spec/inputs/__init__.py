"""Prescribed inputs (data): what drives a run over time, each by a signal that is written down or was measured."""

from __future__ import annotations

from rollover.spec.inputs.fit import check_inputs
from rollover.spec.inputs.kinds import BrakeTorque, DriveTorque, Force, Input, Shake, Steering, TableAngle
from rollover.spec.inputs.signal import Signal, SignalFile

__all__ = ["BrakeTorque", "DriveTorque", "Force", "Input", "Shake", "Signal", "SignalFile", "Steering", "TableAngle"]
__all__ += ["check_inputs"]

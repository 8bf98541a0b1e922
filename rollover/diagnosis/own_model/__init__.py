"""A model of one's own: what recorded inputs drive, diagnosed by the same steps as a scenario."""

from __future__ import annotations

from rollover.diagnosis.own_model.declaration import ForwardModel, Parameter, Term, load_model
from rollover.diagnosis.own_model.pipeline import diagnose_model, json_of

__all__ = ["ForwardModel", "Parameter", "Term", "diagnose_model", "json_of", "load_model"]

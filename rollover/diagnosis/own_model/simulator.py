"""A model of one's own as a forward model of one recording: called with care, and what its sensors make of it."""

from __future__ import annotations

import traceback
from collections.abc import Iterator, Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

from rollover.diagnosis.forward.interface import FailedModelError
from rollover.diagnosis.own_model.declaration import BASELINE, ForwardModel, conditions_of, file_of, values_of
from rollover.diagnosis.own_model.tables import enter, stretches
from rollover.diagnosis.settings import SETTINGS
from rollover.effects import entries, read
from rollover.recording import Recording
from rollover.system.errors import Fault

Array = NDArray[np.float64]
PREFIX = "effects."
CACHED = SETTINGS.forward.drop.cached_predictions
PART = SETTINGS.forward.model_part


class ModelSimulator:
    """One recording's inputs, ready to drive a model; its time is the recording's, so that no shift moves it."""

    effort = SETTINGS.forward.models
    contact = np.inf

    def __init__(self, model: ForwardModel, recording: Recording, inputs: Mapping[str, Array]) -> None:
        self.model, self.recording, self.inputs = model, recording, dict(inputs)
        self._runs: dict[tuple[tuple[str, Any], ...], dict[str, Array] | None] = {}

    def __getstate__(self) -> dict[str, Any]:
        """What is sent to another process: not the runs."""
        return {"model": self.model, "recording": self.recording, "inputs": self.inputs}

    def __setstate__(self, state: Mapping[str, Any]) -> None:
        """Stand in another process, in whose tables the model's channels and terms stand from now on."""
        self.__init__(**state)  # type: ignore[misc]
        enter(self.model)

    def predict(self, changes: Mapping[str, Any], shift: float) -> dict[str, Array] | None:
        """See `Simulator`."""
        del shift
        physics: dict[str, float] = {}
        sensors: dict[str, dict[str, Any]] = {}
        for path, value in changes.items():
            id, _, name = path.removeprefix(PREFIX).rpartition(".")
            if id.startswith("sensor-"):
                sensors.setdefault(id, {})[name] = value
            else:
                physics[name if id == BASELINE else f"{id}.{name}"] = value
        found = self.run(physics)
        if found is None or not sensors:
            return None if found is None else dict(found)
        known = entries()
        acting = {id: known[id](**given) for id, given in sensors.items()}
        made = Recording(title=self.recording.title, time=self.recording.time, channels=found)
        return dict(read(acting, made).channels)

    def run(self, values: Mapping[str, float]) -> dict[str, Array] | None:
        """Outputs before sensors with values exchanged; None where there is no solution. Raises `FailedModelError`."""
        key = tuple(sorted(values.items()))
        if key not in self._runs:
            if len(self._runs) >= CACHED:
                self._runs.pop(next(iter(self._runs)))
            self._runs[key] = self.called(values)
        return self._runs[key]

    def called(self, values: Mapping[str, float]) -> dict[str, Array] | None:
        """The same, made anew."""
        stated = {name: float(self.recording.conditions[name]) for name in conditions_of(self.model)}
        time = _locked(self.recording.time)
        inputs = {name: _locked(v) for name, v in self.inputs.items()}
        try:
            made = self.model.simulate(time, inputs, {**values_of(self.model), **stated, **values})
        except ArithmeticError:
            return None
        except Exception as e:
            raise self.refused(f"simulate failed, got {type(e).__name__}: {e}; {_said(values)}", e) from e
        if wrong := next(self._wrong(made), None):
            raise self.refused(f"{wrong}; {_said(values)}")
        found = {name: np.array(made[name], dtype=np.float64) for name in self.model.outputs}
        return found if all(np.isfinite(v).all() for v in found.values()) else None

    def refused(self, message: str, e: Exception | None = None) -> FailedModelError:
        """A fault of the model's file, at the line where an exception began if there was one."""
        file = file_of(self.model)
        lines = [f.lineno for f in traceback.extract_tb(e.__traceback__) if f.filename == file] if e else []
        fault = Fault(file=file, line=lines[-1] if lines else None, path=self.recording.title, message=message)
        return FailedModelError(str(fault))

    def _wrong(self, made: object) -> Iterator[str]:
        """What is wrong with what a model returned."""
        if not isinstance(made, Mapping):
            yield f"simulate returned no mapping, got {type(made).__name__}; outputs (n,) by channel are needed"
            return
        for name in self.model.outputs:
            if name not in made:
                got = ", ".join(map(str, made)) or "nothing"
                yield f"simulate returned no {name}, got {got}; each output is needed"
                continue
            try:
                values = np.asarray(made[name])
                if np.iscomplexobj(values):  # as a power of a negative number is
                    yield f"simulate returned complex numbers as {name}; real ones are needed"
                    continue
                values = np.asarray(values, dtype=np.float64)
            except (TypeError, ValueError):
                yield f"simulate returned no numbers as {name}, got {made[name]!r}; floats are needed"
                continue
            if values.shape != self.recording.time.shape:
                shape = self.recording.time.shape
                yield f"simulate returned {name} of shape {values.shape}; {shape} is needed, one a stamp"

    def perturbed(
        self, changes: Mapping[str, Any] | None = None, shift: float = 0.0, parts: int = 1
    ) -> list[dict[str, Array]]:
        """See `Simulator`: the same values give the same outputs."""
        del changes, shift, parts
        return []

    def choose_medoid(self) -> None:
        """See `Simulator`."""

    def until(self, n: int) -> ModelSimulator:
        """See `Simulator`."""
        return ModelSimulator(self.model, self.recording.until(n), {c: v[:n] for c, v in self.inputs.items()})

    def marks(self) -> tuple[tuple[float, str], ...]:
        """See `Simulator`: parts of so many samples that what is slow in each is looked for up to high frequencies."""
        return stretches(self.recording.time, PART)

    def state(self, shift: float) -> Mapping[str, Array]:
        """See `Simulator`."""
        return {**self.inputs, **(self.predict({}, shift) or {})}


def _locked(values: Array) -> Array:
    """A view (n,) that a model cannot write to."""
    view = values.view()
    view.setflags(write=False)
    return view


def _said(values: Mapping[str, float]) -> str:
    """At which values a model failed, and what is needed of it."""
    at = ", ".join(f"{name} = {value:.6g}" for name, value in values.items()) or "its starts"
    return f"it has to work within all ranges that it states, here at {at}; no solution is said by NaN"

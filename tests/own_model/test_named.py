"""A model of one's own is diagnosed like a scenario: closed forms, what is named, and what is not."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace

import numpy as np
import pytest

import rollover as ro
from rollover.diagnosis.own_model import diagnose_model, load_model
from rollover.diagnosis.own_model.declaration import found_at
from rollover.diagnosis.own_model.tables import tables
from rollover.diagnosis.settings import SETTINGS
from rollover.effects import EFFECTS, effects
from rollover.spec.channels import CHANNELS
from tests.own_model.line import IN, OUT, Array, Line, measured, model
from tests.own_model.worlds import drawn


def least_squares(recordings: dict[str, ro.Recording], powers: tuple[int, ...]) -> tuple[np.ndarray, np.ndarray]:
    """Coefficients (k,) of powers of the input, and their standard errors under noise of 0.01 V."""
    u = np.concatenate([r[IN] for r in recordings.values()])
    y = np.concatenate([r[OUT] for r in recordings.values()])
    X = np.stack([u**p for p in powers], axis=1)
    error = 0.01 * np.sqrt(np.diag(np.linalg.inv(X.T @ X)))
    return np.linalg.lstsq(X, y, rcond=None)[0], error


def test_terms_stay_in_the_table_whoever_asks_for_it() -> None:
    """One of them by a name that the module in which its class is made has for something else."""
    own = Line()
    own.terms = (*model.terms, replace(model.terms[0], id="effects"))
    with tables(own):
        assert {"effects", "bend"} <= set(effects())
    assert "effects" not in effects()


def test_parameters_of_a_line_are_those_of_least_squares() -> None:
    recordings = measured(2.5, -0.7)
    found = diagnose_model(model, recordings)
    assert (found.verdict, found.effects) == ("no-mismatch", ())
    best, error = least_squares(recordings, (1, 0))
    for name, value, sd in zip(("slope", "level"), best, error, strict=True):
        told = found.baseline[name]
        assert told.value == pytest.approx(value, abs=0.1 * sd), name
        # beside the noise stands a gain error of the model of `model_error`; the noise is estimated, to a tenth or so
        width = np.hypot(sd, SETTINGS.data.dataset.model_error * value)
        assert told.high - told.low == pytest.approx(2.0 * 1.96 * width, rel=0.15), name
    assert found.baseline["slope"].unit == "V/N"


def test_a_bend_is_named_and_fitted_beside_the_line() -> None:
    recordings = measured(2.5, -0.7, bend=0.05)
    found = diagnose_model(model, recordings)
    assert (found.verdict, found.answer) == ("missing-physics", "whole")
    assert [e.id for e in found.effects] == ["bend"]
    best, error = least_squares(recordings, (1, 0, 2))
    told = found.effects[0].parameters["coefficient"]
    # both weigh the same samples, by a noise that is estimated: a fifth of the standard error
    assert told.value == pytest.approx(best[2], abs=0.2 * error[2])
    assert told.low < 0.05 < told.high
    assert found.baseline["level"].value == pytest.approx(best[1], abs=0.2 * error[1])
    assert found.effects[0].statement.startswith("There is a curved characteristic")


def test_what_no_term_has_is_unexplained_with_its_places() -> None:
    found = diagnose_model(model, measured(2.5, -0.7, wave=0.2))
    assert (found.verdict, found.effects) == ("unexplained", ())
    assert found.remaining_significant
    assert {p.channel for p in found.where} == {OUT}


def test_a_fault_of_an_output_is_its_sensors() -> None:
    class Sensed(Line):
        parameters = {"slope": Line.parameters["slope"]}  # noqa: RUF012 - of one test
        sensors = ("sensor-bias",)

        def simulate(
            self, time: Array, inputs: Mapping[str, Array], values: Mapping[str, float]
        ) -> Mapping[str, Array]:
            return Line.simulate(self, time, inputs, {**values, "level": 0.0})

    found = diagnose_model(Sensed(), measured(2.5, -0.7))
    assert found.verdict == "sensor"
    assert [(e.id, e.channel) for e in found.effects] == [("sensor-bias", OUT)]
    assert found.effects[0].parameters["bias"].unit == "V"
    assert found.effects[0].parameters["bias"].value == pytest.approx(-0.7, abs=0.003)


def test_a_recording_that_is_held_out_is_predicted_by_the_others() -> None:
    recordings = measured(2.5, -0.7, bend=0.05)
    found = diagnose_model(model, recordings, hold_out=["r4"])
    assert (found.training, found.held_out) == (("r1", "r2", "r3"), ("r4",))
    best, error = least_squares({n: r for n, r in recordings.items() if n != "r4"}, (1, 0, 2))
    assert found.effects[0].parameters["coefficient"].value == pytest.approx(best[2], abs=0.2 * error[2])
    assert found.after["held_out"].nrmse < 1.1 < found.before["held_out"].nrmse


def test_a_model_without_parameters_of_its_own_is_held_as_it_is() -> None:
    class Fixed(Line):
        parameters: Mapping[str, ro.Parameter] = {}

        def simulate(
            self, time: Array, inputs: Mapping[str, Array], values: Mapping[str, float]
        ) -> Mapping[str, Array]:
            return Line.simulate(self, time, inputs, {**values, "slope": 2.5, "level": -0.7})

    found = diagnose_model(Fixed(), measured(2.5, -0.7, bend=0.05))
    assert ([e.id for e in found.effects], dict(found.baseline)) == (["bend"], {})
    assert diagnose_model(Fixed(), measured(2.5, -0.7)).verdict == "no-mismatch"


def test_stated_noise_is_believed() -> None:
    recordings = {}
    for name, r in measured(0.0, 0.0, count=3).items():  # noise alone, to which a fast input adds
        u = np.sin(2.0 * np.pi * 11.0 * r.time)
        channels = {IN: u, OUT: r[OUT] + 2.5 * u + 0.3 * np.sin(6.0 * u)}
        recordings[name] = replace(r, channels=channels, noise={OUT: 0.01})
    found = diagnose_model(model, recordings)
    assert (found.verdict, dict(found.noise)) == ("unexplained", {OUT: 0.01})
    unstated = diagnose_model(model, {n: replace(r, noise={}) for n, r in recordings.items()})
    assert unstated.noise[OUT] > 0.03  # what is missing is no slower than a noise


def test_two_terms_are_named_beside_the_parameters() -> None:
    class Wavy(Line):
        terms = (
            *Line.terms,
            ro.Term(
                id="kink", family="a kink", equation="y = step |u|",
                parameters={"step": ro.Parameter(unit="V/N", low=-1.0, high=1.0, start=0.1, null=0.0)},
            ),
        )  # fmt: skip

        def simulate(
            self, time: Array, inputs: Mapping[str, Array], values: Mapping[str, float]
        ) -> Mapping[str, Array]:
            return {OUT: Line.simulate(self, time, inputs, values)[OUT] + values["kink.step"] * np.abs(inputs[IN])}

    recordings = {
        n: replace(r, channels={IN: r[IN], OUT: r[OUT] + 0.1 * np.abs(r[IN])})
        for n, r in measured(2.5, -0.7, 0.1).items()
    }
    found = diagnose_model(Wavy(), recordings)
    assert {e.id for e in found.effects} == {"bend", "kink"}
    told = {e.id: next(iter(e.parameters.values())) for e in found.effects}
    assert told["bend"].low < 0.1 < told["bend"].high
    assert told["kink"].low < 0.1 < told["kink"].high
    assert found.baseline["slope"].low < 2.5 < found.baseline["slope"].high


def test_nothing_of_a_model_stays_in_the_tables() -> None:
    channels, effects = dict(CHANNELS), dict(EFFECTS)
    diagnose_model(model, measured(2.5, -0.7))
    assert (channels, effects) == (CHANNELS, EFFECTS)
    with pytest.raises(ro.InputError):
        diagnose_model(model, {"r": ro.Recording(title="r", time=np.arange(9.0), channels={IN: np.arange(9.0)})})
    assert (channels, effects) == (CHANNELS, EFFECTS)


def test_the_api_takes_a_model_as_it_takes_a_scenario() -> None:
    recordings = measured(2.5, -0.7, bend=0.05)
    assert [e.id for e in ro.diagnose(model, recordings).effects] == ["bend"]
    with pytest.raises(ro.InputError, match="no reference, no estimate"):
        ro.diagnose(model, recordings, estimate=True)


@pytest.mark.parametrize(("name", "case"), [("friction_axis", 0), ("cascaded_tanks", 2), ("duffing", 13)])
def test_a_shipped_model_answers_a_case_of_the_benchmark(name: str, case: int) -> None:
    world = drawn(name, 1, case)
    found = diagnose_model(load_model(found_at(name)), world.recordings)
    assert [e.id for e in found.effects] == ([world.truth] if world.kind == "single" else [])

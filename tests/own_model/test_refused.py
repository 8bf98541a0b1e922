"""What is wrong with a model of one's own, or with a recording that should drive it, is one line with its cure."""

from __future__ import annotations

import re
from collections.abc import Callable, Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import rollover as ro
from ground.quantity import Quantity
from rollover.diagnosis.own_model import diagnose_model, load_model
from rollover.recording import Clock
from rollover.system.errors import has_cure
from tests.own_model.line import IN, OUT, Line, measured
from tests.rollover.test_effects_contract import outside

GOOD = Line.parameters["slope"]
TERM = Line.terms[0]


def refused(model: Any, recordings: Mapping[str, ro.Recording] | None = None) -> str:
    """The one line, or the lines, that a diagnosis is refused with."""
    with pytest.raises(ro.InputError) as e:
        diagnose_model(model, recordings or measured(2.5, -0.7, count=2))
    assert all(has_cure(f.message) for f in e.value.faults), str(e.value)
    return str(e.value)


# ---------------------------------------------------------------- what simulate returns


def with_simulate(answer: Callable[[Line, Any, Any, Any], Any]) -> Line:
    return type("Own", (Line,), {"simulate": answer})()


def right(self: Line, time: Any, inputs: Any, values: Any) -> Any:
    return Line.simulate(self, time, inputs, values)


CALLS = [0]


def drifting(self: Line, time: Any, inputs: Any, values: Any) -> Any:
    CALLS[0] += 1
    return {OUT: right(self, time, inputs, values)[OUT] + 1e-9 * CALLS[0]}


def writing(self: Line, time: Any, inputs: Any, values: Any) -> Any:
    inputs[IN][0] = 0.0
    return right(self, time, inputs, values)


def always_there(self: Line, time: Any, inputs: Any, values: Any) -> Any:
    return {OUT: right(self, time, inputs, values)[OUT] * (1.0 + 1e-6 * (values["bend.at"] - 1.0))}


SIMULATES: dict[str, tuple[Callable[..., Any], str]] = {
    "an exception": (lambda self, time, inputs, values: values["sloppe"], "simulate failed, got KeyError: 'sloppe'"),
    "nothing": (lambda self, time, inputs, values: None, "returned no mapping, got NoneType"),
    "a list": (lambda self, time, inputs, values: [inputs[IN]], "returned no mapping, got list"),
    "another channel": (lambda self, time, inputs, values: {"x": inputs[IN]}, f"returned no {OUT}, got x"),
    "one value too many": (
        lambda self, time, inputs, values: {OUT: np.append(inputs[IN], 0.0)},
        r"of shape \(401,\); \(400,\) is needed",
    ),
    "a single number": (lambda self, time, inputs, values: {OUT: 1.0}, r"of shape \(\); \(400,\) is needed"),
    "words": (lambda self, time, inputs, values: {OUT: "much"}, "returned no numbers as"),
    "complex numbers": (lambda self, time, inputs, values: {OUT: inputs[IN] * 1j}, "returned complex numbers as"),
    "not a number": (lambda self, time, inputs, values: {OUT: inputs[IN] * np.nan}, "no solution where fits begin"),
    "a division by zero": (lambda self, time, inputs, values: {OUT: inputs[IN] * (1 / 0)}, "no solution where fits"),
    "something else each time": (drifting, "not the same outputs for the same values twice"),
    "writes to its inputs": (writing, "simulate failed, got ValueError: assignment destination is read-only"),
    "a term that is always there": (always_there, "bend does something at its null"),
}  # fmt: skip


@pytest.mark.parametrize("case", SIMULATES)
def test_what_a_model_does_wrong_is_one_line(case: str) -> None:
    simulate, wanted = SIMULATES[case]
    model = with_simulate(simulate)
    place = {"at": ro.Parameter(unit="N", low=0.5, high=2.0, start=1.0), **TERM.parameters}
    model.terms = (replace(TERM, parameters=place),)
    said = refused(model)
    assert "\n" not in said
    assert re.search(wanted, said), said
    assert said.startswith(f"{__file__}:"), "the model's file comes first"


def test_an_exception_names_its_line() -> None:
    said = refused(with_simulate(SIMULATES["an exception"][0]))
    lines = Path(__file__).read_text(encoding="utf-8").splitlines()
    line = next(k for k, text in enumerate(lines, 1) if "sloppe" in text)
    assert said.startswith(f"{__file__}:{line}: r1: simulate failed")


def test_a_fault_far_from_the_start_says_at_which_values() -> None:
    def breaks(self: Line, time: Any, inputs: Any, values: Any) -> Any:
        if values["slope"] > 1.5:
            raise RuntimeError("too steep")
        return right(self, time, inputs, values)

    said = refused(with_simulate(breaks))
    assert "got RuntimeError: too steep" in said
    assert "here at" in said
    assert "slope = " in said


# ---------------------------------------------------------------- what it declares

DECLARED: dict[str, tuple[dict[str, Any], str]] = {
    "a range the wrong way round": ({"parameters": {"slope": replace(GOOD, low=10.0, high=0.0)}}, "an empty range"),
    "a start outside": ({"parameters": {"slope": replace(GOOD, start=11.0)}}, "outside its range, got 11"),
    "a logarithm of nothing": ({"parameters": {"slope": replace(GOOD, scale="log")}}, "no logarithm, got 0"),
    "a null of what is always fitted": ({"parameters": {"slope": replace(GOOD, null=0.0)}}, "a null is a term's"),
    "not a number": ({"parameters": {"slope": replace(GOOD, high=float("inf"))}}, "not a finite number, got inf"),
    "no number": ({"parameters": {"slope": replace(GOOD, low=None)}}, "slope.low: not a finite number, got None"),  # type: ignore[arg-type]
    "a number beyond all": ({"parameters": {"slope": replace(GOOD, high=10**400)}}, "not a finite number, got 1000"),
    "a channel without a name": ({"inputs": {None: Line.inputs[IN]}}, "a name that is no text, got None"),
    "a unit that is none": ({"outputs": {OUT: Quantity(3.0)}}, f"{OUT}.unit: no text, got 3.0"),  # type: ignore[arg-type]
    "a term without an id": ({"terms": (replace(TERM, id=None),)}, "terms[0].id: no text, got None"),  # type: ignore[arg-type]
    "a sentence of bytes": ({"terms": (replace(TERM, sentence=b"x"),)}, "sentence: no text, got b'x'"),  # type: ignore[arg-type]
    "parameters in a list": ({"terms": (replace(TERM, parameters=[GOOD]),)}, "got list; a mapping is needed"),  # type: ignore[arg-type]
    "a rival without a sentence": ({"terms": (replace(TERM, rivals={"x": None}),)}, "rivals.x: no text"),  # type: ignore[dict-item]
    "conditions in a list": ({"conditions": ["x"]}, "conditions: not of the right type, got list"),
    "a sensor that is none": ({"sensors": ([],)}, "sensors: no list of texts"),
    "a name that is taken": ({"parameters": {"kind": GOOD}}, "not to be used as a name, got 'kind'"),
    "a bare number": ({"parameters": {"slope": 1.0}}, "not a parameter, got float"),
    "a unit that is none of SI": ({"outputs": {OUT: Quantity("mm", "")}}, "not an SI unit, got 'mm'; 'm' is needed"),
    "a channel of another unit": (
        {"outputs": {"ground/sinkage": Quantity("N", "")}},
        "a channel of another unit, got 'N'; 'm'",
    ),
    "a name that is no channel": ({"outputs": {"a b": Quantity("m", "")}}, "not a channel's name, got 'a b'"),
    "an output that is an input": ({"outputs": {IN: Quantity("N", "")}}, "an input as well"),
    "no output": ({"outputs": {}}, "at least one channel that is simulated"),
    "no term": ({"terms": ()}, "at least one term"),
    "a term twice": ({"terms": (TERM, TERM)}, "given twice, got 'bend'"),
    "a term without a null": (
        {"terms": (replace(TERM, parameters={"at": replace(GOOD)}),)},
        "none with a null",
    ),
    "a term that is typically nothing": (
        {"terms": (replace(TERM, parameters={"c": replace(GOOD, start=0.0, null=0.0)}),)},
        "the same as its null",
    ),
    "an id that no report can hold": ({"terms": (replace(TERM, id="Bend 2"),)}, "not to be used, got 'Bend 2'"),
    "a sentence without its value": (
        {"terms": (replace(TERM, sentence="{curve} of it"),)},
        "no such parameter, got 'curve'",
    ),
    "braces in a sentence": ({"terms": (replace(TERM, sentence="{coefficient"),)}, "braces that do not fit"),
    "a condition that is a parameter": ({"conditions": {"slope": Quantity("V", "")}}, "a parameter as well"),
    "a sensor effect that is none": ({"sensors": ("sensor-bais",)}, "sensor-bias"),
    "terms that are none": ({"terms": 3}, "terms: not of the right type, got int"),
}


@pytest.mark.parametrize("case", DECLARED)
def test_what_a_model_declares_wrong_is_one_line(case: str) -> None:
    own, wanted = DECLARED[case]
    said = refused(type("Own", (Line,), own)())
    assert "\n" not in said, said
    assert wanted in said
    assert said.startswith(f"{__file__}: ")


def test_what_is_no_model_says_what_one_has() -> None:
    with pytest.raises(ro.InputError, match="no forward model: without title, inputs"):
        ro.diagnose(object(), measured(1.0, 0.0))  # type: ignore[arg-type]


# ---------------------------------------------------------------- what cannot drive it


def changed(**given: Any) -> dict[str, ro.Recording]:
    recordings = measured(2.5, -0.7, count=2)
    return {**recordings, "r2": replace(recordings["r2"], **given)}


def hole(at: int) -> dict[str, np.ndarray]:
    own = dict(measured(2.5, -0.7, count=2)["r2"].channels)
    own[IN] = np.where(np.arange(400) == at, np.nan, own[IN])
    return own


RECORDINGS: dict[str, tuple[dict[str, Any], str]] = {
    "no input": ({"channels": {OUT: np.ones(400)}}, f"r2: {IN}: missing, got {OUT}"),
    "no output": ({"channels": {IN: np.ones(400)}}, f"r2: no output of the model, got {IN}"),
    "an input that begins late": ({"channels": hole(0)}, f"r2: {IN}: without a value at the first or the last stamp"),
    "a condition that is none": (
        {"conditions": {"initiation.speed": 3.0}},
        "r2: conditions.initiation.speed: no condition",
    ),
    "a clock without a zero": ({"clock": Clock(zero="unknown")}, "r2: clock.zero: got unknown"),
    "a filter": ({"cfc": {OUT: 60}}, f"r2: channels.{OUT}.cfc: got class 60"),
}  # fmt: skip


@pytest.mark.parametrize("case", RECORDINGS)
def test_a_recording_that_cannot_drive_it_is_one_line(case: str) -> None:
    given, wanted = RECORDINGS[case]
    said = refused(Line(), changed(**given))
    assert "\n" not in said
    assert said.startswith(wanted)


def test_a_condition_that_the_model_needs_is_asked_for() -> None:
    class Begun(Line):
        conditions = {"start": Quantity("V", "what is read of nothing")}  # noqa: RUF012 - of one test

    said = refused(Begun(), changed(conditions={"start": "high"}))
    assert said.splitlines() == [
        "r1: conditions.start: missing; the model needs it of each recording, in V",
        "r2: conditions.start: not a number, got 'high'; a number in V is needed",
    ]


def test_a_gap_of_an_input_is_interpolated_and_said() -> None:
    found = diagnose_model(Line(), changed(channels=hole(7)))
    assert f"r2: {IN}: 1 of 400 stamps without a value, interpolated" in found.notes


# ---------------------------------------------------------------- files


@pytest.mark.parametrize(
    ("text", "wanted"),
    [
        ("x = 1\n", "holds no model; an object named 'model' is needed"),
        ("import nothing_of_that_name\n", ":1: cannot be used: ModuleNotFoundError"),
        ("model = 3\n", "no forward model: without title"),
        ("def f(:\n", ":1: cannot be used: SyntaxError"),
    ],
)
def test_a_file_without_a_model_is_one_line(tmp_path: Path, text: str, wanted: str) -> None:
    file = tmp_path / "own.py"
    file.write_text(text)
    with pytest.raises(ro.InputError) as e:
        load_model(file)
    assert str(e.value).startswith(str(file))
    assert wanted in str(e.value)
    assert all(has_cure(f.message) for f in e.value.faults), str(e.value)


@pytest.mark.parametrize("name", ["r1.csv", "own.py.txt", "own"])
def test_a_file_that_is_no_python_is_said_to_be_none(tmp_path: Path, name: str) -> None:
    (tmp_path / name).write_text("model = 3\n")
    with pytest.raises(ro.InputError) as e:
        load_model(tmp_path / name)
    assert str(e.value) == (
        f"{tmp_path / name}: not a Python file of models, got '{name}'; a name that ends in .py is needed"
    )
    assert all(has_cure(f.message) for f in e.value.faults), str(e.value)

    assert "\n" not in str(e.value)


def test_the_command_writes_nothing_for_a_model_that_fails(tmp_path: Path) -> None:
    from rollover.diagnosis.own_model.tables import tables
    from rollover.recording.importers import write_recording

    folder, out = tmp_path / "rec", tmp_path / "out"
    folder.mkdir()
    with tables(Line()):
        for name, r in measured(2.5, -0.7).items():
            write_recording(r, folder / f"{name}.csv")
    text = (
        "from tests.own_model.line import Line\n\n\nclass Own(Line):\n    def simulate(self, time, inputs, values):\n"
    )
    file = tmp_path / "own.py"
    file.write_text(text + "        return values['slop']\n\n\nmodel = Own()\n")
    command = ("-m", "tests.rollover.command", "diagnose", "--model", str(file), str(folder), "--out", str(out))
    done = outside(*command)
    assert done.returncode == 2
    assert done.stderr.splitlines()[-1].startswith(f"{file}:6: r1: simulate failed, got KeyError: 'slop'")
    assert "Traceback" not in done.stderr
    assert not out.exists()
    file.write_text("from tests.own_model.line import model as model\n")
    done = outside(*command, "--workers", "2", "--json")
    assert done.returncode == 0, done.stderr
    assert '"verdict": "no-mismatch"' in done.stdout
    assert '"own.py"' in done.stdout, "the file's hash is stated"
    for option in ("--estimate", "--second-opinion", "--set=a=1", "--reference=r1"):
        assert outside(*command, option).returncode == 2, option

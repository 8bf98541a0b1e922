"""Signals from files: any format alike to the bit, hashes that follow their content, one line for what is wrong."""

from __future__ import annotations

import importlib.util
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from rollover.dynamics import drop_test
from rollover.dynamics.simulate import run
from rollover.recording import Recording
from rollover.recording.importers import write_recording
from rollover.scenario import Scenario, load
from rollover.spec import document
from rollover.spec.inputs import Signal
from rollover.system.errors import InputError

TIME, FORCE = np.arange(0.0, 0.3, 0.01), 300.0 * np.sin(np.arange(0.0, 0.3, 0.01) * 21.0)
CHANNEL = "input/pull/force"
PROFILE = """# p.yaml
format: rollover-profile/1
channels:
  t: {channel: time, unit: s}
  f: {channel: input/pull/force, unit: kN}
"""
SCENARIO = """# s.yaml
base: drop_test.yaml
simulation: {duration: 0.3}
inputs:
  - kind: force
    name: pull
    body: striker
    direction: [0, 0, 1]
    force: %s
"""
PLAIN = "{file: r.csv, channel: input/pull/force}"


@pytest.fixture(autouse=True)
def _inside(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    write_recording(recording(FORCE), "r.csv")
    Path("p.yaml").write_text(PROFILE)


def recording(force: Any, **more: Any) -> Recording:
    return Recording(title="pull", time=TIME, channels={CHANNEL: np.asarray(force), **more}, source="made up")


def scenario(signal: str) -> Scenario:
    Path("s.yaml").write_text(SCENARIO % signal)
    return load("s.yaml")


def fault(signal: str, text: str = SCENARIO) -> str:
    Path("s.yaml").write_text(text % signal)
    with pytest.raises(InputError) as caught:
        load("s.yaml")
    (line,) = str(caught.value).splitlines()
    return line


def as_csv() -> str:
    return PLAIN


def as_parquet() -> str:
    write_recording(recording(FORCE), "q.parquet")
    return "{file: q.parquet, channel: input/pull/force}"


def as_mat() -> str:
    from scipy.io import savemat

    savemat("m.mat", {"t": TIME, "f": FORCE})
    Path("n.yaml").write_text(PROFILE.replace("kN", "N"))
    return "{file: m.mat, channel: input/pull/force, profile: n.yaml}"


def as_mdf() -> str:
    asammdf = pytest.importorskip("asammdf")
    with asammdf.MDF(version="4.10") as file:
        file.append([asammdf.Signal(samples=FORCE, timestamps=TIME, name="f", unit="N")])
        file.save("a.mf4")
    Path("n.yaml").write_text(PROFILE.replace("  t: {channel: time, unit: s}\n", "").replace("unit: kN", "unit: N"))
    return "{file: a.mf4, channel: input/pull/force, profile: n.yaml}"


def as_table() -> str:
    return f"{{time: {TIME.tolist()}, value: {FORCE.tolist()}}}"


def test_every_format_gives_the_same_run_and_the_same_hash() -> None:
    makers = [as_csv, as_parquet, as_mat, as_table] + ([as_mdf] if importlib.util.find_spec("asammdf") else [])
    scenarios = {maker.__name__: scenario(maker()) for maker in makers}
    first = scenarios["as_csv"]
    signal = document.value_at(first, "inputs.pull.force")
    assert signal.value == tuple(FORCE.tolist())
    assert {s: document.content_hash(s) for s in scenarios.values()}.keys() == {first}
    assert len({document.content_hash(s) for s in scenarios.values()}) == 1
    one = run(first).recording
    assert np.ptp(one["input/pull/force"]) > 500.0
    other = run(scenarios["as_mat"]).recording
    for name in one.channels:
        np.testing.assert_array_equal(one[name], other[name], err_msg=name)


def test_the_unit_of_the_column_is_converted() -> None:
    Path("raw.csv").write_text("t,f\n0,0.1\n1,0.3\n")
    found = document.value_at(
        scenario("{file: raw.csv, channel: input/pull/force, profile: p.yaml}"), "inputs.pull.force"
    )
    np.testing.assert_allclose(found.value, [100.0, 300.0])
    Path("angle.csv").write_text("t,f\n0,10\n1,20\n")
    Path("a.yaml").write_text(PROFILE.replace("input/pull/force, unit: kN", "input/table/angle, unit: deg"))
    Path("t.yaml").write_text(
        "base: tilt_table.yaml\ninitiation: {kind: tilt-table, from_deg: 0, to_deg: 70}\ninputs:\n"
        "  - kind: table-angle\n    name: table\n"
        "    angle_deg: {file: angle.csv, channel: input/table/angle, profile: a.yaml}\n"
    )
    np.testing.assert_allclose(document.value_at(load("t.yaml"), "inputs.table.angle_deg").value, [10.0, 20.0])


def test_a_changed_sample_is_another_hash_without_the_file() -> None:
    before = scenario(PLAIN)
    Path("resolved.yaml").write_text(document.dump(before))
    changed = FORCE.copy()
    changed[7] += 1e-9
    write_recording(recording(changed), "r.csv", force=True)
    after = scenario(PLAIN)
    assert document.content_hash(after) != document.content_hash(before)
    Path("r.csv").unlink()
    again = load("resolved.yaml")
    assert again == before
    assert document.content_hash(again) == document.content_hash(before)


def test_no_input_leaves_the_hash_as_it_was() -> None:
    """A list that no older scenario has must not make its results and baselines those of another."""
    assert "inputs: []" in document.dump(load("drop_test"))
    plain = load("drop_test")
    assert document.content_hash(plain) == document.content_hash(plain.replaced({"inputs": []}))
    assert document.content_hash(plain) != document.content_hash(scenario("0.0"))


def test_a_signal_of_too_many_samples_is_refused() -> None:
    many = tuple(0.001 * k for k in range(50_001))
    assert Signal(time=many[1:], value=many[1:]).at(1.5) == pytest.approx(1.5)
    with pytest.raises(ValueError, match=r"^time: too many samples, got 50001; at most 50000, a lower rate$"):
        Signal(time=many, value=many)


def test_offset_and_factor_are_values_like_others() -> None:
    base = scenario(PLAIN.replace("}", ", offset: 0.05}"))
    moved = base.replaced({"inputs.pull.force.offset": 0.1, "inputs.pull.force.factor": 2.0})
    signal = document.value_at(moved, "inputs.pull.force")
    np.testing.assert_allclose(signal.instants, TIME + 0.1)
    np.testing.assert_allclose(signal.values, 2.0 * FORCE)
    assert document.value_at(base.replaced({"inputs.pull.force": 5.0}), "inputs.pull.force").value == (5.0,)


def test_a_drop_with_an_input_is_no_drop_by_itself() -> None:
    """The quick path knows no inputs: it must say so, or a fit would leave the force out."""
    assert "inputs: prescribed over time, got 'pull'" in drop_test.unfit(scenario(PLAIN))
    assert not drop_test.unfit(load("drop_test"))


def test_samples_of_a_slower_clock_are_no_gaps() -> None:
    slow = np.where(np.arange(30) % 3 == 0, FORCE, np.nan)
    write_recording(recording(slow, **{"striker/velocity_z": np.zeros(30)}), "slow.csv")
    signal = document.value_at(scenario("{file: slow.csv, channel: input/pull/force}"), "inputs.pull.force")
    np.testing.assert_allclose(signal.time, TIME[::3])


def holed(at: int) -> str:
    force = FORCE.copy()
    force[at] = np.nan
    write_recording(recording(force, **{"striker/velocity_z": np.zeros(30)}), "h.csv", force=True)
    return "{file: h.csv, channel: input/pull/force}"


HERE = "s.yaml:9: inputs.0.force"
RULES = [
    (
        "{file: r.csv, channel: input/pull/farce}",
        f"{HERE}.channel: no such channel in r.csv, got 'input/pull/farce'; did you mean 'input/pull/force'?",
    ),
    ("{file: gone.csv, channel: a}", f"{HERE}.file: no such file, got 'gone.csv'; a file beside this one is needed"),
    ("{file: ../elsewhere/r.csv, channel: a}", f"{HERE}.file: no such file, got '../elsewhere/r.csv'; a file beside"),
    ("{file: r.csv, channel: input/pull/force, profile: x.yaml}", f"{HERE}.profile: no such file, got 'x.yaml'"),
    ("{file: r.csv}", f"{HERE}.channel: missing; text is needed"),
    ("{file: r.csv, channel: input/pull/force, chanel: 1}", f"{HERE}.chanel: unknown key, got 'chanel'; did you mean"),
    ("r.csv", "s.yaml:9: inputs.pull.force: not a mapping, got text 'r.csv'; a number in N, {time: [...], value:"),
    ("{time: [0, 1], value: [1]}", "s.yaml:9: inputs.pull.force.value: as many as instants are needed, at least one"),
    ("{time: [0, 1, 1], value: [1, 2, 3]}", "s.yaml:9: inputs.pull.force.time: does not rise, got 1.0 after 1.0"),
    ("{time: [], value: []}", "s.yaml:9: inputs.pull.force.value: as many as instants are needed, at least one"),
    ("{time: [0, 1], value: [1, .nan]}", "s.yaml:9: inputs.pull.force.value.1: not finite, got nan"),
]  # fmt: skip


@pytest.mark.parametrize(("signal", "told"), RULES)
def test_one_line_for_what_is_wrong(signal: str, told: str) -> None:
    assert fault(signal).startswith(told)


@pytest.mark.parametrize("at", [0, 12, 29])
def test_a_gap_is_refused_wherever_it_is(at: int) -> None:
    line = fault(holed(at))
    assert line.startswith(f"{HERE}.channel: a gap in h.csv, got no value of 'input/pull/force' from t = ")
    assert "; fill it in the file" in line
    alone = FORCE.copy()
    alone[at] = np.nan
    write_recording(recording(alone), "r.csv", force=True)
    assert "a gap in r.csv" in fault(PLAIN)


def test_a_channel_of_another_quantity_and_a_unit_that_is_none() -> None:
    write_recording(recording(FORCE, **{"striker/velocity_z": FORCE}), "two.csv")
    line = fault("{file: two.csv, channel: striker/velocity_z}")
    assert line.startswith(f"{HERE}.channel: a channel in m/s, got 'striker/velocity_z'; one in N is needed here")
    Path("raw.csv").write_text("t,f\n0,0.1\n1,0.3\n")
    Path("p.yaml").write_text(PROFILE.replace("kN", "kNm"))
    line = fault("{file: raw.csv, channel: input/pull/force, profile: p.yaml}")
    assert line.startswith("p.yaml:5: channels.f.unit")
    assert "unit does not fit input/pull/force, got 'kNm'" in line


def test_a_clock_without_a_zero_asks_for_the_offset() -> None:
    path = Path("r.yaml")
    path.write_text(path.read_text() + "clock: {zero: unknown}\n" if "clock:" not in path.read_text() else "")
    line = fault(PLAIN)
    assert line.startswith(f"{HERE}.offset: the clock of r.csv has no known zero, got no offset; the scenario's time")
    assert document.value_at(scenario(PLAIN.replace("}", ", offset: 0.2}")), "inputs.pull.force").offset == 0.2


DRIVING = """# d.yaml
base: side_overturn.yaml
initiation: {kind: driving, speed: 3.0%s}
inputs:
%s
"""


@pytest.mark.parametrize(
    ("start", "inputs", "told"),
    [
        ("", "- {kind: steering, name: a, angle_deg: 70}", "5: inputs.a.angle_deg: out of bounds, got 70 deg; -60"),
        (", steer_deg: 5", "- {kind: steering, name: a, angle_deg: 3}", "3: initiation.steer_deg: the input 'a' gives"),
        (", drive: {}", "- {kind: steering, name: a, angle_deg: 3}", "3: initiation.drive.torque: missing; a number"),
        (", drive: {torque: 9}", "- {kind: drive-torque, name: a, torque: 3}", "3: initiation.drive.torque: the input"),
        ("", "- {kind: drive-torque, name: a, torque: 3}", "3: initiation.drive: the input 'a' acts on its wheels"),
        (", brake: {}", "- {kind: brake-torque, name: a, torque: -3}", "5: inputs.a.torque: out of bounds, got -3 N m"),
        ("", "- {kind: table-angle, name: a, angle_deg: 3}", "5: inputs.a.kind: turns a tilt table, got"),
        ("", "- {kind: force, name: a, body: striker, direction: [1, 0, 0], force: 3}", "5: inputs.a.body: no such"),
        ("", "- {kind: force, name: a, direction: [0, 0, 0], force: 3}", "5: inputs.a.direction: no direction, got"),
        ("", "- {kind: shake, name: a, direction: [0, 0, 1]}", "5: inputs.a.displacement: one of displacement and"),
        (
            "",
            "- {kind: steering, name: a, angle_deg: 3}\n- {kind: steering, name: b, angle_deg: 4}",
            "6: inputs.b: a second one of kind 'steering', got a, b; one",
        ),
        (
            "",
            "- {kind: shake, name: a, direction: [0, 0, 1], displacement: 0}\n"
            "- {kind: shake, name: a, direction: [0, 1, 0], displacement: 0}",
            "5: inputs: two inputs share a name, got 'a'; each name once",
        ),
    ],
)  # fmt: skip
def test_what_an_input_has_nothing_to_act_on(start: str, inputs: str, told: str) -> None:
    Path("d.yaml").write_text(DRIVING % (start, "\n".join(f"  {line}" for line in inputs.splitlines())))
    with pytest.raises(InputError) as caught:
        load("d.yaml")
    (line,) = str(caught.value).splitlines()
    assert line.startswith(f"d.yaml:{told}")

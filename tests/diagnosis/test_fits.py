"""How fits are made: leaps, shifts, jobs, workers, and what is taken up again."""

from __future__ import annotations

import math
import time
from collections.abc import Sequence
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from rollover.diagnosis import diagnose, diagnosed_text
from rollover.diagnosis.data.dataset import dataset_of
from rollover.diagnosis.fit import levenberg_marquardt
from rollover.diagnosis.fit.jobs import Executor, work
from rollover.diagnosis.fit.levenberg_marquardt import Problem
from rollover.diagnosis.fit.linearisation import ResidualBlock, time_shift_step
from rollover.diagnosis.fit.parameterisation import Candidate, coordinate
from rollover.diagnosis.fit.tasks import Task
from rollover.diagnosis.forward.averaging import simulated
from rollover.diagnosis.forward.discontinuities import largest_jumps_nearby
from rollover.diagnosis.selection.candidates import candidates_of
from rollover.diagnosis.selection.restarts import _best_middle
from rollover.diagnosis.settings import SETTINGS
from rollover.scenario import load
from tests.diagnosis.drops import ACCELERATION, DEPTH, FORCE, recorded, scenario

LAYER = {"effects.soil-layer.depth": 0.08, "effects.soil-layer.stiffness_ratio": 1.3}
GAIN = {"effects.sensor-gain.channel": FORCE, "effects.sensor-gain.gain": 1.05}


def problem_of(recordings: Sequence[Any]) -> Problem:
    found = [dataset_of(name, *simulated(scenario(), r)) for name, r in recordings]
    return Problem([e for e in found if e is not None])


def candidate(problem: Problem, key: str) -> Candidate:
    return next(c for c in candidates_of(problem.dataset, (), "drop") if c.key == key)


def test_a_jump_is_masked_within_a_sample_and_not_beyond() -> None:
    problem = problem_of(recorded({}, speeds=(2.0,), noise=1e-3))
    e = problem.dataset[0]
    signal, part = next((s, p) for s, p in e.spans() if s.channel == DEPTH)
    raw = np.concatenate([s.values for s in e.signals])
    at = part.start + 50
    stepped = raw.copy()
    stepped[part] = 0.0
    stepped[at : part.stop] = signal.span
    measured = stepped.copy()
    measured[at] = 0.4 * signal.span  # the sample that the leap falls into
    moved = [s.values for s in e.signals]
    k = list(e.signals).index(signal)
    moved[k] = measured[part]

    other = replace(e, signals=tuple(replace(s, values=v) for s, v in zip(e.signals, moved, strict=True)))
    discontinuities = other.discontinuities(stepped)
    assert {at - 1, at} <= set(discontinuities.tolist())
    left = (measured - other.masked(stepped, discontinuities))[part]
    assert np.max(np.abs(left)) < 1e-12
    late = measured.copy()
    late[at : at + 9] = 0.0
    moved[k] = late[part]
    other = replace(e, signals=tuple(replace(s, values=v) for s, v in zip(e.signals, moved, strict=True)))
    left = (late - other.masked(stepped, discontinuities))[part]
    assert np.max(np.abs(left)) == pytest.approx(signal.span)


def test_about_a_jump_lie_the_samples_that_it_may_fall_to() -> None:
    times = np.array([0.0, 1.0, 2.0, 3.0])
    sizes = np.array([[0.0, 5.0], [1.0, -2.0], [0.0, 3.0], [0.0, 4.0]])
    found = largest_jumps_nearby(times, np.array([-0.5, 1.5, 1.7, 9.0]), sizes, np.array([1, 0]))
    assert found.tolist() == [[5.0, 3.0, 3.0, 4.0], [0.0, 1.0, 1.0, 0.0]]


def test_a_second_contact_is_masked_at_any_time_shift() -> None:
    """Its force jumps by a third of the peak between two samples whose steps are as large: no two of them show it."""
    oscillation = {
        "effects.structural-compliance.stiffness": 1.54e6,
        "effects.structural-compliance.damping": 78.0,
        "effects.structural-compliance.nose_share": 0.074,
    }
    problem = problem_of(recorded(oscillation, speeds=(2.0,), noise=3e-3, rate=900.0))
    c = candidate(problem, "structural-compliance").whole()
    x = tuple(coordinate(oscillation[f"effects.{c.id}.{p}"], s) for p, s in c.search.items())
    shifts = problem.shifts[0] + np.arange(-1.0e-3, 1.0e-3, 5e-5)
    blocks = [problem.block(0, (c,), x, float(s), 0.0) for s in shifts]
    left = np.array([b.total for b in blocks if b is not None])
    assert np.max(np.abs(np.diff(left))) < 0.2 * np.ptp(left)


def test_a_clock_goes_less_far_where_all_of_its_way_leaves_more() -> None:
    problem = problem_of(recorded({}, speeds=(2.0,), noise=3e-3))
    before = problem.block(0, (), (), problem.shifts[0], 0.0)
    assert before is not None
    far, near = (problem.block(0, (), (), before.shift + d, 0.0) for d in (8e-3, 1e-6))
    back = problem._backtracked_shift(0, (), (), before, far)
    assert back is not None
    assert back.shift == before.shift
    assert problem._backtracked_shift(0, (), (), replace(before, residual=2.0 * before.residual), near) is near
    assert problem._backtracked_shift(0, (), (), before, None) is None


def test_a_linearised_residual_knows_its_robust_weight() -> None:
    problem = problem_of(recorded({}, speeds=(2.0,), noise=1e-3))
    for heavy_tailed in (True, False):
        problem.heavy_tailed = heavy_tailed
        found = problem.block(0, (), (), 0.0, problem.effort.fine)
        assert found is not None
        assert found.masked is heavy_tailed


@pytest.mark.parametrize("late", [-50.0, 50.0])
def test_time_shifts_stay_where_their_clock_can_be(late: float) -> None:
    slope = np.linspace(-1.0, 1.0, 40)
    block = ResidualBlock(residual=late * slope, J=np.zeros((40, 0)), slope=slope, shift=0.5, prior=1.0)
    free = ResidualBlock(residual=0.1 * slope, J=np.zeros((40, 0)), slope=slope, shift=0.0, prior=1.0)
    assert 0.5 + time_shift_step(block, np.zeros(0)) == pytest.approx(np.sign(late) * 4.0)
    assert 0.0 < time_shift_step(free, np.zeros(0)) < 0.1


def test_a_stiffness_far_off_is_found_from_every_start() -> None:
    problem = problem_of(recorded({"effects.soil-stiffness.scale": 1.4}, speeds=(1.2, 3.2), noise=5e-3))
    c = candidate(problem, "soil-stiffness")
    for start in c.starts():
        fitted = problem.fit((c,), start)
        assert fitted is not None
        assert c.values(fitted.x)["scale"] == pytest.approx(1.4, rel=0.01), start


def test_a_first_fit_ends_alike_with_and_without_jacobian() -> None:
    """Central or not, each slope at its end is a simulation of each recording."""
    recordings = recorded({"effects.soil-stiffness.scale": 1.4}, speeds=(1.2, 3.2), noise=5e-3)
    c = candidate(problem_of(recordings), "soil-stiffness")
    whole, first = problem_of(recordings), problem_of(recordings)
    a = whole.fit((c,), c.starts()[0], rounds=2, shifts=(0.0, 0.0))
    b = work(first, Task(candidates=(c,), start=c.starts()[0], shifts=(0.0, 0.0), rounds=2))
    assert a is not None
    assert b is not None
    assert (b.x, [one.shift for one in b.blocks]) == (a.x, [one.shift for one in a.blocks])
    assert b.chi2 == a.chi2
    assert all(np.any(one.J) for one in a.blocks)
    assert not any(np.any(one.J) for one in b.blocks)
    assert first.simulations <= whole.simulations - 2 * len(recordings)


@pytest.mark.parametrize("workers", [2])
def test_any_number_of_workers_gives_the_same_fits(workers: int) -> None:
    recordings = recorded(GAIN, speeds=(1.2, 3.2))
    tasks = []
    for key in (f"sensor-gain:{FORCE}", "soil-stiffness"):
        c = candidate(problem_of(recordings), key)
        tasks.append(Task(candidates=(c,), start=c.starts()[0], shifts=(0.0, 0.0), rounds=3))
    alone = Executor().fits(problem_of(recordings), tasks)
    scan = partial(_best_middle, beside=(), shifts=(0.0, 0.0), most=math.inf)
    things = [(task.candidates[0], task.candidates[0].starts()) for task in (*tasks, tasks[0])]
    seen = Executor().parallel_map(problem_of(recordings), scan, things)
    with Executor(workers) as many:
        assert many.fits(problem_of(recordings), tasks)[0] is not None  # in this process: none has begun
        assert many.children._pool is None
    with Executor(workers) as many:
        many.begin(problem_of(recordings))
        while not many.is_there():
            time.sleep(0.1)
        problem = problem_of(recordings)
        together = many.fits(problem, tasks)
        assert many.parallel_map(problem, scan, things) == seen
        assert many.each(math.factorial, range(9)) == [math.factorial(k) for k in range(9)]
        assert not problem._raw  # nothing was simulated here
        assert many.children._pool is not None
        with pytest.raises(RuntimeError, match=r"factorial: ValueError"):
            many.each(math.factorial, [1, -1])
    assert many.children._pool is None
    for a, b in zip(alone, together, strict=True):
        assert a is not None
        assert b is not None
        assert a.x == b.x
        assert a.chi2 == b.chi2


def test_what_was_fitted_is_taken_up_again(tmp_path: Path) -> None:
    recordings = recorded(GAIN, speeds=(1.2, 3.2))
    problem = problem_of(recordings)
    c = candidate(problem, f"sensor-gain:{FORCE}")
    task = Task(candidates=(c,), start=c.starts()[0], shifts=(0.0, 0.0))
    notebook = tmp_path / "fits"
    first = Executor(notebook=notebook).fits(problem, [task])[0]
    with notebook.open("a") as file:
        file.write('{"key": "broken off he')
    other = problem_of(recordings)
    other_executor = Executor(notebook=notebook)
    again = other_executor.fits(other, [task])[0]
    assert first is not None
    assert again is not None
    assert again.x == first.x
    assert again.chi2 == pytest.approx(first.chi2, rel=1e-12)
    assert other.simulations < problem.simulations
    assert Executor(notebook=notebook, about="another scenario")._done.keys() == other_executor._done.keys()
    assert task.key("another") not in other_executor._done
    other_executor.close()
    assert not notebook.exists()


def test_a_sensor_effect_on_two_channels_is_written_twice(tmp_path: Path) -> None:
    changes = {
        "effects.sensor-bias.channel": FORCE,
        "effects.sensor-bias.bias": 200.0,
        "effects.sensor-bias-2.channel": DEPTH,
        "effects.sensor-bias-2.bias": 0.02,
    }
    recordings = recorded(changes, speeds=(1.2, 2.2, 3.2), noise=3e-3)
    found = diagnose(scenario(), recordings)
    assert found.verdict == "sensor"
    assert {(e.id, e.channel) for e in found.effects} == {("sensor-bias", FORCE), ("sensor-bias", DEPTH)}
    path = tmp_path / "scenario.yaml"
    path.write_text(diagnosed_text(scenario(), found), encoding="utf-8")
    effects = load(path).effects
    assert {e.channel: e.bias for e in effects.values()} == {
        FORCE: pytest.approx(200.0, rel=0.05),
        DEPTH: pytest.approx(0.02, rel=0.05),
    }


def test_a_lone_accelerometer_may_be_turned_or_read_low() -> None:
    """cos(0.25) = 0.969: without the channel across both read the same; a gain of 3 % is common, 14 degrees are not."""
    turned = {"effects.sensor-misalignment.channel": ACCELERATION, "effects.sensor-misalignment.angle": 0.25}
    found = diagnose(scenario(), recorded(turned, 10, speeds=(1.2, 2.2, 3.2), channels=(FORCE, ACCELERATION)))
    (named,) = found.effects
    assert named.id == "sensor-gain"
    assert named.indistinguishable_from == ("sensor-misalignment",)
    assert "a motion across the channel" in named.discriminating_test


@pytest.mark.parametrize(("offset", "of_two"), [(-0.001, True), (-0.01, False)])
def test_of_two_channels_nobody_can_tell_which_is_late(offset: float, of_two: bool) -> None:
    """But by more than the recordings' own clocks may be off it is the one that is alone in it."""
    late = {"effects.sensor-clock-offset.channel": FORCE, "effects.sensor-clock-offset.offset": offset}
    for channels in ((FORCE, DEPTH), (FORCE, DEPTH, ACCELERATION)):
        found = diagnose(scenario(), recorded(late, 3, channels=channels, rate=1000.0, noise=0.003))
        (named,) = found.effects
        assert named.id == "sensor-clock-offset"
        told = "cannot be identified" in named.statement
        assert told == (of_two and len(channels) == 2), named.statement


@pytest.mark.parametrize(
    ("id", "hidden", "shape"),
    [
        ("soil-layer", {"depth": 0.1, "stiffness_ratio": 1.6, "onset": 1.0}, "onset"),
        ("soil-layer", {"depth": 0.1, "stiffness_ratio": 1.6, "width": 0.03}, "width"),
        ("soil-layer", {"depth": 0.1, "stiffness_ratio": 1.0, "stiffness": 8e3}, "stiffness"),
        ("soil-viscous-damping", {"damping": 0.0, "proportion": 0.1}, "proportion"),
        ("soil-elastic-rebound", {"recovery": 0.08, "damping_ratio": 0.03, "clings": 1.0}, "clings"),
        (
            "soil-rate-hardening",
            {"per_decade": 0.0, "power": 0.06, "reference_speed": 0.5, "slowest": 1e-3},
            "reference_speed",
        ),
        ("soil-crust", {"thickness": 0.06, "stiffness_ratio": 1.6, "width": 0.05}, "width"),
        ("soil-crust", {"thickness": 0.06, "stiffness_ratio": 1.6, "remains": 1.0}, "remains"),
        ("sensor-lag", {"channel": FORCE, "time": 0.006, "second_order": 0.5}, "second_order"),
        ("soil-rate-hardening", {"per_decade": 0.1, "reference_speed": 0.3}, "reference_speed"),
    ],
)
def test_the_form_of_an_effect_is_found_with_it(id: str, hidden: dict[str, Any], shape: str) -> None:
    changes = {f"effects.{id}.{name}": value for name, value in hidden.items()}
    # with 11 one of these twenty intervals misses by 2.2 deviations, as one in twenty does
    found = diagnose(scenario(), recorded(changes, 12, speeds=(1.0, 1.7, 2.6, 3.4), rate=1000.0))
    (named,) = found.effects
    assert named.id == id
    for name in (n for n in hidden if n != "channel"):
        told = named.parameters[name]
        assert told.low - 1e-9 <= hidden[name] <= told.high + 1e-9, (name, told)
    assert named.parameters[shape].high - named.parameters[shape].low < 0.5 * hidden[shape]


def test_a_fit_in_another_form_is_taken_up_from_the_notebook(tmp_path: Path) -> None:
    """A power has two numbers where a logarithm has one: what was fitted is told by its form, not by how many."""
    power = {"effects.soil-rate-hardening." + n: v for n, v in (("per_decade", 0.0), ("power", 0.3))}
    problem = problem_of(recorded(power, 13, speeds=(1.2, 2.4, 3.4), noise=0.002))
    rate = candidate(problem, "soil-rate-hardening")
    begun = problem.fit((rate,), (0.5,))
    assert begun is not None
    shifts, variant = tuple(b.shift for b in begun.blocks), rate.variants()[0]
    task = Task(how="secondary", candidates=(rate,), start=begun.x, shifts=shifts, variant=variant)
    found = []
    for _ in range(2):
        with Executor(notebook=tmp_path / "notes") as one:
            before = problem.simulations
            found += one.fits(problem, [task])
            made = problem.simulations - before
    first, again = found
    assert first is not None
    assert again is not None
    assert first.candidates[-1].variant["per_decade"] == 0.0
    assert again.candidates[-1] == first.candidates[-1]
    assert again.x == pytest.approx(first.x, rel=1e-12)
    assert made < 20


def test_far_from_noise_a_fit_stops_at_a_small_gain(monkeypatch: pytest.MonkeyPatch) -> None:
    """A layer fitted as a rate leaves 3.7 times the noise: the last thousandths of what is beyond it tell nothing.

    What is met is fitted as far as ever.
    """
    problem = problem_of(recorded(LAYER, 3, speeds=(1.2, 2.2, 3.2)))
    ends: dict[tuple[str, float], tuple[tuple[float, ...], float, int]] = {}
    for key, start in (("soil-rate-hardening", (0.5,)), ("soil-layer", (0.6, 0.6))):
        for trifling in (0.0, SETTINGS.fit.levenberg_marquardt.converged_share):
            tuning = replace(levenberg_marquardt.TUNING, converged_share=trifling)
            monkeypatch.setattr(levenberg_marquardt, "TUNING", tuning)
            own = problem.no_jacobian()
            found = own.fit((candidate(problem, key),), start)
            assert found is not None
            ends[key, trifling] = found.x, found.chi2, own.simulations
    (x, left, made), (y, more, fewer) = (
        ends["soil-rate-hardening", t] for t in (0.0, SETTINGS.fit.levenberg_marquardt.converged_share)
    )
    assert fewer < made
    assert left <= more < 1.005 * left
    assert y == pytest.approx(x, abs=0.02)
    (x, left, _), (y, more, _) = (
        ends["soil-layer", t] for t in (0.0, SETTINGS.fit.levenberg_marquardt.converged_share)
    )
    assert more == pytest.approx(left, abs=SETTINGS.fit.levenberg_marquardt.converged_gain)
    assert y == pytest.approx(x, abs=1e-3)


def test_a_strength_is_stated_in_what_is_usual() -> None:
    """A gain's usual error is 3 %, an axis is turned by 0.05 rad; a threshold that nothing is null of says nothing."""
    problem = problem_of(recorded({}, speeds=(2.0,), channels=(FORCE, ACCELERATION)))
    cases = {
        f"sensor-gain:{ACCELERATION}": (0.97, 1.0),
        f"sensor-misalignment:{ACCELERATION}": (0.25, 5.0),
        f"sensor-clipping:{ACCELERATION}": (50.0, 1.0),
    }
    for key, (value, times) in cases.items():
        c = candidate(problem, key)
        [search] = c.search.values()
        assert c.strength([coordinate(value, search)]) == pytest.approx(times, rel=1e-9)


def test_what_is_held_out_has_no_part_in_the_fit() -> None:
    good = recorded(GAIN, speeds=(1.2, 2.2, 3.2))
    other = recorded({**GAIN, "effects.sensor-gain.gain": 1.4}, seed=3, speeds=(2.7,))
    kept = [("kept", other[0][1])]
    found = diagnose(scenario(), [*good, *kept], hold_out=["kept"])
    alone = diagnose(scenario(), good)
    assert [e.id for e in found.effects] == [e.id for e in alone.effects] == ["sensor-gain"]
    assert found.effects[0].parameters["gain"].value == alone.effects[0].parameters["gain"].value
    assert found.training == tuple(name for name, _ in good)
    assert found.held_out == ("kept",)
    assert found.after["training"].nrmse < 1.2
    assert found.after["held_out"].nrmse > 3.0  # a recording of another world is not made to fit


def test_one_condition_alone_says_that_nothing_was_held_out() -> None:
    found = diagnose(scenario(), recorded({}, speeds=(2.0,)))
    assert any("one recording only" in note for note in found.notes)
    named = diagnose(scenario(), recorded(GAIN, speeds=(2.0,)))
    assert named.effects
    assert "the misfit falls" in named.sentence
    assert "With one recording nothing can be held out" in named.sentence


def test_a_rebound_is_searched_from_the_laws_own_restitution() -> None:
    recordings = recorded({"effects.soil-elastic-rebound.recovery": 0.0222}, speeds=(1.5, 3.0), noise=5e-3)
    problem = problem_of(recordings)
    own = scenario().ground.law.recovery
    c = next(c for c in candidates_of(problem.dataset, (), "drop", scenario()) if c.key == "soil-elastic-rebound")
    assert c.search["recovery"].low == own > 0.0
    fits = [f for start in c.starts()[:8] if (f := problem.fit((c,), start)) is not None]  # the lowest it may be
    best = min(fits, key=lambda f: f.chi2)
    assert c.values(best.x)["recovery"] == pytest.approx(0.0222, rel=0.02)

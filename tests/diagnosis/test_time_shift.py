"""When a clock began: the first contact tells it, however wrong the simulation is later; and what a shift does."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from rollover.diagnosis.data.dataset import Dataset, dataset_of
from rollover.diagnosis.fit.levenberg_marquardt import Problem
from rollover.diagnosis.fit.local_search import ended
from rollover.diagnosis.fit.parameterisation import coordinate, followed
from rollover.diagnosis.fit.time_shift import (
    clock_offset_sentence,
    clock_outliers,
    estimate_time_shifts,
    shifts_from_contact,
)
from rollover.diagnosis.forward.forward_model import DropSimulator, simulator_of
from rollover.diagnosis.selection.candidates import candidates_of
from rollover.diagnosis.selection.score_test import score_test
from rollover.diagnosis.settings import SETTINGS
from rollover.dynamics.drop_test import DropModel
from rollover.effects import spoken
from rollover.recording import Clock
from tests.diagnosis.drops import ACCELERATION, DEPTH, FORCE, recorded, scenario

HARDPAN = {"effects.soil-layer.depth": 0.08, "effects.soil-layer.stiffness_ratio": 1.6}
CRUST = {"effects.soil-crust.thickness": 0.06, "effects.soil-crust.stiffness_ratio": 0.75}


def problem_of(changes: dict[str, object], *, late: float = 0.0, rate: float = 1000.0, noise: float = 0.003) -> Problem:
    """Three drops whose clocks are late by `late` more than `recorded` makes them by chance."""
    found: list[Dataset] = []
    for name, r in recorded(changes, 3, channels=(FORCE, DEPTH, ACCELERATION), rate=rate, noise=noise):
        moved = replace(r, time=r.time + late)
        one = dataset_of(name, moved, simulator_of(scenario(), moved))
        assert one is not None
        found.append(one)
    return Problem(found)


def without_zero(problem: Problem, since: float = -np.inf) -> Problem:
    """The same recordings from `since` (s) on, by clocks that have no zero."""
    found = []
    for e in problem.dataset:
        inside, clock = e.recording.time > since, replace(e.recording.clock, zero="unknown")
        channels = {c: v[inside] for c, v in e.recording.channels.items()}
        r = replace(e.recording, time=e.recording.time[inside], channels=channels, clock=clock)
        one = dataset_of(e.name, r, simulator_of(scenario(), r))
        assert one is not None
        found.append(one)
    return Problem(found)


def known(problem: Problem, changes: dict[str, object]) -> np.ndarray:
    """Time shifts by fits of the truth itself, s."""
    id = next(iter(changes)).split(".")[1]
    c = {c.id: c for c in candidates_of(problem.dataset, (), "drop")}[id]
    x = [coordinate(float(str(changes[f"effects.{id}.{n}"])), s) for n, s in c.search.items()]
    fitted = problem.fit((c,), x, shifts=[0.0] * len(problem.dataset))
    assert fitted is not None
    return np.array([b.shift for b in fitted.blocks])


@pytest.mark.parametrize("missing", [HARDPAN, CRUST], ids=["hardpan", "crust"])
def test_the_onset_is_not_biased_by_missing_physics(missing: dict[str, object]) -> None:
    problem = problem_of(missing, late=0.5e-3)
    truth = known(problem, missing)
    estimate_time_shifts(problem)
    base = problem.fit((), ())
    assert base is not None
    curved = np.array([b.shift for b in base.blocks]) - truth
    early = np.array([np.nan if v is None else v for v in shifts_from_contact(problem, (), ())]) - truth
    assert np.abs(curved).max() > 0.6e-3  # a whole recording's shift eats part of it
    assert np.abs(early).max() < 0.25e-3


@pytest.mark.parametrize("late", [-0.008, 0.013])
def test_the_onset_of_contact_is_found_whatever_happens_then(late: float) -> None:
    """A striker that gives way rings from the first instant, and its recorder's clock has no zero."""
    oscillation = {"effects.structural-compliance.stiffness": 1.9e6, "effects.structural-compliance.damping": 1400.0}
    problem = without_zero(problem_of(oscillation, late=late))
    estimate_time_shifts(problem)
    base = problem.fit((), ())
    assert base is not None
    curved = np.array([b.shift for b in base.blocks]) - late
    early = np.array([np.nan if v is None else v for v in shifts_from_contact(problem, (), ())]) - late
    assert np.abs(curved).max() > 2e-3
    assert np.abs(early).max() < 1.3e-3  # the clocks themselves stray by half a millisecond


def test_a_recording_that_begins_in_contact_has_no_onset() -> None:
    assert shifts_from_contact(without_zero(problem_of({}), since=0.012), (), ()) == [None, None, None]


def test_a_large_offset_of_a_known_clock_is_not_believed() -> None:
    problem = problem_of({}, late=5.0e-3)
    loose = []
    for e in problem.dataset:
        clock = replace(e.recording.clock, zero="unknown")
        loose.append(replace(e, recording=replace(e.recording, clock=clock)))
    told = [np.nan if v is None else v for v in shifts_from_contact(Problem(loose), (), ())]
    far = [abs(v) > SETTINGS.fit.time_shift.believed_width * e.shift_prior for v, e in zip(told, loose, strict=True)]
    assert any(far)
    assert [v is None for v in shifts_from_contact(problem, (), ())] == far


def test_the_slope_of_a_clock_is_that_of_the_simulation() -> None:
    """Against central differences of the model itself, in the smooth part of the loading."""
    problem = problem_of({}, rate=500.0)
    block = problem.block(0, (), (), 0.0, 0.0)
    assert block is not None
    e = problem.dataset[0]
    speed = e.recording.conditions["initiation.speed"]
    model = DropModel(scenario=scenario(), step=1e-3).with_({"initiation.speed": speed})
    time, h = e.recording.time, 1e-5
    rates = {c: (model.run(time - h)[c] - model.run(time + h)[c]) / (2 * h) for c in (FORCE, DEPTH, ACCELERATION)}
    wanted = e.whitened(np.concatenate([rates[s.channel][s.rows] for s in e.signals]))
    smooth = np.concatenate([(time[s.rows] > 0.02) & (time[s.rows] < 0.1) for s in e.signals])
    assert block.slope[smooth] == pytest.approx(wanted[smooth], rel=0.02, abs=2e-3 * np.abs(wanted).max())


def test_one_fall_serves_every_clock() -> None:
    """A shift, or a channel with a clock of its own, reads the same fall again; one far off makes it longer."""
    e = problem_of({}).dataset[0]
    assert isinstance(e.simulator, DropSimulator)
    stiffer, scenario = {"effects.soil-stiffness.scale": 1.1}, e.simulator.model.scenario
    simulator = DropSimulator(scenario, e.recording)
    first = simulator.predict(stiffer, 0.0)
    (fall,) = simulator._tracks.values()
    late = {"effects.sensor-clock-offset.channel": DEPTH, "effects.sensor-clock-offset.offset": 0.002}
    for shift in (simulator.effort.later, 0.01, -0.01):
        moved = simulator.predict({**stiffer, **late}, shift)
        assert list(simulator._tracks.values()) == [fall]
        alone = DropSimulator(scenario, e.recording).predict({**stiffer, **late}, shift)
        assert first is not None
        assert moved is not None
        assert alone is not None
        assert all(np.array_equal(moved[c], alone[c]) for c in alone)
        assert not np.array_equal(first[DEPTH], moved[DEPTH])
    assert simulator.predict(stiffer, -0.1) is not None
    (longer,) = simulator._tracks.values()
    assert longer.until == pytest.approx(fall.until + 0.1)
    with pytest.raises(ValueError, match=r"times: beyond the track, got 9 s; it ends at "):
        longer.rows(np.array([0.0, 9.0]))


def test_fits_from_two_places_end_at_one() -> None:
    """A soil a thousandth softer than its law: followed to its end, from wherever it began, a fit leaves the same."""
    problem = problem_of({"effects.soil-stiffness.scale": 0.9987}, noise=0.0005)
    candidate = {c.id: c for c in candidates_of(problem.dataset, (), "drop")}["soil-stiffness"]
    estimate_time_shifts(problem)
    ends = [problem.fit((candidate,), (start,)) for start in (0.40, 0.5, 0.62)]
    left = [ended(problem, f).chi2 for f in ends if f is not None]
    assert len(left) == 3
    assert max(left) - min(left) < 0.01


def test_the_score_test_leads_to_where_the_effect_is() -> None:
    mild = {**HARDPAN, "effects.soil-layer.stiffness_ratio": 1.05}
    problem = problem_of(mild)
    candidates = [c for c in candidates_of(problem.dataset, (), "drop") if c.id == "soil-layer"]
    shifts = known(problem, mild)
    base = problem.fit((), (), shifts=shifts.tolist(), rounds=0)
    assert base is not None
    starts = score_test(problem, base, candidates).starts["soil-layer"]
    values = [candidates[0].values(x) for x in starts]
    assert any(abs(v["depth"] - 0.08) < 0.025 and 1.03 < v["stiffness_ratio"] < 1.07 for v in values), values


def test_a_path_from_the_null_value_is_followed_linearly() -> None:
    problem = problem_of({})
    by_id = {c.key: c for c in candidates_of(problem.dataset, (), "drop")}
    layer = by_id["soil-layer"]
    x = layer.scan_points()[0]
    there = followed(layer, x, 30.0)
    assert there is not None
    before, after = layer.values(x), layer.values(there)
    assert after["stiffness_ratio"] - 1.0 == pytest.approx(30.0 * (before["stiffness_ratio"] - 1.0))
    assert after["depth"] == before["depth"]
    clip = by_id[f"sensor-clipping:{FORCE}"]
    assert followed(clip, clip.scan_points()[0], 3.0) is None


def one_late(problem: Problem, late: float) -> Problem:
    """The same, with the clock of the second recording off by `late` (s) more, and said to be right."""
    second = problem.dataset[1]
    moved = replace(second.recording, time=second.recording.time + late)
    one = dataset_of(second.name, moved, simulator_of(scenario(), moved))
    assert one is not None
    return Problem([problem.dataset[0], one, *problem.dataset[2:]])


@pytest.mark.parametrize("late", [0.05, -0.03])
def test_a_large_offset_is_estimated_by_alignment_of_the_run(late: float) -> None:
    problem = one_late(problem_of({}), late)
    base = problem.fit((), (), rounds=3)
    assert base is not None
    [(name, found)] = clock_outliers(problem, base)
    assert name == problem.dataset[1].name
    assert found == pytest.approx(late, abs=2e-3)  # what `recorded` makes it late by itself is up to 1.5 ms
    said = clock_offset_sentence([(name, found)])
    assert f"{spoken(abs(found) * 1e3)} ms {'late' if late > 0 else 'early'} ({name})" in said


@pytest.mark.parametrize("missing", [{}, HARDPAN, {"effects.soil-stiffness.scale": 2.0}])
def test_no_clock_is_blamed_for_what_the_simulation_misses(missing: dict[str, object]) -> None:
    problem = problem_of(missing)
    base = problem.fit((), (), rounds=3)
    assert base is not None
    assert clock_outliers(problem, base) == []
    assert clock_offset_sentence([]) == ""


def cut_at(problem: Problem, until: float) -> Problem:
    """The second recording alone, without what comes after `until` (s)."""
    e = problem.dataset[1]
    rows = np.flatnonzero(e.recording.time < until)
    kept = {c: v[rows] for c, v in e.recording.channels.items()}
    cut = replace(e.recording, time=e.recording.time[rows], channels=kept)
    one = dataset_of(e.name, cut, simulator_of(scenario(), cut))
    assert one is not None
    return Problem([one])


@pytest.mark.parametrize(("until", "told"), [(0.18, [0.15]), (0.14, [])])
def test_any_contact_gives_a_time_shift_and_none_gives_none(until: float, told: list[float]) -> None:
    """150 ms late: of 30 ms after it most samples come before all that is simulated at the stamps as they are."""
    short = cut_at(one_late(problem_of({}), 0.15), until)
    base = short.fit((), (), rounds=3)
    assert base is not None
    assert [round(s, 2) for _, s in clock_outliers(short, base)] == told


@pytest.mark.parametrize("late", [0.4, -0.1, 7.0])
def test_a_time_shift_is_estimated_beside_missing_physics(late: float) -> None:
    """What rests long before or after its impact is met by most samples at many a clock: 0.4 s was called 0.243."""
    problem = one_late(problem_of({"effects.soil-viscous-damping.damping": 250.0}), late)
    base = problem.fit((), (), rounds=3)
    assert base is not None
    [(name, found)] = clock_outliers(problem, base)
    assert name == problem.dataset[1].name
    assert found == pytest.approx(late, abs=0.016)  # no more than the damping bends it


def test_what_is_at_rest_tells_no_time() -> None:
    """Recorded from 0.25 s after its contact on, by a clock 0.25 s early: most of it is met by any earlier one."""
    problem = problem_of({})
    e = problem.dataset[1]
    rows = np.flatnonzero(e.recording.time > 0.25)
    kept = {c: v[rows] for c, v in e.recording.channels.items()}
    for clock in (e.recording.clock, Clock(within=8.0)):
        resting = replace(e.recording, time=e.recording.time[rows] - 0.25, channels=kept, clock=clock)
        one = dataset_of(e.name, resting, simulator_of(scenario(), resting))
        assert one is not None
        alone = Problem([one])
        base = alone.fit((), (), rounds=0)
        assert base is not None
        assert clock_outliers(alone, base) == []


def test_milliseconds_that_are_many_are_spoken_in_full() -> None:
    assert " 6,990 ms late (d)" in clock_offset_sentence([("d", 6.99)])


def test_a_channel_far_too_early_is_screened_in_full_runs_too() -> None:
    """An impact of 20 ms that one channel shows 30 ms early: what a millisecond would do has nothing to do with it."""
    problem = problem_of(
        {"effects.sensor-clock-offset.channel": ACCELERATION, "effects.sensor-clock-offset.offset": -0.03}
    )
    base = problem.fit((), (), rounds=3)
    assert base is not None
    every = candidates_of(problem.dataset, (), "drop")
    [c] = [c for c in every if c.key == f"sensor-clock-offset:{ACCELERATION}"]
    near = score_test(problem, base, [c])
    problem.effort = replace(problem.effort, is_ensemble=True)
    far = score_test(problem, base, [c])
    truth = coordinate(-0.03, c.search["offset"])
    assert far.score > 5.0 * near.score
    # 5 ms, a quarter of the impact: from there a fit goes to it
    assert far.starts[c.key][0][0] == pytest.approx(truth, abs=0.05)
    assert near.starts[c.key][0][0] != pytest.approx(truth, abs=0.15)
    assert {c.id for c in every if c.further()} == {"sensor-clock-offset", "sensor-clock-drift"}


def test_a_record_that_ends_at_contact_has_no_onset() -> None:
    ended = [
        dataset_of(n, r, simulator_of(scenario(), r))
        for n, r in recorded({}, 3, channels=(ACCELERATION, "striker/position_z"), rate=1000.0, until=0.001)
    ]
    problem = Problem([e for e in ended if e is not None])
    assert len(problem.dataset) == 3
    assert all(at is None or abs(at) < 0.03 for at in shifts_from_contact(problem, (), ()))

"""A recording against a run: what is compared, through which filter, by phase, and the clock left alone."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from rollover.comparison import alignment
from rollover.comparison.clock_offset import Clock
from rollover.comparison.misfit import Misfit, contact, estimated_noise, misfit
from rollover.comparison.rating import Rating
from rollover.dynamics.result import Event, Run
from rollover.recording import Recording, Sensor
from rollover.recording.filters import filtered
from tests.rollover.example import run_of
from tests.rollover.twin import NOISE, drop, recorded, scene

FORCE = "ground/force_normal"


def run() -> Run:
    """A finished run around the twin's drop at 3 m/s: contact at 0, the turn at the deepest sinkage."""
    scenario = scene()
    recording = drop(scenario)
    turn = float(recording.time[int(np.argmax(recording["ground/sinkage"]))])
    return replace(
        run_of(scenario),
        recording=recording,
        phases=((-0.01, "approach"), (0.0, "impact")),
        events=(Event(time=turn, kind="unloading", subject="striker", place=(0.0, 0.0, 0.0)),),
    )


@pytest.fixture(scope="module")
def of_noise() -> Misfit:
    made = recorded(scene(), {}, np.random.default_rng(1), every=1)
    return misfit(run(), made)


def test_a_recording_that_differs_by_its_noise_only(of_noise: Misfit) -> None:
    assert [c.channel for c in of_noise.channels] == list(NOISE)
    assert {cell.phase for cell in of_noise.channels[0].cells} == {"approach", "loading", "unloading"}
    for c in of_noise.channels:
        assert c.noise == NOISE[c.channel]
        for cell in c.cells:
            assert isinstance(cell.rating, Rating)
            n = cell.samples
            # the root mean square of n normal numbers is within 5/sqrt(2 n) of 1 but once in a million
            assert cell.rating.over_noise == pytest.approx(1.0, abs=5.0 / np.sqrt(2.0 * n))
            assert abs(cell.bias) < 5.0 * NOISE[c.channel] / np.sqrt(n)


def test_shares_are_of_the_whole_residual(of_noise: Misfit) -> None:
    assert sum(cell.share for c in of_noise.channels for cell in c.cells) == pytest.approx(1.0)
    loading = {c.channel: c.cells[1] for c in of_noise.channels}[FORCE]
    samples = sum(cell.samples for c in of_noise.channels for cell in c.cells)
    assert loading.share == pytest.approx(loading.samples / samples, rel=0.2)


def test_contact_is_seen_in_the_recording(of_noise: Misfit) -> None:
    """5 sigma of 30 N on a first stiffness of 75 kN/m at 2.7 m/s: 2 mm deep after 0.7 ms, plus three rows of 0.25."""
    assert of_noise.contact_simulated == 0.0
    assert of_noise.contact_measured == pytest.approx(0.00075, abs=0.0006)


def test_a_recording_that_begins_in_contact_has_none() -> None:
    made = drop(scene())
    late = made.time > 0.05
    cut = Recording(title="late", time=made.time[late], channels={FORCE: made[FORCE][late]})
    assert contact(cut) is None


def test_the_clock_is_told_and_left_alone() -> None:
    late = recorded(scene(), {}, np.random.default_rng(2), every=1, late=1.5e-3)
    found = misfit(run(), late)
    assert found.clock is not None
    assert found.clock.offset == pytest.approx(1.5e-3, abs=5.0 * found.clock.sigma)
    assert found.clock.sigma < 2e-5
    assert found.clock.gain > 0.5
    assert not found.clock.at_limit
    # the residual is that of the stamps as they are
    force = found.channels[0]
    true = np.interp(force.time, run().recording.time, run().recording[FORCE])
    assert np.array_equal(force.simulated, true)


def test_with_the_clock_right_setting_it_gains_nothing(of_noise: Misfit) -> None:
    assert of_noise.clock is not None
    assert abs(of_noise.clock.offset) < 4.0 * of_noise.clock.sigma
    assert of_noise.clock.gain < 0.01


def test_an_applied_filter_goes_over_the_simulation_alone() -> None:
    base = run()
    smooth = filtered(base.recording[FORCE], 2.5e-4, 60)
    made = Recording(title="CFC 60", time=base.recording.time, channels={FORCE: smooth}, cfc={FORCE: 60})
    same = misfit(base, made)
    assert same.channels[0].cfc == 60
    assert np.max(np.abs(same.channels[0].residual)) < 1e-6
    assert np.array_equal(same.channels[0].measured, smooth)
    # without the statement the two differ by what the filter took
    unstated = misfit(base, replace(made, cfc={}))
    assert np.max(np.abs(unstated.channels[0].residual)) > 10.0
    # asked for more than is left, it stays at what is left
    assert misfit(base, made, cfc=180).channels[0].cfc == 60


def test_the_same_class_on_both_sides() -> None:
    base = run()
    made = replace(base.recording, title="raw")
    found = misfit(base, made, cfc=60).channels[0]
    assert found.cfc == 60
    assert np.allclose(found.measured, filtered(base.recording[FORCE], 2.5e-4, 60))
    assert np.max(np.abs(found.residual)) < 1e-9


@pytest.mark.parametrize(
    ("recorded_class", "wanted", "expected"),
    [
        (None, None, ((), ())),
        (None, 60, ((60,), (60,))),
        (180, None, ((), (180,))),
        (180, 60, ((60,), (180, 60))),
        (60, 180, ((), (60,))),
    ],
)
def test_classes(recorded_class: int | None, wanted: int | None, expected: tuple[tuple[int, ...], ...]) -> None:
    assert alignment.classes(recorded_class, wanted) == expected


def test_what_is_sampled_too_slowly_for_a_class() -> None:
    base = run()
    slow = Recording(title="slow", time=base.recording.time[::8], channels={FORCE: base.recording[FORCE][::8]})
    found = misfit(base, slow, cfc=60)
    assert found.channels[0].cfc is None
    assert "sampled too slowly for CFC 60, got 500 Hz; at least 600 Hz: compared without it" in found.notes[0]
    with pytest.raises(ValueError, match="too slowly for CFC 60"):
        misfit(base, slow, cfc=60, at_least=True)
    coarse = misfit(base, replace(base.recording, channels={FORCE: base.recording[FORCE]}, cfc={FORCE: 600}))
    assert coarse.skipped[FORCE].startswith("simulated too coarsely for CFC 600, got 4000 rows/s")
    assert coarse.skipped[FORCE].endswith("simulation.output_step at most 0.000167 s is needed")


def test_filtered_noise_is_smaller_by_what_is_said() -> None:
    noise = np.random.default_rng(3).normal(size=200_000)
    time = np.arange(noise.size) * 1e-4
    made = Recording(title="noise", time=time, channels={FORCE: noise})
    signal = alignment.ready(made, FORCE, cfc=60, start=0.0, end=1e9, simulated_rate=1e4)
    assert float(np.std(signal.values)) == pytest.approx(signal.quieter, rel=0.05)
    assert 0.1 < signal.quieter < 0.2


def test_uneven_stamps_are_filtered_on_an_even_grid() -> None:
    """A tone of 20 Hz passes CFC 60 (100 Hz): what jitter of a fifth of the step does stays below 1 %."""
    rng = np.random.default_rng(4)
    time = np.sort(np.arange(4000) * 1e-3 + rng.uniform(-2e-4, 2e-4, 4000))
    wave = np.sin(2.0 * np.pi * 20.0 * time)
    made = Recording(title="uneven", time=time, channels={FORCE: wave})
    signal = alignment.ready(made, FORCE, cfc=60, start=0.0, end=1e9, simulated_rate=1e4)
    middle = slice(200, -200)
    assert np.max(np.abs(signal.values[middle] - wave[middle][: signal.values[middle].size])) < 0.01


def test_gaps_and_channels_of_a_slower_clock() -> None:
    base = run()
    force = base.recording[FORCE].copy()
    force[300:500] = np.nan
    depth = np.full(force.size, np.nan)
    depth[::5] = base.recording["ground/sinkage"][::5]
    made = Recording(title="gaps", time=base.recording.time, channels={FORCE: force, "ground/sinkage": depth})
    found = misfit(base, made, cfc=60)
    first, second = found.channels
    assert first.time.size == force.size - 200
    assert np.all(np.diff(second.time) > 1e-3)
    assert second.rate == pytest.approx(800.0)
    assert isinstance(first.rating, Rating)
    # the impulse leaves the gap out, on the measured and on the simulated side
    t, whole = base.recording.time, base.recording[FORCE]
    there = np.flatnonzero(np.isfinite(force) & (t >= -0.01))
    width = np.where(np.diff(there) == 1, np.diff(t[there]), 0.0)
    expected = float(np.sum(0.5 * width * (whole[there][1:] + whole[there][:-1])))
    assert first.rating.integral_measured == pytest.approx(expected, rel=1e-3)
    assert first.rating.integral_simulated == pytest.approx(first.rating.integral_measured, rel=0.01)


def test_what_is_left_out_says_why() -> None:
    made = Recording(
        title="others",
        time=np.linspace(5.0, 6.0, 50),
        channels={FORCE: np.zeros(50), "rops/force": np.zeros(50)},
    )
    found = misfit(run(), made)
    assert found.channels == ()
    assert "no overlap" in found.skipped[FORCE]
    assert found.skipped["rops/force"] == "not simulated in this scenario"
    assert "the rest was not compared" in found.notes[0]


def test_the_ground_takes_the_same_work_on_both_sides() -> None:
    """Force (N) over sinkage (m) of a spring of 1 kN/m to 0.1 m: 5 J."""
    t = np.linspace(0.0, 0.1, 400)
    made = Recording(title="spring", time=t, channels={FORCE: 1000.0 * t, "ground/sinkage": t})
    found = misfit(run(), made)
    assert found.energy_measured == pytest.approx(5.0, rel=1e-3)


def test_a_turned_instrument_is_compared_with_what_it_would_read() -> None:
    """Upside down on the striker, and at rest +1 g where it counts what holds it up: -(a + g)."""
    base = run()
    down = Sensor(body="striker", orientation_deg=(180.0, 0.0, 0.0), gravity="proper")
    name = "striker/acceleration_z"
    reading = -(base.recording[name] + 9.81)
    made = Recording(title="turned", time=base.recording.time, channels={name: reading}, sensors={name: down})
    found = misfit(base, made).channels[0]
    assert np.max(np.abs(found.residual)) < 1e-9
    assert np.max(np.abs(misfit(base, replace(made, sensors={})).channels[0].residual)) > 10.0


def test_noise_is_found_in_the_recording_itself() -> None:
    made = replace(recorded(scene(), {}, np.random.default_rng(6), every=1), noise={})
    for channel, sigma in NOISE.items():
        assert estimated_noise(made, channel) == pytest.approx(sigma, rel=0.15)


def test_a_clock_within_its_error_agrees() -> None:
    sure = Clock(offset=2.5e-3, sigma=1e-3, gain=0.3, at_limit=False)
    way = "setting it, which was not done, would remove 30% of the squared residual"
    assert sure.sentence == f"its clock is 2.5 +- 1 ms late; {way}"
    assert replace(sure, offset=-2.5e-3).sentence == f"its clock is 2.5 +- 1 ms early; {way}"
    assert replace(sure, offset=1.7e-17).sentence == "its clock agrees with the simulation's within 2 ms"
    assert "late" in replace(sure, offset=1e-5, at_limit=True).sentence, "no agreement where the search ended"

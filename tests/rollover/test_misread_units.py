"""Misread units and clocks, frozen channels, rails of two samples: named in drops, and never in clean ones."""

from __future__ import annotations

from dataclasses import replace
from functools import cache
from pathlib import Path

import numpy as np
import pytest
from typer.testing import CliRunner

from rollover.cli.main import app
from rollover.dynamics import simulate
from rollover.recording import Recording, Sensor
from rollover.recording.checks import Finding, prechecks
from rollover.recording.checks.finding import digit_of
from rollover.recording.importers import write_recording
from rollover.scenario import load
from tests.rollover.test_sensor_faults import MASS, A, F, P, S, blows, truth

G = 9.80665


@cache
def faster() -> Recording:
    run = simulate.run(load("drop_test").replaced({"initiation.speed": 5.0})).recording
    return Recording(title="5 m/s", time=run.time, channels=dict(run.channels))


def drop(seed: int, *, speed: float = 3.0, share: float = 0.005, rate: float = 1000.0) -> Recording:
    from rollover.comparison.synthesis import synthetic

    of = truth("drop_test") if speed == 3.0 else faster()
    made = synthetic(of, channels=(F, S, A, P), rate=rate, share=share, seed=seed)
    return replace(made, conditions={"initiation.speed": speed})


def told(recording: Recording, check: str, channel: str) -> list[Finding]:
    return [f for f in prechecks(recording, mass=MASS) if (f.check, f.channel) == (check, channel)]


@pytest.mark.parametrize("speed", [3.0, 5.0])
def test_a_clean_drop_at_a_stated_speed_has_no_fault(speed: float) -> None:
    for seed in range(9):
        made = drop(
            seed, speed=speed, share=(0.001, 0.005, 0.02)[seed % 3], rate=(1000.0, 500.0, 2000.0)[seed // 3 % 3]
        )
        short = replace(made, time=made.time[:200], channels={c: v[:200] for c, v in made.channels.items()})
        for r in (made, short):
            assert [f for f in prechecks(r, mass=MASS) if f.check in ("gain", "stuck", "clipping")] == [], seed


MISREAD = {
    "ms for s": (S, 1.0, 1e3, "stamps in ms taken for s"),
    "s for ms": (S, 1.0, 1e-3, "stamps in s taken for ms"),
    "mm for m": (S, 1e3, 1.0, "mm for m"),
    "kN for N": (F, 1e-3, 1.0, "kN taken for N"),
    "N for kN": (F, 1e3, 1.0, "N taken for kN"),
    "g for m/s2": (A, 1.0 / G, 1.0, "g taken for m/s2"),
    "m/s2 for g": (A, G, 1.0, "m/s2 taken for g"),
}


@pytest.mark.parametrize("what", list(MISREAD))
@pytest.mark.parametrize("speed", [3.0, 5.0])
def test_a_misread_unit_is_named(what: str, speed: float) -> None:
    channel, times, stretched, words = MISREAD[what]
    for seed in range(2):
        made = drop(seed, speed=speed)
        channels = {**made.channels, channel: times * made[channel]}
        (found,) = told(replace(made, time=stretched * made.time, channels=channels), "gain", channel)
        assert words in found.sentence


def test_a_force_in_kn_is_told_before_it_rests() -> None:
    """The striker has stopped, and its weight has no level yet."""
    made = drop(0)
    until = int(np.argmax(made[S])) + 20
    cut = replace(made.until(until), channels={F: 1e-3 * made[F][:until], S: made[S][:until]})
    (found,) = told(cut, "gain", F)
    assert "up to the greatest depth" in found.sentence


def test_gravity_in_an_accelerometer_is_told_at_rest() -> None:
    for seed in range(4):
        made = drop(seed)
        held_up = replace(made, channels={A: made[A] + 9.81})
        (found,) = told(held_up, "gain", A)
        assert "gravity is included, proper acceleration" in found.sentence
        said = replace(held_up, sensors={A: Sensor(body="striker", gravity="proper")})
        assert told(said, "gain", A) == []


def test_gravity_is_told_from_three_axes_of_one_on_its_side() -> None:
    random = np.random.default_rng(0)
    time = np.asarray(np.arange(2000) * 1e-3, dtype=np.float64)
    over = np.minimum(time / 0.8, 1.0) * 1.2  # rad
    axes = {"x": 0.0 * over, "y": 9.81 * np.sin(over), "z": 9.81 * np.cos(over)}
    named = {f"chassis/acceleration_{k}": v + 0.3 * random.normal(size=2000) for k, v in axes.items()}
    (found,) = [f for f in prechecks(Recording(title="r", time=time, channels=named)) if f.check == "gain"]
    assert "with the other axes" in found.sentence
    still = {name: values - values[-500:].mean() for name, values in named.items()}
    assert [f for f in prechecks(Recording(title="r", time=time, channels=still)) if f.check == "gain"] == []


@pytest.mark.parametrize("channel", [F, S, A, P])
@pytest.mark.parametrize("at", [120, 300, 560])
def test_a_channel_that_freezes_is_told_to_the_end(channel: str, at: int) -> None:
    for seed in range(2):
        made = drop(seed)
        held = np.where(np.arange(made.time.size) > at, made[channel][at], made[channel])
        (found,) = told(replace(made, channels={**made.channels, channel: held}), "stuck", channel)
        assert found.start == pytest.approx(made.time[at])
        assert found.end == made.time[-1]
        assert "frozen channel" in found.sentence


def test_what_comes_to_rest_within_a_digit_is_not_frozen() -> None:
    """A coarse converter, a force that ends at 0, a record that is short."""
    made = drop(0, share=0.001)
    coarse = np.round(made[P] / 0.01) * 0.01
    assert told(replace(made, channels={P: coarse}), "stuck", P) == []
    gone = np.where(made.time > 0.3, 0.0, made[F])
    assert told(replace(made, channels={F: gone}), "stuck", F) == []
    few = np.where(np.arange(made.time.size) > made.time.size - 6, made[A][-6], made[A])
    assert told(replace(made, channels={A: few}), "stuck", A) == []


@pytest.mark.parametrize("peaks", [1, 2])
def test_a_rail_of_two_samples_at_an_odd_level(peaks: int) -> None:
    """Blows of which two samples in all reach 7013.77 N: nothing but a rail puts two floats there."""
    for seed in range(10):
        made = blows(seed, (9000.0, 8600.0)[:peaks])
        assert told(made, "clipping", F) == []
        limit = float(np.sort(made[F])[-2])
        cut = replace(made, channels={F: np.minimum(made[F], limit)})
        (found,) = told(cut, "clipping", F)
        assert found.value == pytest.approx(limit)


def test_samples_that_a_logger_holds_are_no_rail() -> None:
    made = blows(0, (9000.0,))
    held = np.repeat(made[F][::2], 2)[: made.time.size]
    assert told(replace(made, channels={F: held}), "clipping", F) == []


@pytest.mark.parametrize("digit", [1e-3, 1.0 / 4096.0, 9.80665e-3])
def test_the_digit_of_a_channel(digit: float) -> None:
    values = np.asarray(digit * np.random.default_rng(0).integers(-2000, 2000, 400), dtype=np.float64)
    assert digit_of(values) == pytest.approx(digit)
    floats = np.random.default_rng(1).normal(size=400)
    assert digit_of(floats) == pytest.approx(1e-9 * np.abs(floats).max())


def test_check_says_it(tmp_path: Path) -> None:
    made = drop(0)
    write_recording(replace(made, channels={**made.channels, S: 1e3 * made[S]}, noise={}), tmp_path / "r.csv")
    said = CliRunner().invoke(app, ["check", str(tmp_path / "r.csv")]).stdout
    assert "gain: ground/sinkage" in said
    assert "mm for m" in said

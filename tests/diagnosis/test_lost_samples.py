"""A channel that breaks off where its signal is small: recordings show it by themselves, without a simulation."""

from __future__ import annotations

import importlib
from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest

from rollover.diagnosis import diagnose
from rollover.diagnosis.inference.recording_faults import lost
from rollover.recording import Recording
from rollover.recording.checks import prechecks
from rollover.recording.checks.finding import trace
from rollover.recording.checks.jumps import across, jumping, of_an_impact
from rollover.recording.filters import filtered
from tests.diagnosis.drops import ACCELERATION, DEPTH, FORCE, recorded, scenario

diagnosing = importlib.import_module("rollover.diagnosis.conclusion")
RATE, N = 1000.0, 600
TIME = np.arange(N) / RATE
PHASES = [((0.0, "approach"), (0.3, "impact"))] * 3


def behind(signal: np.ndarray, seed: int, noise: float = 0.1) -> np.ndarray:
    """A signal behind CFC 60, with noise that comes after it."""
    return filtered(signal, 1.0 / RATE, 60) + noise * np.random.default_rng(seed).standard_normal(N)


def made(values: np.ndarray, time: np.ndarray = TIME) -> Recording:
    return Recording(title="one", time=time, channels={ACCELERATION: values}, cfc={ACCELERATION: 60})


def first_impact() -> np.ndarray:
    """All of an impact of 20 m/s2 s in one sample, a step of 30 m/s2, and a push of 0.05 s."""
    x = np.zeros(N)
    x[300] = 20.0 * RATE / 10.0
    x[400:] = 30.0
    return x + 20.0 * np.exp(-(((TIME - 0.2) / 0.05) ** 2))


def clipped(v: np.ndarray) -> np.ndarray:
    return np.clip(v, -5.0, 12.0)


def digits(v: np.ndarray) -> np.ndarray:
    return np.round(v / 2.0) * 2.0


def spiked(v: np.ndarray) -> np.ndarray:
    v = v.copy()
    v[[120, 350, 500]] += 5.0
    return v


@pytest.mark.parametrize("done", [lambda v: v, clipped, digits, spiked])
def test_no_signal_behind_a_filter_jumps(done: Callable[[np.ndarray], np.ndarray]) -> None:
    """An impact of no duration, a step, a push; at the end of a range, in steps of 20 times the noise, with spikes."""
    for seed in range(20):
        told = trace(made(done(behind(first_impact(), seed))), ACCELERATION)
        assert told is not None
        assert jumping(told, 60).size == 0, seed


def test_gaps_are_no_jumps() -> None:
    for seed in range(20):
        keep = np.ones(N, dtype=bool)
        keep[295:305] = keep[395:405] = False
        told = trace(made(behind(first_impact(), seed)[keep], TIME[keep]), ACCELERATION)
        assert told is not None
        assert jumping(told, 60).size == 0, seed


def test_a_contact_that_opens_makes_jumps_to_and_fro() -> None:
    """For 12 ms twice, where the signal is 20 m/s2 and 7 m/s2: four leaps, each before the sample that is the first."""
    for seed in range(20):
        values = behind(first_impact(), seed)
        for k in (190, 440):
            values[k : k + 12] = 0.1 * np.random.default_rng(seed).standard_normal(12)
        told = trace(made(values), ACCELERATION)
        assert told is not None
        assert jumping(told, 60).tolist() == [190, 202, 440, 452], seed
        assert jumping(told, None).size == 0
        assert jumping(told, 180).size == 0  # too slow for that class
        (found,) = (f for f in prechecks(made(values)) if f.check == "jump")
        assert (found.value, found.channel) == (4.0, ACCELERATION)


def test_two_samples_about_a_jump_lie_off_by_nearly_half_of_it() -> None:
    """The cubic through three on either side weighs them 3/7, 3/14 and -1/7: of a step one side, 1/2; then 1/14 off."""
    off = across((np.arange(20) >= 10).astype(float))
    assert off[10] == pytest.approx(0.5)
    assert np.delete(off, 10).max() == pytest.approx(1.0 / 14.0)
    assert of_an_impact(1000.0, 60) < 0.1
    assert of_an_impact(2000.0, 60) < 0.01  # the faster sampled, the smoother


def test_where_channels_break_off_again_they_are_said_to() -> None:
    whole = [made(behind(first_impact(), seed)) for seed in range(3)]
    assert lost("abc", whole, PHASES) == ()
    holed = whole[1][ACCELERATION].copy()
    holed[100:105] = holed[320:324] = 0.0
    found = lost("abc", [whole[0], made(holed), whole[2]], PHASES)
    assert [(p.recording, p.channel, p.phase, p.depends_on) for p in found] == [
        ("b", ACCELERATION, "approach", "time"),
        ("b", ACCELERATION, "impact", "time"),
    ]
    np.testing.assert_allclose([(p.start, p.end) for p in found], [(0.1, 0.104), (0.32, 0.323)])
    holed[320:324] = whole[1][ACCELERATION][320:324]
    assert lost("abc", [whole[0], made(holed), whole[2]], PHASES) == ()  # once may be anything


def test_a_break_off_in_a_small_signal_is_unexplained() -> None:
    """Exact zeros in the approach, where a load cell reads nothing but its noise."""
    sound = recorded({}, 4, rate=1000.0, channels=(FORCE, DEPTH), noise=0.02)
    assert diagnose(scenario(), sound).verdict == "no-mismatch"
    name, one = sound[1]
    values = one[FORCE].copy()
    values[[5, 6, 7, 8, 15, 16, 17, 18]] = 0.0
    found = diagnose(scenario(), [sound[0], (name, replace(one, channels={**one.channels, FORCE: values})), sound[2]])
    assert (found.verdict, found.effects, found.empirical) == ("unexplained", (), None)
    assert [(p.recording, p.channel, p.phase) for p in found.where] == 2 * [(name, FORCE, "free-fall")]
    assert found.depends_on == "time"
    assert found.remaining_significant
    assert f"{FORCE} breaks off in 2 places" in found.sentence


@pytest.mark.parametrize(
    ("taken", "broken", "refused"),
    [(0.05, DEPTH, True), (0.3, DEPTH, False), (0.3, FORCE, True), (0.8, FORCE, False)],
)
def test_what_takes_little_where_channels_break_off_is_not_named(
    taken: float, broken: str, refused: bool, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Samples that were lost bend a gain to themselves; one that takes what there is stays named.

    A gain of the channel that breaks off must take more than half of it, of another one more than a tenth.
    """
    monkeypatch.setattr(diagnosing, "explains_little", lambda _, __, share=0.1: taken < share)
    recordings = recorded({"effects.sensor-gain.gain": 1.05}, 3, noise=0.003, rate=600.0)
    name, first = recordings[0]
    holed = first.channels[broken].copy()
    holed[1:6] = holed[9:14] = 0.0  # before the contact, where nothing is missed by that
    recordings[0] = name, replace(first, channels={**first.channels, broken: holed})
    found = diagnose(scenario(), recordings)
    named = ["sensor-gain"] * (not refused)
    assert (found.verdict, [e.id for e in found.effects]) == ("unexplained" if refused else "sensor", named)
    assert ("breaks off" in found.sentence) == refused

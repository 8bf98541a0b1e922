"""What a recording alone says of its sensors: nothing of clean drops and overturns, each planted fault by its name."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from functools import cache
from pathlib import Path

import numpy as np
import pytest
from typer.testing import CliRunner

from rollover.cli.main import app
from rollover.comparison.synthesis import synthetic
from rollover.dynamics import simulate
from rollover.recording import Clock, Recording
from rollover.recording.checks import Finding, instant, prechecks, shared_rails, when
from rollover.recording.importers import write_recording
from rollover.scenario import load

F, S, A, P = "ground/force_normal", "ground/sinkage", "striker/acceleration_z", "striker/position_z"
ROLL = ("chassis/roll", "chassis/angular_velocity_x", "chassis/acceleration_y", "chassis/acceleration_z", "rops/force")
CHANNELS = {
    "drop_test": (F, S, A, P),
    "side_overturn": (*ROLL, "rops/force_y", "rops/force_z", "chassis/position_z"),
    "multiple_roll": (*ROLL, "rops/force_z", "chassis/position_y"),
}
MASS = 132.0
NEW = {"zero-offset", "polarity", "gain", "time-base", "gap", "clipping"}


@cache
def truth(name: str) -> Recording:
    changes = {} if name == "drop_test" else {"simulation.duration": 4.0}
    run = simulate.run(load(name).replaced(changes)).recording
    return Recording(title=name, time=run.time, channels=dict(run.channels))


def clean(name: str, seed: int, share: float = 0.005, rate: float = 1000.0) -> Recording:
    return synthetic(truth(name), channels=CHANNELS[name], rate=rate, share=share, seed=seed)


def told(recording: Recording, check: str) -> list[Finding]:
    return [f for f in prechecks(recording, mass=MASS) if f.check == check]


@pytest.mark.parametrize("name", list(CHANNELS))
def test_clean_recordings_have_no_faults(name: str) -> None:
    """70 of each, quiet and noisy, of three rates, every other one rounded to three digits behind the point."""
    blamed, new, read = [], [], {}
    for seed in range(70):
        made = clean(name, seed, (0.001, 0.005, 0.02)[seed % 3], (1000.0, 500.0, 800.0)[seed // 3 % 3])
        if seed % 2:
            made = replace(made, channels={c: np.round(v, 3) for c, v in made.channels.items()})
        read[str(seed)] = made
        found = [f for f in prechecks(made, mass=MASS if name == "drop_test" else None) if f.check != "wrap-around"]
        blamed += [(seed, f.check, f.channel) for f in found]
        new += [f for f in found if f.check in NEW]
    assert not new
    assert len(blamed) < 3, blamed
    assert shared_rails(read) == []


@pytest.mark.parametrize("colour", [0.0, 0.4])
@pytest.mark.parametrize("offset", [137.0, -60.0])
def test_a_load_cell_that_reads_something_before_contact(offset: float, colour: float) -> None:
    """Twenty samples before contact: -60 N are some 14 standard errors of white noise, 9 of coloured."""
    seen = 0
    for seed in range(8):
        made = clean("drop_test", seed)
        sigma = made.noise[F]
        random = np.random.default_rng(seed)
        noise = random.normal(size=made.time.size)
        for k in range(1, noise.size):
            noise[k] = colour * noise[k - 1] + np.sqrt(1.0 - colour**2) * noise[k]
        channels = {
            F: np.interp(made.time, truth("drop_test").time, truth("drop_test")[F]) + sigma * noise + offset,
            S: made[S],
        }
        channels[F] = np.where(made.time < 0.0, sigma * noise + offset, channels[F])
        found = told(replace(made, channels=channels, time=made.time), "zero-offset")
        if not found:
            continue
        (one,) = found
        seen += 1
        assert one.channel == F
        assert one.error is not None
        assert abs(one.value - offset) < 4.0 * one.error
        assert one.end < 0.0
        assert "zero offset" in one.sentence
    assert seen >= (7 if colour and abs(offset) < 100.0 else 8)


def test_what_may_read_something_before_contact_is_no_offset() -> None:
    """A weight that rests on it, a channel in which nothing happens, the size of noise, a tractor on its wheels."""
    random = np.random.default_rng(0)
    time = np.arange(1000) * 1e-3
    pulse = np.where(time > 0.4, 9000.0 * np.exp(-(((time - 0.45) / 0.02) ** 2)), 0.0)
    noise = 20.0 * random.normal(size=1000)

    def of(**channels: np.ndarray) -> list[Finding]:
        named = {c.replace("__", "/"): v for c, v in channels.items()}
        return told(Recording(title="r", time=time, channels=named), "zero-offset")

    assert [f.value for f in of(ground__force_normal=pulse + noise + 137.0)] == [pytest.approx(137.0, abs=8.0)]
    assert of(ground__force_normal=pulse + noise + MASS * 9.81) == []
    assert of(ground__force_normal=noise + 137.0) == []
    assert of(rops__force=np.abs(pulse + noise)) == []
    shaken = Recording(title="r", time=time, channels={F: 0.1 * pulse + noise + 1000.0})  # a weight nobody states
    assert prechecks(shaken) == ()
    assert of(ground__force_normal=pulse + noise + 137.0, chassis__roll=0.01 * noise) == []
    (found,) = of(rops__force_y=-pulse + noise + 137.0, chassis__roll=0.01 * noise)
    assert found.channel == "rops/force_y"


def test_polarity_and_unit() -> None:
    for seed in range(4):
        made = clean("drop_test", seed)
        assert [f.channel for f in told(replace(made, channels={**made.channels, F: -made[F]}), "polarity")] == [F]
        time = -0.4 + 1e-3 * np.arange(1000)
        fall = np.where(time < 0.0, -9.81, 80.0 * np.exp(-(((time - 0.03) / 0.02) ** 2)))
        fall = fall + 0.2 * np.random.default_rng(seed).normal(size=1000)
        assert told(replace(made, time=time, channels={A: fall}), "polarity") == []
        (turned,) = told(replace(made, time=time, channels={A: -fall}), "polarity")
        (in_g,) = told(replace(made, time=time, channels={A: fall / 9.80665}), "gain")
        assert "polarity is reversed" in turned.sentence
        assert "g for m/s2" in in_g.sentence


def blows(seed: int, heights: tuple[float, ...], limit: float = np.inf, digits: int = 9) -> Recording:
    """A force with short blows, 2000 samples of noise between and about them."""
    random = np.random.default_rng(seed)
    time = np.arange(2000) * 1e-3
    force = 20.0 * random.normal(size=2000)
    for k, height in enumerate(heights):
        force += height * np.exp(-(((time - 0.3 * (k + 1) - 1e-4 * random.random()) / 0.0011) ** 2))
    return Recording(title="blows", time=time, channels={F: np.round(np.minimum(force, limit), digits)})


@pytest.mark.parametrize("digits", [9, 1])
def test_peaks_that_end_at_one_value_once_each(digits: int) -> None:
    """Flanks of a sample: each blow has one sample at the rail; 7013.7 is no round number."""
    for seed in range(20):
        free = blows(seed, (9000.0, 8100.0, 9700.0, 8800.0), digits=digits)
        assert told(free, "clipping") == [], seed
        cut = blows(seed, (9000.0, 8100.0, 9700.0, 8800.0), limit=7013.7, digits=digits)
        (found,) = told(cut, "clipping")
        assert found.value == pytest.approx(7013.7)
        assert "clipping at full scale" in found.sentence
        assert found.end - found.start > 0.5


def test_a_peak_in_each_of_several_recordings() -> None:
    for seed in range(20):
        heights = [(9000.0,), (8100.0,), (9700.0,)]
        free = {str(k): blows(10 * seed + k, h) for k, h in enumerate(heights)}
        assert shared_rails(free) == []
        cut = {str(k): blows(10 * seed + k, h, limit=7013.7) for k, h in enumerate(heights)}
        assert [name for name, f in shared_rails(cut) if f.value == pytest.approx(7013.7)] == ["0", "1", "2"]
        assert all(told(r, "clipping") == [] for r in cut.values())
    twice = blows(0, (9000.0,))
    assert shared_rails({"a": twice, "b": replace(twice, title="its copy")}) == []


@pytest.mark.parametrize(("channel", "limit"), [(A, 50.0 * 9.80665), (A, 500.0), (F, 10e3), (F, 4500.0)])
def test_a_peak_at_a_full_scale(channel: str, limit: float) -> None:
    """50 g, 500 m/s2, 10 kN: a peak that is met to the last digit by one sample."""
    for seed in range(20):
        made = blows(seed, (1.3 * limit,), limit=limit)[F]
        cut = Recording(title="cut", time=np.arange(2000) * 1e-3, channels={channel: made})
        (found,) = told(cut, "clipping")
        assert found.value == pytest.approx(limit)
        assert "a full scale's round number" in found.sentence


@pytest.mark.parametrize(
    ("low", "words"), [(-np.pi, "wrapped at +-180 degrees"), (0.0, "wrapped at 0 and 360 degrees")]
)
def test_a_wrapped_angle_is_no_spike(low: float, words: str) -> None:
    for seed in range(20):
        random = np.random.default_rng(seed)
        time = np.arange(3000) * 1e-3
        angle = 2.5 * time**2 + random.uniform(0.0, 1.0) + 0.01 * random.normal(size=3000)
        made = Recording(title="r", time=time, channels={"chassis/roll": np.mod(angle - low, 2.0 * np.pi) + low})
        (found,) = prechecks(made)
        assert found.check == "wrap-around"
        assert words in found.sentence
        assert not prechecks(replace(made, channels={"chassis/roll": angle}))


def test_a_spike_of_an_angle_is_still_one() -> None:
    time = np.arange(3000) * 1e-3
    angle = 0.5 * time + 0.01 * np.random.default_rng(0).normal(size=3000)
    angle[1500] += 4.0
    assert [f.check for f in prechecks(Recording(title="r", time=time, channels={"chassis/roll": angle}))] == ["spike"]


def fallen(seed: int, lost: int) -> Recording:
    """The height of a drop at 2 kHz, `lost` samples of which were left out 0.1 s before contact."""
    t = -0.3 + 5e-4 * np.arange(1500 + lost)
    w = 60.0
    u0 = 4.0
    z = np.where(t < 0.0, -u0 * t - 4.905 * t * t, -u0 / w * np.exp(-0.5 * w * np.maximum(t, 0.0)) * np.sin(w * t))
    z = z + 5e-4 * np.random.default_rng(seed).normal(size=t.size)
    kept = np.delete(z, np.arange(400, 400 + lost))
    return Recording(title="counted", time=-0.3 + 5e-4 * np.arange(kept.size), channels={P: kept})


@pytest.mark.parametrize("lost", [4, 10])
def test_samples_lost_under_a_counted_clock(lost: int) -> None:
    """Each is 1.5 mm of the way, three deviations: four are twice what a parabola on either side leaves open."""
    for seed in range(20):
        assert told(fallen(seed, 0), "gap") == [], seed
        (found,) = told(fallen(seed, lost), "gap")
        assert found.error is not None
        assert abs(found.value - lost) < 0.5 + 3.5 * found.error < 0.5 * lost
        assert found.start == pytest.approx(-0.3 + 400 * 5e-4, abs=2e-3)
        assert "lost samples" in found.sentence


@pytest.mark.parametrize(
    ("start", "step", "zero", "words"),
    [
        (1714551599.98, 1e-3, "known", "begin at 1.71e+09 s"),
        (-90.0, 1e-3, "known", "end at -89"),
        (3600.0, 1e-3, "known", "begin at 3.60e+03 s"),
        (0.0, 1.0, "known", "lasts 999 s at 1 Hz, a scenario 120 s at most"),
        (1714551599.98, 1e-3, "unknown", ""),
        (-0.5, 1e-3, "known", ""),
        (100.0, 1e-3, "known", ""),
    ],
)
def test_stamps_at_which_no_scenario_has_anything(start: float, step: float, zero: str, words: str) -> None:
    time = start + step * np.arange(1000)
    made = Recording(title="r", time=time, channels={S: np.zeros(1000)}, clock=Clock(zero=zero))  # type: ignore[arg-type]
    assert [words in f.sentence for f in told(made, "time-base")] == ([True] if words else [])


def test_times_are_printed_sensibly(tmp_path: Path) -> None:
    assert instant(-1e-17, 1e-3) == "0"
    assert instant(1714551599.98, 1e-3) == "1714551599.98"
    assert when(-1e-9, -1e-9, 5e-4) == "at 0 s"
    assert when(0.0123, 0.0345, 1e-4) == "0.0123 to 0.0345 s"
    time = -0.1 + np.arange(1000) * 1e-3
    force = np.random.default_rng(0).normal(size=1000)
    force[100] += 50.0
    made = Recording(title="spike", time=time, channels={"wheel/front_left/force_normal": force})
    write_recording(made, tmp_path / "s.csv")
    said = CliRunner().invoke(app, ["check", str(tmp_path / "s.csv")]).stdout
    assert "  spike: wheel/front_left/force_normal, at 0 s: one sample lies" in said
    assert "-0 " not in said


CAUSES: dict[str, tuple[Callable[[np.ndarray], np.ndarray], str]] = {
    "flat": (lambda x: np.minimum(x, 0.5 * float(x.max())), "amplifier saturation"),
    "held": (lambda x: np.where((np.arange(x.size) > 300) & (np.arange(x.size) < 330), x[300], x), "dropout"),
    "spike": (lambda x: x + 60.0 * 20.0 * (np.arange(x.size) == 1500), "electromagnetic spike"),
}


@pytest.mark.parametrize("cause", list(CAUSES))
def test_causes_have_the_names_of_test_engineering(cause: str) -> None:
    change, words = CAUSES[cause]
    random = np.random.default_rng(1)
    time = np.arange(2000) * 1e-3
    force = 20.0 * random.normal(size=2000) + 9000.0 * np.exp(-(((time - 0.9) / 0.05) ** 2))
    made = Recording(title="r", time=time, channels={F: change(force)})
    assert [words in f.sentence for f in prechecks(made)] == [True]

"""Pre-checks: silent on clean noisy drops, and each planted fault found, of a size of five standard errors or so."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest
from scipy.signal import butter, lfilter, sosfilt

from rollover.dynamics.drop_test import DropModel
from rollover.recording import Recording
from rollover.recording.checks import noise_floors, prechecks
from tests.physics.scenes import shipped

G, MASS, SPEED, STIFFNESS = 9.81, 132.0, 3.0, 9000.0
N, STEP = 4000, 5e-4
A, P, F = "striker/acceleration_z", "striker/position_z", "ground/force_normal"
SIGMA = {A: 0.5, P: 5e-4, F: 20.0}
Fault = Callable[[np.ndarray, dict[str, np.ndarray]], np.ndarray]


def truth() -> tuple[np.ndarray, dict[str, np.ndarray]]:
    """A drop onto a spring with a strong damper: free fall, pulse, rest, in closed form.

    After contact m p'' = -m g - c p' - k p with c = 2 d m and d = 0.85 w: p = p_eq + e^(-d t) (A cos + B sin).
    """
    t = -0.4 + STEP * np.arange(N)
    w = np.sqrt(STIFFNESS / MASS)
    d = 0.85 * w
    wd, rest = np.sqrt(w * w - d * d), -MASS * G / STIFFNESS
    a0, b0 = -rest, (-SPEED - d * rest) / wd
    e, c, s = np.exp(-d * np.maximum(t, 0.0)), np.cos(wd * t), np.sin(wd * t)
    p = rest + e * (a0 * c + b0 * s)
    u = e * ((b0 * wd - d * a0) * c - (a0 * wd + d * b0) * s)
    a = -2.0 * d * u - w * w * (p - rest)
    fall = t < 0.0
    p[fall] = -SPEED * t[fall] - 0.5 * G * t[fall] ** 2
    a[fall] = -G
    return t, {A: a, P: p, F: MASS * (a + G)}


TIME, TRUE = truth()


def drop(seed: int, colour: float = 0.0) -> Recording:
    random = np.random.default_rng(seed)
    channels = {}
    for name, values in TRUE.items():
        white = random.standard_normal(N + 200)
        if colour:
            white = lfilter([1.0], [1.0, -colour], white) * np.sqrt(1.0 - colour**2)
        channels[name] = values + SIGMA[name] * white[200:]
    return Recording(title="drop", time=TIME.copy(), channels=channels, conditions={"vehicle.mass": MASS})


def test_fewer_than_5_of_100_clean_drops_are_blamed() -> None:
    blamed = [seed for seed in range(200) if prechecks(drop(seed, colour=0.6 * (seed % 2)))]
    assert len(blamed) < 10


def bias(t: np.ndarray, c: dict[str, np.ndarray]) -> np.ndarray:
    c[A] += 0.1  # about 800 samples of free fall: 0.5 / sqrt(800) = 0.018 is one standard error
    return t


def load_cell_bias(t: np.ndarray, c: dict[str, np.ndarray]) -> np.ndarray:
    c[F] += 5.0  # 20 / sqrt(800) = 0.7
    return t


def load_cell_gain(t: np.ndarray, c: dict[str, np.ndarray]) -> np.ndarray:
    c[F] *= 1.01  # 13 N of the weight
    return t


def accelerometer_gain(t: np.ndarray, c: dict[str, np.ndarray]) -> np.ndarray:
    c[A] *= 0.98
    return t


def position_gain(t: np.ndarray, c: dict[str, np.ndarray]) -> np.ndarray:
    c[P] *= 1.08
    return t


def two_clocks(t: np.ndarray, c: dict[str, np.ndarray]) -> np.ndarray:
    c[P] = np.interp(t - 0.03 * (t - t[0]), t, c[P])
    return t


def clipped(t: np.ndarray, c: dict[str, np.ndarray]) -> np.ndarray:
    np.minimum(c[F], 0.9 * TRUE[F].max(), out=c[F])
    return t


def repeated(t: np.ndarray, c: dict[str, np.ndarray]) -> np.ndarray:
    c[A][2000:2005] = c[A][2000]
    return t


def dropped(t: np.ndarray, c: dict[str, np.ndarray]) -> np.ndarray:
    for name in c:
        c[name] = np.delete(c[name], [500, 1200, 1201])
    return np.delete(t, [500, 1200, 1201])


def disturbed(t: np.ndarray, c: dict[str, np.ndarray]) -> np.ndarray:
    c[A][2500] = TRUE[A][2500] + 7.0 * SIGMA[A]
    return t


def gap_in_one(t: np.ndarray, c: dict[str, np.ndarray]) -> np.ndarray:
    c[P][1500:1520] = np.nan
    return t


@pytest.mark.parametrize("speed", [1.5, 3.0])
def test_a_collision_between_two_samples_is_no_fault(speed: float) -> None:
    """A speed leaps where no accelerometer reads it: not where the acceleration itself leaps most, on the way back."""
    times = -0.05 + np.arange(1600) / 4000.0
    run = DropModel(scenario=shipped("drop_test"), step=1e-4).with_({"initiation.speed": speed}).run(times)
    for seed in range(5):
        random = np.random.default_rng(seed)
        read = {c: run[c] + 0.003 * np.ptp(run[c]) * random.standard_normal(times.size) for c in (A, P)}
        blamed = {f.check for f in prechecks(Recording(title="drop", time=times, channels=read))}
        assert not blamed & {"double-integral", "lag", "clock-drift"}, seed


@pytest.mark.parametrize(
    ("fault", "check", "channel"),
    [
        (bias, "free-fall", A),
        (bias, "rest", A),
        (load_cell_bias, "free-fall", F),
        (load_cell_gain, "rest", F),
        (accelerometer_gain, "free-fall", A),
        (position_gain, "double-integral", P),
        (two_clocks, "clock-drift", P),
        (clipped, "clipping", F),
        (repeated, "stuck", A),
        (dropped, "gap", F),
        (gap_in_one, "gap", P),
        (disturbed, "spike", A),
    ],
)
def test_a_planted_fault_is_found(fault: Fault, check: str, channel: str) -> None:
    seen = 0
    for seed in range(1000, 1005):
        clean = drop(seed)
        channels = {name: values.copy() for name, values in clean.channels.items()}
        time = fault(clean.time.copy(), channels)
        found = prechecks(replace(clean, time=time, channels=channels))
        seen += any((f.check, f.channel) == (check, channel) for f in found)
        assert all(f.sentence and f.start <= f.end for f in found)
    assert seen >= 4


@pytest.mark.parametrize(("corner", "jump"), [(6.0, 0.0), (10.0, 0.0), (0.0, 8.0), (0.0, 12.0)])
def test_a_corner_and_a_jump_are_no_spikes(corner: float, jump: float) -> None:
    """A force that turns from one sample to the next, or jumps: what comes before says the sample beside it."""
    k = np.arange(N) - 0.4 * N
    shape = corner * np.minimum(k, 0.0) + jump * (k > 0.0)
    for seed in range(12):
        values = SIGMA[A] * (shape + np.random.default_rng(seed).standard_normal(N))
        assert not [f for f in prechecks(replace(drop(0), channels={A: values})) if f.check == "spike"], seed


def spiked(at: list[int], seed: int) -> list[int]:
    """Where spikes are found in 500 samples of a pulse that has some `at`."""
    clean = drop(seed)
    keep = slice(900, 1400)
    values = clean.channels[A][keep].copy()
    values[at] += 30.0 * SIGMA[A] * np.where(np.arange(len(at)) % 2, -1.0, 1.0)
    few = replace(clean, time=clean.time[keep], channels={A: values})
    return [int(np.argmin(np.abs(few.time - f.start))) for f in prechecks(few) if f.check == "spike"]


@pytest.mark.parametrize("at", [[120, 160, 380], [90, 128, 166, 420], [70, 79, 300, 400]])
def test_spikes_beside_each_other_are_found_one_by_one(at: list[int]) -> None:
    """Each spoils what is said of the twelve samples around it: four of them more than a twentieth of these."""
    for seed in range(6):
        assert spiked(at, seed) == at, seed


def coarse(seed: int, more: int = 0) -> np.ndarray:
    """A rise by five digits, in which two samples of a thousand read one digit off, and one of them `more`."""
    random, k = np.random.default_rng(seed), np.arange(N)
    off = random.choice([-1, 1], N) * (random.random(N) < 0.002)
    off[3000] = more
    return np.asarray(0.125 * (np.round(5.0 / (1.0 + np.exp(-(k - 0.4 * N) / 60.0))) + off))


@pytest.mark.parametrize(("more", "found"), [(0, []), (1, []), (-10, [3000]), (10, [3000])])
def test_a_digit_that_flips_is_no_spike_and_ten_of_them_are(more: int, found: list[int]) -> None:
    """Most samples read exactly what their neighbours say: how far others are off by chance is a digit, not nothing."""
    clean = drop(0)
    for seed in range(6):
        told = prechecks(replace(clean, channels={A: coarse(seed, more)}))
        spikes = [int(np.argmin(np.abs(clean.time - f.start))) for f in told if f.check == "spike"]
        assert spikes == found, seed


def test_contacts_that_follow_one_another_are_no_spikes() -> None:
    """Six within 60 of 500 samples, where chance puts one or two."""
    for seed in range(6):
        assert spiked([300, 309, 320, 331, 343, 354], seed) == []


def digitised(seed: int) -> np.ndarray:
    """A pulse with noise below a hundredth of the sampling rate, in steps of 0.4 of it: levels last for long."""
    white = np.random.default_rng(seed).standard_normal(N + 2000)
    slow = sosfilt(butter(2, 0.01, output="sos"), white)[2000:]
    return np.round((TRUE[A] + 0.05 * slow / slow.std()) / 0.02) * 0.02


def test_levels_of_a_quantised_signal_are_no_repeats() -> None:
    clean = drop(0)
    stuck = [seed for seed in range(20) if prechecks(replace(clean, channels={A: digitised(seed)}))]
    assert len(stuck) < 2


def test_a_quantised_turning_point_is_no_rail() -> None:
    """Flanks of 0.6 digits a sample, a parabola of 0.02 digits a sample squared between them: 20 samples at the top."""
    away = np.abs(np.arange(N) - 0.5 * N)
    turn = np.round(np.where(away < 30.0, 1009.3 - 0.01 * away**2, 1018.3 - 0.6 * away))
    assert np.sum(turn == turn.max()) > 15
    assert not [f for f in prechecks(replace(drop(0), channels={F: turn})) if f.check == "clipping"]
    cut = np.minimum(turn, turn.max() - 8.0)
    assert [f.value for f in prechecks(replace(drop(0), channels={F: cut})) if f.check == "clipping"] == [cut.max()]


@pytest.mark.parametrize(("fault", "check"), [("held", "stuck"), ("cut", "clipping")])
def test_what_a_digitised_signal_loses_is_found(fault: str, check: str) -> None:
    for seed in range(5):
        values = digitised(seed)
        if fault == "held":
            values[850:1250] = values[850]  # over the rise of the pulse
        else:
            values = np.minimum(values, 0.5 * values.max())
        assert check in {f.check for f in prechecks(replace(drop(0), channels={A: values}))}, seed


def test_what_a_finding_says() -> None:
    clean = drop(7)
    (found,) = [
        f
        for f in prechecks(replace(clean, channels={**clean.channels, A: clean[A] + 0.3, P: np.full(N, np.nan)}))
        if f.check == "free-fall"
    ]
    assert found.value == pytest.approx(0.3, abs=0.1)
    assert found.start == pytest.approx(-0.4)
    assert found.end == pytest.approx(0.0, abs=0.05)
    assert "a bias of the accelerometer" in found.sentence
    stuck = {**clean.channels, F: np.minimum(clean[F], 3000.0)}
    (flat,) = [f for f in prechecks(replace(clean, channels=stuck)) if f.check == "clipping"]
    assert flat.value == 3000.0


def test_stated_noise_that_is_too_small() -> None:
    found = prechecks(replace(drop(3), noise={A: 0.1, F: 20.0}))
    assert [(f.check, f.channel) for f in found] == [("stated-noise", A)]


def test_noise_floors_of_the_channels() -> None:
    floors = noise_floors(drop(3))
    assert {name: floor.sigma for name, floor in floors.items()} == pytest.approx(SIGMA, rel=0.1)


def test_a_simulation_has_no_sensors() -> None:
    assert prechecks(Recording(title="s", time=TIME, channels=TRUE, source="simulation")) == ()


@pytest.mark.parametrize("number", [8, 20])
@pytest.mark.parametrize("at", [-0.1, 0.02, 0.05])
def test_samples_lost_under_a_counted_clock_are_found_in_contact(at: float, number: int) -> None:
    """Every channel loses the same rows: the place and about how many are told, and no gain is blamed for it."""
    whole = drop(3)
    kept = np.ones(N, dtype=bool)
    first = int(np.searchsorted(whole.time, at))
    kept[first : first + number] = False
    time = whole.time[: kept.sum()]
    lossy = replace(whole, time=time, channels={name: v[kept] for name, v in whole.channels.items()})
    found = [f for f in prechecks(lossy) if f.channel == P]
    assert [f.check for f in found] == ["gap"]
    assert found[0].start == pytest.approx(at, abs=6 * STEP)
    assert found[0].error is not None
    assert abs(found[0].value - number) < 3.0 * found[0].error + 0.5

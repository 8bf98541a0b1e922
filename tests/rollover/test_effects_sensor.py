"""Effects of sensors on signals whose answer is known."""

from __future__ import annotations

import math

import numpy as np
import pytest

from rollover.dynamics.drop_test import DropModel
from rollover.dynamics.simulate import run
from rollover.effects import read
from rollover.effects.sensor import (
    SensorBias,
    SensorClipping,
    SensorClockDrift,
    SensorClockOffset,
    SensorGain,
    SensorLag,
    SensorMisalignment,
    SensorScale,
)
from rollover.recording import Recording
from tests.physics.scenes import drop, shipped

FORCE = "ground/force_normal"
t = np.linspace(-1.0, 3.0, 4001)


def recorded(**channels: np.ndarray) -> Recording:
    return Recording(title="", time=t, channels={name.replace("__", "/"): x for name, x in channels.items()})


def test_lag_is_the_first_order_answer() -> None:
    """Step: 1 - e^(-t/tau); ramp t: t - tau(1 - e^(-t/tau)); both exact, as the signal is straight between samples."""
    tau = 0.2
    ramp = SensorLag(time=tau).read(recorded(ground__force_normal=np.maximum(t, 0.0)))[FORCE]
    late = t >= 0
    assert ramp[late] == pytest.approx((t - tau * (1 - np.exp(-t / tau)))[late], abs=1e-12)
    assert np.all(ramp[~late] == 0.0)
    edge = SensorLag(time=tau).read(recorded(ground__force_normal=np.where(t >= 0.0, 1.0, 0.0)))[FORCE]
    assert edge[late] == pytest.approx((1 - np.exp(-t / tau))[late], abs=3e-3)
    wave = SensorLag(time=tau).read(recorded(ground__force_normal=np.sin(9 * t)))[FORCE]
    gain = 1 / math.sqrt(1 + (9 * tau) ** 2)
    settled = t > 1.5
    assert wave[settled] == pytest.approx((gain * np.sin(9 * t - math.atan(9 * tau)))[settled], abs=1e-3)


@pytest.mark.parametrize("beta", [0.1, 0.25, 0.5, 1.0])
def test_lag_of_second_order_is_that_of_two_poles(beta: float) -> None:
    """Ramp t: y = (q L_p - p L_q)/(q - p) of the poles p, q.

    L_p t = t + 1/p - e^(pt)/p is the first-order answer at the pole p; beta tau^2 p q = 1. At beta = 1/4 the poles are
    one, at -2/tau: t - tau + (t + tau) e^(-2t/tau).
    """
    tau = 0.2
    ramp = SensorLag(time=tau, second_order=beta).read(recorded(ground__force_normal=np.maximum(t, 0.0)))[FORCE]
    late = t >= 0
    s = t[late]
    if beta == 0.25:
        expected = s - tau + (s + tau) * np.exp(-2.0 * s / tau)
    else:
        p, q = np.roots([beta * tau * tau, tau, 1.0]).astype(complex)
        one, other = s + (1.0 - np.exp(p * s)) / p, s + (1.0 - np.exp(q * s)) / q
        expected = np.real((q * one - p * other) / (q - p))
    assert ramp[late] == pytest.approx(expected, abs=1e-9)
    assert np.all(ramp[~late] == 0.0)


def test_lag_of_hardly_any_second_order_is_one_of_first() -> None:
    wave = recorded(ground__force_normal=np.sin(9 * t))
    first, second = (SensorLag(time=0.2, second_order=beta).read(wave)[FORCE] for beta in (0.0, 1e-7))
    assert second == pytest.approx(first, abs=1e-5)


def test_lag_of_what_moves_from_the_start() -> None:
    """A body that falls before it is recorded: a ramp of slope v is read tau v behind from the first sample on."""
    falling = SensorLag(time=0.2, channel="striker/position_z").read(recorded(striker__position_z=5.0 - 3.0 * t))
    assert falling["striker/position_z"] == pytest.approx(5.0 - 3.0 * (t - 0.2), abs=1e-12)


def test_clock_moves_and_stretches() -> None:
    x = np.exp(-4 * (t - 1) ** 2)
    late = SensorClockOffset(offset=0.25).read(recorded(ground__force_normal=x))[FORCE]
    assert late == pytest.approx(np.exp(-4 * (np.maximum(t - 0.25, t[0]) - 1) ** 2), abs=1e-5)
    slow = SensorClockDrift(drift=0.1).read(recorded(ground__force_normal=x))[FORCE]
    assert slow == pytest.approx(np.exp(-4 * (0.9 * t - 1) ** 2), abs=1e-5)
    assert t[slow.argmax()] == pytest.approx(1 / 0.9, abs=1e-3)


def test_gain_scale_bias_and_range() -> None:
    x = 10.0 * np.sin(t)
    one = recorded(ground__force_normal=x, ground__sinkage=x)
    assert np.array_equal(SensorGain(gain=1.5).read(one)[FORCE], 1.5 * x)
    assert np.array_equal(SensorScale(scale=1.5).read(one)["ground/sinkage"], 1.5 * x)
    assert np.array_equal(SensorBias(bias=3.0).read(one)[FORCE], x + 3.0)
    cut = SensorClipping(limit=4.0).read(one)[FORCE]
    assert (cut.min(), cut.max()) == (-4.0, 4.0)
    assert np.array_equal(cut[np.abs(x) < 4], x[np.abs(x) < 4])
    assert np.array_equal(SensorGain(gain=2.0).read(one)["ground/sinkage"], x)  # and no other channel
    assert np.array_equal(one[FORCE], x)  # nor what was read


def test_a_turned_sensor_reads_across() -> None:
    fall = recorded(
        **{f"chassis__acceleration_{a}": np.full_like(t, v) for a, v in zip("xyz", (1.0, 2.0, 4.0), strict=True)}
    )
    angle = 0.3
    for axis, along, across in (("x", 1.0, 2.0), ("y", 2.0, 4.0), ("z", 4.0, 1.0)):
        read_ = SensorMisalignment(channel=f"chassis/acceleration_{axis}", angle=angle).read(fall)
        assert read_[f"chassis/acceleration_{axis}"] == pytest.approx(
            math.cos(angle) * along + math.sin(angle) * across
        )
    alone = SensorMisalignment(channel="striker/acceleration_z", angle=angle).read(recorded(striker__acceleration_z=t))
    assert alone["striker/acceleration_z"] == pytest.approx(math.cos(angle) * t)


def test_the_chain_is_that_of_a_sensor_whatever_the_order() -> None:
    """y = clip(G (h x)(t - t_0) + b): a clipped signal stays within its range, a bias is not amplified."""
    chosen = {
        "sensor-clipping": SensorClipping(limit=5.0),
        "sensor-bias": SensorBias(bias=1.0),
        "sensor-gain": SensorGain(gain=2.0),
        "sensor-clock-offset": SensorClockOffset(offset=0.5),
    }
    x = np.where(t > 0, 1.5, 0.0)
    seen = read(chosen, recorded(ground__force_normal=x))[FORCE]
    assert np.unique(seen[np.abs(t - 0.5) > 0.002]).tolist() == [1.0, 4.0]
    assert seen[t > 0.51].min() == 4.0
    backwards = dict(reversed(chosen.items()))
    assert np.array_equal(read(backwards, recorded(ground__force_normal=x))[FORCE], seen)
    loud = read({**chosen, "sensor-gain": SensorGain(gain=9.0)}, recorded(ground__force_normal=x))[FORCE]
    assert loud.max() == 5.0


def test_a_run_is_read_by_its_sensors_and_its_ledger_is_not() -> None:
    scenario = drop(2.0, step=1e-3, duration=0.1)
    plain, biased = run(scenario), run(scenario.replaced({"effects.sensor-bias.bias": 40.0}))
    assert biased.recording[FORCE] == pytest.approx(plain.recording[FORCE] + 40.0)
    assert biased.ledger == plain.ledger
    model = DropModel(scenario=shipped("drop_test"))
    gained = model.with_({"effects.sensor-gain.gain": 1.1, "effects.sensor-gain.channel": "ground/sinkage"})
    assert gained.run()["ground/sinkage"] == pytest.approx(1.1 * model.run()["ground/sinkage"])

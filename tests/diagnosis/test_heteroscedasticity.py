"""Noise that grows with the value is known for what it is, and nothing else is taken for it."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from rollover.diagnosis import diagnose
from rollover.diagnosis.data.whitening import Whitening
from rollover.diagnosis.forward.forward_model import simulator_of
from rollover.diagnosis.noise.heteroscedasticity import with_variance_model
from rollover.diagnosis.settings import SETTINGS
from rollover.recording import Recording
from tests.diagnosis.drops import ACCELERATION, DEPTH, FORCE, recorded, scenario, signal
from tests.diagnosis.test_ensemble import CHANNELS as CHASSIS
from tests.diagnosis.test_ensemble import IMPACT, blown
from tests.diagnosis.test_fits import problem_of
from tests.physics.scenes import shipped

CHANNELS = (FORCE, DEPTH, ACCELERATION)
FLOOR, SHARE = 0.002, 0.02  # of the largest range, of the value


def most(recordings: list[tuple[str, Recording]], channel: str) -> float:
    return max(float(np.ptp(r[channel])) for _, r in recordings)


def louder(recordings: list[tuple[str, Recording]], seed: int) -> list[tuple[str, Recording]]:
    rng, found = np.random.default_rng(seed), []
    for name, r in recordings:
        noise = {c: FLOOR * most(recordings, c) + SHARE * np.abs(v) for c, v in r.channels.items()}
        noisy = {c: v + noise[c] * rng.normal(size=v.size) for c, v in r.channels.items()}
        found.append((name, replace(r, channels=noisy)))
    return found


def test_its_law_is_estimated_from_the_samples_alone() -> None:
    quiet = recorded({"effects.soil-crust.thickness": 0.03}, noise=0.0, rate=2000.0, channels=CHANNELS)
    for e, (_, clean) in zip(with_variance_model(problem_of(louder(quiet, 1)).dataset), quiet, strict=True):
        for s in e.signals:
            y = clean[s.channel][s.rows]
            true = 1.0 + SHARE / FLOOR * np.abs(y) / most(quiet, s.channel)
            assert s.level is not None, s.channel
            inside = np.abs(np.gradient(y)) < 0.05 * np.ptp(y)  # not beside a leap, over which the value is averaged
            assert np.corrcoef(s.level[inside], true[inside])[0, 1] > 0.9, s.channel
            if s.channel == FORCE:  # of the acceleration the least is not at nothing, but somewhere in the fall
                # a bin's noise is the median of some 190 differences that overlap: told to SPREAD/sqrt(190), 15 %
                assert s.level.max() == pytest.approx(
                    true.max(), rel=SETTINGS.noise.heteroscedasticity.level_error / np.sqrt(190.0)
                )


def test_noise_alone_does_not_grow_with_itself() -> None:
    """A channel that is nothing but noise: its largest samples are those that differ most from their neighbours."""
    rng = np.random.default_rng(8)
    made = [
        (name, replace(r, channels={**r.channels, FORCE: rng.normal(size=r.time.size)}))
        for name, r in recorded({}, noise=0.01, rate=2000.0, channels=CHANNELS)
    ]
    assert all(s.level is None for e in with_variance_model(problem_of(made).dataset) for s in e.signals)


@pytest.mark.parametrize("cfc", [None, 180])
@pytest.mark.parametrize("rate", [500.0, 5000.0])
def test_an_even_noise_or_a_filter_is_not_taken_for_it(rate: float, cfc: int | None) -> None:
    from rollover.recording.filters import filtered

    made = recorded({"effects.soil-crust.thickness": 0.03}, seed=2, noise=0.01, rate=rate, channels=CHANNELS)
    if cfc is not None and rate > 10.0 * cfc:
        made = [
            (
                name,
                replace(
                    r,
                    channels={c: filtered(v, 1.0 / rate, cfc) for c, v in r.channels.items()},
                    cfc=dict.fromkeys(CHANNELS, cfc),
                ),
            )
            for name, r in made
        ]
    assert all(s.level is None for e in with_variance_model(problem_of(made).dataset) for s in e.signals)


def test_it_is_no_mismatch_and_hides_none() -> None:
    conditions = {"speeds": (1.2, 2.0, 3.0), "noise": 0.0, "rate": 2000.0, "channels": CHANNELS}
    nothing = diagnose(scenario(), louder(recorded({}, **conditions), 3))
    assert nothing.verdict == "no-mismatch"
    assert any("grows with the value" in note for note in nothing.notes)
    found = diagnose(scenario(), louder(recorded({"effects.mass.added": 4.0}, **conditions), 4))
    assert [e.id for e in found.effects] == ["mass"]
    added = found.effects[0].parameters["added"]
    assert added.low < 4.0 < added.high
    assert found.after["held_out"].nrmse == pytest.approx(1.0, abs=0.1)


def test_what_a_model_may_be_off_by_does_not_grow_with_the_noise() -> None:
    """A noise of 0.1, ten times as loud at the end, beside an error of the model of 1: equal but for rounding."""
    values, level = np.ones(50), np.linspace(1.0, 10.0, 50)
    s = replace(signal(values, float(np.hypot(0.1, 1.0))), noise=0.1, level=level)
    whitened = Whitening([s.spread])
    assert whitened(values) == pytest.approx(1.0 / np.hypot(0.1 * level, 1.0), rel=1e-12)
    columns = np.stack([values, 2.0 * values], axis=1)
    assert whitened(columns)[:, 1] == pytest.approx(2.0 / np.hypot(0.1 * level, 1.0), rel=1e-12)


def test_contacts_after_an_impact_are_no_noise() -> None:
    """Twice the noise of a motion after the impact, where values are large, in an overturn and in anything else."""
    rng = np.random.default_rng(3)
    e = blown(CHASSIS)
    n, time = e.signals[0].rows.size, e.recording.time
    after = time >= IMPACT
    values = np.where(after, 5.0 + np.sin(20.0 * time), 0.1) + np.where(after, 0.3, 0.05) * rng.standard_normal(n)
    found = replace(e, signals=tuple(replace(s, values=values) for s in e.signals))
    assert all(s.level is None for s in with_variance_model([found])[0].signals)
    elsewhere = simulator_of(shipped("drop_test"), e.recording)
    assert all(s.level is not None for s in with_variance_model([replace(found, simulator=elsewhere)])[0].signals)

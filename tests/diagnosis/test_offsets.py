"""Zeros set anew for each recording: told before the first contact, taken off, and no offset of a sensor by chance."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
import pytest

from rollover.diagnosis import diagnose
from rollover.diagnosis.data.dataset import Dataset
from rollover.diagnosis.fit.jobs import Executor
from rollover.diagnosis.noise.offsets import Zero, _are_stationary, _differ, _own
from rollover.diagnosis.prepared import prepared, with_common_noise
from rollover.diagnosis.settings import SETTINGS
from rollover.recording import Recording
from tests.diagnosis.drops import ACCELERATION, DEPTH, FORCE, recorded, scenario

CHANNELS = (FORCE, DEPTH, ACCELERATION)
SPEEDS = (1.1, 1.6, 2.1, 2.6, 3.1, 3.6)
LAYER = {"effects.soil-layer.depth": 0.05, "effects.soil-layer.stiffness_ratio": 1.3}
Drops = list[tuple[str, Recording]]


def drops(hidden: dict[str, float], seed: int = 3) -> Drops:
    return recorded(hidden, seed, speeds=SPEEDS, channels=CHANNELS, rate=1000.0)


def moved(made: Drops, sizes: dict[str, float], share: float, seed: int = 5) -> tuple[Drops, list[dict[str, float]]]:
    """Each recording's channels off by its own number, 1 sigma `sizes` of their noise, and by one `share` of all."""
    random = np.random.default_rng(seed)
    one = {c: 0.01 * float(np.ptp(v)) for c, v in made[0][1].channels.items()}
    own = [{c: 0.01 * float(np.ptp(r[c])) * sizes[c] * random.normal() for c in r.channels} for _, r in made]
    off = [{c: v + share * one[c] for c, v in each.items()} for each in own]
    return [
        (n, replace(r, channels={c: v + o[c] for c, v in r.channels.items()}))
        for (n, r), o in zip(made, off, strict=True)
    ], off


def reweighted(made: Drops) -> list[Dataset]:
    every, _ = prepared(scenario(), made, Executor())
    return with_common_noise(scenario(), every)


@pytest.mark.parametrize("hidden", [{}, LAYER])
def test_offsets_are_estimated_despite_missing_physics(hidden: dict[str, float]) -> None:
    made, off = moved(drops(hidden), dict.fromkeys(CHANNELS, 3.0), 0.0)
    z = [(s.zero - o[s.channel]) / s.zero_error for e, o in zip(reweighted(made), off, strict=True) for s in e.signals]
    assert len(z) == 3 * len(SPEEDS)
    assert 0.4 < np.std(z) < 1.5  # 18 numbers: 0.17 is one standard error; quiet is louder where something is missing
    assert abs(np.mean(z)) < 0.7


def test_where_offsets_are_one_none_is_corrected() -> None:
    made, _ = moved(drops({}), dict.fromkeys(CHANNELS, 0.0), 2.0)
    assert all(s.zero == s.zero_error == 0.0 for e in reweighted(made) for s in e.signals)


@pytest.mark.filterwarnings("error")
def test_quantised_rest_without_noise_gives_no_offset() -> None:
    """Sinkage in steps of 30 mm reads 0 there, in which noise of 3 mm never shows: no error to tell a zero to."""
    made = [(n, replace(r, channels={**r.channels, DEPTH: 0.03 * np.round(r[DEPTH] / 0.03)})) for n, r in drops({})]
    coarse = [s for e in reweighted(made) for s in e.signals if s.channel == DEPTH]
    assert min(s.quiet[0] for s in coarse) == 0.0
    assert all(s.zero == s.zero_error == 0.0 for s in coarse)


@pytest.mark.parametrize("size", [0.5, 3.0])
def test_offsets_that_differ_are_reported_and_no_mismatch(size: float) -> None:
    made, _ = moved(drops({}), {FORCE: size, DEPTH: 0.0, ACCELERATION: size}, 0.0)
    found = diagnose(scenario(), made)
    assert (found.verdict, found.effects) == ("no-mismatch", ()), found.sentence
    told = [n for n in found.notes if "its zero differs from recording to recording" in n]
    assert any(n.startswith(FORCE) for n in told)
    assert not any(n.startswith(DEPTH) for n in told)


def test_what_is_missing_is_found_beside_offsets_that_differ() -> None:
    made, _ = moved(drops(LAYER), dict.fromkeys(CHANNELS, 3.0), 0.0)
    found = diagnose(scenario(), made)
    assert [e.id for e in found.effects] == ["soil-layer"], found.sentence
    ratio = found.effects[0].parameters["stiffness_ratio"]
    assert ratio.low <= 1.3 <= ratio.high


def of(off: Sequence[float]) -> list[Zero]:
    return [Zero(r=r, k=0, off=v, error=1.0) for r, v in enumerate(off)]


def test_a_mean_offset_remains_only_if_significant() -> None:
    """Student's t of four: a mean of 20 times its standard error is an offset, one of 1.3 times is not."""
    far, near = (40.0, 41.0, 44.0, 47.0), (-3.0, 1.0, 4.0, 6.0)
    assert np.sum(_own(of(far))) == pytest.approx(0.0, abs=1e-9)
    assert _own(of(near)) == list(near)


def test_offsets_of_all_channels_are_judged_together() -> None:
    """Chi-square of 6 at 22 is p = 0.0012 and of 18 at 66 is 2e-7."""
    one = of((3.3, -0.3, -3.3, 0.3, 0.0, 0.0, 0.0))
    assert not _differ([one])
    assert _differ([one, one, one])
    assert not _differ([])


def test_what_wanders_before_anything_is_hit_has_no_zero() -> None:
    """Chi-square of 9 at 9 and at 30: p = 0.4 and 4e-4."""
    still, wandering = (
        [Zero(r=r, k=0, off=9.0 * r, error=1.0, slow=v) for r in range(3)]
        for v in (SETTINGS.noise.offsets.wave_terms, 10.0)
    )
    assert _are_stationary([still])
    assert not _are_stationary([still, wandering, wandering])

"""Whether any combination of effects could come down to noise: told by all their directions beside the best one."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from rollover.diagnosis.fit.levenberg_marquardt import Fitted, Problem
from rollover.diagnosis.selection.candidates import candidates_of
from rollover.diagnosis.selection.score_test import ScoreTest, score_test
from rollover.diagnosis.selection.stepwise import is_out_of_reach
from rollover.recording import Recording
from tests.diagnosis.drops import recorded
from tests.diagnosis.test_discrepancy import judged

SPEEDS = (1.5, 2.2, 3.0)


def looked_at(recordings: list[tuple[str, Recording]]) -> tuple[Fitted, ScoreTest]:
    """The scenario as it is, and all effects looked at beside it."""
    problem: Problem = judged(recordings)
    base = problem.fit((), ())
    assert base is not None
    return base, score_test(problem, base, candidates_of(problem.dataset, (), "drop"))


def with_waves(share: float) -> list[tuple[str, Recording]]:
    """Drops with a slow wave of a share of each channel's range (rms), of a length and a phase of its own in each."""
    found = []
    for k, (name, r) in enumerate(recorded({}, 3, speeds=SPEEDS, noise=0.002)):
        after = np.maximum(r.time, 0.0)
        wave = (
            np.sin(2.0 * np.pi * after / (0.06 + 0.03 * k) + 2.0 * k) * (r.time > 0.0) * np.minimum(after / 0.01, 1.0)
        )
        wave *= np.exp(-((after / 0.12) ** 2))
        wave /= np.sqrt(np.mean(wave[r.time > 0.0] ** 2))
        found.append((name, replace(r, channels={c: v + share * np.ptp(v) * wave for c, v in r.channels.items()})))
    return found


@pytest.mark.parametrize(
    "missing",
    [
        {
            "effects.soil-layer.depth": 0.1,
            "effects.soil-layer.stiffness_ratio": 1.4,
            "effects.guide-friction.force": 60.0,
        },
        {"effects.soil-viscous-damping.damping": 150.0, "effects.soil-stiffness.scale": 1.06},
    ],
)
def test_two_effects_at_once_are_within_reach(missing: dict[str, float]) -> None:
    base, looked = looked_at(recorded(missing, 3, speeds=SPEEDS, noise=0.002))
    count = sum(b.residual.size for b in base.blocks)
    assert base.left > 9.0 * count
    assert looked.outside < 0.2 * base.left
    assert not is_out_of_reach(base, looked)


def test_waves_of_each_drop_are_out_of_reach_unless_noise_hides_them() -> None:
    base, looked = looked_at(with_waves(0.03))
    assert base.left > looked.outside > 0.5 * base.left
    assert is_out_of_reach(base, looked)
    faint, looked = looked_at(with_waves(0.001))
    assert not is_out_of_reach(faint, looked)

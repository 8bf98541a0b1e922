"""What a recorder's digits hide is neither noise nor physics: it is said where, and that no candidate does it."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from rollover.diagnosis import diagnose
from rollover.recording import Recording
from tests.diagnosis.drops import ACCELERATION, DEPTH, FORCE, recorded, scenario


def in_steps(channel: str, share: float, noise: float) -> tuple[list[tuple[str, Recording]], float]:
    """Drops with one channel recorded in steps of a share of its range over all of them."""
    made = recorded({}, 4, speeds=(2.2, 2.4, 2.6), noise=noise, rate=1000.0, channels=(FORCE, DEPTH, ACCELERATION))
    values = [r[channel] for _, r in made]
    step = share * float(max(v.max() for v in values) - min(v.min() for v in values))
    rounded = [(n, replace(r, channels={**r.channels, channel: step * np.round(r[channel] / step)})) for n, r in made]
    return rounded, step


@pytest.mark.parametrize("channel", [ACCELERATION, FORCE])
def test_a_channel_in_coarse_steps_is_unexplained_there(channel: str) -> None:
    recordings, step = in_steps(channel, 0.12, 0.004)
    found = diagnose(scenario(), recordings)
    assert (found.verdict, found.effects, found.empirical) == ("unexplained", (), None)
    assert {p.channel for p in found.where} == {channel}
    assert {p.recording for p in found.where} == {n for n, _ in recordings}
    assert {p.depends_on for p in found.where} == {"value"}
    assert sum(p.share for p in found.where) == pytest.approx(1.0)
    assert found.remaining_significant
    assert found.broken == ()  # though all else is met to the noise
    assert f"{channel} in steps of {step:.3g}"[:-1] in found.sentence


@pytest.mark.parametrize(("share", "noise"), [(0.02, 0.002), (0.12, 0.12)])
def test_fine_steps_and_such_as_noise_dithers_are_no_mismatch(share: float, noise: float) -> None:
    recordings, _ = in_steps(DEPTH, share, noise)
    assert diagnose(scenario(), recordings).verdict == "no-mismatch"

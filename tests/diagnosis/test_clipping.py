"""A channel that ends at one value in several recordings is named for that, though no simulation misses it."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from rollover.diagnosis import diagnose
from rollover.diagnosis.data.dataset import dataset_of
from rollover.diagnosis.data.quantisation import with_quantisation
from rollover.diagnosis.forward.averaging import simulated
from rollover.diagnosis.inference.recording_faults import clipped_channels
from rollover.diagnosis.selection.candidates import candidates_of
from rollover.recording import Recording
from tests.diagnosis.drops import FORCE, recorded, scenario

PHASES = [((-0.1, "approach"), (0.1, "impact"))] * 3


def blows(ends: tuple[float, ...], peaks: tuple[float, ...] = (5e3, 6e3, 7e3)) -> list[Recording]:
    """Blows of 50 ms about t = 0.2 s with noise of 10 N, each cut off at its end."""
    rng, time = np.random.default_rng(1), np.arange(0.0, 0.6, 1e-3)
    found = []
    for end, peak in zip(ends, peaks, strict=True):
        force = peak * np.exp(-(((time - 0.2) / 0.05) ** 2)) + rng.normal(0.0, 10.0, time.size)
        found.append(Recording(title="blow", time=time, channels={FORCE: np.clip(force, -end, end)}))
    return found


def test_what_ends_at_one_value_in_several_recordings_is_cut_off() -> None:
    (named,), places = clipped_channels("abc", blows((4200.0, 4200.0, 4200.0)), PHASES)
    assert (named.id, named.kind, named.channel) == ("sensor-clipping", "sensor", FORCE)
    assert named.parameters["limit"].value == 4200.0
    assert named.settings == {"channel": FORCE, "limit": 4200.0}
    assert named.p_value == pytest.approx(1e-9)
    assert [(p.recording, p.channel, p.phase) for p in places] == [(name, FORCE, "impact") for name in "abc"]
    assert sum(p.share for p in places) == pytest.approx(1.0)
    assert all(0.1 < p.start < 0.2 < p.end < 0.3 for p in places)


@pytest.mark.parametrize(
    ("ends", "peaks"),
    [
        ((9e3, 9e3, 9e3), (5e3, 6e3, 7e3)),  # none reaches its end
        ((4200.0, 9e3, 9e3), (5e3, 3e3, 3.5e3)),  # one alone shows it
        ((4200.0, 4300.0, 4400.0), (5e3, 6e3, 7e3)),  # each ends elsewhere
        ((4200.0, 4200.0, 9e3), (5e3, 6e3, 7e3)),  # one goes beyond
    ],
)
def test_what_ends_elsewhere_or_goes_beyond_is_not(ends: tuple[float, ...], peaks: tuple[float, ...]) -> None:
    assert clipped_channels("abc", blows(ends, peaks), PHASES) == ((), ())


def cut(share: float) -> tuple[list[tuple[str, Recording]], float]:
    """Drops alike with noise of 5 %, cut off at a share of the largest force of all."""
    made = recorded({}, 4, speeds=(2.5, 2.52, 2.54), noise=0.05, rate=1000.0)
    end = share * max(float(np.quantile(r[FORCE], 0.995)) for _, r in made)
    return [(n, replace(r, channels={**r.channels, FORCE: np.minimum(r[FORCE], end)})) for n, r in made], end


def test_slight_clipping_is_named_where_all_else_agrees() -> None:
    made, end = cut(0.93)
    found = diagnose(scenario(), made)
    (named,) = found.effects
    assert (found.verdict, named.id, named.settings["limit"]) == ("sensor", "sensor-clipping", end)
    assert "Otherwise simulation and 3 recordings agree within the noise" in found.sentence
    assert found.p_value <= 1e-6
    assert {place.channel for place in found.where} == {FORCE}
    assert found.remaining_p_value > 0.01
    assert diagnose(scenario(), recorded({}, 4, noise=0.05, rate=1000.0)).verdict == "no-mismatch"


def test_a_limit_is_looked_for_where_values_end_too() -> None:
    made, end = cut(0.8)
    found = with_quantisation([dataset_of(n, *simulated(scenario(), r)) for n, r in made], [r for _, r in made])
    limit = next(c for c in candidates_of(found, (), "drop") if c.key == f"sensor-clipping:{FORCE}")
    assert any(limit.values(x)["limit"] == pytest.approx(end) for x in limit.scan_points())

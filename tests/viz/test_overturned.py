"""A diagnosis of what turned over, as it is shown: what runs scatter by is no misfit, and its phases have colours."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from rollover.diagnosis.overlay import Track, _scatter
from rollover.diagnosis.result import Diagnosis
from tests.rollover.diagnosed import overlays, sensor_at_fault
from viz.content.diagnosis_words import label_of
from viz.pages.diagnosis import page
from viz.recordings.diagnosis import PHASES


def test_a_misfit_is_held_against_noise_and_scatter() -> None:
    time = np.linspace(0.0, 1.0, 200)
    scatter = np.where(time > 0.5, 3.0, 0.0)
    off = np.where(time > 0.5, 5.0, 1.0)
    track = Track(
        channel="chassis/acceleration_y", time=time, measured=off, before=np.zeros(200), after=None, noise=1.0,
        scatter=scatter,
    )  # fmt: skip
    np.testing.assert_allclose(track.unsure[time > 0.5], np.sqrt(10.0))
    assert track.rms_before == pytest.approx(np.sqrt(0.5 * 1.0 + 0.5 * 25.0 / 10.0))
    assert replace(track, scatter=None).rms_before == pytest.approx(np.sqrt(0.5 * 1.0 + 0.5 * 25.0))


def test_scatter_is_what_perturbed_runs_differ_by() -> None:
    time = np.linspace(0.0, 1.0, 400)
    perturbed = [np.full(400, 0.3), np.full(400, -0.5), np.full(400, np.nan)]
    found = _scatter(perturbed, time)
    assert found is not None
    np.testing.assert_allclose(found, np.sqrt((0.09 + 0.25) / 2.0))
    assert _scatter([], time) is None


def test_the_page_says_that_runs_differ() -> None:
    def shown(scatter: float | None) -> str:
        tracks = [
            replace(t, scatter=None if scatter is None else np.full(t.time.size, scatter)) for t in overlays()[0].tracks
        ]
        one = [replace(overlays()[0], tracks=tuple(tracks))]
        return page(sensor_at_fault(), one, title="Overturn", command="rollover diagnose x")

    assert "ensemble scatter" in shown(30.0)
    assert "ensemble scatter" not in shown(None)


def test_quantities_that_predict_nothing_need_no_table() -> None:
    found: Diagnosis = replace(sensor_at_fault(), dependencies=(("time", 0.001), ("ground/sinkage", -0.2)))
    assert "as a function of" not in page(found, overlays(), title="Overturn", command="x")


def test_phases_and_quantities_of_overturns_have_names() -> None:
    assert {"support", "tipping", "impact", "sliding", "rest"} <= set(PHASES)
    assert label_of("chassis/angular_velocity_x") == "roll rate"
    names = [label_of(f"chassis/{q}") for q in ("roll", "pitch", "velocity_y", "velocity_z", "angular_velocity_x")]
    assert len(set(names)) == 5

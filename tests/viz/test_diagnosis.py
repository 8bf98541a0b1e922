"""The page and the recording of a diagnosis, from made-up ones."""

from __future__ import annotations

import pickle
from collections.abc import Callable, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from rollover.recording.checks import Finding
from tests.rollover.diagnosed import FORCE, nothing_found, overlays, sensor_at_fault
from tests.viz.html import Parts
from viz.content.diagnosis_words import answer, markdown, ranked
from viz.pages.diagnosis import page

FLAT = Finding(
    check="clipping", channel=FORCE, start=0.1, end=0.12, value=3e3, unit="N", error=None, sentence="a flat top"
)


def test_the_page_of_a_finding() -> None:
    text = page(sensor_at_fault(), overlays(), title="Drop", prechecks=[("one", FLAT)], command="rollover diagnose x")
    parts = Parts(text)
    assert parts.fetched() == []
    said = parts.said
    assert "A sensor is faulty: sensor-gain of ground/force_normal." in said
    row = next(r for r in parts.rows if r[:2] == ["sensor-gain of ground/force_normal", "sensor"])
    assert row[2:7] == ["gain", "1.08", "1.07", "1.09", "-"]
    assert "at the end of its range" in row[7]
    assert "predicts the held-out recordings no better than soil-stiffness: it may be any of these" in said
    assert "Measure next: weigh the striker at rest." in said
    assert "Structure remains in the misfit (p = 1e-06)." in said
    assert ["one", FORCE, "loading", "0.0050", "0.1000", "70.0", "speed"] in parts.rows
    assert ["speed", "90"] in parts.rows
    assert ["time", "0"] in parts.rows  # worse than nothing is nothing
    assert ["fitted", "one", "before", "9", "0.800", "8"] in parts.rows
    assert ["held out", "two", "after", "1.25", "", ""] in parts.rows
    assert ["one", "fitted", "9", "1.2"] in parts.rows
    assert ["two", "held out", "9.1", "1.3"] in parts.rows
    assert "Without a gain: 1 more" in said
    assert "a flat top" in said
    assert "<one>: a note." in said
    assert "What these recordings would have detected" not in said
    assert text.count("<svg") == 2


def test_a_page_is_the_same_whoever_draws_its_figures() -> None:
    asked = []

    def backwards(function: Callable[[Any], Any], things: Sequence[Any]) -> list[Any]:
        asked.extend(pickle.loads(pickle.dumps((function, things)))[1])  # as children are sent them
        return [function(thing) for thing in reversed(things)][::-1]

    two = tuple(replace(t, tracks=(*t.tracks, replace(t.tracks[0], channel="ground/sinkage"))) for t in overlays())
    about = sensor_at_fault(), two
    assert page(*about, title="Drop", command="x", each=backwards) == page(*about, title="Drop", command="x")
    channels = [[t.channel for t in one.tracks] for one, _ in asked]  # no other track goes with a figure
    assert channels == 2 * [[FORCE], ["ground/sinkage"]]


def test_held_out_data_are_shown_with_their_prediction() -> None:
    """Of several the one that is missed most; not where the mismatch is looked for, and not twice."""
    one, two = overlays()
    worse = replace(two, recording="three", tracks=(replace(two.tracks[0], before=0.9 * two.tracks[0].before),))
    text = page(sensor_at_fault(), (one, two, worse), title="Drop", command="x")
    assert text.count("<svg") == 3
    followed = text.index("How well the recordings are followed")
    assert text.index("three, held out: ") > followed > text.index("two, held out: ")
    alike = replace(sensor_at_fault(), training=("one", "two"), held_out=("one", "two"))
    in_turn = page(alike, [replace(t, held_out=False) for t in (one, two)], title="Drop", command="x")
    assert in_turn.rindex("<svg") < in_turn.index("How well the recordings are followed")


def test_the_page_where_nothing_was_found() -> None:
    parts = Parts(page(nothing_found(), overlays(with_after=False), title="Drop", command="rollover diagnose x"))
    assert "Simulation and recordings agree within the noise." in parts.said
    assert ["soil-viscous-damping", "damping", "120"] in parts.rows
    assert "Nothing was found in 2 recordings" in parts.said
    assert "What was found" not in parts.said
    assert "Where they differ" not in parts.said


def test_one_recording_is_not_called_held_out() -> None:
    """Of several under one condition each is held out in turn."""
    found = replace(sensor_at_fault(), training=("one", "two"), held_out=("one", "two"))
    alone = replace(found, training=("one",), held_out=("one",))
    alike = tuple(replace(t, condition="initiation.speed=3") for t in overlays())
    for about, shown, single, one in (
        (found, overlays(), False, False),
        (found, alike, False, True),
        (alone, alike[:1], True, False),
    ):
        text = page(about, shown, title="Drop", command="rollover diagnose x")
        assert ("nothing could be held out" in text) == single
        assert ("All recordings share one condition" in text) == one


@pytest.mark.parametrize(("p_value", "said"), [(0.3, "agree within the noise."), (1e-9, "more than noise")])
def test_what_is_tolerated_is_not_called_noise(p_value: float, said: str) -> None:
    assert said in answer(replace(nothing_found(), p_value=p_value))


def test_each_verdict_has_its_sentence() -> None:
    said = {
        answer(replace(nothing_found(), verdict=v))
        for v in ("no-mismatch", "parameter", "sensor", "missing-physics", "unexplained", "cannot-tell")
    }
    assert len(said) == 6


def test_the_recording_with_the_largest_share_comes_first() -> None:
    found = sensor_at_fault()
    assert [one.recording for one, _ in ranked(found, overlays())] == ["one", "two"]
    moved = replace(found, where=(replace(found.where[0], recording="two"),))
    assert [one.recording for one, _ in ranked(moved, overlays())] == ["two", "one"]


def test_residuals_are_over_the_noise() -> None:
    track = overlays()[0].tracks[0]
    assert track.rms_after == pytest.approx(np.sqrt(0.5), rel=0.05)  # a sine of one sigma
    assert track.rms_before > 1.0
    assert overlays(with_after=False)[0].tracks[0].rms_after is None


@pytest.mark.parametrize("with_after", [True, False])
def test_the_recording_for_the_viewer(with_after: bool, tmp_path: Path) -> None:
    pytest.importorskip("rerun", reason="no rerun wheel for this platform", exc_type=ImportError)
    from viz.recordings.diagnosis import write_diagnosis
    from viz.recordings.verify import check_rrd, read_column, read_entities

    path = tmp_path / "diagnosis.rrd"
    found = sensor_at_fault() if with_after else nothing_found()
    write_diagnosis(found, overlays(with_after=with_after), path, "Drop")
    assert check_rrd(path) == []
    assert [p.name for p in tmp_path.iterdir()] == [path.name]
    entities = set(read_entities(path))
    here = "/two/values/ground_force_normal_kN"
    assert {f"{here}/measured", f"{here}/before", "/answer", "/one/phase"} <= entities
    assert (f"{here}/after" in entities) == with_after
    at, values = read_column(path, f"{here}/measured", "Measurements:values")
    track = overlays()[1].tracks[0]
    assert len(at) == track.time.size + 1  # a gap, marked
    read = np.array([v[0] for v in values])
    assert np.isnan(read).sum() == 1
    assert read[~np.isnan(read)] == pytest.approx(1e-3 * track.measured)
    _, band = read_column(path, f"{here}/measured", "Measurements:variances")
    deviations = 1e3 * np.sqrt([v[0] for v, known in zip(band, ~np.isnan(read), strict=True) if known])
    assert deviations == pytest.approx(track.noise * track.unsure), (
        "the band is 1 sigma of what the misfit is held against"
    )
    _, units = read_column(path, f"{here}/measured", "Measurements:units")
    assert units == [["kN"]]
    left = read_column(path, "/two/residual/ground_force_normal_kN/before", "Scalars:scalars")[1]
    residual = np.array([v[0] for v in left])
    assert np.nanmax(residual) == pytest.approx(np.max(track.measured - track.before) / 40.0)


@pytest.mark.parametrize(
    ("kept", "one", "two"), [(("two",), "fitted", "held out"), (("one", "two"), "held out", "held out")]
)
def test_the_words_say_which_recordings_were_left_out(kept: tuple[str, ...], one: str, two: str) -> None:
    """With some kept out of all fits the others are fitted; else each is left out in turn."""
    rows = (("one", 8.0, 1.0), ("two", 9.0, 1.02))
    training = tuple(name for name in ("one", "two") if name not in kept or len(kept) == 2)
    found = replace(sensor_at_fault(), training=training, held_out=kept, per_recording=rows)
    words = markdown(found)
    assert f"| one | {one} | 8 | 1 |" in words
    assert f"| two | {two} | 9 | 1.02 |" in words


def test_the_words_name_the_rival_and_the_next_test() -> None:
    words = markdown(sensor_at_fault())
    assert words.startswith("# A sensor is faulty: sensor-gain of ground/force_normal.")
    assert "Not distinguishable from soil-stiffness." in words
    assert "Measure next: weigh the striker at rest." in words

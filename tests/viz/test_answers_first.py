"""Pages that answer first: curves before tables, tables that fit a sheet of paper, noise as a band."""

from __future__ import annotations

import html
import re
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from rollover.calibration.identifiability import Profile
from rollover.calibration.objective import Parameter
from rollover.comparison.misfit import Misfit, misfit
from rollover.dynamics.result import Run
from rollover.recording import Recording
from tests.viz.html import Parts
from tests.viz.test_injection import calibrated
from viz.content.entities import series
from viz.pages import calibration, comparison
from viz.recordings.comparison import write_comparison
from viz.recordings.verify import read_column, read_entities

FORCE = "ground/force_normal"
NOISE = 200.0  # N
WIDEST = 8  # columns that fit between the margins of A4 at the size of print


def compared(drop: Run, factor: float = 1.1, noise: float | None = NOISE) -> Misfit:
    measured = Recording(title="Drop", time=drop.recording.time, channels={FORCE: factor * drop.recording[FORCE]})
    found = misfit(drop, measured, name="drop 1", noise=lambda r, c: NOISE)
    return found if noise else replace(found, channels=tuple(replace(c, noise=None) for c in found.channels))


def test_a_comparison_opens_with_its_curves(drop: Run) -> None:
    found = compared(drop)
    text = comparison.page([found], title="Drop", command="rollover compare")
    body = text[text.index("<main>") :]
    assert body.index("<svg") < body.index("<table")
    heads = [re.findall(r"<th[^>]*>(.*?)</th>", table) for table in re.findall(r"<thead>(.*?)</thead>", body)]
    assert max(map(len, heads)) <= WIDEST
    folded = re.findall(r"<summary>(.*?)</summary>", body)
    assert [f.partition(":")[0] for f in folded] == ["ISO/TS 18571", "Sprague and Geers, residual, peak", "By phase"]
    (channel,) = found.channels
    rating = channel.rating
    shown = [row for row in Parts(text).rows if row and row[0] == FORCE]
    everything = " ".join(" ".join(row) for row in shown)
    for value in (rating.iso18571.corridor, rating.iso18571.phase, rating.iso18571.slope):
        assert f"{value:.3f}" in everything, "folded, not dropped"
    assert f"{100.0 * rating.sprague_geers.magnitude:.3g}" in everything
    assert f"{1e3 * rating.peak.time_error:+.3g}" in everything
    assert "residual, kN" in html.unescape(text), "the residual's axis bears its unit"


def test_a_calibration_shows_curves_and_correlations(drop: Run) -> None:
    marked = calibrated()
    names = ("vehicle.mass", "ground.law.stiffness_scale")
    estimates = tuple(
        replace(e, path=name, bounds=(0.5, 4.5), low=1.5, high=2.5, value=2.0, unit="kg")
        for e, name in zip(marked.estimates, names, strict=True)
    )
    bent = Profile(places=np.array([0.2, 0.4, 0.6, 0.8]), rises=np.array([9.0, 0.0, 2.0, -1.5]), fit=0.4, sigma=0.1)
    c = replace(
        marked,
        estimates=estimates,
        correlation=np.array([[1.0, -0.87], [-0.87, 1.0]]),
        parameters=tuple(
            Parameter(path=n, start=1.0, low=1.0, high=6.0, unit=u) for n, u in zip(names, ("kg", "1"), strict=True)
        ),
        profiles=(bent, replace(bent, rises=np.array([9.0, 0.0, 2.0, 6.0]))),
        warnings=("d2.0: its clock is off", "of 3 starts none ended where the best did"),
    )
    before, after = compared(drop, 1.3), compared(drop, 1.02)
    text = calibration.page(c, curves=[(before, after)], command="rollover calibrate")
    head = re.search(r'<div class="headline.*?</div>', text, flags=re.DOTALL)
    assert head is not None
    assert "vehicle.mass 2 kg (1.5 to 2.5); " in head[0]
    order = re.findall(r"<h2>(.*?)</h2>", text)
    assert order[:2] == ["Before and after", "Parameters"]
    first = text[text.index("<h2>Before and after") : text.index("<h2>Parameters")]
    for word in ("measured", "before", "after", "residual / noise"):
        assert f">{word}<" in first, word
    assert "drop 1, ground/force_normal" in first
    second = text[text.index("<h2>Parameters") : text.index("<h2>Correlations")]
    assert "place in the allowed range, %" in second
    assert "vehicle.mass 0.5 to 4.5 kg" in second
    assert order[2] == "Profile likelihood"
    profiles = text[text.index("<h2>Profile likelihood") : text.index("<h2>How well")]
    for word in ("others fitted anew", "quadratic", "95 %", "vehicle.mass, kg", "ground.law.stiffness_scale"):
        assert f">{word}<" in profiles, word
    assert profiles.count("lies below the fit") == 1
    assert "At 4.19" in profiles, "1 * 6^0.8"
    assert "d2.0: its clock is off." in text, "the name of a recording is not a word"
    assert "Of 3 starts none" in text
    third = text[text.index("<h2>Correlations") :]
    assert third.index("<svg") < third.index("<table")
    assert ">-0.87<" in third[: third.index("</svg>")].replace("\u2212", "-")


def test_a_known_noise_is_a_band_in_the_viewer(drop: Run, tmp_path: Path) -> None:
    s, found = series(FORCE), compared(drop)
    write_comparison(drop, found, tmp_path / "a.rrd")
    here = f"/{s.measured}"
    _, values = read_column(tmp_path / "a.rrd", here, "Measurements:values")
    _, variances = read_column(tmp_path / "a.rrd", here, "Measurements:variances")
    assert np.nanmax(np.array(values, dtype=float)) == pytest.approx(s.factor * found.channels[0].measured.max())
    assert set(np.sqrt(np.array(variances, dtype=float)).round(9).ravel()) == {round(s.factor * NOISE, 9)}
    _, units = read_column(tmp_path / "a.rrd", here, "Measurements:units")
    assert units == [[s.unit]]
    write_comparison(drop, compared(drop, noise=None), tmp_path / "b.rrd")
    assert not any("Measurements" in name for name in read_entities(tmp_path / "b.rrd")[here])
    _, bare = read_column(tmp_path / "b.rrd", here, "Scalars:scalars")
    assert np.array(bare, dtype=float) == pytest.approx(np.array(values, dtype=float))


def test_a_headline_of_one_channel_is_no_span(drop: Run) -> None:
    one = comparison.headline([compared(drop)])
    assert re.fullmatch(r"1 recording, 1 channel: ISO/TS 18571 0\.\d\d \(\w+\)\.", one.sentence)
    assert re.match(r"Residuals are [\d.]+ times the noise\.", one.detail)
    two = comparison.headline([compared(drop), compared(drop, 1.3)])
    assert re.fullmatch(r"2 recordings, 2 channels: ISO/TS 18571 0\.\d\d \(\w+\) to 0\.\d\d \(\w+\)\.", two.sentence)

"""The viewer itself draws the recordings without complaint. What they look like is for eyes: see `picture`."""

from __future__ import annotations

import dataclasses
from pathlib import Path

import numpy as np
import pytest

from tests.viz import example
from tests.viz.picture import has_software_driver, kept, picture_of_view, pictures, pixels
from viz.content.entities import SIMULATED

pytestmark = pytest.mark.skipif(
    not has_software_driver(), reason="no software Vulkan driver (mesa-vulkan-drivers): pictures cannot be made here"
)


@pytest.mark.parametrize(("name", "times"), [("overturn_rrd", (0.5, 1.37)), ("drop_rrd", (-0.05, 0.02))])
def test_the_viewer_draws_it_without_complaint(
    name: str, times: tuple[float, ...], request: pytest.FixtureRequest
) -> None:
    path: Path = request.getfixturevalue(name)
    shots, complaints = pictures(path, times)
    assert complaints == []
    assert len(set(shots)) == len(times)  # time moves something
    assert all(shot.startswith(b"\x89PNG") and len(shot) > 50_000 for shot in shots)


def test_a_peak_of_one_sample_is_drawn_as_high_as_a_long_one(tmp_path: Path) -> None:
    """Thirty thousand samples on some five hundred pixels: a plateau, then one sample of the same height."""
    log = pytest.importorskip("viz.recordings.log", reason="no rerun wheel for this platform", exc_type=ImportError)
    time = np.round(np.arange(0.0, 3.0, 1e-4), 9)
    force = np.zeros(time.size)
    force[3000:6000] = 80e3
    force[20_000] = 80e3
    run = example.overturn()
    channels = {"rops/force": force}
    log.write_rrd(
        dataclasses.replace(run, recording=dataclasses.replace(run.recording, time=time, channels=channels)),
        tmp_path / "spike.rrd",
    )
    shot = kept("spike.png", picture_of_view(tmp_path / "spike.rrd", "ROPS force, kN"))
    image = pixels(shot.read_bytes())
    rgb = [(SIMULATED >> k) & 255 for k in (24, 16, 8)]
    curve = np.abs(image - rgb).max(axis=2) < 40
    across = np.flatnonzero(curve.any(axis=0))
    tops = np.array([int(np.flatnonzero(curve[:, x])[0]) for x in across])
    foot = int(np.median(tops))  # most of the curve is at zero
    left, width = across[0], across[-1] - across[0]
    plateau = tops[(across > left + 0.12 * width) & (across < left + 0.18 * width)]
    spike = tops[(across > left + 0.64 * width) & (across < left + 0.70 * width)]
    height = foot - int(np.median(plateau))
    assert height > 40, "the plateau is to be seen"
    assert foot - int(spike.min()) >= height - 3

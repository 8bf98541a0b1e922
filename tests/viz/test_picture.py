"""The viewer itself draws the recordings without complaint. What they look like is for eyes: see `picture`."""

from __future__ import annotations

from pathlib import Path

import pytest

from tests.viz.picture import has_software_driver, pictures

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

"""What the pictures of the shipped scenarios lacked when they were looked at, and must not lack again."""

from __future__ import annotations

import dataclasses
import math
from pathlib import Path

import numpy as np
import pytest

from ground.surface import Bank, Ditch, Kerb, Slope, Sum, height
from rollover.dynamics.result import Run
from rollover.spec.initiation import Release
from tests.viz import example
from viz.content.verdict import newtons, verdict
from viz.recordings.edges import edges
from viz.recordings.scene import parts, path_of_centre

blueprint = pytest.importorskip(
    "viz.recordings.blueprint", reason="no rerun wheel for this platform", exc_type=ImportError
)

from viz.recordings.verify import read_column  # noqa: E402

OUTER = (-4.0, 6.0, -5.0, 7.0)


@pytest.mark.parametrize(
    ("part", "across"),
    [
        (Kerb(height=0.15, face_deg=60.0, foot=(0.0, 2.0)), [2.0, 2.0 + 0.15 / math.tan(math.radians(60.0))]),
        (Bank(height=1.0, angle_deg=45.0, edge=(0.0, 1.0)), [1.0, 2.0]),
        (Ditch(depth=0.5, bottom=1.0, angle_deg=45.0), [-1.0, -0.5, 0.5, 1.0]),
    ],
)
def test_lines_stand_where_the_ground_breaks(part: Kerb | Bank | Ditch, across: list[float]) -> None:
    lines = edges(part, OUTER)
    assert [float(line[0, 1]) for line in lines] == pytest.approx(across)
    eps = 1e-4
    for line in lines:
        assert np.ptp(line[:, 0]) > 5.0
        x, y = line[:, 0], line[:, 1]
        slopes = [(height(part, x, y + s * eps) - height(part, x, y)) / (s * eps) for s in (-1.0, 1.0)]
        assert np.all(np.abs(slopes[0] - slopes[1]) > 0.4), "the slope differs on both sides"
        assert np.all((line[:, 2] >= height(part, x, y)) & (line[:, 2] < height(part, x, y) + 0.02))


def test_a_sum_has_the_lines_of_its_parts_and_a_slope_none() -> None:
    kerb = Kerb(height=0.15, direction_deg=30.0)
    both = Sum(parts=(Slope(angle_deg=10.0), kerb))
    assert edges(Slope(angle_deg=10.0), OUTER) == []
    for mine, alone in zip(edges(both, OUTER), edges(kerb, OUTER), strict=True):
        np.testing.assert_allclose(mine[:, :2], alone[:, :2])
        assert np.ptp(mine[:, 2]) > 0.5, "they lie on the slope"


def test_the_label_of_a_peak_does_not_stand_for_ever(overturn: Run, overturn_rrd: Path) -> None:
    time, shown = read_column(overturn_rrd, "/world/peak", "Points3D:show_labels")
    assert time.tolist() == [1_362_000_000, 1_662_000_000]
    assert shown == [[True], [False]]
    _, places = read_column(overturn_rrd, "/world/peak", "Points3D:positions")
    assert places[0] == places[1], "the mark stays"


def turned(run: Run, **channels: np.ndarray) -> Run:
    found = {**run.recording.channels, **{f"chassis/{k}": v for k, v in channels.items()}}
    return dataclasses.replace(run, recording=dataclasses.replace(run.recording, channels=found))


def test_a_plot_that_says_nothing_is_not_in_front(overturn: Run, drop: Run) -> None:
    def front(run: Run) -> str:
        names = list(run.recording.channels)
        return str(blueprint.matching(names, blueprint.lively(run, names, blueprint.MOTION))[0][0])

    roll = overturn.recording["chassis/roll"]
    assert front(overturn) == "Roll, deg"
    assert front(turned(overturn, roll=0.01 * roll)) != "Roll, deg", "a tractor on a test stand"
    assert front(turned(overturn, pitch=np.full(roll.size, 1.5))) != "Roll, deg", "one that goes over backwards"
    constant = np.full(drop.recording.time.size, -9.81)
    channels = {**drop.recording.channels, "striker/acceleration_z": constant}
    falling = dataclasses.replace(drop, recording=dataclasses.replace(drop.recording, channels=channels))
    assert front(falling) == "Energy, kJ", "free fall: a line at -9.81"


def test_a_legend_stands_where_the_curve_is_low(overturn: Run) -> None:
    roll = overturn.recording["chassis/roll"]  # falls to the left: negative from 0
    assert blueprint.free_corner(overturn, ["chassis/roll"]) == "RightTop"
    assert blueprint.free_corner(turned(overturn, roll=-roll), ["chassis/roll"]) == "LeftTop"


def test_what_is_let_go_has_no_guide_and_is_followed() -> None:
    run = example.drop()
    thing = dataclasses.replace(run.scenario, initiation=Release(height=47.0))
    free = dataclasses.replace(run, scenario=thing)
    assert any("guide" in part.path for part in parts(run))
    assert not any("guide" in part.path for part in parts(free))
    np.testing.assert_array_equal(path_of_centre(free), run.motion["striker"].origin)


def test_what_never_landed_says_how_far_it_fell() -> None:
    run = example.drop()
    recording = dataclasses.replace(run.recording, channels=dict(run.recording.channels))
    peak = example.Peak(channel="ground/force_normal", unit="N", raw=0.0, raw_time=0.0, filtered=0.0, filtered_time=0.0)
    text = verdict(dataclasses.replace(run, recording=recording), [peak])
    assert text.startswith("# Ground force: none\n\nIt fell from 0.25")
    assert "****" not in text


@pytest.mark.parametrize(("force", "text"), [(14.94, "14.9 N"), (-99.4, "-99.4 N"), (100.0, "0.100 kN"), (0.0, "0 N")])
def test_a_small_force_is_told_in_newtons(force: float, text: str) -> None:
    assert newtons(force) == text

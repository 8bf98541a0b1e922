"""How a recording is laid out in the viewer: scene and phases to the left, loads first to the right."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from fnmatch import fnmatchcase
from typing import Any, Literal

import numpy as np
import rerun.blueprint as rrb
from numpy.typing import NDArray

from rollover.dynamics.result import Run
from rollover.scenario import Scenario
from rollover.spec.vehicle import Striker
from viz.content.entities import FOLLOWED, TIMELINE, series
from viz.recordings.scene import extent, path_of_centre

BACKGROUND = 0x2B313CFF
_FIELD_OF_VIEW = math.radians(55.0)  # the viewer's own, vertical

_STILL, _UPRIGHT = math.radians(2.0), math.radians(75.0)  # of roll and pitch
_FAR = 2.6  # times the vehicle's own size: a run that covers more shows the vehicle too small

# title, patterns of channels; a plot of which no channel was recorded is left out
_Plots = tuple[tuple[str, tuple[str, ...]], ...]
TOP: _Plots = (
    ("ROPS force, kN", ("rops/force",)),
    ("Test stand, kN", ("device/force",)),
    ("Ground force, kN", ("ground/force_normal", "ground/force_tangential")),
)
LOADS: _Plots = (
    ("ROPS by axis, kN", ("rops/force_?",)),
    ("Wheels, kN", ("wheel/*/force_normal",)),
    ("Sinkage, mm", ("ground/sinkage", "rops/deflection", "rops/post/*/set", "device/deflection")),
    ("Impulse, N s", ("ground/impulse_normal", "rops/impulse")),
    ("Use of posts", ("rops/post/*/use",)),
    ("Axle stop, N m s", ("axle/*/impulse",)),
    ("Contact area, cm\N{SUPERSCRIPT TWO}", ("ground/contact_area",)),
    ("Hitch, kN", ("hitch/force",)),
    ("Hitch, kN m", ("hitch/moment",)),
    ("Suspension, kN", ("suspension/*/force", "bogie/*/force")),
    ("Suspension, m", ("suspension/*/travel",)),
    ("Occupant, kN", ("occupant/*/contact_force", "occupant/*/ground_force", "occupant/*/force")),
)
MOTION: _Plots = (
    ("Input: angle, deg", ("input/*/angle",)),
    ("Input: force, kN", ("input/*/force",)),
    ("Input: torque, kN m", ("input/*/torque",)),
    ("Input: displacement, m", ("input/*/displacement",)),
    ("Input: acceleration, m/s\N{SUPERSCRIPT TWO}", ("input/*/acceleration",)),
    ("Roll, deg", ("chassis/roll",)),
    ("Striker acceleration, m/s\N{SUPERSCRIPT TWO}", ("striker/acceleration_z",)),
    ("Energy, kJ", ("energy/*", "rops/energy", "rops/post/*/plastic_work", "device/energy")),
    ("Rates, deg/s", ("chassis/angular_velocity_?",)),
    ("Striker speed, m/s", ("striker/velocity_z",)),
    ("Striker position, m", ("striker/position_z",)),
    ("Acceleration, m/s\N{SUPERSCRIPT TWO}", ("chassis/acceleration_?",)),
    ("Attitude, deg", ("chassis/pitch", "chassis/yaw", "axle/*/angle")),
    ("Trailer, deg", ("trailer/*", "hitch/angle_?")),
    ("Bogies, deg", ("bogie/*/angle",)),
    ("Position, m", ("chassis/position_?",)),
    ("Velocity, m/s", ("chassis/velocity_?",)),
    ("Head and torso, m/s\N{SUPERSCRIPT TWO}", ("occupant/head/acceleration_?", "occupant/torso/acceleration_?")),
)
_MOUNTS = ("rops/mount/*/force_?", "rops/hinge/*/force_?")
_MOMENTS = ("rops/mount/*/moment_?", "rops/hinge/*/moment_?", "rops/hinge/*/angle_?")


@dataclass(frozen=True, kw_only=True)
class Beside:
    """What a layout shows besides a run: a document that answers first, plots before the motion, its own phases."""

    answer: str
    title: str
    views: Sequence[rrb.TimeSeriesView] = ()
    phase: str = ""


def blueprint(run: Run, scales: str, beside: Beside | None = None) -> rrb.Blueprint:
    """Layout for one run: what answers "how high were the loads, and when" is in front in every place.

    `scales` says what lengths and colours in the scene mean.
    """
    # a plot of nothing but zeros says less than its absence, but for the load that is asked for
    found = run.recording.channels
    asked = "" if run.tests else "rops/force"
    channels = [c for c, v in found.items() if c == asked or np.any(np.nan_to_num(v))]
    top = _views(run, channels, TOP)
    loads = _views(run, channels, LOADS)
    if not top:  # on a tilt table the wheels tell
        top, loads = loads[:1], loads[1:]
    phases = [_phase("phase", "Phase")]
    words = [rrb.TextDocumentView(origin="/report/verdict", contents=["+ /report/verdict"], name="How high, and when")]
    if beside is not None:
        words.insert(0, rrb.TextDocumentView(origin=beside.answer, contents=[f"+ {beside.answer}"], name=beside.title))
        phases += [_phase(beside.phase, "Phase, measured")] if beside.phase else []
    left = rrb.Vertical(_scenes(run, scales), *phases, row_shares=[7, *[1] * len(phases)])
    rows = [
        top[:1],
        _mounts(run, channels) + top[1:] + loads + _moments(run, channels),
        [
            *(beside.views if beside else ()),
            *_views(run, channels, lively(run, channels, MOTION)),
            *_others(run, channels),
        ],
        [
            *words,
            rrb.TextLogView(
                origin="/events",
                contents=["+ /events"],
                name="Events",
                columns=rrb.TextLogColumns(timeline_columns=[TIMELINE], text_log_columns=["loglevel", "body"]),
            ),
            rrb.TextDocumentView(origin="/report/scenario", contents=["+ /report/scenario"], name="Scenario"),
        ],
    ]
    shares = [share for row, share in zip(rows, (3, 2, 2, 3.4), strict=True) if row]
    right = rrb.Vertical(
        *(row[0] if len(row) == 1 else rrb.Tabs(*row, active_tab=0) for row in rows if row), row_shares=shares
    )
    return framed(rrb.Horizontal(left, right, column_shares=[3, 2]))


def framed(front: Any) -> rrb.Blueprint:
    """A front with a time line that plays at a quarter of the speed, and nothing of the viewer's own panels."""
    return rrb.Blueprint(
        front,
        rrb.TimePanel(timeline=TIMELINE, playback_speed=0.25, loop_mode="all", state="collapsed"),
        rrb.BlueprintPanel(state="hidden"),
        rrb.SelectionPanel(state="hidden"),
        auto_layout=False,
        auto_views=False,
    )


def _phase(path: str, name: str) -> rrb.StateTimelineView:
    return rrb.StateTimelineView(origin=f"/{path}", contents=[f"+ /{path}"], name=name)


def _scenes(run: Run, scales: str) -> rrb.Spatial3DView | rrb.Tabs:
    """The whole run in one picture and, for a vehicle, a picture that goes with it; in front, what shows more."""
    (centre, radius), (_, own) = extent(run), extent(run, at=0)
    centre = centre - np.array([0.0, 0.0, 0.15 * radius])  # the sky may be cut, the ground may not
    towards, stays, goes = _seen_from(run), "Scene", "Following"
    if not len(path_of_centre(run)):
        return _scene(f"{stays}: {scales}", "/world", centre, radius, towards)
    # tabs are narrow: the one in front says what lengths and colours mean
    far = radius > _FAR * own
    stays, goes = (stays, f"{goes}: {scales}") if far else (f"{stays}: {scales}", goes)
    return rrb.Tabs(
        _scene(stays, "/world", centre, radius, towards),
        _scene(goes, f"/{FOLLOWED}", np.zeros(3), 1.25 * own, towards),
        active_tab=int(far),
    )


def _scene(
    name: str, origin: str, target: NDArray[np.float64], radius: float, direction: NDArray[np.float64]
) -> rrb.Spatial3DView:
    distance = 0.92 * radius / math.sin(0.5 * _FIELD_OF_VIEW)
    position = target + distance * direction / np.linalg.norm(direction)
    return rrb.Spatial3DView(
        origin=origin,
        contents=["+ /world/**"],
        name=name,
        background=np.array([BACKGROUND], dtype=np.uint32),
        line_grid=False,
        eye_controls=rrb.EyeControls3D(position=position, look_target=target, eye_up=(0.0, 0.0, 1.0)),
    )


def _seen_from(run: Run) -> NDArray[np.float64]:
    """Direction to the eye: the side to which the vehicle falls, from above and a little behind.

    There the ROPS and the ground below it are in sight from first touch to rest. A striker is seen across the guide,
    before the section through the soil.
    """
    if isinstance(run.scenario.vehicle, Striker):
        return np.array([0.3, -0.9, 0.38])
    heading = math.radians(_heading(run.scenario))
    c, s = math.cos(heading), math.sin(heading)
    return np.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]]) @ [-0.45, 0.8 * _side(run), 0.52]


def _heading(scenario: Scenario) -> float:
    start = scenario.initiation
    if start.kind == "throw" or start.kind == "release":
        return 0.0  # a body that tumbles heads nowhere; one that is let go looks along x
    return start.yaw_deg if start.kind == "drop" else start.heading_deg


def _side(run: Run) -> float:
    """+1 if it falls to its left."""
    if run.scenario.initiation.kind == "tip-over":
        return 1.0 if run.scenario.initiation.side == "left" else -1.0
    roll = run.recording.channels.get("chassis/roll", np.zeros(1))
    return -1.0 if float(roll[int(np.nanargmax(np.abs(roll)))]) > 0.0 else 1.0


def matching(channels: Sequence[str], plots: _Plots) -> list[tuple[str, list[str]]]:
    """Title and channels of every plot that has any; one whose channels have several units becomes one for each."""
    found = []
    for title, patterns in plots:
        by_unit: dict[str, list[str]] = {}
        for channel in (c for p in patterns for c in channels if fnmatchcase(c, p)):
            by_unit.setdefault(series(channel).unit, []).append(channel)
        found += [(f"{title.rpartition(', ')[0]}, {unit}", fitting) for unit, fitting in by_unit.items()]
    return found


def lively(run: Run, channels: Sequence[str], plots: _Plots) -> _Plots:
    """The same plots, those in front first that show something."""

    def is_dull(one: tuple[str, tuple[str, ...]]) -> bool:
        fitting = [c for _, found in matching(channels, (one,)) for c in found]
        return bool(fitting) and all(_dull(run, c) for c in fitting)

    return tuple(sorted(plots, key=is_dull))


def _dull(run: Run, channel: str) -> bool:
    """Whether a curve says nothing: it stands still, or it is a roll that jumps where the vehicle stands upright."""
    values = run.recording[channel][1:]
    spread = float(np.ptp(values[np.isfinite(values)])) if np.isfinite(values).any() else 0.0
    if channel == "chassis/roll":
        pitch = run.recording.channels.get("chassis/pitch", np.zeros(1))
        return spread < _STILL or float(np.nanmax(np.abs(pitch))) > _UPRIGHT
    return spread <= 1e-3 * float(np.nanmax(np.abs(values), initial=0.0))


def _views(run: Run, channels: Sequence[str], plots: _Plots) -> list[rrb.TimeSeriesView]:
    return [plot(run, title, fitting) for title, fitting in matching(channels, plots)]


def plot(run: Run, title: str, channels: Sequence[str]) -> rrb.TimeSeriesView:
    """Plot of some channels, with whatever is recorded beside the simulated values: measured, limit, peak."""
    paths = [series(c).path for c in channels]
    return rrb.TimeSeriesView(
        origin="/" + paths[0].partition("/")[0],
        contents=[f"+ /{path}/**" for path in paths],
        name=title,
        axis_x=rrb.TimeAxis(link=rrb.components.LinkAxis.LinkToGlobal),
        plot_legend=rrb.PlotLegend(free_corner(run, channels)),
    )


def free_corner(run: Run, channels: Sequence[str]) -> Literal["LeftTop", "RightTop"]:
    """The upper corner in which the curves leave more room for a legend."""
    third = max(1, run.recording.time.size // 3)
    values = np.nan_to_num(np.array([run.recording[c] * series(c).factor for c in channels]))
    left, right = values[:, :third].max(), values[:, -third:].max()
    return "LeftTop" if left < right else "RightTop"


def _mounts(run: Run, channels: Sequence[str]) -> list[rrb.Container]:
    """One tab with a plot for each mount and hinge; the axes have the same colours in each."""
    return _joints(run, channels, _MOUNTS, "Mounts, kN")


def _moments(run: Run, channels: Sequence[str]) -> list[rrb.Container]:
    """One tab with the moments through mounts and hinges, and how far these turn."""
    return _joints(run, channels, _MOMENTS, "Moments and turns")


def _joints(run: Run, channels: Sequence[str], patterns: tuple[str, ...], title: str) -> list[rrb.Container]:
    found: dict[str, list[str]] = {}
    for channel in channels:
        if any(fnmatchcase(channel, pattern) for pattern in patterns):
            _, what, name, part = channel.split("/")
            load = "" if part.startswith("force") else f" {part[:-2]}"
            found.setdefault(f"{what.capitalize()} {name}{load}, {series(channel).unit}", []).append(channel)
    plots = [plot(run, name, of_joint) for name, of_joint in found.items()]
    return [rrb.Grid(*plots, grid_columns=min(2, len(plots)), name=title)] if plots else []


def _others(run: Run, channels: Sequence[str]) -> list[rrb.TimeSeriesView]:
    """What no plot above shows; nothing recorded is out of reach."""
    patterns = [p for plots in (TOP, LOADS, MOTION) for _, found in plots for p in found]
    patterns += [*_MOUNTS, *_MOMENTS]
    rest: dict[str, list[str]] = {}
    for channel in channels:
        if not any(fnmatchcase(channel, p) for p in patterns):
            rest.setdefault(series(channel).unit, []).append(channel)
    return [plot(run, f"Other, {unit}" if unit else "Other, SI", found) for unit, found in rest.items()]

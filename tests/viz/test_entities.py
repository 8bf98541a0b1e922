"""Paths, units and colours of channels; what of `viz` does without the viewer's SDK."""

from __future__ import annotations

import math
import subprocess
import sys

import pytest

from rollover.spec.channels import CHANNELS
from viz.content.entities import SIMULATED, WHEEL, escaped, force_colour, force_path, series

NAMES = [
    name.replace("NAME", who)
    for name in CHANNELS
    for who in (("left", "right", "front_left") if "NAME" in name else ("",))
    if name != "time"
]


@pytest.mark.parametrize("body", ["chassis", "trailer", "front_axle", "hub_rear_left", "bogie_left", "occupant_head"])
def test_only_the_arrow_at_the_rops_has_its_colour(body: str) -> None:
    assert force_colour("rops") == force_colour("rops_upper") == SIMULATED
    assert force_colour(body) != SIMULATED


def test_every_known_channel_has_a_place_of_its_own() -> None:
    found = [series(name) for name in NAMES]
    assert {s.channel for s in found if s.group == "other"} == set()
    assert len({s.path for s in found}) == len(found)
    assert all(s.unit for s in found)


@pytest.mark.parametrize(
    ("channel", "path", "unit", "factor"),
    [
        ("rops/force", "loads/rops_force_kN", "kN", 1e-3),
        ("rops/mount/left/force_z", "mounts/rops_mount_left_force_z_kN", "kN", 1e-3),
        ("rops/mount/left/force", "mounts/rops_mount_left_force_kN", "kN", 1e-3),  # a magnitude, no channel
        ("chassis/roll", "motion/chassis_roll_deg", "deg", 180.0 / math.pi),
        ("chassis/angular_velocity_x", "motion/chassis_angular_velocity_x_deg_s", "deg/s", 180.0 / math.pi),
        ("ground/sinkage", "sinkage/ground_sinkage_mm", "mm", 1e3),
        ("chassis/position_z", "motion/chassis_position_z_m", "m", 1.0),
        ("energy/soil", "energy/energy_soil_kJ", "kJ", 1e-3),
        ("made up/by hand", r"other/made\ up_by\ hand", "", 1.0),
    ],
)
def test_paths_and_units_for_people(channel: str, path: str, unit: str, factor: float) -> None:
    s = series(channel)
    assert (s.path, s.unit, s.factor) == (path, unit, factor)
    assert s.simulated == f"{path}/simulated"


def test_a_wheel_has_one_colour_in_plot_and_scene() -> None:
    for name, colour in WHEEL.items():
        assert series(f"wheel/{name}/force_normal").colour == colour
    assert len(set(WHEEL.values())) == 4


def test_names_are_escaped_so_that_no_two_meet() -> None:
    assert escaped("a b") != escaped("a_b")
    assert force_path(20e3, "rops") == "world/forces_1m_is_20kN/rops"
    assert force_path(0.5, "rops") == "world/forces_1m_is_0.0005kN/rops"


def test_only_log_draw_blueprint_stream_and_verify_need_the_sdk() -> None:
    code = (
        "import sys, viz.content.entities, viz.recordings.scene, viz.recordings.terrain; "
        "import viz.content.verdict, viz.recordings.viewer; "
        "sys.exit(any(m.partition('.')[0] == 'rerun' for m in sys.modules))"
    )
    assert subprocess.run([sys.executable, "-c", code], check=False).returncode == 0

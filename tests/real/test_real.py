"""What real recordings must give; skipped where ROLLOVER_DATA does not say where they are."""

from __future__ import annotations

import os
from pathlib import Path

import pytest

from ground.penetration import chosen
from tests.real import cube_tosses, penetrometer

DATA = os.environ.get("ROLLOVER_DATA", "")


def folder(name: str) -> Path:
    """A folder of recordings, or a skip that says what is missing."""
    path = Path(DATA, name)
    if not DATA or not path.is_dir():
        pytest.skip(f"needs the recordings {name!r}: set ROLLOVER_DATA to the folder that holds them")
    return path


def test_cube_tosses_give_the_published_friction_and_beat_wrong_numbers_on_tosses_left_out() -> None:
    found = cube_tosses.study(str(folder("cube_tosses") / "cube_tosses.npz"), 10, starts=((0.3, 0.4),))
    # published 0.15 to 0.18; five tosses narrow it to some 20 %
    assert 0.12 < found["friction"]["value"] < 0.22
    assert 0.10 < found["restitution"]["value"] < 0.35
    for window, error in found["held_out_corner_error"].items():
        assert error["fitted"] < 0.02, window
        assert error["fitted"] < 0.5 * error["far_off"], window
    assert found["start"]["velocity_error"] < 0.005


def test_the_sea_bed_resists_with_depth_and_rate_and_handling_is_left_out() -> None:
    refused, forms = penetrometer.study(folder("soil_penetrometer"))
    assert len(refused) == 1
    assert refused[0].startswith("bLog0D39: ")
    best = chosen(forms)
    assert best.form.name == "bearing-rate"
    # measured: 24 % and 12 %; three places on a sea bed are not one soil
    assert best.deceleration_error < 0.30
    assert best.depth_error < 0.16
    assert best.residual < 0.75 * forms["ye-2006"].residual
    assert [round(d.depth[0], 1) for d in best.held_out] == [0.5, 0.5, 0.5]

"""The table of channels, and units on the way in."""

from __future__ import annotations

import math

import numpy as np
import pytest

from rollover.spec.channels import CHANNELS, UNITS, describe, factor, is_known, to_si

# the fixed channels of the product: extended at will, never renamed or dropped
FIXED = {
    "time": "s",
    "ground/force_normal": "N",
    "ground/force_tangential": "N",
    "ground/impulse_normal": "N s",
    "ground/sinkage": "m",
    "striker/position_z": "m",
    "striker/velocity_z": "m/s",
    "striker/acceleration_z": "m/s2",
    **{f"chassis/position_{a}": "m" for a in "xyz"},
    **{f"chassis/velocity_{a}": "m/s" for a in "xyz"},
    **{f"chassis/{a}": "rad" for a in ("roll", "pitch", "yaw")},
    **{f"chassis/angular_velocity_{a}": "rad/s" for a in "xyz"},
    **{f"chassis/acceleration_{a}": "m/s2" for a in "xyz"},
    **{f"rops/force_{a}": "N" for a in "xyz"},
    "rops/force": "N",
    **{f"rops/mount/left/force_{a}": "N" for a in "xyz"},
    "rops/mount/rear-2_left/force_x": "N",
    "rops/deflection": "m",
    "rops/energy": "J",
    **{f"wheel/{end}_{side}/force_normal": "N" for end in ("front", "rear") for side in ("left", "right")},
    "axle/front/angle": "rad",
    **{
        f"energy/{name}": "J"
        for name in ("kinetic", "potential", "soil", "tyre", "rops", "friction", "collision", "residual")
    },
}


@pytest.mark.parametrize("name", FIXED)
def test_fixed_channels(name: str) -> None:
    channel = describe(name)
    assert (channel.name, channel.unit) == (name, FIXED[name])
    assert channel.meaning
    assert is_known(name)


@pytest.mark.parametrize(
    "name", ["", "Time", "rops/mount/NAME/force_x", "rops/mount/a/b/force_x", "rops/mount//force_x", "energy/NAME"]
)
def test_not_a_channel(name: str) -> None:
    assert not is_known(name)


def test_an_unknown_channel_offers_the_nearest() -> None:
    with pytest.raises(ValueError, match=r"^unknown channel, got 'rops/forcey'; did you mean 'rops/force_y' or "):
        describe("rops/forcey")
    with pytest.raises(ValueError, match=r"^unknown channel, got 'xyz'; see `rollover list channels`$"):
        describe("xyz")


def test_every_channel_has_a_table_of_units_with_its_own_as_one() -> None:
    for channel in CHANNELS.values():
        assert UNITS[channel.unit][channel.unit] == 1.0


# worked out by hand from the definitions: inch 25.4 mm, pound 0.45359237 kg, standard gravity 9.80665 m/s2
@pytest.mark.parametrize(
    ("unit", "channel", "si"),
    [
        ("ms", "time", 0.001),
        ("kN", "rops/force", 1000.0),
        ("lbf", "rops/force", 0.45359237 * 9.80665),
        ("kip", "rops/force", 453.59237 * 9.80665),
        ("daN", "rops/force", 10.0),
        ("kgf", "rops/force", 9.80665),
        ("mm", "ground/sinkage", 0.001),
        ("in", "ground/sinkage", 0.0254),
        ("ft", "ground/sinkage", 0.3048),
        ("km/h", "striker/velocity_z", 1.0 / 3.6),
        ("mph", "striker/velocity_z", 0.44704),
        ("g", "striker/acceleration_z", 9.80665),
        ("m/s^2", "striker/acceleration_z", 1.0),
        ("deg", "chassis/roll", math.pi / 180.0),
        ("deg/s", "chassis/angular_velocity_x", math.pi / 180.0),
        ("rpm", "chassis/angular_velocity_x", 2.0 * math.pi / 60.0),
        ("N s", "ground/impulse_normal", 1.0),
        ("lbf s", "ground/impulse_normal", 0.45359237 * 9.80665),
        ("kJ", "rops/energy", 1000.0),
        ("Nm", "rops/energy", 1.0),
        ("ft lbf", "rops/energy", 0.3048 * 0.45359237 * 9.80665),
        ("cm2", "ground/contact_area", 1e-4),
    ],
)
def test_factors(unit: str, channel: str, si: float) -> None:
    assert factor(unit, channel) == pytest.approx(si, rel=1e-14)
    assert to_si([2.0, -1.0], unit, channel) == pytest.approx([2.0 * si, -si], rel=1e-14)


def test_gaps_stay_gaps() -> None:
    assert np.isnan(to_si(np.array([np.nan]), "kN", "rops/force")).all()


@pytest.mark.parametrize(
    ("unit", "channel"), [("g", "rops/force"), ("kN", "ground/sinkage"), ("Nm", "ground/sinkage"), ("deg", "time")]
)
def test_a_unit_of_another_dimension_is_refused(unit: str, channel: str) -> None:
    with pytest.raises(ValueError, match=rf"^unit does not fit {channel}, got '{unit}'; .*allowed: "):
        factor(unit, channel)


def test_a_misspelt_unit_offers_the_nearest_and_all_that_fit() -> None:
    with pytest.raises(ValueError, match=r"got 'km/hr'; did you mean 'km/h'\? allowed: m/s, mm/s, .*mph"):
        factor("km/hr", "striker/velocity_z")

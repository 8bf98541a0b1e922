"""The table of channels: name, unit, meaning; and units on the way in.

SI, right-handed; vehicle axes x forward, y left, z up (ISO 8855), world z up.
"""

from __future__ import annotations

import functools
import math
import re
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import ArrayLike, NDArray

from rollover.spec import units
from rollover.system.errors import hint, nearest


@dataclass(frozen=True, kw_only=True)
class Channel:
    """One channel, or a family of them where `name` holds NAME: a wheel or a mount."""

    name: str
    unit: str
    meaning: str
    period: float | None = None  # in its unit: values that differ by it say the same


TURN = 2.0 * math.pi


def _attitude(body: str) -> list[Channel]:
    meaning = "ISO 8855, on one branch along a run"
    return [Channel(name=f"{body}/{a}", unit="rad", meaning=meaning, period=TURN) for a in ("roll", "pitch", "yaw")]


def _axes(name: str, unit: str, meaning: str, axes: str = "xyz") -> list[Channel]:
    return [Channel(name=f"{name}_{axis}", unit=unit, meaning=f"{meaning}, {axis}") for axis in axes]


_ENERGY = {
    "kinetic": "of all bodies and of the soil that moves with them",
    "potential": "of all bodies in gravity, zero at the start",
    "soil": "put into the ground's loading curve, less what came back",
    "tyre": "stored and lost in the tyres",
    "rops": "stored and lost in the mounts and hinges of the ROPS",
    "friction": "lost in sliding",
    "collision": "lost in the collision with the co-moving mass, eq (8)",
    "axle": "stored and lost in the front axle's stops",
    "device": "taken by the devices of a test stand, less what they put in",
    "lashing": "stored and lost in the lashings of a test stand",
    "effects": "taken by effects on the bodies: guide, air, a compliant striker",
    "occupant": "stored and lost in the occupant's joints, belt and contacts with seat, frame and vehicle",
    "hitch": "stored and lost in the hitch of a trailer",
    "suspension": "stored and lost in springs, dampers and guides of sprung wheels, pins and stops of bogies",
    "drive": "taken by the brakes, less what the engine gave",
    "input": "taken by prescribed forces, motion of the ground and steering, less what they put in",
    "residual": "what the ledger does not explain",
}

CHANNELS: dict[str, Channel] = {
    channel.name: channel
    for channel in [
        Channel(name="time", unit="s", meaning="zero at the scenario's start"),
        Channel(name="ground/force_normal", unit="N", meaning="ground on striker or vehicle, without the impulse"),
        Channel(name="ground/force_tangential", unit="N", meaning="ground on striker or vehicle, along the surface"),
        Channel(name="ground/impulse_normal", unit="N s", meaning="collision impulse, accumulated"),
        Channel(
            name="ground/sinkage", unit="m", meaning="of the deepest element in contact, positive down; 0 where none is"
        ),
        Channel(name="ground/contact_area", unit="m2", meaning="of the elements that are in contact"),
        Channel(
            name="striker/position_z",
            unit="m",
            meaning="of the striker's face, world, 0 on the ground; travel of its body, if its nose is compliant",
        ),
        Channel(name="striker/velocity_z", unit="m/s", meaning="world"),
        Channel(name="striker/acceleration_z", unit="m/s2", meaning="world, coordinate acceleration"),
        *_axes("chassis/position", "m", "centre of mass, world"),
        *_axes("chassis/velocity", "m/s", "centre of mass, world"),
        *_attitude("chassis"),
        *_axes("chassis/angular_velocity", "rad/s", "body axes"),
        *_axes("chassis/acceleration", "m/s2", "centre of mass, body axes, coordinate acceleration"),
        *_axes("chassis/quaternion", "1", "attitude, body axes to world, scalar first", "wxyz"),
        *_axes("sensor/NAME/acceleration", "m/s2", "of an accelerometer, at its place, its own axes"),
        *_axes("sensor/NAME/angular_velocity", "rad/s", "of a gyroscope, its own axes"),
        *_axes("rops/force", "N", "ground on the ROPS, vehicle axes"),
        Channel(name="rops/force", unit="N", meaning="ground on the ROPS, resultant"),
        *_axes("rops/mount/NAME/force", "N", "load through the mount, vehicle axes"),
        *_axes("rops/mount/NAME/moment", "N m", "through the mount, vehicle axes"),
        *_axes("rops/hinge/NAME/force", "N", "load through the hinge on the upper part, axes of the lower"),
        *_axes("rops/hinge/NAME/moment", "N m", "through the hinge on the upper part, axes of the lower"),
        *_axes("rops/hinge/NAME/angle", "rad", "turn of the upper part against the lower, rotation vector"),
        Channel(name="rops/impulse", unit="N s", meaning="collision impulse on the ROPS, accumulated"),
        Channel(name="rops/deflection", unit="m", meaning="of the loaded upper corner against the chassis"),
        Channel(name="rops/energy", unit="J", meaning="absorbed by the ROPS"),
        Channel(name="rops/post/NAME/set", unit="m", meaning="what stays of the way of a post's head, by itself"),
        Channel(name="rops/post/NAME/plastic_work", unit="J", meaning="put into a post and its rail beyond yield"),
        Channel(name="rops/post/NAME/use", unit="1", meaning="of a post's worst section, 1 at its plastic resistance"),
        Channel(name="wheel/NAME/force_normal", unit="N", meaning="ground on the tyre"),
        Channel(name="device/force", unit="N", meaning="of the test stand's beam, block or exciter on what it loads"),
        Channel(name="device/deflection", unit="m", meaning="of the loaded point along the load, since it began"),
        Channel(name="device/energy", unit="J", meaning="put in by the device since the load began"),
        Channel(name="wheel/NAME/spin", unit="rad/s", meaning="of a wheel that turns by itself, forward"),
        Channel(name="axle/front/angle", unit="rad", meaning="of the front axle about its pivot", period=TURN),
        Channel(name="axle/front/impulse", unit="N m s", meaning="of the axle on its stops, accumulated"),
        *_axes("occupant/NAME/acceleration", "m/s2", "centre of mass of pelvis, torso or head, coordinate, own axes"),
        Channel(
            name="occupant/NAME/contact_force", unit="N", meaning="on a part by seat, frame and vehicle, resultant"
        ),
        Channel(name="occupant/NAME/ground_force", unit="N", meaning="on a part by the ground, resultant"),
        Channel(name="occupant/NAME/force", unit="N", meaning="through lumbar or neck, resultant"),
        Channel(name="occupant/NAME/moment", unit="N m", meaning="through lumbar or neck, resultant"),
        Channel(name="occupant/belt/NAME/force", unit="N", meaning="tension of a strap of the lap belt"),
        Channel(name="hitch/force", unit="N", meaning="through the hitch of a trailer, resultant"),
        Channel(name="hitch/moment", unit="N m", meaning="through the hitch of a trailer, resultant"),
        *_axes("hitch/angle", "rad", "turn of the trailer against the vehicle, rotation vector"),
        *_attitude("trailer"),
        Channel(name="suspension/NAME/travel", unit="m", meaning="of a sprung wheel, up from the design position"),
        Channel(name="suspension/NAME/force", unit="N", meaning="of spring, damper and stop on the vehicle, upward"),
        Channel(name="bogie/NAME/angle", unit="rad", meaning="of a bogie against what carries it, front wheel down"),
        Channel(name="bogie/NAME/force", unit="N", meaning="through the pin of a bogie, resultant"),
        Channel(name="input/NAME/angle", unit="rad", meaning="prescribed: of the front wheels, or of a tilt table"),
        Channel(name="input/NAME/force", unit="N", meaning="prescribed, on a body"),
        Channel(name="input/NAME/torque", unit="N m", meaning="prescribed: of the engine, or limit of a brake"),
        Channel(name="input/NAME/displacement", unit="m", meaning="prescribed, of the shaken ground"),
        Channel(name="input/NAME/acceleration", unit="m/s2", meaning="prescribed, of the shaken ground"),
        *[Channel(name=f"energy/{name}", unit="J", meaning=meaning) for name, meaning in _ENERGY.items()],
    ]
}


@functools.cache
def _patterns() -> list[tuple[re.Pattern[str], Channel]]:
    return [
        (re.compile(re.escape(name).replace("NAME", "[A-Za-z][A-Za-z0-9_-]*")), channel)
        for name, channel in CHANNELS.items()
        if "NAME" in name
    ]


def describe(name: str) -> Channel:
    """Look a channel up by its full name. Raises ``ValueError`` with the nearest names."""
    entry = entry_of(name)
    return CHANNELS[entry] if entry == name else replace(CHANNELS[entry], name=name)


def entry_of(name: str) -> str:
    """Key of `CHANNELS` for a full name, with NAME for what stands there. Raises ``ValueError`` with near names."""
    if name in CHANNELS and "NAME" not in name:
        return name
    for pattern, channel in _patterns():
        if pattern.fullmatch(name) and "NAME" not in name.split("/"):
            return channel.name
    close = nearest(name, CHANNELS, most=3)
    help_ = f"did you mean {' or '.join(map(repr, close))}?" if close else "see `rollover list channels`"
    raise ValueError(f"unknown channel, got {name!r}; {help_}")


def is_known(name: str) -> bool:
    """Whether this is the full name of a channel."""
    try:
        describe(name)
    except ValueError:
        return False
    return True


_POUND, _FOOT, _INCH, _MILE, _G = 4.4482216152605, 0.3048, 0.0254, 1609.344, 9.80665  # exact by definition

# unit of the channel -> spelling -> factor; a table for each dimension, so that g is no gram and Nm no length;
# `rollover.spec.units` knows other spellings of the same
UNITS: dict[str, dict[str, float]] = {
    "1": {"1": 1.0, "-": 1.0, "": 1.0, "%": 0.01},
    "s": {"s": 1.0, "ms": 1e-3, "us": 1e-6, "µs": 1e-6, "ns": 1e-9, "min": 60.0},
    "N": {
        "N": 1.0,
        "kN": 1e3,
        "MN": 1e6,
        "daN": 10.0,
        "dN": 0.1,
        "mN": 1e-3,
        "lbf": _POUND,
        "kip": 1e3 * _POUND,
        "klbf": 1e3 * _POUND,
        "kgf": _G,
        "kp": _G,
        "tf": 1e3 * _G,
    },
    "N s": {
        **dict.fromkeys(("N s", "Ns", "N·s", "N*s", "kg m/s", "kg*m/s"), 1.0),
        **dict.fromkeys(("kN s", "kNs", "kN·s", "kN*s"), 1e3),
        **dict.fromkeys(("lbf s", "lbf*s", "lbf·s"), _POUND),
    },
    "N m": {
        **dict.fromkeys(("N m", "Nm", "N·m", "N*m"), 1.0),
        **dict.fromkeys(("kN m", "kNm", "kN·m", "kN*m"), 1e3),
        **dict.fromkeys(("ft lbf", "ft*lbf", "ft-lbf", "ft·lbf", "lbf ft"), _FOOT * _POUND),
        **dict.fromkeys(("in lbf", "in*lbf", "in-lbf", "lbf in"), _INCH * _POUND),
    },
    "N m s": {
        **dict.fromkeys(("N m s", "Nms", "N·m·s", "N*m*s"), 1.0),
        **dict.fromkeys(("kN m s", "kNms"), 1e3),
    },
    "m": {"m": 1.0, "mm": 1e-3, "cm": 1e-2, "um": 1e-6, "µm": 1e-6, "nm": 1e-9, "km": 1e3, "in": _INCH, "ft": _FOOT},
    "m2": {
        **dict.fromkeys(("m2", "m^2", "m²"), 1.0),
        **dict.fromkeys(("cm2", "cm^2", "cm²"), 1e-4),
        **dict.fromkeys(("mm2", "mm^2", "mm²"), 1e-6),
    },
    "m/s": {
        "m/s": 1.0,
        "mm/s": 1e-3,
        "cm/s": 1e-2,
        "ft/s": _FOOT,
        "in/s": _INCH,
        "km/h": 1.0 / 3.6,
        "kph": 1.0 / 3.6,
        "mph": _MILE / 3600.0,
        "mi/h": _MILE / 3600.0,
    },
    "m/s2": {
        **dict.fromkeys(("m/s2", "m/s^2", "m/s²", "m/s**2"), 1.0),
        **dict.fromkeys(("mm/s2", "mm/s^2", "mm/s²"), 1e-3),
        **dict.fromkeys(("ft/s2", "ft/s^2", "ft/s²"), _FOOT),
        "g": _G,
        "G": _G,
        "g_n": _G,
        "mg": 1e-3 * _G,
    },
    "rad": {
        "rad": 1.0,
        "mrad": 1e-3,
        "rev": 2.0 * math.pi,
        **dict.fromkeys(("deg", "°"), math.pi / 180.0),
    },
    "rad/s": {
        "rad/s": 1.0,
        "mrad/s": 1e-3,
        "rev/s": 2.0 * math.pi,
        **dict.fromkeys(("deg/s", "°/s", "dps"), math.pi / 180.0),
        **dict.fromkeys(("rpm", "1/min", "rev/min", "r/min"), math.pi / 30.0),
    },
    "J": {
        **dict.fromkeys(("J", "N m", "Nm", "N·m", "N*m", "W s", "Ws"), 1.0),
        **dict.fromkeys(("kJ", "kN m", "kNm", "kN·m", "kN*m"), 1e3),
        "MJ": 1e6,
        "mJ": 1e-3,
        "Wh": 3600.0,
        "kWh": 3.6e6,
        **dict.fromkeys(("ft lbf", "ft*lbf", "ft-lbf", "ft·lbf", "lbf ft"), _FOOT * _POUND),
        **dict.fromkeys(("in lbf", "in*lbf", "in-lbf", "lbf in"), _INCH * _POUND),
    },
}


def factor(unit: str, channel: str) -> float:
    """What one `unit` is in the channel's own unit. Raises ``ValueError`` that lists what fits the channel."""
    own = describe(channel).unit
    known = UNITS.get(own, {own: 1.0})  # of a model of one's own may be any unit
    found = units.find(unit, known, {other: table for other, table in UNITS.items() if other != own})
    if found is None:
        raise ValueError(f"unit does not fit {channel}, got {unit!r}; {hint(unit, known, most_listed=99)}")
    return found


def to_si(values: ArrayLike, unit: str, channel: str) -> NDArray[np.float64]:
    """Values of a channel in its own unit, from values in `unit`."""
    return np.asarray(values, dtype=np.float64) * factor(unit, channel)

"""ISO/TS 13499 channel codes, 16 characters, to channels and back.

test object (1), position (1), main location (4), three fine locations (2 + 2 + 2), dimension (2), direction (1),
filter class (1). The main location ROPS is of the code list since 1.6.2; VEHC and WHEL are the vehicle's and the
wheels', GRND and STRK our own for what the list has no place for [M].
"""

from __future__ import annotations

import functools
import re

from rollover.spec.channels import CHANNELS, describe

DEFAULT_UNITS = {"AC": "m/s2", "AV": "rad/s", "AN": "rad", "FO": "N", "DS": "m", "DC": "m", "VE": "m/s", "EN": "J"}
DEFAULT_UNITS |= {"TI": "s"}
FILTERS = {"A": 1000, "B": 600, "C": 180, "D": 60}
_LETTERS = {cfc: letter for letter, cfc in FILTERS.items()} | {0: "0"}
_PLACES = {
    "ground": "GRND000000",
    "ground/force_normal": "GRNDNO0000",
    "ground/force_tangential": "GRNDTA0000",
    "striker": "STRK000000",
    "chassis": "VEHCCG0000",
    "rops": "ROPS000000",
    "axle": "AXLEFR0000",
    "energy": "VEHC000000",
}
_QUANTITIES = {
    "acceleration": "AC",
    "angular_velocity": "AV",
    "velocity": "VE",
    "position": "DC",
    "sinkage": "DS",
    "deflection": "DS",
    "force": "FO",
    "force_normal": "FO",
    "force_tangential": "FO",
    "roll": "AN",
    "pitch": "AN",
    "yaw": "AN",
    "angle": "AN",
    "energy": "EN",
}
_DIRECTIONS = {"roll": "X", "pitch": "Y", "yaw": "Z", "rops/force": "R"}


def code_of(channel: str, cfc: int = 0, *, test_object: str = "1") -> str:
    """Code of a channel; what the code list has no word for gets zeros, and keeps its name beside the code."""
    if channel == "time":
        return f"{test_object}0TIME000000TI00"
    describe(channel)
    first, *_, last = channel.split("/")
    match = re.fullmatch(r"(.*)_([xyzw])", last)
    quantity, direction = (match[1], match[2].upper()) if match else (last, "0")
    direction = _DIRECTIONS.get(channel, _DIRECTIONS.get(last, direction))
    place = _PLACES.get(channel, _PLACES.get(first, "0000000000"))
    if first == "wheel" or channel.startswith("rops/mount/"):
        place = _side("WHEL" if first == "wheel" else "ROPS", channel.split("/")[-2])
    dimension = "EN" if first == "energy" else _QUANTITIES.get(quantity, "00")
    return f"{test_object}0{place}{dimension}{direction}{_LETTERS[cfc]}"


def channel_of(code: str) -> str | None:
    """Channel of a code, whatever its test object, position and filter class; None if it is none of ours."""
    return _codes().get(_bare(code))


def cfc_of(code: str) -> int | None:
    """Filter class of a code's last letter; None for unfiltered, prefiltered and special."""
    return FILTERS.get(code[15:16].upper())


def dimension_of(code: str) -> str:
    """The two letters of the physical dimension."""
    return code[12:14].upper()


def _bare(code: str) -> str:
    return code[2:15].upper().replace("?", "0")


@functools.cache
def _codes() -> dict[str, str]:
    names = [name for name in CHANNELS if "NAME" not in name and name != "time"]
    ends = [f"{end}_{side}" for end in ("front", "rear") for side in ("left", "right")]
    names += [f"wheel/{end}/force_normal" for end in ends]
    names += [f"rops/mount/{end}/force_{axis}" for end in (*ends, "left", "right") for axis in "xyz"]
    found: dict[str, str] = {}
    twice: set[str] = set()
    for name in names:
        bare = _bare(code_of(name))
        if bare in found or "0000" in bare[:4] or bare[10:12] == "00":
            twice.add(bare)
        found[bare] = name
    return {bare: name for bare, name in found.items() if bare not in twice}


def _side(place: str, name: str) -> str:
    end = "FR" if "front" in name else "RE" if "rear" in name else "00"
    side = "LE" if "left" in name else "RI" if "right" in name else "00"
    mount = "MT" if place == "ROPS" else "00"
    return f"{place}{end}{side}{mount}"

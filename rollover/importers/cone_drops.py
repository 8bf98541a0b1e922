"""A two-part body with a cone for a nose, dropped onto water: rigid, or with a spring between nose and body."""

from __future__ import annotations

import math
import re
from collections.abc import Iterator, Sequence
from fnmatch import fnmatch
from pathlib import Path

import numpy as np

from rollover.importers.importer import Collection, check_claim, reading
from rollover.recording import Recording, Sensor

G, GRAVITY = 9.80665, 9.81  # unit g; free fall in the laboratory, m/s2
BODY, SHAFT, SPRING, INSERT = 0.5228, 0.0343, 0.0040, 0.0025  # kg
CONE = {80: 0.0257, 60: 0.0300}  # kg, by half angle
CLIPS = 41.7  # g
RADIUS = 0.026  # m, of the cone's base
_KEY = re.compile(r"S([FR])(60|80)(\d{3})(\d)")


def _read(path: Path, select: Sequence[str]) -> Iterator[tuple[str, Recording]]:
    file = path / "cone_drops.npz" if path.is_dir() else path
    with reading(file, "cone drops"), np.load(file, allow_pickle=False) as found:
        for name in sorted(found.files):
            match = _KEY.fullmatch(name)
            if match is None or not any(fnmatch(name, pattern) for pattern in select):
                continue
            rows = np.asarray(found[name], dtype=np.float64)
            check_claim(file, rows.size)
            yield name, _drop(name, match, rows)


def _drop(name: str, match: re.Match[str], rows: np.ndarray) -> Recording:
    sprung, angle, height = match[1] == "F", int(match[2]), int(match[3]) / 100.0
    mass = BODY + SHAFT + CONE[angle] + (SPRING if sprung else INSERT)
    lateral = Sensor(body="striker", gravity="proper")
    between = "a spring" if sprung else "a rigid insert"
    return Recording(
        title=f"Cone of {angle} deg with {between}, dropped {height:g} m, no. {match[4]}",
        source=CONE_DROPS.source,
        time=rows[:, 0].copy(),
        channels={
            # 0 in free fall: what the water does to the body; coordinate acceleration is that less gravity
            "striker/acceleration_z": rows[:, 1] * G - GRAVITY,
            "sensor/body/acceleration_x": rows[:, 2] * G,
            "sensor/body/acceleration_y": rows[:, 3] * G,
        },
        conditions={
            "initiation.speed": math.sqrt(2.0 * GRAVITY * height),
            "vehicle.mass": mass,
            "vehicle.nose": "cone",
            "vehicle.nose_radius": RADIUS,
            "vehicle.nose_height": RADIUS / math.tan(math.radians(angle)),
        },
        sensors={f"sensor/body/acceleration_{axis}": lateral for axis in "xy"},
        notes=(
            f"the accelerometer sits in the body of {BODY} kg and clips at {CLIPS} g; use 0 to 50 ms",
            f"half cone angle {angle} deg, cone radius 26 mm, between nose and body {between}",
            f"nose, with what lies between: {1.0 - BODY / mass:.4f} of the mass",
            "speed at impact worked out from the height of the drop, without air",
        ),
    )


CONE_DROPS = Collection(
    name="cone-drops",
    meaning="142 drops of a two-part body with a cone onto water, six heights, 4.04 kHz",
    citation="Boom, Truscott, Fish, Habtour, arXiv:2403.13262",
    licence="none stated: measure with it, do not pass it on",
    where="github.com/Illimited-Lab/TwoBodyConeImpactData",
    read=_read,
)

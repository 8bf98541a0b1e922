"""A free-fall penetrometer dropped into a sea bed: accelerometers of several ranges, pore pressure."""

from __future__ import annotations

import gzip
import math
import zlib
from collections.abc import Iterator, Sequence
from fnmatch import fnmatch
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ground.drops import Drop, UnusableDrop, found_contact
from rollover.faults import Fault, InputError
from rollover.importers.importer import Collection
from rollover.recording import Clock, Recording, Sensor

G = 9.80665  # m/s2
MASS = 7.71  # kg
RADIUS, HEIGHT = 0.04375, 0.0755  # m, of the cone
BEFORE = 3.0  # s of each file before the impact
RANGES = {"a2g": 2.0, "a18g": 18.0, "a50g": 50.0, "a200g": 200.0, "a250g": 250.0}
COLUMNS = ("t_s", "a2g", "a18g", "a50g", "a200g", "tx", "ty", "a250g", "pore_kPa")
LARGEST = 1 << 26  # bytes unpacked
ENDING = "_main_drop.csv.gz"


def _read(path: Path, select: Sequence[str]) -> Iterator[tuple[str, Recording]]:
    files = sorted(path.glob(f"*{ENDING}")) if path.is_dir() else [path]
    for file in files:
        name = file.name.removesuffix(ENDING)
        if any(fnmatch(name, pattern) for pattern in select):
            yield name, _drop(name, _table(file))


def finest(columns: dict[str, NDArray[np.float64]]) -> str:
    """The accelerometer of the smallest range that stays below 98 % of it throughout."""
    for name, most in RANGES.items():
        if float(np.max(np.abs(columns[name]))) < 0.98 * most:
            return name
    return "a250g"


def disagreement(columns: dict[str, NDArray[np.float64]], chosen: str) -> dict[str, tuple[float, float]]:
    """Offset (g) and gain of every other range against the chosen one, by least squares where neither clips."""
    found = {}
    for name, most in RANGES.items():
        both = (np.abs(columns[name]) < 0.9 * most) & (np.abs(columns[chosen]) < 0.9 * RANGES[chosen])
        if name != chosen and both.sum() > 10:
            x, y = columns[chosen][both], columns[name][both]
            gain = float(np.cov(x, y)[0, 1] / np.var(x, ddof=1))
            found[name] = (float(np.mean(y) - np.mean(x)), gain)
    return found


def _drop(name: str, columns: dict[str, NDArray[np.float64]]) -> Recording:
    chosen = finest(columns)
    others = ", ".join(f"{n} {off:+.3f} g, gain {gain:.3f}" for n, (off, gain) in disagreement(columns, chosen).items())
    time = columns["t_s"] - columns["t_s"][0] - BEFORE
    # upright it reads +1 g at rest: what holds it up; coordinate acceleration is that less gravity
    acceleration = (columns[chosen] - 1.0) * G
    conditions: dict[str, Any] = {
        "vehicle.mass": MASS,
        "vehicle.nose": "cone",
        "vehicle.nose_radius": RADIUS,
        "vehicle.nose_height": HEIGHT,
    }
    try:
        found = found_contact(Drop(name=name, time=time, mass=MASS, speed=math.nan, acceleration=-acceleration))
        time, landing = found.time, f"speed at first contact {found.speed:.3f} m/s, integrated back from rest"
        conditions["initiation.speed"] = found.speed
    except UnusableDrop as reason:
        landing = f"no clean drop, its clock and speed at first contact are not known: {reason}"
    lateral = Sensor(body="striker", gravity="proper")
    return Recording(
        title=f"Penetrometer {name}",
        source=SOIL_PENETROMETER.source,
        time=time,
        channels={
            "striker/acceleration_z": acceleration,
            "sensor/body/acceleration_x": columns["tx"] * G,
            "sensor/body/acceleration_y": columns["ty"] * G,
        },
        conditions=conditions,
        clock=Clock(zero="unknown"),
        sensors={f"sensor/body/acceleration_{axis}": lateral for axis in "xy"},
        notes=(
            f"axial acceleration from {chosen}, the finest range that is not clipped; against it: {others}",
            "2 kHz assumed from the number of rows; the instrument's tilt is taken as 0",
            landing,
            "cone tip of 43.75 mm radius and 75.5 mm height, volume 2.473 l",
        ),
    )


def _table(path: Path) -> dict[str, NDArray[np.float64]]:
    try:
        with gzip.open(path, "rb") as file:
            data = file.read(LARGEST + 1)
        if len(data) > LARGEST:
            raise InputError(Fault(file=str(path), message=f"unpacks to more than {LARGEST} bytes; that is no drop"))
        lines = data.decode("ascii").splitlines()
        if tuple(lines[0].split(",")) != COLUMNS:
            raise ValueError(f"got columns {lines[0][:80]}; {', '.join(COLUMNS)} are needed")
        rows = np.array([line.split(",") for line in lines[1:]], dtype=np.float64)
    except (OSError, EOFError, zlib.error, IndexError, UnicodeDecodeError, ValueError) as e:
        if isinstance(e, InputError):
            raise
        raise InputError(Fault(file=str(path), message=f"not a drop of the penetrometer: {e}")) from None
    return {name: rows[:, k] for k, name in enumerate(COLUMNS)}


SOIL_PENETROMETER = Collection(
    name="soil-penetrometer",
    meaning="four drops of a free-fall penetrometer into a sea bed, 2 kHz",
    citation="University of Florida Coastal Geotechnics, BlueDrop analysis library",
    licence="none stated: measure with it, do not pass it on",
    where="github.com/stevADUS/BlueDrop_Analysis_Lib",
    read=_read,
)

"""A free-fall penetrometer dropped into a sea bed: accelerometers of several ranges, pore pressure.

As published: `bLog*.bin`, a minute of the logger's numbers in three bytes each, and a workbook of calibration factors
with a sheet for each instrument. Cut and converted drops, `*_main_drop.csv.gz`, are read as well.
"""

from __future__ import annotations

import gzip
import math
from collections.abc import Iterator, Mapping, Sequence
from fnmatch import fnmatch
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ground.drops import Drop, UnusableDrop, found_contact
from rollover.recording import Clock, Recording
from rollover.recording.importers.bluedrop import COLUMNS, RATE, read_log
from rollover.recording.importers.importer import Collection, reading
from rollover.recording.text_rows import refuse
from rollover.system.errors import Fault, InputError

Array = NDArray[np.float64]
G = 9.80665  # m/s2
MASS, VOLUME = 7.71, 2.473e-3  # kg, m3
RADIUS, HEIGHT = 0.04375, 0.0755  # m, of the cone
SEA_WATER = 1025.0  # kg/m3
GRAVITY = 9.81 * (1.0 - SEA_WATER * VOLUME / MASS)  # m/s2, what the buoyancy leaves
BEFORE, BEHIND = 3.0, 1.5  # s of a log about its largest deceleration, in which the drop is looked for
WINDOW = (-0.7, 1.2)  # s about the first contact: the fall at its terminal speed, the stop, at rest
FALLING = -0.01  # s: before it nothing but water
APART = 1.0  # s between decelerations that are tried
MOST_TRIED = 12
SMOOTH = round(0.02 * RATE)  # rows: a knock on the deck is shorter, a sea bed is not
SPEED, WITHIN = 0.05, 0.01  # m/s, s: 1 sigma of what is found by integrating back from rest
# Pa, Pa/m: a quarter of the stand-in soil, as laws fitted to these drops scatter; three places are not one soil
SOIL = {"ground.law.surface_pressure": 500.0, "ground.law.depth_pressure": 1575.0}
RANGES = {"a2g": 2.0, "a18g": 18.0, "a50g": 50.0, "a200g": 200.0, "a250g": 250.0}
LARGEST = 1 << 26  # bytes unpacked
CUT, LOG = "_main_drop.csv.gz", ".bin"


def _read(path: Path, select: Sequence[str]) -> Iterator[tuple[str, Recording]]:
    files = [path]
    if path.is_dir():
        files = sorted(path.glob(f"*{LOG}")) or sorted(path.glob(f"*{CUT}"))
        if not files:
            message = "no drops in this folder; files such as bLog0D2F.bin are needed"
            raise InputError(Fault(file=str(path), message=message))
    for file in files:
        name = file.name.removesuffix(CUT).removesuffix(LOG)
        if not any(fnmatch(name, pattern) for pattern in select):
            continue
        if file.suffix == LOG:
            columns, how = read_log(file)
            yield name, _found(name, columns, how)
        else:
            yield name, _drop(name, _table(file), ())


def _found(name: str, columns: Mapping[str, Array], how: str) -> Recording:
    """The fastest clean drop about the largest decelerations of a log; if there is none, the largest of them."""
    a = np.convolve(columns["a50g"], np.full(SMOOTH, 1.0 / SMOOTH), mode="same")
    tried = []
    for _ in range(MOST_TRIED):
        peak = int(np.argmax(a))
        if not np.isfinite(a[peak]):
            break
        rows = slice(max(peak - round(BEFORE * RATE), 0), peak + round(BEHIND * RATE) + 1)
        tried.append(_drop(name, {c: v[rows] for c, v in columns.items()}, (how,)))
        a[max(peak - round(APART * RATE), 0) : peak + round(APART * RATE)] = -np.inf
    # a knock on the deck may look like a stop, from a lower speed
    return max(tried, key=lambda drop: float(drop.conditions.get("initiation.speed", 0.0)))


def finest(columns: Mapping[str, Array]) -> str:
    """The accelerometer of the smallest range that stays below 98 % of it throughout."""
    for name, most in RANGES.items():
        if float(np.max(np.abs(columns[name]))) < 0.98 * most:
            return name
    return "a250g"


def disagreement(columns: Mapping[str, Array], chosen: str) -> dict[str, tuple[float, float]]:
    """Offset (g) and gain of every other range against the chosen one, by least squares where neither clips."""
    found = {}
    for name, most in RANGES.items():
        both = (np.abs(columns[name]) < 0.9 * most) & (np.abs(columns[chosen]) < 0.9 * RANGES[chosen])
        if name != chosen and both.sum() > 10:
            x, y = columns[chosen][both], columns[name][both]
            gain = float(np.cov(x, y)[0, 1] / np.var(x, ddof=1))
            found[name] = (float(np.mean(y) - np.mean(x)), gain)
    return found


def _drop(name: str, columns: Mapping[str, Array], how: tuple[str, ...]) -> Recording:
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
    uncertainty: dict[str, Any] = {}
    clock, rows = Clock(zero="unknown"), np.ones(time.size, dtype=bool)
    try:
        found = found_contact(Drop(name=name, time=time, mass=MASS, speed=math.nan, acceleration=-acceleration))
    except UnusableDrop as reason:
        landing = [f"no clean drop, its clock and speed at first contact are not known: {reason}"]
    else:
        time = found.time
        rows = (time > WINDOW[0]) & (time < WINDOW[1])
        area = _drag(acceleration[rows & (time < FALLING)], found.speed)
        conditions |= {"initiation.speed": found.speed}
        conditions |= {"effects.air-drag.density": SEA_WATER, "effects.air-drag.area": area}
        uncertainty = {"initiation.speed": SPEED, **SOIL}
        clock = Clock(zero="known", within=WITHIN)
        landing = [
            f"speed at first contact {found.speed:.3f} m/s, integrated back from rest: {SPEED} m/s and {WITHIN} s in"
            " doubt",
            f"{int(np.sum(~rows))} rows left out: those more than {-WINDOW[0]:g} s before and {WINDOW[1]:g} s after it",
            "drag of the water from the fall before the contact; strength of the sea bed in doubt by a quarter of the"
            " stand-in soil of `penetrometer_drop`: no two places are the same",
        ]
    return Recording(
        title=f"Penetrometer {name}",
        source=SOIL_PENETROMETER.source,
        time=time[rows],
        channels={"striker/acceleration_z": acceleration[rows]},
        conditions=conditions,
        uncertainty=uncertainty,
        clock=clock,
        notes=(
            f"axial acceleration from {chosen}, the finest range that is not clipped; against it: {others}",
            *how,
            "2 kHz assumed from the number of rows; the instrument's tilt is taken as 0",
            *landing,
            "two lateral axes and the pore pressure left out: a drop along its axis says nothing of them",
            "cone tip of 43.75 mm radius and 75.5 mm height, volume 2.473 l",
        ),
    )


def _drag(falling: Array, speed: float) -> float:
    """Drag area of the fall through water, m2: m a = m g - 1/2 rho C_d A v^2, a downwards."""
    return max(MASS * (GRAVITY + float(falling.mean())) / (0.5 * SEA_WATER * speed**2), 0.0)


def _table(path: Path) -> dict[str, Array]:
    with reading(path, "penetrometer"):
        with gzip.open(path, "rb") as file:
            data = file.read(LARGEST + 1)
        if len(data) > LARGEST:
            message = f"unpacks to too much, got more than {LARGEST} bytes; a table of one cut drop is needed"
            refuse(path, message)
        head, *lines = data.decode("ascii").splitlines() or [""]
        if tuple(head.split(",")) != COLUMNS:
            message = f"not a drop of the penetrometer, got columns {head[:80]!r}; {', '.join(COLUMNS)} are needed"
            refuse(path, message)
        rows = [line.split(",") for line in lines]
        odd = next((k for k, row in enumerate(rows) if len(row) != len(COLUMNS)), None)
        if odd is not None or not rows:
            got = "no row" if odd is None else f"{len(rows[odd])} cells in row {odd + 1}"
            message = f"not a drop of the penetrometer, got {got}; {len(COLUMNS)} numbers in each row are needed"
            refuse(path, message)
        try:
            values = np.array(rows, dtype=np.float64)
        except ValueError:
            k, cell = next((k, cell) for k, row in enumerate(rows) for cell in row if not _is_number(cell))
            message = f"row {k + 1}: not a number, got {cell!r}; {len(COLUMNS)} numbers in each row are needed"
            refuse(path, message)
    return {name: values[:, k] for k, name in enumerate(COLUMNS)}


def _is_number(text: str) -> bool:
    try:
        float(text)
    except ValueError:
        return False
    return True


SOIL_PENETROMETER = Collection(
    name="soil-penetrometer",
    meaning="drops of a free-fall penetrometer into a sea bed, 2 kHz: bLog0D2F.bin and so on, calibration factors",
    citation="University of Florida Coastal Geotechnics, BlueDrop analysis library",
    licence="none stated: measure with it, do not pass it on",
    where="github.com/stevADUS/BlueDrop_Analysis_Lib",
    read=_read,
)

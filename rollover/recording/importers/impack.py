"""Water entry of an aluminium impactor with a hemisphere or a cone for a nose, its accelerometers in IDE files."""

from __future__ import annotations

import math
import re
from collections.abc import Iterator, Sequence
from fnmatch import fnmatch
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from rollover.recording import Clock, Recording
from rollover.recording.importers.ide import read_ide
from rollover.recording.importers.importer import Collection
from rollover.recording.importers.signals import Signal
from rollover.system.errors import Fault, InputError

Array = NDArray[np.float64]
G, GRAVITY = 9.80665, 9.81  # unit g; free fall in the laboratory, m/s2
RADIUS = 0.022225  # m, of the impactor: 44.45 mm across
FINE, STEADY = "100g PR Acceleration/X (100g)", "40g DC Acceleration/X (40g)"  # along the axis, upwards
CLIPS = 100.0  # g, of the fine one
FLOATS = 0.1  # g: less is free fall
LEAST_FALL, QUIET = 0.1, 0.02  # s of a fall; g by which it may tremble: a body that floats trembles more
EDGE = 0.01  # s at both ends of a fall, in which the sensor is still on its way
STEP = 0.5  # g: half of what release takes away; ten times the noise of the fine one at contact
WINDOW = (-0.05, 0.05)  # s about the contact
SPEED, WITHIN = 0.02, 5e-4  # m/s of 2 ms at the release; s: 1 sigma
_NAME = re.compile(r"(\d+)mps_(sphere|(\d+)degcone)_(\d+)")


def _read(path: Path, select: Sequence[str]) -> Iterator[tuple[str, Recording]]:
    files = sorted(path.glob("*.ide")) if path.is_dir() else [path]
    if not files:
        message = "no water entries in this folder; files such as 6mps_sphere_1.ide are needed"
        raise InputError(Fault(file=str(path), message=message))
    for file in files:
        if any(fnmatch(file.stem, pattern) for pattern in select):
            yield file.stem, _entry(file)


def _entry(file: Path) -> Recording:
    match = _NAME.fullmatch(file.stem)
    if match is None:
        message = f"no such name, got {file.stem!r}; such as 6mps_sphere_1 or 6mps_150degcone_1: speed and nose"
        raise InputError(Fault(file=str(file), message=message))
    signals = read_ide(file, (FINE, STEADY))
    for name in (FINE, STEADY):
        if name not in signals or signals[name].time is None:
            message = f"no channel {name!r}, got {', '.join(list(signals)[:6])}; both accelerometers are needed"
            raise InputError(Fault(file=str(file), message=message))
    fine = signals[FINE]
    assert fine.time is not None
    begins, ends = _fall(file, signals[STEADY])
    offset = float(np.mean(fine.values[(fine.time > begins + EDGE) & (fine.time < ends - EDGE)]))
    read = fine.values - offset
    held = np.flatnonzero((fine.time < begins + EDGE) & (read > STEP))
    met = np.flatnonzero((fine.time > ends - EDGE) & (read > STEP))
    if not (held.size and met.size):
        raise InputError(Fault(file=str(file), message="the fall has no beginning or no end; a whole drop is needed"))
    contact = float(fine.time[met[0]])
    fall = contact - float(fine.time[held[-1]])
    rows = (fine.time > contact + WINDOW[0]) & (fine.time < contact + WINDOW[1])
    usable = rows & (np.abs(fine.values) < 0.97 * CLIPS)
    conditions: dict[str, Any] = {"initiation.speed": GRAVITY * fall}
    nose = "a hemisphere, which no scenario has: its area grows as that of no cone"
    if match[3] is not None:
        half = math.radians(0.5 * int(match[3]))
        if not 0.0 < half < 0.5 * math.pi:
            message = f"no such cone, got {match[3]} degrees; above 0 and below 180"
            raise InputError(Fault(file=str(file), message=message))
        nose = f"a cone of {match[3]} degrees in all"
        conditions |= {
            "vehicle.nose": "cone",
            "vehicle.nose_radius": RADIUS,
            "vehicle.nose_height": RADIUS / math.tan(half),
        }
    return Recording(
        title=f"Water entry at {match[1]} m/s, {match[2]}, no. {match[4]}",
        source=IMPACK.source,
        time=fine.time[usable] - contact,
        # upwards positive, +1 g at rest: what holds it up; coordinate acceleration is that less gravity
        channels={"striker/acceleration_z": read[usable] * G - GRAVITY},
        conditions=conditions,
        uncertainty={"initiation.speed": SPEED},
        clock=Clock(zero="known", within=WITHIN),
        notes=(
            f"nose: {nose}; {2e3 * RADIUS:.2f} mm across",
            "the mass is not stated with the files: set vehicle.mass to that of the impactor",
            f"speed at contact {GRAVITY * fall:.3f} m/s from {fall:.4f} s of free fall, without air",
            f"{FINE}: {offset:.3f} g taken off, so that it reads 0 in free fall; the slower one follows 1 ms late",
            f"{int(np.sum(rows & ~usable))} clipped rows cut out; {int(np.sum(~rows))} rows left out: those more than"
            f" {1e3 * WINDOW[1]:g} ms from the contact",
            "lateral axes, rotation, pressure, temperature and light left out: a drop along its axis says nothing of"
            " them; all are read with --as ide and a profile",
        ),
    )


def _fall(file: Path, steady: Signal) -> tuple[float, float]:
    """Begin and end of the first free fall, s, by the accelerometer that holds its zero. Raises `InputError`."""
    assert steady.time is not None
    near = np.abs(steady.values) < FLOATS
    edges = np.flatnonzero(np.diff(np.concatenate([[False], near, [False]]).astype(int)))
    for first, behind in zip(edges[::2], edges[1::2], strict=True):
        begins, ends = float(steady.time[first]), float(steady.time[behind - 1])
        inside = (steady.time > begins + EDGE) & (steady.time < ends - EDGE)
        if ends - begins > LEAST_FALL and float(np.std(steady.values[inside])) < QUIET:
            return begins, ends
    message = f"no free fall, got no {LEAST_FALL:g} s with less than {FLOATS:g} g along the axis; a drop is needed"
    raise InputError(Fault(file=str(file), message=message))


IMPACK = Collection(
    name="impack",
    meaning="water entry of an impactor with a hemisphere or a cone, 20 kHz: 6mps_sphere_1.ide and so on",
    citation="Harris Lab, Brown University: IMpack, an impact-rated data logger",
    licence="CC BY-SA 4.0",
    where="github.com/harrislab-brown/IMpack, data/water entry",
    read=_read,
)

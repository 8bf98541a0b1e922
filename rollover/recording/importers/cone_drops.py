"""A two-part body with a cone for a nose, dropped onto water: rigid, or with a spring between nose and body.

As published: one MATLAB file for each series and height, in it one n x 4 matrix for each drop. All of a series in one
`cone_drops.npz` is read as well.
"""

from __future__ import annotations

import math
import re
from collections.abc import Iterator, Mapping, Sequence
from fnmatch import fnmatch
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ground.reference import REFERENCE_AREA
from rollover.recording import Clock, Recording
from rollover.recording.importers.apart import apart
from rollover.recording.importers.importer import Collection, reading
from rollover.recording.importers.mat_claims import check_claims
from rollover.recording.importers.npz import arrays_of
from rollover.recording.importers.soundness import check_time, check_values
from rollover.system.errors import Fault, InputError

Array = NDArray[np.float64]
G, GRAVITY = 9.80665, 9.81  # unit g; free fall in the laboratory, m/s2
BODY, SHAFT = 0.5228, 0.0343  # kg
BETWEEN = {"R": 0.0025, "S": 0.0015, "F": 0.0040}  # kg: insert, soft spring, firm spring
NAMED = {"R": "a rigid insert", "S": "a soft spring", "F": "a firm spring"}
CONE = {  # kg, by the half angle in the name; 12 stands for 12.5 degrees
    10: 0.0458,
    12: 0.0436,
    25: 0.0312,
    30: 0.0283,
    40: 0.0321,
    45: 0.0301,
    50: 0.0307,
    60: 0.0300,
    70: 0.0280,
    80: 0.0257,
}
DRAG = (1.81100050e-07, -8.13339690e-05, 1.49104512e-02, -3.78712427e-02)  # C_d over degrees, the authors' cubic
# the authors' fit of the water to rigid cones: depth to which its mass grows with the cone (m), k of k rho r^3, and how
# fast the growth dies out behind, exp(-tau sqrt(z/depth - 1))
WATER = {
    10: (0.12512, 0.21614, 0.82432),
    12: (0.10257, 0.18312, 1.13663),
    25: (0.043915, 0.43677, 0.93576),
    30: (0.035278, 0.51476, 0.86043),
    40: (0.026107, 0.52548, 0.97613),
    45: (0.022665, 0.66933, 1.41719),
    50: (0.019473, 0.72813, 1.52306),
    60: (0.014633, 0.87266, 2.52946),
    70: (0.0086783, 1.06549, 2.22545),
    80: (0.0049956, 0.80594, 2.63711),
}
CLIPS = 41.7  # g
CLIPPED = 0.97 * CLIPS
RADIUS = 0.026  # m, of the cone's base
DENSITY = 997.0  # kg/m3, of the authors' water
MOVING = "effects.soil-added-mass-growth"
WINDOW = (-0.015, 0.050)  # s about the impact: falling, until the accelerometer comes off its stop
WITHIN = 0.002  # s: time 0 is "about" at the impact
AXIAL = "striker/acceleration_z"
_KEY = re.compile(r"S([RSF])(\d\d)(\d{3})(\d)")


def _read(path: Path, select: Sequence[str]) -> Iterator[tuple[str, Recording]]:
    for file in _files(path):
        with reading(file, "cone drops"):
            drops = _matrices(file, select)
            for name in sorted(drops):
                yield name, _drop(file, name, drops[name])


def _files(path: Path) -> list[Path]:
    if not path.is_dir():
        return [path]
    found = sorted(p for p in path.glob("S*.mat") if re.fullmatch(r"S[RSF]\d{5}", p.stem)) or [path / "cone_drops.npz"]
    if not found[0].is_file():
        message = "no cone drops in this folder; files such as SR45100.mat are needed"
        raise InputError(Fault(file=str(path), message=message))
    return found


def _matrices(file: Path, select: Sequence[str]) -> dict[str, Array]:
    """Matrices by the names of their drops, those that are asked for."""
    if file.suffix == ".npz":
        with arrays_of(file) as found:
            return {name: np.asarray(found[name], dtype=np.float64) for name in _wanted(found.files, select)}
    return apart(_of_mat, file, tuple(select), what="MATLAB 5", modules=("scipy.io",))


def _wanted(names: Sequence[str], select: Sequence[str]) -> list[str]:
    return [n for n in names if _KEY.fullmatch(n) and any(fnmatch(n, pattern) for pattern in select)]


def _of_mat(file: Path, select: Sequence[str]) -> dict[str, Array]:
    from scipy.io import loadmat, whosmat

    with reading(file, "cone drops"):
        check_claims(file)
        names = _wanted([name for name, _, _ in whosmat(str(file))], select)
        table: Mapping[str, Any] = loadmat(str(file), variable_names=names) if names else {}
        return {name: np.asarray(table[name], dtype=np.float64) for name in names}


def _drop(file: Path, name: str, rows: Array) -> Recording:
    match = _KEY.fullmatch(name)
    assert match is not None
    kind, angle, height = match[1], int(match[2]), int(match[3]) / 100.0
    if rows.ndim != 2 or rows.shape[1] != 4:
        message = (
            f"{name}: not a drop, got a shape of {list(rows.shape)}; four columns are needed (time and three axes)"
        )
        raise InputError(Fault(file=str(file), message=message))
    if angle not in CONE:
        message = f"{name}: no such cone, got {angle} degrees; {', '.join(map(str, CONE))} were dropped"
        raise InputError(Fault(file=str(file), message=message))
    check_time(file, rows[:, 0])
    check_values(file, f"{name}, axial", rows[:, 1])
    about = rows[(rows[:, 0] > WINDOW[0]) & (rows[:, 0] < WINDOW[1])]
    unclipped = about[about[:, 1] < CLIPPED]
    if not len(unclipped):
        message = f"{name}: nothing from {WINDOW[0]:g} to {WINDOW[1]:g} s about the impact that is not clipped"
        raise InputError(Fault(file=str(file), message=message))
    half = math.radians(12.5 if angle == 12 else angle)
    mass = BODY + SHAFT + CONE[angle] + BETWEEN[kind]
    drag = float(np.polyval(DRAG, math.degrees(half)))
    conditions: dict[str, Any] = {
        "initiation.speed": math.sqrt(2.0 * GRAVITY * height),
        "vehicle.mass": mass,
        "vehicle.nose": "cone",
        "vehicle.nose_radius": RADIUS,
        "vehicle.nose_height": RADIUS / math.tan(half),
        "ground.law.drag_coefficient": drag,
    }
    uncertainty = {"ground.law.drag_coefficient": 0.5 * drag}
    water = "what of the water moves along is left to be found"
    if kind != "R":
        rate, fade = _water(angle, half)
        # where the instrument sits: the body, all but the nose
        conditions |= {
            "effects.structural-compliance.stiffness": None,
            "effects.structural-compliance.nose_share": 1.0 - BODY / mass,
            f"{MOVING}.rate": rate,
            f"{MOVING}.fade": fade,
        }
        # after a rigid cone's blow little tells where the growth ends
        uncertainty |= {f"{MOVING}.rate": 0.5 * rate, f"{MOVING}.fade": 0.5 * conditions["vehicle.nose_height"]}
        water = "the water that moves along: the authors' fit to rigid cones too; half of it in doubt"
    return Recording(
        title=f"Cone of {math.degrees(half):g} deg with {NAMED[kind]}, dropped {height:g} m, no. {match[4]}",
        source=CONE_DROPS.source,
        time=unclipped[:, 0].copy(),
        # 0 in free fall: what the water does to the body; coordinate acceleration is that less gravity
        channels={AXIAL: unclipped[:, 1] * G - GRAVITY},
        conditions=conditions,
        uncertainty=uncertainty,
        clock=Clock(zero="known", within=WITHIN),
        notes=(
            f"rows from {1e3 * WINDOW[0]:g} to {1e3 * WINDOW[1]:g} ms about the impact; {len(rows) - len(about)} others"
            " left out",
            f"{len(about) - len(unclipped)} rows above {CLIPPED:.4g} g cut out: the accelerometer clips at {CLIPS} g",
            "two lateral axes left out: a drop along its axis says nothing of them",
            f"the accelerometer sits in the body of {BODY} kg, not in the nose; between them {NAMED[kind]}",
            f"nose, with what lies between: {1.0 - BODY / mass:.4f} of the mass",
            "speed at impact worked out from the height of the drop, without air; time 0 is about at the impact",
            f"drag coefficient: the authors' fit to rigid cones, {drag:.3f} at this half angle; half of it in doubt",
            water,
        ),
    )


def _water(angle: int, half: float) -> tuple[float, float]:
    """Rate (kg/m) and fade (m) of `soil-added-mass-growth` with the mass that the authors' fit has in the end.

    The mass is k rho r^3, on a displaced volume of pi/3 r^3/tan(half). Its growth behind the depth L is that of the law
    at L times exp(-tau sqrt(z/L - 1)), whose integral is 2 L/tau^2.
    """
    depth, k, tau = WATER[angle]
    return 3.0 * k * DENSITY * math.tan(half) / math.pi * REFERENCE_AREA, 2.0 * depth / tau**2


CONE_DROPS = Collection(
    name="cone-drops",
    meaning="drops of a two-part body with a cone onto water, six heights, 4.04 kHz: SR45100.mat and so on",
    citation="Boom, Truscott, Fish, Habtour, arXiv:2403.13262",
    licence="none stated: measure with it, do not pass it on",
    where="github.com/Illimited-Lab/TwoBodyConeImpactData",
    read=_read,
)

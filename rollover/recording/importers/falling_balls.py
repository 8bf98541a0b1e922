"""Balls dropped from a bridge, their height by video.

As published: `Ball_drops_data.xls`, a workbook of the newer kind in spite of its name, with a sheet for each ball, and
`balls.txt` with their sizes. All sheets in one `ball_drops.csv` are read as well.
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

from rollover.recording import Clock, Recording
from rollover.recording.importers.importer import Collection
from rollover.recording.importers.soundness import check_time, check_values
from rollover.recording.importers.workbook import Row, read_workbook
from rollover.recording.tables import read_csv, read_words
from rollover.system.boundary import worded
from rollover.system.errors import Fault, InputError

Array = NDArray[np.float64]
OUNCE = 0.028349523125  # kg
HEADING = ("Drop #", "Time (s)", "Height (m)", "Velocity (m/s)")
BOOK, TABLE, SIZES = "Ball_drops_data.xls", "ball_drops.csv", "balls.txt"
AREA = 0.01  # m2, to which the drag of every ball is referred, so that one coefficient holds for several
RULES = {"volleyball": (0.27, 2.0 * math.pi * 0.105)}  # kg, m: by the rules of the game, 0.26 to 0.28 kg
MASS_BY_RULES = 0.006  # kg, 1 sigma of what the rules allow
RELEASE_HEIGHT = 80.0  # m: from there no ball lands within its record, not even one that falls without air
HEIGHT, SPEED, WITHIN = 0.3, 0.3, 0.1  # m, m/s, s: 1 sigma of a ball that is let go by hand


def _read(path: Path, select: Sequence[str]) -> Iterator[tuple[str, Recording]]:
    file = next((path / n for n in (BOOK, TABLE) if (path / n).is_file()), path / BOOK) if path.is_dir() else path
    if not file.is_file():
        message = f"no falling balls in this folder, got no {BOOK}; it and {SIZES} are needed"
        raise InputError(Fault(file=str(path), message=message))
    drops = _from_table(file) if file.suffix == ".csv" else _from_book(file)
    known = _balls(file.parent / SIZES)
    for (ball, drop), (time, height) in drops.items():
        name = f"{re.sub(r'[^a-z0-9]+', '-', ball.lower())}-{drop}"
        if any(fnmatch(name, pattern) for pattern in select):
            yield name, _recording(file, name, ball, drop, time, height, known.get(_key(ball), (None, None)))


def _from_book(file: Path) -> dict[tuple[str, str], tuple[Array, Array]]:
    """Time and height of each drop, from a sheet for each ball. Raises `InputError`."""
    found: dict[tuple[str, str], tuple[Array, Array]] = {}
    for ball, rows in read_workbook(file).items():
        if not rows or tuple(rows[0][:4]) != HEADING:
            got = ", ".join(str(v) for v in (rows[0][:4] if rows else ()))[:60] or "nothing"
            message = f"sheet {ball!r}: not a ball, got {got}; {', '.join(HEADING)} are needed"
            raise InputError(Fault(file=str(file), message=message))
        drops: dict[str, list[tuple[float, float]]] = {}
        for number, row in enumerate(rows[1:], start=2):
            drop, time, height = _numbers(file, ball, number, row)
            drops.setdefault(f"{drop:g}", []).append((time, height))
        for drop_name, pairs in drops.items():
            time_, height_ = np.array(pairs, dtype=np.float64).T
            found[ball, drop_name] = (time_.copy(), height_.copy())
    return found


def _numbers(file: Path, ball: str, number: int, row: Row) -> tuple[float, float, float]:
    given = row[:3]
    for value, name in zip(given, HEADING, strict=False):
        if isinstance(value, bool) or not isinstance(value, (int, float)):
            message = f"sheet {ball!r}, row {number}, {name}: not a number, got {value!r}; every row needs one"
            raise InputError(Fault(file=str(file), message=message))
    return float(given[0]), float(given[1]), float(given[2])


def _from_table(file: Path) -> dict[tuple[str, str], tuple[Array, Array]]:
    labels = read_words(file, ("ball", "drop"))
    values = read_csv(file, ("t_s", "h_m"))
    rows: dict[tuple[str, str], list[int]] = {}
    for i, key in enumerate(zip(labels["ball"], labels["drop"], strict=True)):
        rows.setdefault(key, []).append(i)
    return {key: (values["t_s"][at], values["h_m"][at]) for key, at in rows.items()}


def _recording(
    file: Path,
    name: str,
    ball: str,
    drop: str,
    time: Array,
    height: Array,
    size: tuple[float | None, float | None],
) -> Recording:
    check_time(file, time)
    check_values(file, f"{name}, height", height)
    falling = landed(height)
    conditions: dict[str, Any] = {"initiation.kind": "release", "initiation.height": RELEASE_HEIGHT}
    uncertainty: dict[str, Any] = {"initiation.height": HEIGHT, "initiation.speed": SPEED}
    notes = [
        "height from video at 15 Hz",
        f"the zero of the heights is not the ground: shifted by {RELEASE_HEIGHT - height[0]:+.3f} m, so that the first"
        f" row is at {RELEASE_HEIGHT:g} m, from where a ball without air does not land within the record either",
        f"let go by hand at about the first row, from about its height: {HEIGHT} m, {SPEED} m/s, {WITHIN} s in doubt",
        "the speed of the file is left out: a filtered difference of the height, not measured by itself",
    ]
    if falling < len(height):
        notes.append(f"{len(height) - falling} rows after the landing cut off")
    mass, around = size
    if (mass is None or around is None) and _key(ball) in RULES:
        mass, around = RULES[_key(ball)]
        uncertainty["vehicle.mass"] = MASS_BY_RULES
        notes.append("mass and size of this ball are not stated: those by the rules of the game")
    if mass is not None and around is not None:
        radius = around / (2.0 * math.pi)
        side = math.sqrt(math.pi) * radius  # of a square of the ball's frontal area
        conditions |= {
            "vehicle.mass": mass,
            "vehicle.face_length": side,
            "vehicle.face_width": side,
            "effects.air-drag.area": 0.0,
            "effects.air-drag.drag_coefficient": math.pi * radius**2 / AREA,
        }
        notes.append(f"radius {radius:.4f} m")
        notes.append(
            f"the drag coefficient in the conditions is the ball's frontal area over {AREA} m2: an area of `air-drag`"
            f" that is fitted, over {AREA} m2, is C_d, and the same for all balls of a kind"
        )
    else:
        notes.append("mass and size of this ball are not stated")
    return Recording(
        title=f"{ball}, drop {drop}",
        source=FALLING_BALLS.source,
        time=time[:falling],
        channels={"striker/position_z": height[:falling] - height[0] + RELEASE_HEIGHT},
        conditions=conditions,
        uncertainty=uncertainty,
        clock=Clock(zero="unknown", within=WITHIN),
        notes=tuple(notes),
    )


def landed(height: Array) -> int:
    """Rows before the ground: where a ball in full fall covers less than half of the way of the step before."""
    way = -np.diff(height)
    short = (way[1:] < 0.5 * way[:-1]) & (way[:-1] > 0.5 * way.max(initial=0.0))
    return int(np.argmax(short)) + 2 if short.any() else len(height)


def _balls(path: Path) -> Mapping[str, tuple[float | None, float | None]]:
    """Mass (kg) and circumference (m) of each ball; None where the table has question marks."""
    try:
        lines = path.read_text(encoding="utf-8").splitlines()[1:]
    except (OSError, UnicodeDecodeError) as e:
        raise InputError(
            Fault(file=str(path), message=f"cannot be read: {worded(e)}; a text file in UTF-8 is needed")
        ) from None
    found = {}
    for number, line in enumerate(lines, start=2):
        words = line.split()
        if len(words) != 3:
            continue
        try:
            mass, around = (None if "?" in word else float(word) for word in words[1:])
        except ValueError:
            message = f"not a size, got {line.strip()[:40]!r}; ball, ounces and centimetres, ?? where not known"
            raise InputError(Fault(file=str(path), line=number, message=message)) from None
        found[_key(words[0])] = (mass and mass * OUNCE, around and around * 0.01)
    return found


def _key(name: str) -> str:
    """Spelling that the two files share: Whiffle Ball 1 is wiffleball1, Yellow Whiffle Ball yellowWiffle."""
    letters = re.sub(r"[^a-z0-9]", "", name.lower()).replace("whiffle", "wiffle")
    return letters.removesuffix("ball") if letters.endswith("wiffleball") else letters


FALLING_BALLS = Collection(
    name="falling-balls",
    meaning="eleven balls dropped twice from a bridge, height by video, 15 Hz: Ball_drops_data.xls and balls.txt",
    citation="de Silva, Higdon, Brunton, Kutz: Discovery of physics from data, Frontiers in AI 2020",
    licence="MIT",
    where="github.com/briandesilva/discovery-of-physics-from-data, Data",
    read=_read,
)

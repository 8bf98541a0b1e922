"""Balls dropped from a bridge, their height by video."""

from __future__ import annotations

import math
import re
from collections.abc import Iterator, Sequence
from fnmatch import fnmatch
from pathlib import Path
from typing import Any

from rollover.faults import Fault, InputError
from rollover.importers.importer import Collection
from rollover.recording import Clock, Recording
from rollover.recording.tables import read_csv, read_words

OUNCE = 0.028349523125  # kg


def _read(path: Path, select: Sequence[str]) -> Iterator[tuple[str, Recording]]:
    file = path / "ball_drops.csv" if path.is_dir() else path
    labels = read_words(file, ("ball", "drop"))
    values = read_csv(file, ("t_s", "h_m", "v_mps"))
    known = _balls(file.parent / "balls.txt")
    drops: dict[tuple[str, str], list[int]] = {}
    for i, key in enumerate(zip(labels["ball"], labels["drop"], strict=True)):
        drops.setdefault(key, []).append(i)
    for (ball, drop), rows in drops.items():
        name = f"{re.sub(r'[^a-z0-9]+', '-', ball.lower())}-{drop}"
        if not any(fnmatch(name, pattern) for pattern in select):
            continue
        height = values["h_m"][rows]
        conditions: dict[str, Any] = {"initiation.kind": "release", "initiation.height": float(height[0])}
        notes: tuple[str, ...] = (
            "height from video at 15 Hz; the speed is a filtered difference of it",
            "let go at about the first row, from about its height: neither was measured by itself",
        )
        mass, circumference = known.get(_key(ball), (None, None))
        if mass is not None and circumference is not None:
            radius = circumference / (2.0 * math.pi)
            side = math.sqrt(math.pi) * radius  # of a square of the ball's frontal area
            conditions |= {"vehicle.mass": mass, "vehicle.face_length": side, "vehicle.face_width": side}
            notes += (f"radius {radius:.4f} m",)
        else:
            notes += ("mass and size of this ball are not stated",)
        yield (
            name,
            Recording(
                title=f"{ball}, drop {drop}",
                source=FALLING_BALLS.source,
                time=values["t_s"][rows],
                channels={"striker/position_z": height, "striker/velocity_z": values["v_mps"][rows]},
                conditions=conditions,
                clock=Clock(zero="unknown"),
                notes=notes,
            ),
        )


def _balls(path: Path) -> dict[str, tuple[float | None, float | None]]:
    """Mass (kg) and circumference (m) of each ball; None where the table has question marks."""
    try:
        lines = path.read_text(encoding="utf-8").splitlines()[1:]
    except OSError as e:
        raise InputError(Fault(file=str(path), message=f"cannot be read: {e.strerror}")) from None
    found = {}
    for line in lines:
        words = line.split()
        if len(words) == 3:
            numbers = [None if "?" in word else float(word) for word in words[1:]]
            mass, around = numbers
            found[_key(words[0])] = (mass and mass * OUNCE, around and around * 0.01)
    return found


def _key(name: str) -> str:
    """Spelling that the two files share: Whiffle Ball 1 is wiffleball1, Yellow Whiffle Ball yellowWiffle."""
    letters = re.sub(r"[^a-z0-9]", "", name.lower()).replace("whiffle", "wiffle")
    return letters.removesuffix("ball") if letters.endswith("wiffleball") else letters


FALLING_BALLS = Collection(
    name="falling-balls",
    meaning="seven balls dropped twice from a bridge, height by video, 15 Hz",
    citation="de Silva, Higdon, Brunton, Kutz: Discovery of physics from data, Frontiers in AI 2020",
    licence="MIT",
    where="github.com/briandesilva/discovery-of-physics-from-data",
    read=_read,
)

"""Small published sets of the shapes in which their owners publish them, with odd values where `rng` says so."""

from __future__ import annotations

import io
import random
from typing import Any

import numpy as np

from tests.fuzz import seeds
from tests.fuzz.seeds import Files
from tests.rollover import published_files as published


def cube(rng: random.Random | None = None) -> Files:
    rows = published.cube_rows()
    if rng is not None:
        i, j = rng.randrange(len(rows)), rng.randrange(rows.shape[1])
        match rng.randrange(5):
            case 0:
                rows[i, 3:7] = 0.0
            case 1:
                rows[i, j] = rng.choice((np.nan, np.inf, 1e300, -1e300))
            case 2:
                rows = rows[: rng.choice((0, 1, 2, 5))]
            case 3:
                rows[:, j] = rng.choice((0.0, 1e9, -1.0))
            case _:
                rows = rows[:, : rng.choice((3, 7, 12))]
    array = published.as_tensor(rows)
    write = published.write_old_pt if rng is None or rng.random() < 0.5 else published.write_new_pt
    return {"7.pt": seeds.made(lambda path: write(path, array), "7.pt")}


def elbow(rng: random.Random | None = None) -> Files:
    t = np.arange(30) / 148.0
    a = 0.3 + 4.0 * t
    second = np.stack([-0.035 + 0.035 * np.cos(a), np.full(t.size, 0.06), -0.035 * np.sin(a)], axis=1)
    centre = np.stack([0.5 * t, 0.1 + 0.0 * t, 1.0 + 0.3 * t - 0.5 * 9.81 * t**2], axis=1)
    rows = np.zeros((t.size, 15))
    rows[:, 0], rows[:, 4:7], rows[:, 7] = 1.0, centre - 0.5 * second, a
    if rng is not None:
        rows[rng.randrange(30) :, rng.randrange(15)] = rng.choice((0.0, np.nan, 1e300, -1.0))
        rows = rows[: rng.choice((1, 3, 30)), : rng.choice((8, 15, 15, 15))]
    return {"3.pt": seeds.made(lambda path: published.write_new_pt(path, rows), "3.pt")}


def cones(rng: random.Random | None = None) -> Files:
    from scipy.io import savemat

    t = np.arange(-0.6, 0.2, 1.0 / 1000.0)
    rows = np.stack([t, np.where(t < 0.0, 0.01, 3.0), 0.2 + 0 * t, 0.3 + 0 * t], axis=1)
    name = "SR450251"
    if rng is not None:
        i = rng.randrange(len(rows))
        rows[i:, rng.randrange(4)] = rng.choice((np.nan, 1e300, 0.0, 100.0))
        rows = rows[:, : rng.choice((0, 1, 3, 4, 4, 4))]
        name = rng.choice(("SR450251", "SR990251", "SX450251", "SR450250", "SS120001"))
        if rng.random() < 0.3:
            stream = io.BytesIO()
            array: Any = rng.choice((rows, np.array(["a", "b"]), np.array([1, "a"], object), np.zeros((3, 4, 5))))
            np.savez(stream, **{name: array})
            return {"cone_drops.npz": stream.getvalue()}
        if rng.random() < 0.3:
            return {
                "SR45025.mat": seeds.made(
                    lambda p: savemat(p, {name: rng.choice(("text", {"a": 1}, 1j * rows[:, :1]))}), "a.mat"
                )
            }
    return {"SR45025.mat": seeds.made(lambda path: savemat(path, {name: rows}), "a.mat")}


def balls(rng: random.Random | None = None) -> Files:
    t = np.arange(30) / 15.0
    fall = (46.0 - 0.5 * 9.81 * t**2).tolist()
    sheets: dict[str, Any] = {
        "Whiffle Ball 1": published.ball_rows({1: fall}),
        "Volleyball": published.ball_rows({1: fall}),
    }
    head = "ball            weight(oz)  circumference(cm)\n"
    table = head + "wiffleball1     1           22.8\nvolleyball      ??          ??\n"
    if rng is not None:
        rows = sheets["Whiffle Ball 1"]
        row = rows[rng.randrange(len(rows))]
        row[rng.randrange(4)] = rng.choice((None, "x", "", 1e300, -1, True, "n" * 300, "=1+1"))
        if rng.random() < 0.3:
            rows[0] = rows[0][: rng.randrange(4)]
    return {
        "Ball_drops_data.xls": seeds.made(lambda path: published.write_book(path, sheets), "a.xls"),
        "balls.txt": table.encode(),
    }


def penetrometer(rng: random.Random | None = None) -> Files:
    g, factors = published.drop_log()
    heading = ["Sensor", "May_2020_offset", "May_2020_scale"]
    own: list[list[Any]] = [heading, *([name, *pair] for name, pair in factors.items())]
    if rng is not None:
        own[rng.randrange(len(own))][rng.randrange(3)] = rng.choice((None, "x", 0, 1e300, -1, "n" * 300))
    sheets = {"README": [["Calibration factors"]], "bluedrop_3": own}
    book = seeds.made(lambda path: published.write_book(path, sheets), "a.xlsx")
    log = seeds.made(lambda path: published.write_log(path, g, factors), "a.bin")
    return {"bLog0A01.bin": log, "BlueDrop_Calibration_Factors.xlsx": book}

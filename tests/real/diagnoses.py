"""Real recordings diagnosed with a known effect left out of the scenario: is it named, and with which value.

    python -m tests.real.diagnoses $ROLLOVER_DATA [--only whiffle-ball-1 ...] [--json] [--write]

Each set goes through the same `diagnose` as a user's recordings. What a set needs to be compared with a simulation is
stated here and nowhere else: which rows and channels are used, what its conditions leave uncertain, and a tolerance,
the share of a channel's range by which the best law of its kind still misses it (5 %: the inner corridor of
ISO/TS 18571). `--write` puts the numbers into tests/real/diagnoses.json, beside those of the sets not asked for.
"""

from __future__ import annotations

import argparse
import json
import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from rollover.diagnosis import Diagnosis, diagnose
from rollover.importers import COLLECTIONS
from rollover.importers.cone_drops import BODY, CLIPS, G
from rollover.recording import Clock, Recording
from rollover.scenario import Scenario, load
from tests.real import cone_drops

DRAWS = "cube tosses, draws of five"
RESULTS = Path(__file__).with_suffix(".json")
PLACE, ACCELERATION = "striker/position_z", "striker/acceleration_z"
HEIGHTS = (25, 50, 75, 100, 125, 150)  # cm, of the cone drops
CORRIDOR = 0.05  # of the range, ISO/TS 18571
AREA = 0.01  # m2, to which drag areas of several balls are referred
SEEDS = 16  # draws of tosses
SEA_WATER = 1025.0  # kg/m3
VOLLEYBALL = 0.105  # m, by the rules of the game
MOVED = 0.3  # of the longer way along the table, that the cube must move along an axis
WATER = (("rate", math.nan), ("fade", 0.0))
ALONG = ("chassis/position_x", "chassis/position_y")  # the table: where friction acts
Recordings = list[tuple[str, Recording]]


@dataclass(frozen=True, kw_only=True)
class Set:
    """Recordings, the scenario without the effect, what was left out, and what is published of it."""

    left_out: str
    make: Callable[[Path], tuple[Scenario, Recordings]]
    tolerance: float = 0.0
    hold_out: tuple[str, ...] = ()
    published: str = ""
    value: Callable[[Diagnosis, Recordings], dict[str, float]] = lambda _d, _r: {}


def cut(recording: Recording, rows: Any, channels: Sequence[str], **changes: Any) -> Recording:
    """Rows and channels of a recording; what else is known of it in `changes`."""
    kept = {c: recording.channels[c][rows] for c in channels}
    return replace(recording, time=recording.time[rows], channels=kept, sensors={}, **changes)


def balls(*names: str, referred: bool = False) -> Callable[[Path], tuple[Scenario, Recordings]]:
    """Drops of balls, no air, until they land. They were let go by hand: from 80 m (told), 0.3 m, 0.1 s, 0.3 m/s.

    The speed in the file is a difference of the height and says nothing by itself. `referred`: the drag of each ball
    over its own frontal area, so that one coefficient holds for all.
    """

    def made(folder: Path) -> tuple[Scenario, Recordings]:
        found = []
        for name, r in COLLECTIONS["falling-balls"].read(folder / "falling_balls", [f"{n}-?" for n in names]):
            conditions = dict(r.conditions) | {"initiation.height": 80.0}
            if referred:
                ratio = math.pi * radius(r) ** 2 / AREA
                conditions |= {"effects.air-drag.area": 0.0, "effects.air-drag.drag_coefficient": ratio}
            told = replace(r, channels={PLACE: r[PLACE] - r[PLACE][0] + 80.0}, conditions=conditions)
            clock = Clock(zero="unknown", within=0.1)
            doubt = {"initiation.height": 0.3, "initiation.speed": 0.3}
            one = cut(told, slice(landed(r[PLACE])), [PLACE], uncertainty=doubt, clock=clock)
            found.append((name, one))
        return load("ball_drop"), found

    return made


def landed(height: Any) -> int:
    """Rows before the ground: where a ball in full fall covers less than half of the way of the step before."""
    way = -np.diff(height)
    short = (way[1:] < 0.5 * way[:-1]) & (way[:-1] > 0.5 * way.max())
    return int(np.argmax(short)) + 2 if short.any() else len(height)


def radius(r: Recording) -> float:
    """Of a ball, m; that of a volleyball is not stated."""
    stated = (float(note.split()[1]) for note in r.notes if note.startswith("radius"))
    return next(stated, VOLLEYBALL)


def drag(found: Diagnosis, recordings: Recordings) -> dict[str, float]:
    """C_d from the fitted drag area; speed of the drag crisis where one was found."""
    named = next((e.parameters for e in found.effects if e.id == "air-drag"), {})
    area, crisis = (named[n].value if n in named else math.nan for n in ("area", "crisis_speed"))
    face = AREA
    if not any("effects.air-drag.area" in r.conditions for _, r in recordings):
        face = math.pi * radius(recordings[0][1]) ** 2
    return {"drag_coefficient": area / face} | ({} if math.isnan(crisis) else {"crisis_speed": crisis})


def cones(kind: str, angle: int) -> Callable[[Path], tuple[Scenario, Recordings]]:
    """Two drops of each height onto water from -15 to 50 ms, without clipped rows.

    Rigid cones ("R") meet drag and buoyancy alone, 0.7 +- 0.3; sprung ones ("F") the water that `cone_drops` fits to
    the rigid ones of their angle, to half of its mass and half a cone's height for the end of its growth: after a
    rigid cone's blow little tells where that ends. The clock's zero is "about" the impact, 2 ms.
    """

    def made(folder: Path) -> tuple[Scenario, Recordings]:
        folder = folder / "cone_drops"
        names = [f"S{kind}{angle}{h:03d}{k}" for h in HEIGHTS for k in "12"]
        scenario = load("cone_drop")
        doubt = {cone_drops.DRAG: 0.3}
        if kind == "F":
            known = cone_drops.rigid(folder, angle)["with"]["numbers"]
            scenario = scenario.replaced(known)
            doubt[cone_drops.RATE] = 0.5 * known[cone_drops.RATE]
        found = []
        for name, r in COLLECTIONS["cone-drops"].read(folder, names):
            rows = np.flatnonzero((r.time > -0.015) & (r.time < 0.050) & (r[ACCELERATION] < 0.97 * CLIPS * G))
            conditions = dict(r.conditions)
            if kind == "F":
                # where the instrument sits: the body, all but the nose
                share = 1.0 - BODY / conditions["vehicle.mass"]
                conditions |= {cone_drops.STIFFNESS: None, cone_drops.SHARE: share}
                doubt[cone_drops.FADE] = 0.5 * conditions["vehicle.nose_height"]
            clock = Clock(zero="known", within=0.002)
            found.append((name, cut(r, rows, [ACCELERATION], conditions=conditions, uncertainty=doubt, clock=clock)))
        return scenario, found

    return made


def water(found: Diagnosis, recordings: Recordings) -> dict[str, float]:
    """The rate at which the water's mass grows, where that ends, and k of k rho r^3 in the end."""
    named = next((e for e in found.effects if e.id == "soil-added-mass-growth"), None)
    rate, fade = (named.parameters[n].value if named and n in named.parameters else d for n, d in WATER)
    conditions = recordings[0][1].conditions
    half = math.atan2(conditions["vehicle.nose_radius"], conditions["vehicle.nose_height"])
    return {
        "rate": rate,
        "fade": fade,
        "k": cone_drops.share_of_cube({cone_drops.RATE: rate, cone_drops.FADE: fade}, half),
    }


def spring(found: Diagnosis, _: Recordings) -> dict[str, float]:
    """Stiffness between nose and body, N/m."""
    named = next((e for e in found.effects if e.id == "structural-compliance"), None)
    return {"stiffness": named.parameters["stiffness"].value if named is not None else math.nan}


def penetrometer(rate: float) -> Callable[[Path], tuple[Scenario, Recordings]]:
    """Drops into a sea bed on the stand-in soil of the scenario, 0.2 s before to 0.4 s behind the contact.

    The water's drag is that of each fall before the contact. Three places are not one soil: its strength is told to a
    quarter, as laws fitted to these drops scatter. `rate` is the gain of strength for each decade of speed.
    """

    def made(folder: Path) -> tuple[Scenario, Recordings]:
        scenario = load("penetrometer_drop")
        law = scenario.ground.law
        doubt = {f"ground.law.{n}": 0.25 * getattr(law, n) for n in ("surface_pressure", "depth_pressure")}
        found = []
        for name, r in COLLECTIONS["soil-penetrometer"].read(folder / "soil_penetrometer", ["*"]):
            if "initiation.speed" not in r.conditions:
                continue  # no clean drop
            rows = np.flatnonzero((r.time > -0.2) & (r.time < 0.4))
            falling = rows[r.time[rows] < -0.01]
            # m a = m g - 1/2 rho C_d A v^2, a downwards; g is what the buoyancy leaves
            braked = scenario.gravity + float(r[ACCELERATION][falling].mean())
            dynamic = 0.5 * SEA_WATER * r.conditions["initiation.speed"] ** 2
            drag = {"density": SEA_WATER, "area": r.conditions["vehicle.mass"] * braked / dynamic}
            conditions = dict(r.conditions) | {f"effects.air-drag.{n}": v for n, v in drag.items()}
            told = {"initiation.speed": 0.05, **doubt}
            clock = Clock(zero="known", within=0.01)
            found.append((name, cut(r, rows, [ACCELERATION], conditions=conditions, uncertainty=told, clock=clock)))
        return scenario.replaced({"ground.law.rate_per_decade": rate}), found

    return made


def cubes(numbers: Sequence[int]) -> Callable[[Path], tuple[Scenario, Recordings]]:
    """Tosses of a cube onto a table without friction, along the table, from the start to 0.1 s after the first contact.

    Tumbling is chaotic: nothing is asked of what comes later. The start is that of a flight fitted to the poses, which
    leaves 0.0006 m/s and 0.004 rad/s, and it is the first row: its clock is not in doubt. The table is where the
    cube comes to rest, 1.9 mm below the zero of the poses. An axis along which the cube moves little tells of nothing
    that a share of its own range could be allowed for.
    """

    def made(folder: Path) -> tuple[Scenario, Recordings]:
        from tests.real.cube_tosses import tosses

        known = {t.number: t for t in tosses(str(folder / "cube_tosses" / "cube_tosses.npz"))}
        names = [f"toss{n:03d}" for n in numbers]
        found = []
        for name, r in COLLECTIONS["cube-tosses"].read(folder / "cube_tosses", names):
            toss = known[int(name[4:])]
            rows = np.flatnonzero(r.time <= toss.contact + 0.1)
            way = {c: float(np.ptp(r[c][rows])) for c in ALONG}
            x, y, z = r.conditions["initiation.position"]
            at_rest = float(np.median(toss.corners[-5:, :, 2].min(axis=1)))
            one = cut(
                r,
                rows,
                [c for c in ALONG if way[c] > MOVED * max(way.values())],
                conditions={**r.conditions, "initiation.position": [x, y, z - at_rest]},
                uncertainty={"initiation.velocity": (0.001,) * 3, "initiation.angular_velocity": (0.007,) * 3},
                clock=Clock(zero="known", within=3e-4),
            )
            found.append((name, one))
        return load("cube_toss").replaced({"ground.friction.coefficient": 0.0}), found

    return made


def drawn(folder: Path, seed: int, many: int = 5) -> list[int]:
    """Numbers of `many` tosses by chance, of those with a flight to begin from."""
    from tests.real.cube_tosses import tosses

    usable = sorted(t.number for t in tosses(str(folder / "cube_tosses" / "cube_tosses.npz")))
    return sorted(int(n) for n in np.random.default_rng(seed).choice(usable, many, replace=False))


def draws(folder: Path, seeds: Sequence[int] = tuple(range(SEEDS))) -> dict[str, Any]:
    """How many draws of five tosses name friction, and with which coefficient."""
    rows = []
    for seed in seeds:
        one = replace(SETS["cube tosses"], make=cubes(drawn(folder, seed)))
        scenario, recordings = one.make(folder)
        found = diagnose(scenario, recordings, tolerance=one.tolerance)
        rows.append({"seed": seed, **account(one, found, recordings)})
    named = [row for row in rows if [e["id"] for e in row["effects"]] == ["ground-friction"]]
    return {
        "draws": len(rows),
        "named": len(named),
        "not_named": {
            row["seed"]: [row["verdict"], *(e["id"] for e in row["effects"])] for row in rows if row not in named
        },
        "coefficients": [row["value"]["coefficient"] for row in named],
        "intervals": [row["effects"][0]["parameters"]["coefficient"][1:] for row in named],
        "before": [row["before"]["nrmse"] for row in rows],
        "after": [row["after"]["nrmse"] for row in rows],
    }


def friction(found: Diagnosis, _: Recordings) -> dict[str, float]:
    """Mu of cube on table."""
    named = next((e for e in found.effects if e.id == "ground-friction"), None)
    return {"coefficient": named.parameters["coefficient"].value if named is not None else math.nan}


SETS: dict[str, Set] = {
    "whiffle-ball-1": Set(left_out="air-drag", make=balls("whiffle-ball-1"), value=drag),
    "yellow-whiffle-ball": Set(left_out="air-drag", make=balls("yellow-whiffle-ball"), value=drag),
    "whiffle balls, one held out": Set(
        left_out="air-drag",
        make=balls("whiffle-ball-1", "yellow-whiffle-ball", referred=True),
        hold_out=("yellow-whiffle-ball-1", "yellow-whiffle-ball-2"),
        value=drag,
    ),
    "volleyball": Set(left_out="air-drag", make=balls("volleyball"), value=drag),
    "baseball": Set(left_out="air-drag", make=balls("baseball")),
    "golf-ball": Set(left_out="air-drag", make=balls("golf-ball")),
    "cones, rigid, 60 deg": Set(
        left_out="soil-added-mass-growth",
        make=cones("R", 60),
        tolerance=CORRIDOR,
        value=water,
        published="k 0.6 to 1.7",
    ),
    "cones, sprung, 60 deg": Set(
        left_out="structural-compliance",
        make=cones("F", 60),
        tolerance=CORRIDOR,
        value=spring,
        published="7800 N/m",
    ),
    "cones, rigid, 80 deg": Set(
        left_out="soil-added-mass-growth",
        make=cones("R", 80),
        tolerance=CORRIDOR,
        value=water,
        published="k 0.6 to 1.7",
    ),
    "penetrometer, no rate": Set(left_out="soil-rate-hardening", make=penetrometer(0.0), tolerance=CORRIDOR),
    "penetrometer": Set(left_out="", make=penetrometer(0.15), tolerance=CORRIDOR),
    "cube tosses": Set(
        left_out="ground-friction",
        make=cubes((1, 4, 7, 9, 12)),
        tolerance=0.01,  # 2 mm: a corner digs 2.3 mm deeper in an impact than at rest, which hard ground does not
        value=friction,
        published="mu 0.15 to 0.18",
    ),
}


def account(one: Set, found: Diagnosis, recordings: Recordings) -> dict[str, Any]:
    """Numbers of a diagnosis that are worth keeping."""

    def score(which: Mapping[str, Any]) -> dict[str, float | None]:
        s = which["held_out"]
        return {"nrmse": rounded(s.nrmse), "iso18571": rounded(s.iso18571), "peak": rounded(s.peak_force_error)}

    return {
        "left_out": one.left_out,
        "published": one.published,
        "verdict": found.verdict,
        "effects": [
            {
                "id": e.id,
                **({} if e.channel is None else {"channel": e.channel}),
                "parameters": {n: [rounded(v) for v in (i.value, i.low, i.high)] for n, i in e.parameters.items()},
                "indistinguishable_from": list(e.indistinguishable_from),
            }
            for e in found.effects
        ],
        "value": {name: rounded(v) for name, v in one.value(found, recordings).items()},
        "before": score(found.before) if found.before else {},
        "after": score(found.after) if found.after else {},
        "remaining": found.remaining_significant,
        "depends_on": found.depends_on,
        "recordings": len(recordings),
        "next_best": [[c.id, c.channel, rounded(c.held_out_gain)] for c in found.candidates[:5]],
        **(
            {}
            if found.empirical is None
            else {"law": found.empirical.law, "gain": rounded(found.empirical.held_out_gain)}
        ),
        "simulations": found.simulations,
    }


def rounded(x: float | None) -> float | None:
    """Three figures; None for what is no number."""
    return None if x is None or not math.isfinite(x) else float(f"{x:.3g}")


def study(folder: Path, name: str) -> dict[str, Any]:
    """Diagnose one set."""
    one = SETS[name]
    scenario, recordings = one.make(folder)
    found = diagnose(scenario, recordings, hold_out=one.hold_out, tolerance=one.tolerance)
    return account(one, found, recordings)


def write(known: Mapping[str, Any], *, to: bool) -> None:
    """All answers into the file of results, if asked for."""
    if to:
        ordered = {k: known[k] for k in (*SETS, DRAWS) if k in known}
        RESULTS.write_text(json.dumps(ordered, indent=2) + "\n", encoding="utf-8")


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").partition("\n")[0])
    parser.add_argument("folder", type=Path)
    parser.add_argument("--only", nargs="*", default=[*SETS, DRAWS], choices=[*SETS, DRAWS])
    parser.add_argument("--json", action="store_true")
    parser.add_argument("--write", action="store_true")
    given = parser.parse_args()
    known: dict[str, Any] = json.loads(RESULTS.read_text(encoding="utf-8")) if RESULTS.exists() else {}
    for name in given.only:
        if name == DRAWS:
            known[name] = many = draws(given.folder)
            if not given.json:
                print(f"{name:28s} {many['named']} of {many['draws']} name ground-friction: {many['coefficients']}")
            write(known, to=given.write)
            continue
        known[name] = found = study(given.folder, name)
        named = ", ".join(e["id"] for e in found["effects"]) or "-"
        value = ", ".join(f"{k} {v}" for k, v in found["value"].items())
        if not given.json:
            before, after = (found[k].get("nrmse") for k in ("before", "after"))
            print(f"{name:28s} {found['left_out']:24s} {found['verdict']:16s} {named:40s} {before} -> {after}  {value}")
        write(known, to=given.write)
    if given.json:
        print(json.dumps({name: known[name] for name in given.only}, indent=2))


if __name__ == "__main__":
    main()

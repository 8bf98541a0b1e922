"""Annotated files to begin with, one for each kind of file that a user writes; texts beside this module."""

from __future__ import annotations

import math
import re
from collections.abc import Callable, Mapping
from dataclasses import replace
from pathlib import Path

from rollover import scenario as scenarios
from rollover import studies
from rollover.recording.importers.sidecar import Profile, Sidecar, read_described
from rollover.spec import document
from rollover.spec.rops import Rops

VEHICLE, ROPS = "utility_tractor", "rops/two_post_rear_3t.yaml"
FRAME = "rops/two_post_rear_tubes_3t.yaml"


def written(kind: str, name: str) -> Mapping[str, str]:
    """Text of the files of a kind by file name; `name` is a plain name without an ending."""
    return _KINDS[kind](name)


def of_sealed_cases(cases: int, rig: str, digest: str) -> Mapping[str, str]:
    """What stands beside sealed cases: the baseline as a function, and how they are answered."""
    words = {"@CASES@": str(cases), "@RIG@": "drops" if rig == "drop" else "side overturns", "@DIGEST@": digest}
    text = _text("benchmark.txt").read_text(encoding="utf-8")
    readme = re.sub("|".join(words), lambda found: words[found[0]], text)
    return {"README.md": readme, "baseline.py": _text("baseline.txt").read_text(encoding="utf-8")}


def _scenario(name: str) -> Mapping[str, str]:
    head = (
        f"{name}: a tractor tips over sideways onto flat clay.\n"
        f"Check: rollover check {name}.yaml   Run: rollover run {name}.yaml   Values: rollover list paths {name}.yaml\n"
        "A key with a default may be left out. `vehicle`, `law`: see `rollover list vehicles`, `list soils`, or\n"
        "your own (`rollover new vehicle`). `effects`: `rollover list effects`. Other kinds: `rollover schema`."
    )
    files = {"vehicle": f"vehicles/{VEHICLE}.yaml", "ground.law": "soils/natural_clay.yaml"}
    return {f"{name}.yaml": document.annotated(scenarios.load("side_overturn"), head, files)}


def _vehicle(name: str) -> Mapping[str, str]:
    head = (
        f"{name}: a tractor of 3000 kg with wheels, outline, axle and ROPS, to be replaced by your own numbers.\n"
        f"Check: rollover check {name}.yaml   Use: vehicle: {name}.yaml in a scenario, or\n"
        f"rollover run side_overturn --set vehicle={name}.yaml   Stability: rollover stability {name}.yaml\n"
        "A key with a default may be left out; `provenance` states where numbers come from."
    )
    vehicle = document.load(document.find(VEHICLE, "vehicles"), scenarios.AnyVehicle)
    return {f"{name}.yaml": document.annotated(vehicle, head, {"rops": f"vehicles/{ROPS}"})}


def _rops(name: str) -> Mapping[str, str]:
    head = (
        f"{name}: a two-post ROPS at the rear of a tractor of 3000 kg, to be replaced by your own tubes.\n"
        f"Check: rollover check {name}.yaml   What it carries: rollover rops {name}.yaml --mass 3000\n"
        f"Use: rops: {name}.yaml in a vehicle, or rollover run side_overturn --set vehicle.rops={name}.yaml\n"
        "A key with a default may be left out. Other sections and members: `rollover schema rops`; steels: `rollover\n"
        "list steels`, or {base: S355, yield_strength: ...}. Of a frame whose side-load curve was measured, `mounts`\n"
        "with that stiffness and yield stand in the place of `feet`, as in vehicles/rops/two_post_rear_3t.yaml."
    )
    rops = document.load(document.shipped_folder() / "vehicles" / FRAME, Rops)
    return {f"{name}.yaml": document.annotated(rops, head, {"members.material": "S355"})}


def _study(name: str) -> Mapping[str, str]:
    head = (
        f"{name}: 20 drops whose impact speed and soil stiffness are drawn; seconds of work.\n"
        f"Check: rollover check {name}.yaml   Run: rollover study {name}.yaml\n"
        "A key with a default may be left out. `paths` of an axis: `rollover list paths SCENARIO`. Other kinds of\n"
        "axes and plans with their keys: `rollover schema study`."
    )
    study = studies.load(_text("study.yaml"))
    return {f"{name}.yaml": document.annotated(study, head, {"scenario": "drop_test.yaml"})}


def _recording(name: str) -> Mapping[str, str]:
    head = (
        f"{name}: what the columns of {name}.csv are, and under which conditions it was measured.\n"
        f"Check: rollover check {name}.csv   Compare: rollover compare drop_test {name}.csv\n"
        f"The numbers in {name}.csv are made up (a half sine); put yours there. A key with a default may be left out.\n"
        "Channels: `rollover list channels`; paths of conditions: `rollover list paths SCENARIO`."
    )
    found = read_described(_text("recording.yaml"), Sidecar)
    rows = [f"{t:.4f},{force:.4f},{acceleration:.4f}" for t, force, acceleration in _pulse()]
    return {
        f"{name}.yaml": document.annotated(replace(found.about, channels=found.columns), head),
        f"{name}.csv": "\n".join(["t,F,a", *rows]) + "\n",
    }


def _profile(name: str) -> Mapping[str, str]:
    head = (
        f"{name}: how the files of an instrument are read; one profile serves all of them.\n"
        f"Check: rollover check {name}.yaml   Use: rollover import {name}-sample.csv --profile {name}.yaml --out rec\n"
        f"{name}-sample.csv shows such a file with made-up numbers. A key with a default may be left out.\n"
        "Channels: `rollover list channels`; paths of conditions: `rollover list paths SCENARIO`."
    )
    found = read_described(_text("profile.yaml"), Profile)
    rows = [f"{1e3 * t:.1f};{force:.4f};{acceleration:.4f}".replace(".", ",") for t, force, acceleration in _pulse()]
    return {
        f"{name}.yaml": document.annotated(replace(found.about, channels=found.columns), head),
        f"{name}-sample.csv": "\n".join(["Zeit;Kraft;Beschl", *rows]) + "\n",
    }


def _code(kind: str) -> Callable[[str], Mapping[str, str]]:
    def written(name: str) -> Mapping[str, str]:
        file = f"{name.replace('-', '_')}.py"
        words = {"@NAME@": name.replace("_", "-"), "@FILE@": file, "@CLASS@": _class(name)}
        text = _text(f"{kind}.txt").read_text(encoding="utf-8")
        return {file: re.sub("|".join(words), lambda found: words[found[0]], text)}

    return written


def _class(name: str) -> str:
    return "".join(word[:1].upper() + word[1:] for word in re.split("[-_]+", name))


def _pulse() -> list[tuple[float, float, float]]:
    """Made-up time (s), force (kN) and acceleration (g) of a drop: a half sine over 0.2 s, sampled at 2 kHz."""
    times = [k / 2000.0 for k in range(401)]
    forces = [3.5 * math.sin(math.pi * t / 0.2) for t in times]
    return [(t, abs(f), f / (0.132 * 9.81) - 1.0) for t, f in zip(times, forces, strict=True)]


def _text(name: str) -> Path:
    return Path(__file__).with_name(name)


_KINDS: Mapping[str, Callable[[str], Mapping[str, str]]] = {
    "scenario": _scenario,
    "vehicle": _vehicle,
    "rops": _rops,
    "study": _study,
    "recording": _recording,
    "profile": _profile,
    "law": _code("law"),
    "effect": _code("effect"),
}

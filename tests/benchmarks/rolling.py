"""Planar calculation of rolling beside the dynamic run: `python -m tests.benchmarks.rolling [--narrow | VEHICLE ...]`.

`--narrow`: ten narrow tractors with a front-mounted ROPS, which the calculation is made for: the vineyard tractor with
other frames, tracks and centres of gravity. Else each shipped vehicle on wheels. It tips over on a slope of 1 : 1.5; it
rolls on if its roll passes half a turn. Prints the verdict of the calculation, how much of the energy that its last
turn needs it has, its verdict without restitution, which the run's clay does not have; the run's verdict, the roll
(deg) at the end, and the ledger (%). Where the calculation does not cover a vehicle it says why: a ROPS that is folded
down lands after the bonnet, which the regulation's order of blows does not know; the run goes on.
"""

from __future__ import annotations

import math
import sys

import numpy as np

from rollover.assessment.ledger import closure
from rollover.assessment.rolled import rolled
from rollover.assessment.standing import scenario_of
from rollover.dynamics.simulate import run
from rollover.scenario import Scenario, load
from rollover.spec.shapes import Tube
from rollover.spec.vehicle import Vehicle
from rollover.system.errors import InputError

SHIPPED = (
    "vineyard_tractor",
    "compact_tractor",
    "compact_tractor_folding",
    "compact_tractor_folded",
    "utility_tractor",
    "utility_tractor_tubes",
    "mf178",
    "row_crop_tractor",
    "large_tractor",
    "light_vehicle",
)


def framed(x: float = 0.84, top: float = 2.165) -> dict[str, object]:
    """The vineyard tractor's frame elsewhere along x, and with its crossbar at another height, m."""
    vehicle = scenario_of("vineyard_tractor").vehicle
    assert isinstance(vehicle, Vehicle)
    assert vehicle.rops is not None
    ahead, corner = x - vehicle.rops.corner[0], vehicle.rops.corner
    found: dict[str, object] = {
        "vehicle.rops.corner": [x, corner[1], top + corner[2] - 2.165],
        "vehicle.rops.body.centre_of_mass.0": vehicle.rops.body.centre_of_mass[0] + ahead,
    }
    for member in vehicle.rops.members:
        assert isinstance(member, Tube)
        for end, (a, b, z) in (("start", member.start), ("end", member.end)):
            found[f"vehicle.rops.members.{member.name}.{end}"] = [a + ahead, b, top if z == 2.165 else z]
    for mount in vehicle.rops.mounts:
        found[f"vehicle.rops.mounts.{mount.name}.position.0"] = mount.position[0] + ahead
    return found


def wider(way: float) -> dict[str, object]:
    """All wheels of the vineyard tractor further out, m."""
    vehicle = scenario_of("vineyard_tractor").vehicle
    assert isinstance(vehicle, Vehicle)
    return {f"vehicle.wheels.{w.name}.centre.1": w.centre[1] + math.copysign(way, w.centre[1]) for w in vehicle.wheels}


def high(centre: float) -> dict[str, object]:
    """Its centre of gravity at another height, m."""
    return {"vehicle.whole.centre_of_mass.2": centre}


NARROW: dict[str, dict[str, object]] = {
    "as shipped": {},
    "frame of 2.50 m": framed(top=2.465),
    "frame of 1.74 m": framed(top=1.70),
    "frame of 1.54 m": framed(top=1.50),
    "frame 0.26 m ahead": framed(x=1.10),
    "ahead, 1.74 m": framed(x=1.10, top=1.70),
    "ahead, 1.74 m, high": framed(x=1.10, top=1.70) | high(0.80),
    "1.74 m, high": framed(top=1.70) | high(0.85),
    "track of 1.35 m": wider(0.20),
    "1.35 m, frame of 1.74 m": wider(0.20) | framed(top=1.70),
}


def calculated(scenario: Scenario, inputs: dict[str, float]) -> str:
    """Verdict of the calculation, energy of its last turn over what that needs, verdict without restitution."""
    try:
        found, dead = (rolled(scenario, inputs | more)[1] for more in ({}, {"U": 0.0}))
    except InputError as e:
        return f"{e!s:38}"
    turns = [s.symbol[1:] for s in found.steps if s.symbol[0] == "N"]  # in their order; E goes with each
    needed, has = found[f"N{turns[-1]}"], found[f"E{turns[-1]}"]
    share = has / needed if needed > 0.0 else math.inf
    return f"{found.verdict:13} {share:9.2f} {dead.verdict:14}"


def beside(name: str, changes: dict[str, object] | None = None, **inputs: float) -> tuple[str, str, float, float]:
    """The calculation in words, verdict of the run, its roll at the end (deg) and its ledger (%)."""
    vehicle = scenario_of(name).vehicle
    assert isinstance(vehicle, Vehicle)
    base = load("side_overturn_slope")
    slope = base.replaced({"ground.surface.angle_deg": math.degrees(0.588), "ground.elements.width": 48.0})
    scenario = slope.replaced({"vehicle": vehicle, "simulation.duration": 5.0}).replaced(changes or {}).of_many()
    planar = calculated(scenario, inputs)
    done = run(scenario)
    roll = np.degrees(np.abs(done.recording["chassis/roll"]))
    verdict = "continuous" if float(roll.max()) > 180.0 else "interrupted"
    return planar, verdict if done.status == "done" else done.sentence, float(roll[-1]), 100.0 * closure(done).largest


def main() -> None:
    """Print the table."""
    print(
        f"{'vehicle':24} {'calculation':13} {'has/needs':>9} {'with U = 0':14} {'dynamic run':13} roll, deg ledger, %"
    )
    cases: dict[str, tuple[str, dict[str, object]]] = {name: (name, {}) for name in sys.argv[1:] or SHIPPED}
    if sys.argv[1:] == ["--narrow"]:
        cases = {name: ("vineyard_tractor", changes) for name, changes in NARROW.items()}
    for name, (vehicle, changes) in cases.items():
        planar, dynamic, roll, ledger = beside(vehicle, changes)
        print(f"{name:24} {planar} {dynamic:13} {roll:9.0f} {ledger:9.3f}", flush=True)


if __name__ == "__main__":
    main()

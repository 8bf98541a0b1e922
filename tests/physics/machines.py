"""Which scenarios each machine belongs to, and what of a scenario has to be another for it."""

from __future__ import annotations

import numpy as np

from rollover.dynamics.result import Run
from rollover.scenario import Scenario
from tests.physics.scenes import shipped

FINER = {"simulation.step": 0.0005}  # machines of 300 kg on stiff tyres
# a trailer of 6 m behind the tractor stands on the ground too
LONGER = {"ground.elements.length": 34.0, "ground.elements.width": 30.0, "ground.elements.centre": [0.0, 5.0]}
BELONGS: dict[str, dict[str, dict[str, object]]] = {
    "quad_bike": {
        "side_overturn": {},
        "side_overturn_slope": FINER,
        "bank_overturn": {},
        "ditch": {},
        "cornering_overturn": {},
        "quad_rear_overturn": {},
        "forward_pitch": {},
    },
    "quad_bike_sprung": {
        "side_overturn": FINER,
        "bank_overturn": FINER,
        "cornering_overturn": FINER,
        "quad_rear_overturn": {},
        "forward_pitch": FINER,
    },
    "side_by_side": {
        "side_overturn": {},
        "side_overturn_slope": {},
        "bank_overturn": {},
        "ditch": {},
        "cornering_overturn": {},
        "corkscrew_ramp": {},
    },
    "mini_excavator": {"side_overturn": {}, "side_overturn_slope": {}, "bank_overturn": {}},
    "electric_tractor": {
        "side_overturn": {},
        "side_overturn_slope": {},
        "bank_overturn": {},
        "ditch": {},
        "kerb_trip": {},
        "rear_overturn": {},
    },
    "tractor_trailer": {"side_overturn_slope": {}, "trailer_overturn": {}, "ditch": LONGER},
    "forwarder": {"forwarder_overturn": {}, "bank_overturn": LONGER},
    "skid_load": {"soil_trip": {}},
    "vineyard_tractor": {"cornering_overturn": {}},
    "light_vehicle": {"dolly_rollover": {}},
    "utility_tractor": {"ditch": {}, "kerb_trip": {}},
}
PAIRS = [(machine, name) for machine, names in BELONGS.items() for name in names]


def scene(machine: str, name: str) -> Scenario:
    """A machine in a scenario that it belongs to, by the compiled loop."""
    changes = {"vehicle": f"vehicles/{machine}.yaml", "simulation.integrator": "compiled"}
    return shipped(name).replaced(changes).replaced(BELONGS[machine][name])


def lean(done: Run) -> float:
    """Largest angle (rad) between the vehicle's z and the vertical."""
    rec = done.recording
    upright = 1.0 - 2.0 * (rec["chassis/quaternion_x"] ** 2 + rec["chassis/quaternion_y"] ** 2)
    return float(np.arccos(np.clip(upright.min(), -1.0, 1.0)))

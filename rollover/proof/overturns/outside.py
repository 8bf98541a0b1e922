"""What no table of effects holds, in overturns: two kinds of physics and four faults that must end as `unexplained`."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from typing import Any

import numpy as np

from rollover.proof.campaign import log_uniform
from rollover.proof.instruments import Fault
from rollover.proof.overturns.library import TYRES, Change, Draw, Random

STIFF = {"front_left": 220e3, "front_right": 220e3, "rear_left": 350e3, "rear_right": 350e3}  # N/m, of its tyres


def _flat(random: Random, _: Mapping[str, float]) -> Change:
    """One tyre is nearly flat: its force is a function of how far it is pressed in, which goes with the attitude."""
    wheel, share = str(random.choice(TYRES[2:])), log_uniform(random, 0.15, 0.5)
    return Change(
        id="outside:flat-tyre",
        kind="outside",
        parameters={"share": share},
        values={f"vehicle.wheels.{wheel}.tyre.vertical_stiffness": share * STIFF[wheel]},
        depends_on="attitude",
        near=("centre-of-mass", "slope", "tyre-lateral-stiffness"),
    )


def _pushed(random: Random, _: Mapping[str, float]) -> Change:
    """Tests began with another roll rate than was written down, all by one factor.

    Of what tips over, energy tells the rate from the angle: omega^2 = omega_0^2 + 2 (U_0 - U(phi))/J.
    """
    factor = math.exp(log_uniform(random, 0.05, 0.3) * float(random.choice((-1.0, 1.0))))
    near = ("slope", "inertia", "centre-of-mass")
    return Change(
        id="outside:pushed",
        kind="outside",
        parameters={"factor": factor},
        pushed=factor,
        depends_on="attitude",
        near=near,
    )


def _fault(
    id: str, near: tuple[str, ...], draw: Callable[[Random, float], dict[str, float]], depends_on: str = "time"
) -> Draw:
    def drawn(random: Random, spans: Mapping[str, float]) -> Change:
        channel = str(random.choice(sorted(spans)))
        parameters = draw(random, spans[channel])
        wrong: dict[str, Any] = dict(parameters)
        return Change(
            id=id,
            kind="outside",
            parameters=parameters,
            channel=channel,
            fault=Fault(**wrong),
            depends_on=depends_on,
            near=near,
        )

    return drawn


def _warming(random: Random, _: float) -> dict[str, float]:
    gain = log_uniform(random, 0.05, 0.4) * float(random.choice((-1.0, 1.0)))
    return {"warming": gain, "middle": float(random.uniform(0.25, 0.45)), "width": float(random.uniform(0.01, 0.05))}


def _hum(random: Random, span: float) -> dict[str, float]:
    return {
        "hum": span * log_uniform(random, 0.02, 0.15),
        "frequency": 50.0,
        "phase": float(random.uniform(0.0, 2.0 * np.pi)),
    }


def _loose(random: Random, _: float) -> dict[str, float]:
    return {"dropouts": float(random.uniform(8.0, 30.0)), "lasting": float(random.uniform(0.006, 0.02))}


def _curved(random: Random, span: float) -> dict[str, float]:
    return {"curved": log_uniform(random, 0.1, 0.8) * float(random.choice((-1.0, 1.0))) / span}


OUTSIDE: dict[str, Draw] = {
    "outside:flat-tyre": _flat,
    "outside:pushed": _pushed,
    "outside:warming": _fault("outside:warming", ("sensor-gain",), _warming),
    "outside:hum": _fault("outside:hum", (), _hum),
    "outside:loose-contact": _fault("outside:loose-contact", (), _loose),
    "outside:curved": _fault("outside:curved", ("sensor-gain", "sensor-clipping"), _curved, "value"),
}

"""A linear axis with friction, driven by the force of its motor: after the electro-mechanical positioning system EMPS.

    M v' = F - F_v v - F_c sgn v - F_0,   q' = v

(Janot, Gautier and Brunot 2019, a benchmark of nonlinear system identification.) The force is held over each sampling
interval, as an amplifier does; Coulomb friction is solved for at the end of each step, so that the axis can stick.
Diagnosed with: `rollover diagnose --model friction_axis RECORDING...`
"""

import math

import numpy as np
from numba import njit

from ground.quantity import Quantity
from rollover import Parameter, Term

STEPS = 4  # of a sampling interval
SHARP = 1e-9  # m/s, below which friction has no direction


@njit
def _axis(dt, force, q0, p, out):  # type: ignore[no-untyped-def]
    """Position and velocity (n, 2) at the stamps, from rest at q0; p in the order of `ORDER`."""
    mass, viscous, coulomb, offset, asymmetry, extra, slow, quadratic, stiffness, play = p
    q, v, read = q0, 0.0, q0
    for i in range(force.size):
        out[i, 0], out[i, 1] = read, v
        h = dt[min(i, dt.size - 1)] / STEPS
        for _ in range(STEPS):
            held = coulomb + extra * math.exp(-((v / slow) ** 2))
            drag = viscous + asymmetry * (1.0 if v > SHARP else 0.0) + quadratic * abs(v)
            free = (mass * v + h * (force[i] - offset - stiffness * q)) / (mass + h * drag)
            stuck = h * held / (mass + h * drag)
            new = 0.0 if abs(free) <= stuck else free - math.copysign(stuck, free)
            q += 0.5 * h * (v + new)
            v = new
        read = min(max(read, q - play), q + play)


ORDER = (
    "mass", "viscous", "coulomb", "offset", "direction-dependence.added", "stribeck.force", "stribeck.speed",
    "quadratic-drag.coefficient", "cable-stiffness.stiffness", "backlash.half_width",
)  # fmt: skip


class FrictionAxis:
    """Mass, viscous and Coulomb friction and a constant force; what else there may be are the terms."""

    title = "Linear axis with friction"
    inputs = {"axis/force": Quantity("N", "of the motor on the carriage, held until the next stamp")}
    outputs = {
        "axis/position": Quantity("m", "as the encoder reads it"),
        "axis/velocity": Quantity("m/s", "of the carriage"),
    }
    sensors = ("sensor-bias", "sensor-gain", "sensor-scale", "sensor-lag", "sensor-clock-offset")
    parameters = {
        "mass": Parameter(unit="kg", low=30.0, high=300.0, start=90.0, scale="log"),
        "viscous": Parameter(unit="N s/m", low=20.0, high=2000.0, start=150.0, scale="log"),
        "coulomb": Parameter(unit="N", low=2.0, high=200.0, start=15.0, scale="log"),
        "offset": Parameter(unit="N", low=-30.0, high=30.0, start=0.5),
    }
    terms = (
        Term(
            id="direction-dependence",
            family="a friction that depends on the direction",
            equation="F = (F_v + added) v for v > 0",
            parameters={"added": Parameter(unit="N s/m", low=-150.0, high=150.0, start=40.0, null=0.0)},
            sentence="Viscous friction is {added:more|less} in the positive direction than in the other one.",
        ),
        Term(
            id="stribeck",
            family="a friction that falls with speed",
            equation="F = force exp(-(v/speed)^2) sgn v",
            parameters={
                "force": Parameter(unit="N", low=-15.0, high=40.0, start=8.0, null=0.0),
                "speed": Parameter(unit="m/s", low=0.01, high=0.2, start=0.05, scale="log"),
            },
        ),
        Term(
            id="quadratic-drag",
            family="a resistance that grows faster than speed",
            equation="F = coefficient v |v|",
            parameters={"coefficient": Parameter(unit="N s2/m2", low=-300.0, high=600.0, start=100.0, null=0.0)},
        ),
        Term(
            id="cable-stiffness",
            family="a force that depends on position",
            equation="F = stiffness q",
            parameters={"stiffness": Parameter(unit="N/m", low=-200.0, high=400.0, start=60.0, null=0.0)},
        ),
        Term(
            id="backlash",
            family="play",
            equation="q read follows q within half_width",
            parameters={"half_width": Parameter(unit="m", low=0.0, high=5e-3, start=5e-4, null=0.0)},
        ),
    )

    def simulate(self, time, inputs, values):  # type: ignore[no-untyped-def]
        """Position and velocity from rest at 0."""
        out = np.empty((time.size, 2))
        _axis(np.diff(time), inputs["axis/force"], 0.0, np.array([values[name] for name in ORDER]), out)
        return {"axis/position": out[:, 0], "axis/velocity": out[:, 1]}


model = FrictionAxis()

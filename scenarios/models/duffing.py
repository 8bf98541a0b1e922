"""A linear oscillator driven by a force: the baseline that a Duffing oscillator is held against, after Silverbox.

    m x'' + c x' + k x (+ k_3 x^3 + k_2 x^2 + F_c sgn x') = F

(Wigren and Schoukens 2013, an electronic circuit of this equation.) The force is held over each sampling interval;
classical Runge-Kutta of fourth order in between. Diagnosed with: `rollover diagnose --model duffing RECORDING...`
"""

import math

import numpy as np
from numba import njit

from ground.quantity import Quantity
from rollover import Parameter, Term

STEPS = 2  # of a sampling interval
SHARP = 1e-3  # m/s, over which dry friction changes its direction


@njit
def _acceleration(x, v, force, p):  # type: ignore[no-untyped-def]
    mass, damping, stiffness, cubic, square, friction = p
    return (force - damping * v - (stiffness + (square + cubic * x) * x) * x - friction * math.tanh(v / SHARP)) / mass


@njit
def _oscillate(dt, force, p, out):  # type: ignore[no-untyped-def]
    """Deflection (n,) at the stamps, from rest; p in the order of `ORDER`."""
    x, v = 0.0, 0.0
    for i in range(force.size):
        out[i] = x
        h = dt[min(i, dt.size - 1)] / STEPS
        for _ in range(STEPS):
            a1 = _acceleration(x, v, force[i], p)
            a2 = _acceleration(x + 0.5 * h * v, v + 0.5 * h * a1, force[i], p)
            a3 = _acceleration(x + 0.5 * h * v + 0.25 * h * h * a1, v + 0.5 * h * a2, force[i], p)
            a4 = _acceleration(x + h * v + 0.5 * h * h * a2, v + h * a3, force[i], p)
            x += h * v + h * h * (a1 + a2 + a3) / 6.0
            v += h * (a1 + 2.0 * a2 + 2.0 * a3 + a4) / 6.0


ORDER = (
    "mass", "damping", "stiffness", "cubic-stiffness.coefficient", "quadratic-stiffness.coefficient",
    "dry-friction.force",
)  # fmt: skip


class Oscillator:
    """Mass, damping and stiffness; what else there may be are the terms."""

    title = "Oscillator with one degree of freedom"
    inputs = {"oscillator/force": Quantity("N", "held until the next stamp")}
    outputs = {"oscillator/deflection": Quantity("m", "from rest")}
    sensors = ("sensor-bias", "sensor-lag", "sensor-clock-offset")  # a gain is that of mass, damping and stiffness
    parameters = {
        "mass": Parameter(unit="kg", low=0.2, high=5.0, start=0.9, scale="log"),
        "damping": Parameter(unit="N s/m", low=0.3, high=30.0, start=3.0, scale="log"),
        "stiffness": Parameter(unit="N/m", low=1000.0, high=16000.0, start=3700.0, scale="log"),
    }
    terms = (
        Term(
            id="cubic-stiffness",
            family="a stiffness that depends on deflection",
            equation="F = coefficient x^3",
            parameters={"coefficient": Parameter(unit="N/m3", low=-4e6, high=4e7, start=4e6, null=0.0)},
            rivals={"quadratic-stiffness": "a force of the other sign: a cubic one is the same both ways"},
        ),
        Term(
            id="quadratic-stiffness",
            family="a stiffness that depends on deflection",
            equation="F = coefficient x^2",
            parameters={"coefficient": Parameter(unit="N/m2", low=-1e5, high=1e5, start=2e4, null=0.0)},
            rivals={"cubic-stiffness": "a force of the other sign: a cubic one is the same both ways"},
        ),
        Term(
            id="dry-friction",
            family="a resistance that does not grow with speed",
            equation="F = force sgn x'",
            parameters={"force": Parameter(unit="N", low=0.0, high=10.0, start=1.0, null=0.0)},
        ),
    )

    def simulate(self, time, inputs, values):  # type: ignore[no-untyped-def]
        """Deflection from rest."""
        out = np.empty(time.size)
        _oscillate(np.diff(time), inputs["oscillator/force"], np.array([values[name] for name in ORDER]), out)
        return {"oscillator/deflection": out}


model = Oscillator()

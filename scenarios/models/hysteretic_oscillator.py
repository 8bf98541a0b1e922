"""A linear oscillator driven by a force: the baseline that a hysteretic one is held against, after Bouc and Wen.

    m x'' + c x' + k x (+ Z w) = F,   w' = (x'/d) (1 - |w| (1 + sgn(x' w))/2)

(Wen 1976 with n = 1, beta = gamma; Noel and Schoukens 2016 as a benchmark.) The force is held over each sampling
interval; Heun's method in between. Diagnosed with: `rollover diagnose --model hysteretic_oscillator RECORDING...`
"""

import numpy as np
from numba import njit

from ground.quantity import Quantity
from rollover import Parameter, Term

STEPS = 6  # of a sampling interval


@njit
def _rates(x, v, w, force, p):  # type: ignore[no-untyped-def]
    mass, damping, stiffness, strength, travel, cubic, drag = p
    pull = (stiffness + cubic * x * x) * x + strength * w
    yielding = abs(w) if v * w > 0.0 else 0.0
    return v, (force - pull - (damping + drag * abs(v)) * v) / mass, v / travel * (1.0 - yielding)


@njit
def _oscillate(dt, force, p, out):  # type: ignore[no-untyped-def]
    """Deflection (n,) at the stamps, from rest; p in the order of `ORDER`."""
    x, v, w = 0.0, 0.0, 0.0
    for i in range(force.size):
        out[i] = x
        h = dt[min(i, dt.size - 1)] / STEPS
        for _ in range(STEPS):
            dx, dv, dw = _rates(x, v, w, force[i], p)
            ex, ev, ew = _rates(x + h * dx, v + h * dv, w + h * dw, force[i], p)
            x += 0.5 * h * (dx + ex)
            v += 0.5 * h * (dv + ev)
            w += 0.5 * h * (dw + ew)


ORDER = (
    "mass", "damping", "stiffness", "hysteresis.strength", "hysteresis.travel", "cubic-stiffness.coefficient",
    "quadratic-damping.coefficient",
)  # fmt: skip


class HystereticOscillator:
    """Mass, damping and stiffness; what else there may be are the terms."""

    title = "Oscillator that may be hysteretic"
    inputs = {"oscillator/force": Quantity("N", "held until the next stamp")}
    outputs = {"oscillator/deflection": Quantity("m", "from rest")}
    sensors = ("sensor-bias", "sensor-lag", "sensor-clock-offset")  # a gain is that of mass, damping and stiffness
    parameters = {
        "mass": Parameter(unit="kg", low=0.5, high=8.0, start=1.8, scale="log"),
        "damping": Parameter(unit="N s/m", low=1.0, high=100.0, start=8.0, scale="log"),
        "stiffness": Parameter(unit="N/m", low=10000.0, high=250000.0, start=48000.0, scale="log"),
    }
    terms = (
        Term(
            id="hysteresis",
            family="a force that depends on the way that was gone",
            equation="F = strength w, w' = (x'/travel) (1 - |w| (1 + sgn(x' w))/2)",
            parameters={
                "strength": Parameter(unit="N", low=0.0, high=80.0, start=15.0, null=0.0),
                "travel": Parameter(unit="m", low=1e-4, high=5e-3, start=8e-4, scale="log"),
            },
        ),
        Term(
            id="cubic-stiffness",
            family="a stiffness that depends on deflection",
            equation="F = coefficient x^3",
            parameters={"coefficient": Parameter(unit="N/m3", low=-5e8, high=5e9, start=5e8, null=0.0)},
        ),
        Term(
            id="quadratic-damping",
            family="a resistance that grows faster than speed",
            equation="F = coefficient x' |x'|",
            parameters={"coefficient": Parameter(unit="N s2/m2", low=-100.0, high=600.0, start=60.0, null=0.0)},
        ),
    )

    def simulate(self, time, inputs, values):  # type: ignore[no-untyped-def]
        """Deflection from rest."""
        out = np.empty(time.size)
        _oscillate(np.diff(time), inputs["oscillator/force"], np.array([values[name] for name in ORDER]), out)
        return {"oscillator/deflection": out}


model = HystereticOscillator()

"""Two tanks, the upper one filled by a pump and drained into the lower one: after the cascaded tanks benchmark.

    x_1' = -k_1 sqrt x_1 + k_4 u,   x_2' = k_2 sqrt x_1 - k_3 sqrt x_2

(Schoukens, Mattsson, Wigren and Noel 2016: Torricelli's outflow; what is above the rim of the upper tank runs into the
lower one.) The pump's voltage is held over each sampling interval; Runge-Kutta of fourth order in between. Diagnosed
with: `rollover diagnose --model cascaded_tanks RECORDING...`
"""

import math

import numpy as np
from numba import njit

from ground.quantity import Quantity
from rollover import Parameter, Term

STEPS = 4  # of a sampling interval
HIGHEST = 2.0  # m, of a rim that nothing reaches


@njit
def _flows(upper, lower, pumped, k1, k2, k3, k4, leak):  # type: ignore[no-untyped-def]
    root, other = math.sqrt(max(upper, 0.0)), math.sqrt(max(lower, 0.0))
    return k4 * pumped - k1 * root - leak * upper, k2 * root - k3 * other


@njit
def _fill(dt, voltage, upper, lower, p, out):  # type: ignore[no-untyped-def]
    """Levels (n, 2) at the stamps; p in the order of `ORDER`."""
    k1, k2, k3, k4, rim, leak, lag = p
    pumped = voltage[0]
    for i in range(voltage.size):
        out[i, 0], out[i, 1] = upper, lower
        h = dt[min(i, dt.size - 1)] / STEPS
        for _ in range(STEPS):
            pumped = voltage[i] if lag <= 0.0 else voltage[i] + (pumped - voltage[i]) * math.exp(-h / lag)
            a1, b1 = _flows(upper, lower, pumped, k1, k2, k3, k4, leak)
            a2, b2 = _flows(upper + 0.5 * h * a1, lower + 0.5 * h * b1, pumped, k1, k2, k3, k4, leak)
            a3, b3 = _flows(upper + 0.5 * h * a2, lower + 0.5 * h * b2, pumped, k1, k2, k3, k4, leak)
            a4, b4 = _flows(upper + h * a3, lower + h * b3, pumped, k1, k2, k3, k4, leak)
            upper = max(upper + h * (a1 + 2.0 * a2 + 2.0 * a3 + a4) / 6.0, 0.0)
            over = max(upper - rim, 0.0)
            upper -= over
            lower = max(lower + h * (b1 + 2.0 * b2 + 2.0 * b3 + b4) / 6.0 + over, 0.0)


ORDER = ("outflow", "inflow_lower", "outflow_lower", "pump", "overflow.rim", "leak.rate", "pump-lag.time")


class CascadedTanks:
    """Outflows and the pump; what else there may be are the terms."""

    title = "Two cascaded tanks"
    inputs = {"pump/voltage": Quantity("V", "held until the next stamp")}
    outputs = {"tank/upper": Quantity("m", "level"), "tank/lower": Quantity("m", "level")}
    conditions = {"initial.upper": Quantity("m", "level at the start"), "initial.lower": Quantity("m", "the same")}
    sensors = ("sensor-bias", "sensor-clipping")  # a scale is that of the flows, a lag too short beside the levels
    parameters = {
        "outflow": Parameter(unit="m^0.5/s", low=2e-3, high=0.1, start=0.012, scale="log", meaning="k_1"),
        "inflow_lower": Parameter(unit="m^0.5/s", low=2e-3, high=0.1, start=0.012, scale="log", meaning="k_2"),
        "outflow_lower": Parameter(unit="m^0.5/s", low=2e-3, high=0.1, start=0.012, scale="log", meaning="k_3"),
        "pump": Parameter(unit="m/(V s)", low=1e-4, high=1e-2, start=9e-4, scale="log", meaning="k_4"),
    }
    terms = (
        Term(
            id="overflow",
            family="a level that cannot rise further",
            equation="x_1 <= rim, what is above runs into the lower tank",
            parameters={"rim": Parameter(unit="m", low=0.02, high=HIGHEST, start=0.2, null=HIGHEST, scale="log")},
            rivals={"sensor-clipping": "the lower level as the upper one is full: an overflow fills it"},
        ),
        Term(
            id="leak",
            family="water that is lost",
            equation="x_1' = ... - rate x_1",
            parameters={"rate": Parameter(unit="1/s", low=-0.002, high=0.02, start=0.002, null=0.0)},
        ),
        Term(
            id="pump-lag",
            family="an input that comes late",
            equation="pump follows its voltage, first order, within time",
            parameters={"time": Parameter(unit="s", low=0.0, high=60.0, start=8.0, null=0.0)},
        ),
    )

    def simulate(self, time, inputs, values):  # type: ignore[no-untyped-def]
        """Levels from those that the recording states."""
        out, p = np.empty((time.size, 2)), np.array([values[name] for name in ORDER])
        _fill(np.diff(time), inputs["pump/voltage"], values["initial.upper"], values["initial.lower"], p, out)
        return {"tank/upper": out[:, 0], "tank/lower": out[:, 1]}


model = CascadedTanks()

"""A tilt table as it runs: at which angle a wheel lifts, the axle meets its stop, and the vehicle goes over."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any

import numpy as np

from rollover.dynamics.result import Event
from rollover.dynamics.setup import Rig
from rollover.kernels import stand_devices as d
from rollover.kernels import tables as c
from rollover.kernels.tables import Tables
from rollover.scenario import Scenario
from rollover.spec.frames import matrices
from rollover.spec.stand import TiltTable
from rollover.spec.vehicle import Vehicle

AFTER = 1.2  # s that the run goes on then, to be seen
GONE = math.radians(10.0)  # roll against the table, with all uphill wheels off, from which nothing brings it back


class TiltControl:
    """Watches wheels and axle; once the vehicle goes over, the table stops."""

    def __init__(self, tilt: TiltTable, rig: Rig, scenario: Scenario) -> None:
        assert isinstance(scenario.vehicle, Vehicle)
        self.tilt, self.t = tilt, rig.tables
        self.names = [w.name for w in scenario.vehicle.wheels]
        y = np.array([self._side(rig, w.carrier, w.centre) for w in scenario.vehicle.wheels])
        self.uphill = [w for w in range(len(y)) if y[w] < float(y.mean())]
        self.events: list[Event] = []
        self.mass = np.array([body.inertia.mass for body in rig.bodies])
        self.lifted: dict[str, float] = {}
        self.stop: float | None = None
        self.all_off: float | None = None
        self.over: float | None = None
        self.since = 0.0
        self.angle = math.radians(tilt.from_deg)
        self.R0 = matrices(rig.start.q[None, 3:6])[0]

    @staticmethod
    def _side(rig: Rig, carrier: str, centre: tuple[float, float, float]) -> float:
        b = next(k for k, body in enumerate(rig.bodies) if body.name == carrier)
        R = matrices(rig.start.q[None, 6 * b + 3 : 6 * b + 6])[0]
        return float((rig.start.q[6 * b : 6 * b + 3] + R @ (np.array(centre) - rig.bodies[b].centre))[1])

    def after(self, now: float, dt: float, q: Any, qd: Any, t: Tables) -> bool:
        """Watch; the run ends a while after the vehicle went over."""
        self.angle = float(t.device_memory[0, d.K_ALONG])
        out = t.device_out
        out[c.O_DEFLECTION] = 0.0
        out[c.O_POINT : c.O_POINT + 3] = self.mass @ np.asarray(q).reshape(-1, 6)[:, :3] / self.mass.sum()
        pull = (math.sin(self.angle), -math.cos(self.angle))
        out[c.O_WAY], out[c.O_WAY + 1], out[c.O_WAY + 2] = 0.0, *pull
        if self.over is not None:
            return now < self.since + AFTER
        if dt <= 0.0:
            return True
        for w in self.uphill:
            if t.wheel_memory[w, c.E_FORCE] <= 0.0:
                if not self.lifted:
                    self._go_on(now, math.radians(self.tilt.rate_deg * self.tilt.creep))
                self.lifted.setdefault(self.names[w], self.angle)
        if self.stop is None and t.axle_f.size and abs(t.axle_memory[c.M_ANGLE]) >= t.axle_f[c.A_SWING]:
            self.stop = self.angle
        off = all(t.wheel_memory[w, c.E_FORCE] <= 0.0 for w in self.uphill)
        self.all_off = (self.all_off if self.all_off is not None else self.angle) if off else None
        turned = self.R0.T @ matrices(np.asarray(q)[None, 3:6])[0]
        if off and math.acos(min(1.0, 0.5 * (float(np.trace(turned)) - 1.0))) > GONE:
            self._went_over(now, q)
        return True

    def _go_on(self, now: float, rate: float) -> None:
        f = self.t.device_f[0]
        f[d.D_START], f[d.D_RATE], f[d.D_T0] = self.angle, rate, now

    def _went_over(self, now: float, q: Any) -> None:
        self.over, self.since = self.all_off, now
        self._go_on(now, 0.0)
        place = (float(q[0]), float(q[1]), float(q[2]))
        detail = f"table at {math.degrees(self.angle):.2f} deg, stopped there"
        self.events.append(Event(time=now, kind="overturn", subject="chassis", place=place, detail=detail))

    def results(self) -> tuple[Mapping[str, Any], ...]:
        """One: angles of the table in degrees, None for what did not happen.

        `first_lift_off_deg`: the force of the first uphill wheel vanishes; `stop_contact_deg`: the front axle meets
        its stop; `unstable_deg`: no uphill wheel touches any more, for good; `table_deg` where the table ended.
        """

        def deg(x: float | None) -> float | None:
            return None if x is None else math.degrees(x)

        return (
            {
                "kind": "tilt-table",
                "name": f"heading {self.tilt.heading_deg:g} deg",
                "status": "overturned" if self.over is not None else "stood",
                "heading_deg": self.tilt.heading_deg,
                "first_lift_off_deg": deg(min(self.lifted.values(), default=None)),
                "lift_off_deg": {name: deg(a) for name, a in self.lifted.items()},
                "stop_contact_deg": deg(self.stop),
                "unstable_deg": deg(self.over),
                "table_deg": deg(self.angle),
            },
        )

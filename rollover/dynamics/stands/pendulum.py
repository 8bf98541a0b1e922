"""A pendulum's blow as it runs: what the block had at first contact, and where that went."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from rollover.dynamics.result import Event
from rollover.dynamics.setup import Rig
from rollover.kernels import stand_devices as d
from rollover.kernels import tables as c
from rollover.kernels.tables import Tables
from rollover.spec.frames import matrices
from rollover.spec.stand import DIRECTION, PendulumBlow

CAUGHT = 0.1  # s without contact after which the block is caught: it does not strike twice


class PendulumControl:
    """Watches the face; the shares are those at the block's turning point and at the end of the contact."""

    def __init__(self, blow: PendulumBlow, rig: Rig, gravity: float) -> None:
        self.blow, self.t, self.bodies, self.gravity = blow, rig.tables, rig.bodies, gravity
        self.rops = next(b for b, body in enumerate(rig.bodies) if body.name == "rops")
        self.block = len(rig.bodies) - 1
        self.way = np.array(DIRECTION[blow.come_from])
        self.arm = rig.hinges[0].point[2]
        self.events: list[Event] = []
        self.found: dict[str, Any] = {}
        self.apart, self.lowest_speed = 0.0, 0.0
        self.before = np.zeros(c.WORKS)

    def energy(self, q: Any, qd: Any) -> float:
        """Kinetic energy of the block and its potential, zero where its centre of mass hangs lowest, J."""
        at = 6 * self.block
        v = np.asarray(qd)[at : at + 6]
        kinetic = 0.5 * v @ self.t.mass[at : at + 6, at : at + 6] @ v
        R = matrices(np.asarray(q)[None, at + 3 : at + 6])[0]
        return float(kinetic + self.blow.mass * self.gravity * self.arm * (1.0 - R[2, 2]))

    def after(self, now: float, dt: float, q: Any, qd: Any, t: Tables) -> bool:
        """Watch; never ends the run."""
        m, at = self.t.device_memory[0], 6 * self.block
        force, speed = float(m[d.K_FORCE]), float(np.asarray(qd)[at : at + 3] @ self.way)
        place = np.array(q[at : at + 3])
        if force > 0.0 and not self.found:
            self._begin(now, q, qd, speed)
        out = self.t.device_out
        out[c.O_FORCE] = force
        out[c.O_POINT : c.O_POINT + 3] = place + 0.5 * self.blow.depth * self.way
        out[c.O_WAY : c.O_WAY + 3] = self.way
        if not self.found:
            return True
        found = self.found
        out[c.O_DEFLECTION] = self._struck(q) - self.first
        out[c.O_ENERGY] = found["block_energy"] - self.energy(q, qd)
        if self.t.device_i[0, d.D_KIND] == d.OFF:
            return True
        found["peak_force"] = max(found["peak_force"], force)
        found["deflection"] = max(found["deflection"], float(out[c.O_DEFLECTION]))
        found["given_most"] = max(found["given_most"], float(out[c.O_ENERGY]))
        if speed <= 0.0 and "at_turning_point" not in found:
            found["turned_at"] = now
            found["at_turning_point"] = self._shares()
        self.apart = 0.0 if force > 0.0 else self.apart + dt
        if force > 0.0:
            at_end = self.energy(q, qd)
            found |= {"contact_ended_at": now, "rebound_speed": -speed, "block_energy_after": at_end}
            found["at_end_of_contact"] = self._shares()
        elif self.apart > CAUGHT:
            self.t.device_i[0, d.D_KIND] = d.OFF
            found["status"] = "done"
        return True

    def _begin(self, now: float, q: Any, qd: Any, speed: float) -> None:
        self.first = self._struck(q)
        self.before = self.t.work.copy()
        energy = self.energy(q, qd)
        self.found |= {
            "kind": "pendulum-blow",
            "name": f"from {self.blow.come_from}",
            "status": "not finished",
            "height": self.blow.height,
            "struck_at": now,
            "block_speed": speed,
            "block_energy": energy,
            "peak_force": 0.0,
            "deflection": 0.0,
            "given_most": 0.0,
        }
        x = np.asarray(q)[6 * self.block : 6 * self.block + 3] + 0.5 * self.blow.depth * self.way
        detail = f"{speed:.2f} m/s, {energy:.0f} J above its lowest point"
        place = (float(x[0]), float(x[1]), float(x[2]))
        self.events.append(Event(time=now, kind="blow", subject="pendulum", place=place, detail=detail))

    def _shares(self) -> dict[str, float]:
        work = self.t.work - self.before
        names = {"rops": c.ROPS, "tyres": c.TYRE, "lashings": c.LASHING, "friction": c.FRICTION_WORK, "axle": c.AXLE}
        shares = {name: float(work[k]) for name, k in names.items()}
        return shares | {"soil": float(work[c.SOIL] + work[c.COLLISION]), "contact": float(work[c.DEVICE])}

    def _struck(self, q: Any) -> float:
        at = 6 * self.rops
        R = matrices(np.asarray(q)[None, at + 3 : at + 6])[0]
        point = np.asarray(q)[at : at + 3] + R @ (np.array(self.blow.point) - self.bodies[self.rops].centre)
        return float(point @ self.way)

    def results(self) -> tuple[Mapping[str, Any], ...]:
        """The blow, or that there was none."""
        missed = {"kind": "pendulum-blow", "name": f"from {self.blow.come_from}", "status": "not struck"}
        return (self.found or missed,)

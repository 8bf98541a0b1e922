"""What drives a striker as it runs: an exciter that turns, a hammer that falls again and again."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any

import numpy as np

from ground.kernel import MASS_B
from rollover.dynamics.result import Event
from rollover.dynamics.setup import Rig
from rollover.kernels import stand_devices as d
from rollover.kernels import tables as c
from rollover.kernels.tables import Tables
from rollover.spec.excitation import Blows, Harmonic

COUNTED = (1, 2, 3, 5, 10, 20, 30, 50, 100, 200, 300, 500, 1000)  # turns after which the settlement is reported
LAST = 10  # turns at the end over which the steady motion is measured


class Shaker:
    """Switches the exciter on, and keeps how far the striker swings and settles."""

    def __init__(self, harmonic: Harmonic, rig: Rig) -> None:
        self.harmonic, self.t = harmonic, rig.tables
        self.events: list[Event] = []
        self.way: list[tuple[float, float]] = []
        self.first = float(rig.start.q[2])

    def after(self, now: float, dt: float, q: Any, qd: Any, t: Tables) -> bool:
        """Never ends the run."""
        f = self.t.device_f[0]
        if self.t.device_i[0, d.D_KIND] == d.OFF and now >= self.harmonic.start - 1e-9:
            self.t.device_i[0, d.D_KIND] = d.FORCE
            f[d.D_T0], f[d.D_SWING] = self.harmonic.start, self.harmonic.amplitude
            f[d.D_TURN] = 2.0 * math.pi * self.harmonic.frequency
            self.t.device_memory[0, d.K_ALONG] = -float(q[2])
        self.way.append((now, self.first - float(q[2])))
        show(self.t, q, self.way[-1][1], float(self.t.device_memory[0, d.K_FORCE]), self.t.device_memory[0, d.K_WORK])
        return True

    def results(self) -> tuple[Mapping[str, Any], ...]:
        """One: amplitude of force and way over the last turns, how far it settled, after how many turns."""
        time, way = np.array(self.way).T
        turns = float((time[-1] - self.harmonic.start) * self.harmonic.frequency)
        last = time >= time[-1] - LAST / self.harmonic.frequency
        settled = []
        at = (time - self.harmonic.start) * self.harmonic.frequency
        for k in (k for k in COUNTED if k <= turns):
            turn = (at > k - 1.0) & (at <= k)
            settled.append({"turns": k, "settlement": float(way[turn].mean())})
        return (
            {
                "kind": "harmonic",
                "name": "exciter",
                "status": "done" if turns > LAST else "not finished",
                "force_amplitude": self.harmonic.amplitude,
                "frequency": self.harmonic.frequency,
                "turns": turns,
                "deflection_amplitude": 0.5 * float(np.ptp(way[last])),
                "settlement": settled,
                "work": float(self.t.device_memory[0, d.K_WORK]),
            },
        )


class Hammer:
    """Strikes at fixed intervals; between two blows it keeps what the last one did.

    What is struck, mass m_t with the soil that moves along, gains dv = (1 + e) m_h (v_h - v)/(m_h + m_t) at once.
    """

    def __init__(self, blows: Blows, rig: Rig, gravity: float) -> None:
        self.blows, self.t, self.gravity = blows, rig.tables, gravity
        self.mass = rig.bodies[0].inertia.mass
        self.events: list[Event] = []
        self.found: list[dict[str, Any]] = []
        self.first = float(rig.start.q[2])
        self.given = 0.0
        self.work = np.zeros(c.WORKS)

    def after(self, now: float, dt: float, q: Any, qd: Any, t: Tables) -> bool:
        """Strike when it is time; never ends the run."""
        z, done = float(q[2]), len(self.found)
        if self.found:
            self._note(z)
        if done < self.blows.count and now >= self.blows.start + done * self.blows.interval - 1e-9:
            if self.found:
                self.found[-1]["status"] = "done"
            self._strike(now, q, qd, t)
        show(self.t, q, self.first - z, 0.0, self.given)
        return True

    def _strike(self, now: float, q: Any, qd: Any, t: Tables) -> None:
        soil = float(sum(t.memory[i, MASS_B] for i in t.active[: t.counts[c.ACTIVE]]))
        mass, hammer, e = self.mass + soil, self.blows.hammer_mass, self.blows.restitution
        fall = math.sqrt(2.0 * self.gravity * self.blows.height * self.blows.efficiency)
        before = -float(qd[2])
        after = before + (1.0 + e) * hammer * (fall - before) / (hammer + mass)
        left = fall - mass * (after - before) / hammer
        given = 0.5 * mass * (after * after - before * before)
        energy = 0.5 * hammer * fall * fall
        qd[2] = t.pose[0, c.VEL + 2] = -after
        t.work[c.DEVICE] -= given
        self.given += given
        self.work = t.work.copy()
        self.found.append(
            {
                "kind": "blow",
                "name": f"blow {len(self.found) + 1}",
                "status": "not finished",
                "struck_at": now,
                "blow_energy": energy,
                "kept_by_hammer": 0.5 * hammer * left * left,
                "lost_in_cushion": energy - 0.5 * hammer * left * left - given,
                "into_striker": given,
                "impulse": mass * (after - before),
                "from": self.first - float(q[2]),
                "deepest": self.first - float(q[2]),
            }
        )
        place = (float(q[0]), float(q[1]), float(q[2]))
        detail = f"blow {len(self.found)}: {given:.0f} of {energy:.0f} J go in"
        self.events.append(Event(time=now, kind="blow", subject="striker", place=place, detail=detail))

    def _note(self, z: float) -> None:
        entry, work = self.found[-1], self.t.work - self.work
        way = self.first - z
        entry["deepest"] = max(entry["deepest"], way)
        entry["set"] = way - entry["from"]
        entry["work_on_soil"] = float(work[c.SOIL] + work[c.COLLISION])
        entry["work_of_weight"] = self.mass * self.gravity * entry["set"]

    def results(self) -> tuple[Mapping[str, Any], ...]:
        """One for each blow; `set` is where the striker stood when the next one fell, against the one before."""
        if self.found:
            self.found[-1]["status"] = "done"
        return tuple(self.found)


def show(t: Tables, q: Any, way: float, force: float, work: float) -> None:
    """Write what is recorded of a device that pushes straight down."""
    out = t.device_out
    out[c.O_FORCE], out[c.O_DEFLECTION], out[c.O_ENERGY] = force, way, work
    out[c.O_POINT : c.O_POINT + 3] = q[:3]
    out[c.O_WAY : c.O_WAY + 3] = 0.0, 0.0, -1.0

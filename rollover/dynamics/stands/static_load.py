"""The static test of a ROPS as it runs: load after load, each to its energy or force, then released."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any, Literal

import numpy as np

from rollover.dynamics.result import Event
from rollover.dynamics.setup import Rig
from rollover.kernels import stand_devices as d
from rollover.kernels.tables import O_DEFLECTION, O_ENERGY, O_FORCE, O_POINT, O_WAY, Tables
from rollover.spec.frames import matrices
from rollover.spec.stand import DIRECTION, StaticTest
from rollover.spec.standards.static_sequence import Push

RECORDED = 0.005  # m between the points of a recorded curve; a standard asks for 0.015 m at most
START_UP = 0.02  # s in which the beam comes to its speed, or stops
STILL = 2e-4  # m/s: a deflection that goes on more slowly than this has stopped
OVERLOAD_DROP, OVERLOAD_STRETCH = 0.03, 0.05  # fall of the force over this last share of the deflection
OVERLOAD_STEP, OVERLOAD_MOST, OVERLOAD_LEAST_FORCE = 0.05, 0.20, 0.8  # of energy; of the greatest force

Stage = Literal["pause", "push", "raise", "hold", "lower", "retract", "over"]


def fall(deflection: np.ndarray, force: np.ndarray, share: float = OVERLOAD_STRETCH) -> float:
    """By how much the force ends below its greatest over the last `share` of the deflection, over the latter; (n,)."""
    last = force[deflection >= (1.0 - share) * deflection[-1]]
    return float(1.0 - last[-1] / last.max()) if last.max() > 0.0 else 0.0


def _asked(load: Push) -> float | None:
    """What the code asks, or the number of the user's own; J or N."""
    return load.asked.value if load.asked is not None else load.energy if load.energy is not None else load.force


class StaticControl:
    """Stages of each load: push | raise, hold; then retract | lower, pause."""

    def __init__(self, test: StaticTest, loads: Sequence[Push], rig: Rig) -> None:
        self.test, self.loads, self.t, self.bodies = test, loads, rig.tables, rig.bodies
        self.row = {body.name: b for b, body in enumerate(rig.bodies)}
        self.loaded = self.row[loads[0].body]
        chassis = self.row["chassis"]
        self.R = matrices(rig.start.q[None, 6 * chassis + 3 : 6 * chassis + 6])[0]
        self.events: list[Event] = []
        self.found: list[dict[str, Any]] = []
        self.stage: Stage = "pause"
        self.since, self.next = 0.0, 0
        self.curve: list[tuple[float, float]] = []
        self._aim(loads[0])
        self.first, self.target, self.still, self.force_before = 0.0, 0.0, 0.0, 0.0
        self.absorbed = False

    def after(self, now: float, dt: float, q: Any, qd: Any, t: Tables) -> bool:
        """Move on; False when the sequence is through."""
        if dt <= 0.0:
            self._show(q)
            return True
        m, f = self.t.device_memory[0], self.t.device_f[0]
        force, way = float(m[d.K_FORCE]), float(m[d.K_ALONG]) - self.first
        self._steer(now, dt)
        if self.stage in ("push", "raise", "hold"):
            self._note(way, force, dt)
        if self.stage == "push":
            self._push(now, way, force, float(m[d.K_WORK]))
        elif self.stage == "raise" and d.level(f, now) >= self.target:
            self._raised(now)
        elif self.stage == "hold" and self.still >= self.test.hold:
            self._reached(now, "reached", way, force, float(m[d.K_WORK]))
            self._release(now)
        elif (self.stage == "retract" and force <= 0.0 and f[d.D_RATE] < 0.0) or (
            self.stage == "lower" and d.level(f, now) <= 0.0
        ):
            self.t.device_i[0, d.D_KIND] = d.OFF
            m[d.K_FORCE] = m[d.K_FORCE_NOW] = 0.0
            self._go("pause", now)
        elif self.stage == "pause" and now - self.since >= self.test.pause:
            return self._next_load(now, q)
        if self.stage in ("raise", "hold", "push") and way > self.test.most_deflection:
            self._reached(
                now,
                self._failed(f"deflected by more than {1e3 * self.test.most_deflection:.0f} mm"),
                way,
                force,
                float(m[d.K_WORK]),
            )
            self._release(now)
        self._show(q)
        return True

    def _steer(self, now: float, dt: float) -> None:
        """Bring the beam to its speed over a short time: the frame's inertia would show as a blow."""
        f, wanted = self.t.device_f[0], {"push": self.test.rate, "retract": -self.test.rate}.get(self.stage)
        if wanted is None or f[d.D_RATE] == wanted:
            return
        most = self.test.rate * dt / START_UP
        f[d.D_START], f[d.D_T0] = d.level(f, now), now
        f[d.D_RATE] += min(max(wanted - float(f[d.D_RATE]), -most), most)

    def _go(self, stage: Stage, now: float) -> None:
        self.stage, self.since, self.still = stage, now, 0.0

    def _note(self, way: float, force: float, dt: float) -> None:
        speed = abs(way - self.curve[-1][0]) / dt if self.curve else 0.0
        self.still = self.still + dt if speed < STILL else 0.0
        self.curve.append((way, force))

    def _push(self, now: float, way: float, force: float, energy: float) -> None:
        load = self.loads[self.next - 1]
        assert load.energy is not None
        if self.absorbed and force < OVERLOAD_LEAST_FORCE * max(y for _, y in self.curve):
            self._reached(now, self._failed("the force fell below 0.8 of its greatest"), way, force, energy)
            self._release(now)
        if energy < self.target or self.absorbed:
            return
        entry = self.found[-1]
        x, y = np.array(self.curve).T
        drop = fall(x, y)
        extra = self.target / load.energy - 1.0
        over = entry["overload"]
        if not over:
            over |= {"fall": drop, "required": drop > OVERLOAD_DROP, "extra_energy": 0.0, "passed": None}
            entry |= {"energy_at": way}
        elif over["required"]:
            over["extra_energy"] = extra
            drop = 1.0 - force / self.force_before
            over["passed"] = drop <= OVERLOAD_DROP and force > OVERLOAD_LEAST_FORCE * float(y.max())
        if over["required"] and not over["passed"] and extra < OVERLOAD_MOST - 1e-9:
            self.target, self.force_before = self.target + OVERLOAD_STEP * load.energy, force
            return
        if load.until_failure:
            self.absorbed = True
            return
        self._reached(now, "reached", way, force, energy)
        self._release(now)

    def _raised(self, now: float) -> None:
        """The force that was given is there: hold it, or go on."""
        if not self.loads[self.next - 1].until_failure:
            self._go("hold", now)
        self.absorbed = True

    def _failed(self, how: str) -> str:
        return f"pushed on until it failed: {how}" if self.absorbed and self._going_on else f"given up: {how}"

    @property
    def _going_on(self) -> bool:
        return self.loads[self.next - 1].until_failure

    def _release(self, now: float) -> None:
        """Take the load off as it came on."""
        f, pushed = self.t.device_f[0], self.stage == "push"
        f[d.D_START], f[d.D_T0] = d.level(f, now), now
        if not pushed:
            f[d.D_RATE] = -self.test.force_rate
        self._go("retract" if pushed else "lower", now)

    def _reached(self, now: float, how: str, way: float, force: float, energy: float) -> None:
        x, y = np.array(self.curve).T
        thinned, last = [], -np.inf
        for a, b in zip(x.tolist(), y.tolist(), strict=True):
            if a >= last + RECORDED:
                thinned.append([a, b])
                last = a
        self.found[-1] |= {
            "status": how,
            "reached_at": now,
            "energy": energy,
            "deflection": way,
            "force": force,
            "peak_force": float(y.max()),
            "curve": [*thinned, [way, force]],
        }
        load = self.loads[self.next - 1]
        detail = f"{load.name} {how}: {energy:.0f} J, {1e3 * way:.0f} mm, {1e-3 * force:.1f} kN"
        self.events.append(Event(time=now, kind="load-reached", subject="rops", place=self._place(), detail=detail))

    def _next_load(self, now: float, q: Any) -> bool:
        """Book the permanent set of the load before and begin the next; False if there is none."""
        if self.found and "reached_at" in self.found[-1]:
            self.found[-1]["permanent_set"] = self._along(q) - self.first
        while self.next < len(self.loads) and not (self.loads[self.next].energy or self.loads[self.next].force):
            skipped = self.loads[self.next]
            self.found.append(self._entry(skipped, now) | {"status": "not a step of the code"})
            self.next += 1
        if self.next == len(self.loads):
            self.stage = "over"
            return False
        load = self.loads[self.next]
        self.next += 1
        f, m = self.t.device_f[0], self.t.device_memory[0]
        self._aim(load)
        self.first = self._along(q)
        m[:] = 0.0
        m[d.K_ALONG] = m[d.K_ALONG_NOW] = self.first
        f[d.D_T0] = now
        f[d.D_K], f[d.D_C] = self.test.contact_stiffness, self.test.contact_damping
        if load.energy is not None:
            kind, f[d.D_START], f[d.D_RATE], f[d.D_MOST] = d.BEAM, self.first, 0.0, np.inf
            self.target = load.energy
            self._go("push", now)
        else:
            assert load.force is not None
            most = np.inf if load.until_failure else load.force
            kind, f[d.D_START], f[d.D_RATE], f[d.D_MOST] = d.FORCE, 0.0, self.test.force_rate, most
            self.target = load.force
            self._go("raise", now)
        self.t.device_i[0, d.D_KIND], self.t.device_i[0, d.D_BODY] = kind, self.loaded
        self.curve, self.force_before, self.absorbed = [(0.0, 0.0)], 0.0, False
        self.found.append(self._entry(load, now))
        detail = f"{load.name} from {load.come_from}"
        self.events.append(Event(time=now, kind="load-begins", subject="rops", place=self._place(), detail=detail))
        return True

    def _aim(self, load: Push) -> None:
        f = self.t.device_f[0]
        self.loaded = self.row[load.body]
        f[d.D_POINT : d.D_POINT + 3] = np.array(load.point) - self.bodies[self.loaded].centre
        f[d.D_WAY : d.D_WAY + 3] = self.R @ np.array(DIRECTION[load.come_from])

    def _entry(self, load: Push, now: float) -> dict[str, Any]:
        return {
            "kind": "static-load",
            "name": load.name,
            "come_from": load.come_from,
            "status": "not finished",
            "begun_at": now,
            "required_energy": _asked(load) if load.energy is not None else None,
            "required_force": _asked(load) if load.force is not None else None,
            "given": load.energy if load.energy is not None else load.force,
            "by": None if load.asked is None else f"{load.asked.standard}: {load.asked.formula}",
            "rate": self.test.rate if load.energy is not None else None,
            "overload": {},
        }

    def _point(self, q: Any) -> np.ndarray:
        at = 6 * self.loaded
        R = matrices(np.asarray(q)[None, at + 3 : at + 6])[0]
        return np.asarray(q[at : at + 3] + R @ self.t.device_f[0, d.D_POINT : d.D_POINT + 3])

    def _along(self, q: Any) -> float:
        return float(self._point(q) @ self.t.device_f[0, d.D_WAY : d.D_WAY + 3])

    def _place(self) -> tuple[float, float, float]:
        x = self.t.device_out[O_POINT : O_POINT + 3]
        return (float(x[0]), float(x[1]), float(x[2]))

    def _show(self, q: Any) -> None:
        out, m, f = self.t.device_out, self.t.device_memory[0], self.t.device_f[0]
        point, way = self._point(q), f[d.D_WAY : d.D_WAY + 3]
        out[O_FORCE], out[O_ENERGY] = m[d.K_FORCE], m[d.K_WORK]
        out[O_DEFLECTION] = point @ way - self.first if self.found else 0.0
        # the beam stays at the ROPS, and stands back while nothing is loaded
        stands_back = 0.0 if self.t.device_i[0, d.D_KIND] != d.OFF else 0.15
        out[O_POINT : O_POINT + 3], out[O_WAY : O_WAY + 3] = point - stands_back * way, way

    def results(self) -> tuple[Mapping[str, Any], ...]:
        """One for each load that began."""
        return tuple(self.found)

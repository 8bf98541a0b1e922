"""One run: the time loop, its events and phases, the energy ledger."""

from __future__ import annotations

import math
import time as clock
from collections.abc import Callable
from dataclasses import replace
from typing import Any, Literal, cast

import numpy as np
from numpy.typing import NDArray

from ground.compiled import mark_warm
from rollover.dynamics import history, model, prescribed
from rollover.dynamics.assembly import grown
from rollover.dynamics.bodies import Body
from rollover.dynamics.history import History, States
from rollover.dynamics.result import ContactForce, Event, GroundTrack, Motion, Run
from rollover.dynamics.setup import set_up
from rollover.dynamics.stands.control import Control, control_of
from rollover.dynamics.validity import Told, flag_names
from rollover.effects import read
from rollover.kernels import tables as c
from rollover.kernels.dense import largest
from rollover.kernels.forces import generalised_forces
from rollover.kernels.step import end_of_step, keep_strain, start_step
from rollover.kernels.tables import Tables, handle
from rollover.recording import Recording
from rollover.scenario import Scenario
from rollover.spec.frames import matrices, quaternions, rotation_vector
from rollover.spec.initiation import Driving, Drop, Standing
from rollover.spec.stand import StaticTest, TiltTable
from rollover.spec.vehicle import Striker, Vehicle

Array = NDArray[np.float64]
FRAME_RATE = 100.0  # Hz, of motion for pictures
TRACK_RATE = 50.0  # Hz, of the ground's deformation
REST_SPEED = 0.02  # m/s: slower than this, all bodies, for REST_TIME is rest
REST_TIME = 0.2
RUNAWAY = 50.0  # m/s of a driven tread, 180 km/h: no vehicle that is rolled over here has gears for it

KINDS: dict[int, str] = {
    c.TOUCH: "first-touch",
    c.BRANCH_CHANGE: "branch-change",
    c.TURN: "unloading",
    c.WHEEL_OFF: "lift-off",
    c.WHEEL_ON: "touch-down",
    c.AXLE_STOP: "axle-stop",
    c.HINGE: "plastic-hinge",
    c.AXLE_BLOW: "axle-stop",
}


class DivergedError(Exception):
    """The state left what can be: not finite, or faster than anything that falls."""


def run(scenario: Scenario, *, progress: Callable[[float, float], None] | None = None) -> Run:
    """Simulate a scenario. A run that fails is returned with its sentence and what was recorded until then.

    `progress(simulated time, wall time)` is called a few times a second. Raises ``ValueError`` for a start that does
    not exist, and lets a keyboard interrupt through.
    """
    began = clock.perf_counter()
    given, scenario = scenario, scenario.applied()
    rig = set_up(scenario)
    bodies, t, start = rig.bodies, rig.tables, rig.start
    control = control_of(scenario, rig)
    settings = scenario.simulation
    h = settings.step
    steps = round((settings.duration - start.time) / h)
    every = max(1, round(settings.output_step / h))
    track_every = max(1, round(1.0 / (TRACK_RATE * every * h)))
    rows = np.zeros((steps // every + 2, history.row_length(t)))
    past = History(scenario=scenario, bodies=bodies, time=np.zeros(len(rows)), rows=rows)
    live = model.Live(tables=t, handle=handle(t))
    Q = np.zeros(len(t.spin_mass))
    t.clock[1] = start.time
    changing = prescribed.over(scenario.inputs)
    generalised_forces(live.handle, start.q, start.qd, Q)
    keep_strain(live.handle)
    generalised_forces(live.handle, start.q, start.qd, Q)
    start_step(live.handle)
    events: list[Event] = []
    seen: set[tuple[int, int]] = set()
    told = Told([scenario.ground.law, *(patch.law for patch in scenario.ground.patches)])
    touched = isinstance(scenario.initiation, (Standing, Driving))  # what balances before it falls is not at rest
    landed = {(c.TOUCH, b) for b in range(len(bodies))}
    state = {"rows": 0, "last": 0.0, "quiet": 0.0, "next": began + 0.25}

    def after_step(time: float, q: Any, qd: Any, qdd: Any) -> bool:
        t = live.tables
        now = round(start.time + time, 9)  # step times are sums: 0.6, not 0.5999999999999643
        dt = time - state["last"]  # the solver halves a step that does not converge
        state["last"] = time
        t.clock[1] = now
        end_of_step(live.handle, q, qd, qdd, dt, Q)
        _throttle(scenario, t, now)
        if t.counts[c.EVENTS] > 0:
            _collect(t, now, bodies, scenario, events, seen)
        speed = largest(qd)
        if not speed <= 1e3 or not math.isfinite(largest(Q)):
            raise DivergedError(f"diverged at t = {now:.4f} s: a velocity of {speed:.3g} (m/s or rad/s)")
        if t.counts[c.OUTSIDE] > 0:
            raise DivergedError(
                f"left the array of ground elements at t = {now:.4f} s: "
                "enlarge ground.elements.length, .width or move .centre"
            )
        if (larger := grown(t)) is not t:
            live.tables, live.handle = larger, handle(larger)
        goes_on = control is None or control.after(now, dt, q, qd, live.tables)
        live.tables.velocity[:] = qd  # a blow of the control has changed it
        k = int(state["rows"])
        if time >= k * every * h - 1e-9:
            live.tables.counts[c.FLAGS_NOW] |= told.now(live.tables)
            past.add(now, live.handle, q, qd, qdd)
            if k % track_every == 0:
                past.add_track(now, live.tables)
            state["rows"] = k + 1
        settled = largest(qd[: len(t.mass)]) < REST_SPEED and (touched or not seen.isdisjoint(landed))
        state["quiet"] = state["quiet"] + dt if settled and now > changing else 0.0
        if progress is not None and k % 20 == 0 and clock.perf_counter() >= state["next"]:
            progress(now, clock.perf_counter() - began)
            state["next"] = clock.perf_counter() + 0.25
        if state["quiet"] >= REST_TIME and "rest" not in {e.kind for e in events}:
            events.append(
                Event(time=round(now - REST_TIME, 9), kind="rest", subject=bodies[0].name, place=_point(q[:3]))
            )
            if settings.stop_at_rest:
                return False
        return goes_on

    sentence = ""
    try:
        sentence = model.solve(
            bodies=bodies,
            live=live,
            start=start,
            gravity=scenario.gravity,
            step=h,
            steps=steps,
            spectral_radius=settings.spectral_radius,
            held=rig.held,
            hinges=rig.hinges,
            after_step=after_step,
        )
        if sentence:
            sentence = f"the solver gave up at t = {past.time[max(past.count - 1, 0)]:.4f} s: {sentence}"
    except DivergedError as reason:
        sentence = str(reason)
    if sentence and (why := _runaway(scenario, live.tables)):
        sentence = f"{why} ({sentence})"
    mark_warm()
    done = _result(scenario, bodies, live.tables, past, events, control, sentence, clock.perf_counter() - began)
    if start.note and not done.sentence:
        done = replace(done, sentence=start.note)
    return done if given is scenario else replace(done, scenario=given)


def _throttle(scenario: Scenario, t: Tables, now: float) -> None:
    """What the engine may give in the next step."""
    start = scenario.initiation
    if isinstance(start, Driving) and start.drive is not None and start.drive.torque is not None:
        if start.drive.until is not None and now >= start.drive.until:
            t.drive[c.D_TORQUE] = 0.0
            return
        rising = now / start.drive.rise_time if start.drive.rise_time > 0.0 else 1.0
        t.drive[c.D_TORQUE] = start.drive.torque * min(max(rising, 0.0), 1.0)


def _runaway(scenario: Scenario, t: Tables) -> str:
    """Which driven wheel an engine without a limit has spun up, and what is missing; empty if none."""
    start, vehicle = scenario.initiation, scenario.vehicle
    if not isinstance(start, Driving) or start.drive is None or start.drive.limit_rate is not None:
        return ""
    assert isinstance(vehicle, Vehicle)
    spun = [w for w in range(len(vehicle.wheels)) if t.spin_i[w] >= 0 and t.spin_f[w, c.P_DRIVEN] > 0.0]
    rate = {w: abs(float(t.spin_memory[w, c.P_RATE_NOW])) for w in spun}
    fast = [w for w in spun if rate[w] * t.wheel_f[w, c.W_RADIUS] > RUNAWAY]
    if not fast:
        return ""
    w = max(fast, key=lambda k: rate[k])
    name, torque = (
        vehicle.wheels[w].name,
        float(t.drive[c.D_TORQUE]) if start.drive.torque is None else start.drive.torque,
    )
    return (
        f"wheel {name} runs away at t = {t.clock[1]:.4f} s: it turns at {rate[w]:.0f} rad/s, "
        f"driven with {torque:g} N m and no limit; initiation.drive.limit_rate (rad/s) is needed"
    )


def _point(x: Any) -> tuple[float, float, float]:
    return (float(x[0]), float(x[1]), float(x[2]))


def _collect(
    t: Tables, now: float, bodies: tuple[Body, ...], scenario: Scenario, events: list[Event], seen: set[tuple[int, int]]
) -> None:
    """Turn the kernel's event rows into events: the first of its kind for each subject, wheels each time."""
    vehicle = scenario.vehicle
    for k in range(int(t.counts[c.EVENTS])):
        kind, who = int(t.event[k, c.EV_KIND]), int(t.event[k, c.EV_SUBJECT])
        if (kind, who) in seen and kind not in (c.WHEEL_OFF, c.WHEEL_ON):
            continue
        seen.add((kind, who))
        value, detail = float(t.event[k, c.EV_VALUE]), ""
        if kind in (c.WHEEL_OFF, c.WHEEL_ON) and isinstance(vehicle, Vehicle):
            subject = vehicle.wheels[who].name
        elif kind == c.HINGE and isinstance(vehicle, Vehicle) and vehicle.rops is not None:
            way = "along" if value < 3 else "about"
            subject, detail = vehicle.rops.connectors[who].name, f"yields {way} {'xyz'[int(value) % 3]}"
        elif kind == c.AXLE_BLOW:
            subject, detail = "front_axle", f"strikes with {value:.3g} N m s"
        elif kind == c.AXLE_STOP:
            subject, detail = "front_axle", f"{math.degrees(value):.1f} deg"
        else:
            subject = bodies[who].name
            detail = f"{value:.3g} m/s" if kind == c.TOUCH else f"sinkage {1e3 * value:.1f} mm"
        place = _point(t.event[k, c.EV_PLACE : c.EV_PLACE + 3])
        events.append(Event(time=now, kind=cast(Any, KINDS[kind]), subject=subject, place=place, detail=detail))
    t.counts[c.EVENTS] = 0


def _result(
    scenario: Scenario,
    bodies: tuple[Body, ...],
    t: Tables,
    past: History,
    events: list[Event],
    control: Control | None,
    sentence: str,
    wall: float,
) -> Run:
    count = max(past.count, 1)
    time = past.time[:count].copy()
    s = history.states(past.rows[:count], t)
    found = history.channels(scenario, time, s, t, bodies)
    wanted = np.arange(time[0], time[-1] + 1e-9, 1.0 / FRAME_RATE)
    frames = np.unique(np.minimum(np.searchsorted(time, wanted - 1e-9), count - 1))
    track_time, element, sinkage = past.sinkage(t)
    status: Literal["done", "failed"] = "failed" if sentence else "done"
    flags = int(np.bitwise_or.reduce(s.flags))
    recording = Recording(title=scenario.title, time=time, channels=found, source="simulation")
    recording = read(scenario.effects, recording)
    return Run(
        scenario=scenario,
        status=status,
        sentence=sentence,
        recording=recording,
        flags=s.flags,
        events=tuple(sorted([*events, *(control.events if control else ())], key=lambda e: e.time)),
        phases=_phases(scenario, time, events, found["ground/force_normal"]),
        frame_time=time[frames],
        motion=_motion(s, bodies, frames) | _beam(scenario, s, frames),
        pose=_motion(s, bodies, np.arange(len(time))),
        contact=_contact(scenario, s, bodies, frames, t),
        track=GroundTrack(time=track_time, element=element, sinkage=sinkage),
        domain_flags=flag_names(flags),
        ledger={name.split("/")[1]: float(v[-1]) for name, v in found.items() if name.startswith("energy/")},
        released=_released(found),
        wall_time=wall,
        stop_time=float(time[-1]),
        tests=control.results() if control else (),
    )


def _released(found: dict[str, Array]) -> float:
    """Energy that the run had to give, J: kinetic at the start, the deepest fall, what a device or an engine put in."""
    start = found["energy/kinetic"][0] + found["energy/collision"][0]
    put_in = sum(-float(found[e].min()) for e in ("energy/device", "energy/input") if e in found)
    return float(start - found["energy/potential"].min() - found["energy/drive"].min() + put_in)


def _phases(scenario: Scenario, time: Array, events: list[Event], force: Array) -> tuple[tuple[float, str], ...]:
    """Start and name of each phase: approach or support, tipping, impact, rest; driven once an exciter is at work."""
    first = min((e.time for e in events if e.kind == "first-touch"), default=math.inf)
    rest = min((e.time for e in events if e.kind == "rest"), default=math.inf)
    wheels = isinstance(scenario.vehicle, Vehicle) and scenario.vehicle.wheels
    if isinstance(scenario.vehicle, Vehicle) and wheels:
        # a tyre's side wall leans on the ground long before anything hits it
        heavy = force > 0.1 * scenario.vehicle.whole.mass * scenario.gravity
        first = float(time[int(np.argmax(heavy))]) if heavy.any() else math.inf
    tipping = min((e.time for e in events if e.kind == "lift-off"), default=math.inf)
    if wheels and scenario.initiation.kind == "tip-over":
        tipping = float(time[0])
    dropped = isinstance(scenario.initiation, Drop)
    marks = [(float(time[0]), "support" if wheels and not dropped else "approach")]
    marks += [(at, name) for at, name in ((tipping, "tipping"), (first, "impact"), (rest, "rest")) if math.isfinite(at)]
    found = [m for k, m in enumerate(marks) if k + 1 == len(marks) or marks[k + 1][0] > m[0]]
    if scenario.excitation is not None and (start := scenario.excitation.start) <= time[-1]:
        found = [*(m for m in found if m[0] < start), (start, "driven")]  # between two blows nothing rests
    return tuple(found)


def _motion(s: States, bodies: tuple[Body, ...], frames: NDArray[np.int64]) -> dict[str, Motion]:
    found = {}
    for b, body in enumerate(bodies):
        q = s.q[frames, b]
        origin = q[:, :3] - matrices(q[:, 3:]) @ body.centre
        found[body.name] = Motion(origin=origin, quaternion=quaternions(q[:, 3:]))
    return found


def _beam(scenario: Scenario, s: States, frames: NDArray[np.int64]) -> dict[str, Motion]:
    if not isinstance(scenario.initiation, StaticTest):
        return {}
    device = s.device[frames]
    turns = np.array([rotation_vector(_facing(way)) for way in device[:, c.O_WAY : c.O_WAY + 3]])
    return {"beam": Motion(origin=device[:, c.O_POINT : c.O_POINT + 3], quaternion=quaternions(turns))}


def _facing(way: Array) -> Array:
    """Rotation whose x is a unit direction, y level."""
    level = np.array([-way[1], way[0], 0.0]) if math.hypot(way[0], way[1]) > 0.1 else np.array([0.0, 1.0, 0.0])
    level /= np.linalg.norm(level)
    return np.column_stack([way, level, np.cross(way, level)])


def _contact(
    scenario: Scenario, s: States, bodies: tuple[Body, ...], frames: NDArray[np.int64], t: Tables
) -> dict[str, ContactForce]:
    found = {}
    for b, body in enumerate(bodies):
        r = s.resultant[frames, b]
        weight = r[:, c.R_WEIGHT : c.R_WEIGHT + 1]
        loaded = np.abs(weight) > 1e-9
        point = np.where(loaded, r[:, c.R_POINT : c.R_POINT + 3] / np.where(loaded, weight, 1.0), s.q[frames, b, :3])
        force = r[:, c.R_NORMAL : c.R_NORMAL + 3] + r[:, c.R_TANGENT : c.R_TANGENT + 3]
        found[body.name] = ContactForce(point=point, force=force)
    if s.device.size:
        out = s.device[frames]
        way, size = out[:, c.O_WAY : c.O_WAY + 3], out[:, c.O_FORCE : c.O_FORCE + 1]
        name = "device"
        if isinstance(scenario.initiation, TiltTable):  # what turns there is the weight
            name, size = "weight", np.full_like(size, scenario.gravity * sum(body.inertia.mass for body in bodies))
        found[name] = ContactForce(point=out[:, c.O_POINT : c.O_POINT + 3], force=size * way)
    if isinstance(scenario.vehicle, Striker):
        return found
    for w, wheel in enumerate(scenario.vehicle.wheels):
        force = s.wheels[frames, w, :1] * s.wheels[frames, w, 7:10] + s.wheels[frames, w, 1:4]
        found[wheel.name] = ContactForce(point=s.wheels[frames, w, 4:7], force=force)
    return found

"""One run: the time loop, its events and phases, the energy ledger."""

from __future__ import annotations

import math
import time as clock
from collections.abc import Callable
from dataclasses import replace
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from ground.compiled import mark_warm
from rollover.dynamics import compiled, history
from rollover.dynamics.bodies import Body
from rollover.dynamics.history import History, States
from rollover.dynamics.recorder import SAID_EVERY, DivergedError, Live, Recorder, watch_of
from rollover.dynamics.result import ContactForce, Event, GroundTrack, Motion, Run
from rollover.dynamics.setup import set_up
from rollover.dynamics.stands.control import control_of
from rollover.dynamics.validity import flag_names
from rollover.effects import read
from rollover.kernels import tables as c
from rollover.kernels.forces import generalised_forces
from rollover.kernels.step import keep_strain, start_step
from rollover.kernels.tables import Tables, handle
from rollover.recording import Recording
from rollover.scenario import Scenario
from rollover.spec.frames import matrices, quaternions, rotation_vector
from rollover.spec.initiation import Driving, Drop
from rollover.spec.stand import StaticTest, TiltTable
from rollover.spec.vehicle import Striker, Vehicle

Array = NDArray[np.float64]
FRAME_RATE = 100.0  # Hz, of motion for pictures
RUNAWAY = 50.0  # m/s of a driven tread, 180 km/h: no vehicle that is rolled over here has gears for it


def run(scenario: Scenario, *, progress: Callable[[float, float], None] | None = None) -> Run:
    """Simulate a scenario. A run that fails is returned with its sentence and what was recorded until then.

    `progress(simulated time, wall time)` is called a few times a second. Raises ``ValueError`` for a start that does
    not exist, and lets a keyboard interrupt through.
    """
    began = clock.perf_counter()
    given, scenario = scenario, scenario.applied()
    rig = set_up(scenario)
    t, start, settings = rig.tables, rig.start, scenario.simulation
    steps = round((settings.duration - start.time) / settings.step)
    live = Live(tables=t, handle=handle(t))
    Q = np.zeros(len(t.spin_mass))
    t.clock[1] = start.time
    generalised_forces(live.handle, start.q, start.qd, Q)
    keep_strain(live.handle)
    generalised_forces(live.handle, start.q, start.qd, Q)
    start_step(live.handle)
    watch = watch_of(scenario, t, steps, start.time)
    past = History(scenario=scenario, bodies=rig.bodies, watch=watch, start=start.time)
    control = control_of(scenario, rig)
    recorder = Recorder(
        scenario=scenario,
        rig=rig,
        live=live,
        past=past,
        control=control,
        progress=progress,
        began=began,
        force=Q,
        due=began + SAID_EVERY,
    )
    sentence = ""
    try:
        if scenario.integrator == "compiled":
            sentence = compiled.solve(recorder, steps)
        else:
            from rollover.dynamics import model  # with Exudyn, which takes memory and time, and many runs do without

            sentence = model.solve(
                bodies=rig.bodies,
                live=live,
                start=start,
                gravity=scenario.gravity,
                step=settings.step,
                steps=steps,
                spectral_radius=settings.spectral_radius,
                held=rig.held,
                hinges=rig.hinges,
                after_step=recorder.after_step,
            )
        if sentence:
            sentence = f"the solver gave up at t = {past.time[-1]:.4f} s: {sentence}"
    except DivergedError as reason:
        sentence = str(reason)
    if sentence and (why := _runaway(scenario, live.tables)):
        sentence = f"{why} ({sentence})"
    mark_warm(scenario.integrator)
    done = _result(scenario, recorder, sentence, clock.perf_counter() - began)
    if start.note and not done.sentence:
        done = replace(done, sentence=start.note)
    return done if given is scenario else replace(done, scenario=given)


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


def _result(scenario: Scenario, recorder: Recorder, sentence: str, wall: float) -> Run:
    past, bodies, t = recorder.past, recorder.rig.bodies, recorder.live.tables
    events, control = recorder.events, recorder.control
    time, count = past.time, len(past.time)
    s = history.states(past.rows, t)
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

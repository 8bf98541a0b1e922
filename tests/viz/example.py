"""Runs made up by hand, so that pictures can be tested without a solver: a side overturn and a drop test.

Motion is kinematic and forces are pulses; they are plausible to look at, nothing more.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ground.array import Elements
from ground.surface import Slope
from ground.ye import Ye2006
from rollover.dynamics.result import ContactForce, Event, GroundTrack, Motion, Run
from rollover.recording import Recording
from rollover.scenario import Ground, Scenario, Simulation
from rollover.spec.connector import Connector
from rollover.spec.inertia import MassProperties
from rollover.spec.initiation import Drop, TipOver
from rollover.spec.rops import ClearanceZone, Rops
from rollover.spec.shapes import Box, Tube
from rollover.spec.vehicle import FrontAxle, Striker, Tyre, Vehicle, Wheel

Floats = NDArray[np.float64]
REAR = Tyre(radius=0.71, width=0.42, vertical_stiffness=3e5, lateral_stiffness=1.5e5)
FRONT = Tyre(radius=0.48, width=0.28, vertical_stiffness=2e5, lateral_stiffness=1e5)
SPIKE = 63_210.123  # N, one sample long


def tractor() -> Vehicle:
    """A small tractor with a two-post rear frame."""
    stiff, damp, turn = (4e6, 4e6, 8e6), (4e3, 4e3, 8e3), (8e5, 8e5, 4e5)
    return Vehicle(
        name="example tractor",
        whole=MassProperties(mass=2600.0, centre_of_mass=(0.85, 0.0, 0.78), inertia=(900.0, 2300.0, 2400.0)),
        wheels=(
            Wheel(name="rear_left", centre=(0.0, 0.76, 0.71), tyre=REAR),
            Wheel(name="rear_right", centre=(0.0, -0.76, 0.71), tyre=REAR),
            Wheel(name="front_left", centre=(2.05, 0.72, 0.48), tyre=FRONT, carrier="front_axle"),
            Wheel(name="front_right", centre=(2.05, -0.72, 0.48), tyre=FRONT, carrier="front_axle"),
        ),
        front_axle=FrontAxle(
            pivot=(2.05, 0.0, 0.52),
            body=MassProperties(mass=180.0, centre_of_mass=(2.05, 0.0, 0.5), inertia=(45.0, 6.0, 45.0)),
            swing_deg=11.0,
            stop_stiffness=2e5,
        ),
        rops=Rops(
            frame="two-post-rear",
            body=MassProperties(mass=75.0, centre_of_mass=(-0.2, 0.0, 1.75), inertia=(25.0, 14.0, 14.0)),
            mounts=(
                Connector(
                    name="left", position=(-0.2, 0.52, 0.95), stiffness=stiff, damping=damp, rotational_stiffness=turn
                ),
                Connector(
                    name="right", position=(-0.2, -0.52, 0.95), stiffness=stiff, damping=damp, rotational_stiffness=turn
                ),
            ),
            members=(
                Tube(name="left_post", start=(-0.2, 0.52, 0.95), end=(-0.25, 0.55, 2.35), diameter=0.08),
                Tube(name="right_post", start=(-0.2, -0.52, 0.95), end=(-0.25, -0.55, 2.35), diameter=0.08),
                Tube(name="crossbar", start=(-0.25, 0.55, 2.35), end=(-0.25, -0.55, 2.35), diameter=0.08),
            ),
            corner=(-0.25, 0.55, 2.35),
            clearance_zone=ClearanceZone(seat_reference_point=(0.1, 0.0, 1.15)),
        ),
        outline=(
            Box(name="bonnet", low=(1.05, -0.3, 0.75), high=(2.55, 0.3, 1.35)),
            Box(name="transmission", low=(-0.25, -0.22, 0.45), high=(1.3, 0.22, 0.85)),
            Box(name="left_fender", low=(-0.55, 0.38, 0.9), high=(0.55, 0.62, 1.22)),
            Box(name="right_fender", low=(-0.55, -0.62, 0.9), high=(0.55, -0.38, 1.22)),
            Box(name="dashboard", low=(0.85, -0.3, 0.85), high=(1.05, 0.3, 1.5)),
        ),
    )


def overturn_scenario(title: str = "Side overturn of the example tractor", slope_deg: float = 0.0) -> Scenario:
    """A tip-over to the left."""
    elements = Elements(length=8.0, width=9.0, centre=(0.9, 2.6), spacing=(0.05, 0.05))
    surface = Slope(angle_deg=slope_deg)
    return Scenario(
        title=title,
        vehicle=tractor(),
        ground=Ground(surface=surface, elements=elements, law=Ye2006()),
        initiation=TipOver(),
        simulation=Simulation(duration=3.0, step=0.001),
    )


def _corners(vehicle: Vehicle) -> dict[str, Floats]:
    bodies: dict[str, list[Floats]] = {"chassis": [], "rops": []}
    for box in vehicle.outline:
        assert isinstance(box, Box)
        axes = [(box.low[i], box.high[i]) for i in range(3)]
        bodies["chassis"] += [np.array((x, y, z)) for x in axes[0] for y in axes[1] for z in axes[2]]
    assert vehicle.rops is not None
    for tube in vehicle.rops.members:
        assert isinstance(tube, Tube)
        bodies["rops"] += [np.array(tube.start), np.array(tube.end)]
    for wheel in vehicle.wheels:
        angle = np.linspace(0.0, 2.0 * math.pi, 24, endpoint=False)
        ring = np.stack([np.cos(angle), np.zeros(24), np.sin(angle)], axis=1) * wheel.tyre.radius
        sides = (-0.5 * wheel.tyre.width, 0.5 * wheel.tyre.width)
        bodies[wheel.name] = [np.array(wheel.centre) + np.array([0.0, s, 0.0]) + p for s in sides for p in ring]
    return {name: np.array(points) for name, points in bodies.items()}


def _roll(t: Floats) -> Floats:
    """Roll towards the left as a positive angle, rad: falls, hits at 1.35 s, bounces a little, lies still."""
    falling = math.radians(42.0) * np.cosh(1.05 * np.clip(t, 0.0, None)) ** 1.0
    hit = np.clip(t - 1.35, 0.0, None)
    after = math.radians(94.0) + math.radians(6.0) * (1.0 - np.exp(-hit / 0.15)) * np.exp(-hit / 0.5)
    level = np.where(t < 1.35, falling * math.radians(94.0) / (math.radians(42.0) * math.cosh(1.05 * 1.35)), after)
    return np.asarray(np.maximum(level, math.radians(42.0)))


def overturn(*, failed: bool = False, slope_deg: float = 0.0) -> Run:
    """A tractor rolls to its left onto fender and ROPS."""
    scenario = overturn_scenario(slope_deg=slope_deg)
    vehicle = scenario.vehicle
    assert isinstance(vehicle, Vehicle)
    end = 1.5 if failed else 3.0
    time = np.round(np.arange(0.0, end + 5e-4, 0.001), 9)
    frame_time = time[::10]
    roll = _roll(frame_time)
    bodies = _corners(vehicle)
    n = frame_time.size
    # world: R about x by -roll, shifted so that the lowest point stands on the ground, 4 cm deep once it lies
    c, s = np.cos(roll), np.sin(roll)
    rotate = np.zeros((n, 3, 3))
    rotate[:, 0, 0], rotate[:, 1, 1], rotate[:, 1, 2], rotate[:, 2, 1], rotate[:, 2, 2] = 1.0, c, s, -s, c
    world = {name: np.einsum("nij,kj->nki", rotate, points) for name, points in bodies.items()}
    lowest = np.min([w[:, :, 2].min(axis=1) for w in world.values()], axis=0)
    depth = 0.05 * (1.0 - np.exp(-np.clip(frame_time - 1.3, 0.0, None) / 0.08))
    shift = np.zeros((n, 3))
    shift[:, 1] = 0.97 - rotate[:, 1, 1] * 0.97
    shift[:, 2] = -lowest - depth
    world = {name: w + shift[:, None, :] for name, w in world.items()}
    quaternion = np.stack([-np.sin(0.5 * roll), np.zeros(n), np.zeros(n), np.cos(0.5 * roll)], axis=1)
    motion = {name: Motion(origin=shift, quaternion=quaternion) for name in ("chassis", "front_axle", "rops")}

    def pulse(t: Floats, start: float, rise: float, width: float, height: float) -> Floats:
        x = np.clip(t - start, 0.0, None)
        return np.asarray(height * (1.0 - np.exp(-x / rise)) * np.exp(-((x / width) ** 2)) * (t >= start))

    def rops_force(t: Floats) -> Floats:
        return pulse(t, 1.35, 0.006, 0.12, 46e3) + pulse(t, 1.72, 0.01, 0.1, 14e3) + 2.5e3 * (t > 2.1)

    def chassis_force(t: Floats) -> Floats:
        return pulse(t, 1.31, 0.01, 0.2, 17e3) + 5e3 * (t > 1.9)

    rops_z = rops_force(time)
    spike = int(np.searchsorted(time, 1.362))
    rops_z[spike] = SPIKE
    contact = {
        name: ContactForce(
            point=np.take_along_axis(w, w[:, :, 2].argmin(axis=1)[:, None, None], axis=1)[:, 0], force=np.zeros((n, 3))
        )
        for name, w in world.items()
    }
    contact["rops"].force[:, 2] = rops_force(frame_time)
    contact["rops"].force[:, 1] = -0.3 * contact["rops"].force[:, 2]
    contact["chassis"].force[:, 2] = chassis_force(frame_time)
    standing = np.where(frame_time < 1.3, 1.0, 0.35)
    for name, weight in {"rear_left": 15e3, "front_left": 8e3}.items():
        contact[name].force[:, 2] = weight * standing
    track = _track(scenario, frame_time[::2], {b: world[b][::2] for b in ("rops", "chassis", "rear_left")})

    wheel = {
        f"wheel/{w.name}/force_normal": np.interp(time, frame_time, contact[w.name].force[:, 2]) for w in vehicle.wheels
    }
    signed = -np.interp(time, frame_time, roll)
    rate = np.gradient(signed, time)
    total = rops_z + chassis_force(time) + sum(wheel.values())
    channels: dict[str, Floats] = {
        "rops/force_x": 0.05 * rops_z,
        "rops/force_y": rops_z * np.cos(signed) * 0.9,
        "rops/force_z": rops_z * 0.3,
        "rops/force": rops_z,
        "rops/mount/left/force_x": 0.03 * rops_z,
        "rops/mount/left/force_y": 0.55 * rops_z,
        "rops/mount/left/force_z": 0.8 * rops_z,
        "rops/mount/right/force_x": 0.02 * rops_z,
        "rops/mount/right/force_y": 0.35 * rops_z,
        "rops/mount/right/force_z": -0.5 * rops_z,
        "rops/deflection": 0.9e-6 * rops_z,
        "rops/energy": 600.0 * (1.0 - np.exp(-np.clip(time - 1.35, 0.0, None) / 0.05)),
        "ground/force_normal": total,
        "ground/force_tangential": 0.3 * rops_z,
        "ground/impulse_normal": 90.0 * (time > 1.31) + 140.0 * (time > 1.35),
        "ground/sinkage": np.interp(time, track.time, track.sinkage.max(axis=1)),
        "chassis/roll": signed,
        "chassis/pitch": 0.01 * np.sin(3.0 * time),
        "chassis/yaw": 0.02 * np.sin(2.0 * time),
        "chassis/angular_velocity_x": rate,
        "chassis/angular_velocity_y": 0.02 * np.cos(3.0 * time),
        "chassis/angular_velocity_z": 0.03 * np.cos(2.0 * time),
        "chassis/position_x": np.full_like(time, 0.85),
        "chassis/position_y": np.interp(time, frame_time, shift[:, 1]),
        "chassis/position_z": np.interp(time, frame_time, shift[:, 2]) + 0.4,
        "chassis/acceleration_y": np.gradient(rate, time) * 0.8,
        "axle/front/angle": 0.19 * np.tanh(8.0 * (time - 0.3)),
        **wheel,
        "energy/kinetic": 0.5 * 2600.0 * rate**2,
        "energy/potential": 2600.0 * 9.81 * (np.interp(time, frame_time, shift[:, 2]) + 0.4),
        "energy/soil": 4200.0 * (1.0 - np.exp(-np.clip(time - 1.31, 0.0, None) / 0.1)),
        "energy/rops": 600.0 * (1.0 - np.exp(-np.clip(time - 1.35, 0.0, None) / 0.05)),
        "energy/friction": 300.0 * np.clip(time, 0.0, 2.0),
        "energy/collision": 350.0 * (time > 1.31),
        "energy/residual": 2.0 * np.sin(20.0 * time),
    }

    def at(name: str, t: float) -> tuple[float, float, float]:
        x, y, z = contact[name].point[min(int(np.searchsorted(frame_time, t)), n - 1)]
        return (float(x), float(y), float(z))

    events = (
        Event(time=0.3, kind="axle-stop", subject="axle", place=(2.05, 0.0, 0.5), detail="front axle at its left stop"),
        Event(time=0.62, kind="lift-off", subject="rear_right", place=at("rear_right", 0.62)),
        Event(time=1.31, kind="first-touch", subject="chassis", place=at("chassis", 1.31), detail="left_fender"),
        Event(time=1.35, kind="first-touch", subject="rops", place=at("rops", 1.35), detail="crossbar at 3.4 m/s"),
        Event(time=1.37, kind="branch-change", subject="rops", place=at("rops", 1.37), detail="K_b1 to K_b2"),
        Event(time=1.38, kind="plastic-hinge", subject="left", place=at("rops", 1.38), detail="yields along y"),
        Event(time=1.45, kind="unloading", subject="rops", place=at("rops", 1.45)),
        Event(time=2.6, kind="rest", subject="chassis", place=at("chassis", 2.6)),
    )
    phases = ((0.0, "support"), (0.62, "tipping"), (1.31, "impact"), (2.6, "rest"))
    return Run(
        scenario=scenario,
        status="failed" if failed else "done",
        sentence="the time step did not converge at 1.500 s after 10 halvings" if failed else "came to rest at 2.600 s",
        recording=Recording(title=scenario.title, time=time, channels=channels, source="made up"),
        events=tuple(e for e in events if e.time <= end),
        phases=tuple(p for p in phases if p[0] <= end),
        frame_time=frame_time,
        motion=motion,
        pose=motion,
        contact=contact,
        track=track,
        domain_flags=("oblique-impact", "momentum"),
        flags=np.zeros(time.size, dtype=np.int64),
        released=9000.0,
        ledger={"kinetic": 3.0, "potential": 9000.0, "soil": 4200.0, "tyre": 150.0, "rops": 600.0, "residual": 2.1},
        wall_time=4.2,
        stop_time=end,
    )


def _track(scenario: Scenario, time: Floats, bodies: dict[str, Floats]) -> GroundTrack:
    e = scenario.ground.elements
    (nx, ny), (dx, dy) = e.count, e.spacing
    x0, y0 = e.centre[0] - 0.5 * nx * dx, e.centre[1] - 0.5 * ny * dy
    deepest: dict[int, Floats] = {}
    for points in bodies.values():
        # every straight line between two points touches what lies under it
        share = np.linspace(0.0, 1.0, 25)
        pairs = [(i, j) for i in range(points.shape[1]) for j in range(i)]
        for i, j in pairs:
            line = points[:, i, None] * (1.0 - share[None, :, None]) + points[:, j, None] * share[None, :, None]
            if line[:, :, 2].min() > -0.003:
                continue
            for f, m in zip(*np.nonzero(line[:, :, 2] < -0.003), strict=True):
                ix, iy = int((line[f, m, 0] - x0) // dx), int((line[f, m, 1] - y0) // dy)
                if 0 <= ix < nx and 0 <= iy < ny:
                    column = deepest.setdefault(ix * ny + iy, np.zeros(time.size))
                    column[f] = max(column[f], -line[f, m, 2])
    element = np.array(sorted(deepest), dtype=np.int64)
    sinkage = np.stack([np.maximum.accumulate(deepest[k]) for k in element.tolist()], axis=1)
    return GroundTrack(time=time, element=element, sinkage=sinkage)


def drop(speed: float = 3.0) -> Run:
    """The striker on clay, released before t = 0."""
    scenario = Scenario(
        title=f"Drop on clay, 132 kg, {speed:.1f} m/s",
        vehicle=Striker(),
        ground=Ground(elements=Elements(length=0.98, width=0.495, spacing=(0.140, 0.045)), law=Ye2006()),
        initiation=Drop(speed=speed, lead_time=0.1),
        simulation=Simulation(duration=0.3, step=0.0005, output_step=0.0005),
    )
    time = np.round(np.arange(-0.1, 0.3 + 1e-9, 0.0005), 9)
    omega, most = 38.0, speed / 38.0
    inside = np.clip(time, 0.0, 0.5 * math.pi / omega)
    position = np.where(time < 0.0, -speed * time - 0.5 * 9.81 * time**2, -most * np.sin(omega * inside))
    force = np.where(time > 0.0, 132.0 * omega**2 * most * np.sin(omega * inside), 0.0)
    force = np.where(time > 0.5 * math.pi / omega, 132.0 * 9.81, force)
    frame_time = time[::10]
    n = frame_time.size
    origin = np.stack([np.zeros(n), np.zeros(n), position[::10]], axis=1)
    sinkage = np.maximum.accumulate(np.clip(-position, 0.0, None))
    # the element below the face
    nx, ny = scenario.ground.elements.count
    track = GroundTrack(
        time=frame_time,
        element=np.array([(nx // 2) * ny + ny // 2], dtype=np.int64),
        sinkage=sinkage[::10, None],
    )
    channels = {
        "ground/force_normal": force,
        "ground/impulse_normal": 36.0 * (time > 0.0),
        "ground/sinkage": sinkage,
        "striker/position_z": position,
        "striker/velocity_z": np.gradient(position, time),
        "striker/acceleration_z": force / 132.0 - 9.81,
        "energy/kinetic": 66.0 * np.gradient(position, time) ** 2,
        "energy/soil": np.cumsum(force * np.clip(-np.gradient(position), 0.0, None)),
        "energy/residual": 0.01 * np.sin(30.0 * time),
    }
    return Run(
        scenario=scenario,
        status="done",
        sentence="came to rest at 0.042 s",
        recording=Recording(title=scenario.title, time=time, channels=channels, source="made up"),
        events=(
            Event(time=0.0, kind="first-touch", subject="striker", place=(0.0, 0.0, 0.0), detail=f"{speed:.1f} m/s"),
            Event(time=0.012, kind="branch-change", subject="striker", place=(0.0, 0.0, -0.03)),
            Event(time=0.0415, kind="unloading", subject="striker", place=(0.0, 0.0, -most)),
        ),
        phases=((-0.1, "approach"), (0.0, "impact"), (0.0415, "rest")),
        frame_time=frame_time,
        motion={"striker": Motion(origin=origin, quaternion=np.tile([0.0, 0.0, 0.0, 1.0], (n, 1)))},
        pose={"striker": Motion(origin=origin, quaternion=np.tile([0.0, 0.0, 0.0, 1.0], (n, 1)))},
        contact={
            "striker": ContactForce(
                point=origin.copy(), force=np.stack([np.zeros(n), np.zeros(n), force[::10]], axis=1)
            )
        },
        track=track,
        domain_flags=(),
        flags=np.zeros(time.size, dtype=np.int64),
        released=650.0,
        ledger={"kinetic": 0.0, "potential": -60.0, "soil": 640.0, "collision": 55.0, "residual": 0.05},
        wall_time=0.4,
        stop_time=0.3,
    )


@dataclass(frozen=True, kw_only=True)
class Peak:
    """What `rollover.assessment.loads.PeakLoad` has."""

    channel: str
    unit: str
    raw: float
    raw_time: float
    filtered: float | None = None
    filtered_time: float | None = None
    cfc: int | None = None
    impulse: float | None = None
    domain_flags: tuple[str, ...] = ()
    half_step_change: float | None = None


def peaks(run: Run) -> tuple[Peak, ...]:
    """Peaks of some loads of the overturn; what is filtered is made up."""
    found = []
    time = run.recording.time
    for channel in ("wheel/rear_left/force_normal", "rops/mount/left/force", "ground/force_normal", "rops/force"):
        parts = [c for c in (channel, *(f"{channel}_{axis}" for axis in "xyz")) if c in run.recording.channels]
        values = run.recording[channel] if channel in parts else np.hypot.reduce([run.recording[c] for c in parts])
        at = int(np.argmax(np.abs(values)))
        found.append(
            Peak(
                channel=channel,
                unit="N",
                raw=float(values[at]),
                raw_time=float(time[at]),
                filtered=0.7 * float(values[at]),
                filtered_time=float(time[at]) + 0.008,
                cfc=60,
                impulse=5600.0 if channel == "rops/force" else None,
                domain_flags=("oblique-impact",) if channel.startswith("rops") else (),
                half_step_change=0.012,
            )
        )
    return tuple(found)

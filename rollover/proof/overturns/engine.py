"""Overturns by another engine: the tractor of a scenario as MuJoCo has it, its sensors, the forces on its ROPS.

What is the same: masses, inertias, outline, ROPS members, pivot and stops of the axle, tyre stiffness, friction,
slope, gravity, and how it begins. What is not, and makes a background that no term of the product has: a tyre is a
rigid wheel on a spring along the vehicle's height, stiff sideways (a cylinder on a slide); the ROPS is bolted on
rigidly; the ground is MuJoCo's compliant contact, without memory, layers or momentum of its own (Todorov 2014,
recalled); steps are semi-implicit ones of first order. It needs the package `mujoco`.
"""

from __future__ import annotations

import importlib.util
import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from rollover.dynamics.bodies import Body
from rollover.dynamics.setup import set_up
from rollover.proof.overturns import library
from rollover.proof.overturns.library import Draw
from rollover.recording import Recording
from rollover.scenario import Scenario
from rollover.spec.beam import Beam
from rollover.spec.frames import matrices
from rollover.spec.shapes import Box, Shape, Tube
from rollover.spec.vehicle import Vehicle, Wheel

Array = NDArray[np.float64]

STEP = 1e-4  # s: a blow of MuJoCo's contact lasts some ten milliseconds
EVERY = 5  # steps from one row to the next
SINKS = 0.08  # s, time constant of what the ground meets (MuJoCo's solref), critically damped: blows as long as on clay
TREAD = 0.05  # s, the same of a wheel, whose spring takes the most of what is not sideways
WHEEL = 0.15  # share of its carrier's mass that a wheel on its spring has at most
LIGHT = 20.0  # kg of a wheel, taken off its carrier
LOADED = 0.1  # m above the lowest wheel, within which one stands on the ground at the start
NEEDED = "mujoco, which is not installed, is needed; pip install 'rollover[proof]' installs it"
CHANNELS = (
    *(f"chassis/acceleration_{axis}" for axis in "xyz"),
    *(f"chassis/angular_velocity_{axis}" for axis in "xyz"),
    "chassis/roll",
    "rops/force_y",
    "rops/force_z",
)
# effects that act there as numbers of the scenario; a layer has no place in its ground, a yield none in its ROPS
ACTING = (
    "ground-friction", "tyre-damping", "axle-stop", "centre-of-mass", "inertia", "slope", "sensor-gain", "sensor-bias",
    "sensor-clock-offset",
)  # fmt: skip
EFFECTS: dict[str, Draw] = {id: library.EFFECTS[id] for id in ACTING}


class EngineError(RuntimeError):
    """The engine is not there, or its run failed."""


def overturn(scenario: Scenario) -> Recording:
    """`CHANNELS` of an overturn, SI, a row each `EVERY` steps from t = 0; the scenario's vehicle has wheels and a ROPS.

    Raises `EngineError` where the engine is not installed or its state is not finite.
    """
    engine = _engine()
    vehicle = scenario.vehicle
    assert isinstance(vehicle, Vehicle)
    rig = set_up(scenario)
    lab = _Tractor(scenario=scenario, vehicle=vehicle, bodies=rig.bodies, q=rig.start.q.reshape(-1, 6))
    model = engine.MjModel.from_xml_string(lab.text())
    data = engine.MjData(model)
    _begin(engine, model, data, lab, rig.start.qd.reshape(-1, 6))
    bars = np.array([g for g in range(model.ngeom) if (model.geom(g).name or "").startswith("rops:")])
    count = round(scenario.simulation.duration / STEP / EVERY) + 1
    rows = np.empty((count, len(CHANNELS)))
    for k in range(count):
        engine.mj_forward(model, data)
        rows[k] = _read(engine, model, data, bars, scenario.gravity)
        engine.mj_step(model, data, nstep=EVERY)
    if not np.all(np.isfinite(rows)):
        raise EngineError("MuJoCo's state is not finite")
    time = np.arange(count, dtype=np.float64) * EVERY * STEP
    rows[:, CHANNELS.index("chassis/roll")] = np.unwrap(rows[:, CHANNELS.index("chassis/roll")])
    return Recording(
        title=scenario.title, time=time, channels=dict(zip(CHANNELS, rows.T, strict=True)), source="MuJoCo"
    )


def is_installed() -> bool:
    """Whether the engine can be asked."""
    return importlib.util.find_spec("mujoco") is not None


def _engine() -> Any:
    try:
        import mujoco
    except ImportError as e:
        raise EngineError(NEEDED) from e
    return mujoco


def _begin(engine: Any, model: Any, data: Any, lab: _Tractor, qd: Array) -> None:
    """Velocities as the scenario begins, the axle on its pivot, each wheel as far up its spring as its load asks."""
    data.qvel[:3], data.qvel[3:6] = qd[0, :3], qd[0, 3:]
    if lab.row.get("front_axle") is not None:
        R = matrices(lab.q[:, 3:])
        turned = R[0].T @ R[lab.row["front_axle"]]
        data.joint("axle").qpos[0] = math.atan2(turned[2, 1], turned[1, 1])
        data.joint("axle").qvel[0] = qd[lab.row["front_axle"], 3] - qd[0, 3]
    engine.mj_kinematics(model, data)
    low = {w.name: _lowest(data, w, lab.normal) for w in lab.vehicle.wheels}
    down = [w for w in lab.vehicle.wheels if low[w.name] < min(low.values()) + LOADED]
    for wheel, load in zip(down, lab.loads(down), strict=True):
        up = float(data.body(f"wheel:{wheel.name}").xmat.reshape(3, 3)[2, 2])
        data.joint(f"spring:{wheel.name}").qpos[0] = load * up / wheel.tyre.vertical_stiffness
    engine.mj_kinematics(model, data)
    # a wheel's edge lies deeper than a tyre that gives sideways: it is put down on the ground
    data.qpos[2] -= min(_lowest(data, w, lab.normal) for w in down) / lab.normal[2]


def _lowest(data: Any, wheel: Wheel, normal: Array) -> float:
    """Height of a wheel's edge over the ground's plane, m."""
    geom = data.geom(f"wheel:{wheel.name}")
    lean = abs(float(geom.xmat.reshape(3, 3)[:, 2] @ normal))
    reach = wheel.tyre.radius * math.sqrt(max(1.0 - lean**2, 0.0)) + 0.5 * wheel.tyre.width * lean
    return float(geom.xpos @ normal) - reach


def _read(engine: Any, model: Any, data: Any, bars: NDArray[np.int64], gravity: float) -> Array:
    """A row of `CHANNELS`: the accelerometer without gravity, the gyroscope, the roll, what presses on the ROPS."""
    R = data.body("chassis").xmat.reshape(3, 3)
    force, one = np.zeros(3), np.zeros(6)
    for c in range(data.ncon):
        contact = data.contact[c]
        is_second = contact.geom[1] in bars
        if is_second or contact.geom[0] in bars:
            engine.mj_contactForce(model, data, c, one)
            # of the first geom on the second, in the contact's frame
            force += (1.0 if is_second else -1.0) * contact.frame.reshape(3, 3).T @ one[:3]
    acceleration = data.sensor("accelerometer").data + R.T @ np.array([0.0, 0.0, -gravity])
    pressed = R.T @ force
    roll = math.atan2(R[2, 1], R[2, 2])
    return np.array([*acceleration, *data.sensor("gyroscope").data, roll, pressed[1], pressed[2]])


@dataclass(frozen=True, kw_only=True)
class _Tractor:
    """A vehicle at its start (q of each body: centre of mass, rotation vector), to be written down as MJCF."""

    scenario: Scenario
    vehicle: Vehicle
    bodies: Sequence[Body]
    q: Array

    @property
    def row(self) -> dict[str, int]:
        """Place of each body by name."""
        return {body.name: b for b, body in enumerate(self.bodies)}

    @property
    def normal(self) -> Array:
        """Of the ground, (3,)."""
        surface = self.scenario.ground.surface
        gx, gy = getattr(surface, "gradient", (0.0, 0.0))
        return np.array([-gx, -gy, 1.0]) / math.sqrt(gx * gx + gy * gy + 1.0)

    def text(self) -> str:
        """The model as MJCF, its frame at the chassis' centre of mass."""
        mu = self.scenario.ground.friction.coefficient
        chassis = self.bodies[0].centre
        R = matrices(self.q[:1, 3:])[0]
        shapes = [_shape(s, chassis, f"outline:{s.name}", mu) for s in self.vehicle.outline]
        nested = ""
        if self.vehicle.rops is not None:
            bars = "".join(_shape(s, chassis, f"rops:{s.name}", mu) for s in self.vehicle.rops.members)
            nested += f'<body name="rops">{_inertial(self._less("rops"), chassis)}{bars}</body>'
        if self.vehicle.front_axle is not None:
            axle, b = self.vehicle.front_axle, self.row["front_axle"]
            swing, own = math.radians(axle.swing_deg), self.bodies[b].centre
            # a stop of MuJoCo's is a time constant: that of its stiffness and the axle's inertia about the pivot
            about = self.bodies[b].tensor[0, 0] + self.bodies[b].inertia.mass * float(
                np.sum((own - axle.pivot)[1:] ** 2)
            )
            stop = max(math.sqrt(about / axle.stop_stiffness), 2.0 * STEP)
            joint = (
                f'<joint name="axle" type="hinge" axis="1 0 0" pos="{_row(np.array(axle.pivot) - own)}" limited="true" '
                f'range="{-swing:.9g} {swing:.9g}" solreflimit="{stop:.6g} 1"/>'
            )
            nested += (
                f'<body name="front_axle" pos="{_row(own - chassis)}">{joint}{_inertial(self._less("front_axle"), own)}'
                f"{self._wheels('front_axle', own)}</body>"
            )
        mass = _inertial(self._less("chassis"), chassis)
        return f"""<mujoco>
  <compiler angle="radian"/>
  <option timestep="{STEP}" gravity="0 0 {-self.scenario.gravity:.9g}" integrator="implicitfast"/>
  <default><geom contype="1" conaffinity="0" condim="3" solref="{SINKS} 1"/></default>
  <worldbody>
    <geom type="plane" size="0 0 1" zaxis="{_row(self.normal)}" contype="0" conaffinity="1" friction="0.001"/>
    <body name="chassis" pos="{_row(self.q[0, :3])}" quat="{_row(_quaternion(R))}"><freejoint/>{mass}
      <site name="instruments"/>{"".join(shapes)}{self._wheels("chassis", chassis)}{nested}
    </body>
  </worldbody>
  <sensor><accelerometer name="accelerometer" site="instruments"/><gyro name="gyroscope" site="instruments"/></sensor>
</mujoco>"""

    def loads(self, wheels: Sequence[Wheel]) -> Array:
        """Static loads of those that stand, N: the weight by its lever along the vehicle, evenly from left to right."""
        weight = sum(b.inertia.mass for b in self.bodies) * self.scenario.gravity
        x = np.array([w.centre[0] for w in wheels])
        mean, apart = float(x.mean()), float(np.sum((x - x.mean()) ** 2))
        lever = (self.vehicle.whole.centre_of_mass[0] - mean) * (x - mean) / apart if apart > 0.0 else 0.0 * x
        return np.asarray(weight * (1.0 / len(wheels) + lever))

    def _carried(self, carrier: str) -> list[Wheel]:
        return [w for w in self.vehicle.wheels if w.carrier == carrier]

    def _light(self, carrier: str) -> float:
        """Mass of each wheel on a carrier, kg."""
        whole = self.bodies[self.row[carrier]].inertia.mass
        return min(LIGHT, WHEEL * whole)

    def _less(self, carrier: str) -> tuple[float, Array, Array]:
        """Mass, centre (vehicle axes) and tensor about it of a body without the wheels on their springs."""
        body = self.bodies[self.row[carrier]]
        m, centre, J = body.inertia.mass, body.centre, body.tensor
        wheels, light = self._carried(carrier), self._light(carrier)
        rest = m - light * len(wheels)
        there = (m * centre - light * sum((np.array(w.centre) for w in wheels), np.zeros(3))) / rest
        J = J + m * _about(centre - there)
        for w in wheels:
            J = J - _wheel_tensor(w, light) - light * _about(np.array(w.centre) - there)
        return rest, there, J

    def _wheels(self, carrier: str, centre: Array) -> str:
        """Wheels of a carrier: along their springs, and round where they turn by themselves."""
        found = ""
        for w in self._carried(carrier):
            tyre, light = w.tyre, self._light(carrier)
            J = np.diag(_wheel_tensor(w, light))
            spin = f'<joint name="spin:{w.name}" type="hinge" axis="0 1 0"/>' if w.rolls else ""
            found += (
                f'<body name="wheel:{w.name}" pos="{_row(np.array(w.centre) - centre)}">'
                f'<joint name="spring:{w.name}" type="slide" axis="0 0 1" stiffness="{tyre.vertical_stiffness:.9g}" '
                f'damping="{tyre.vertical_damping:.9g}"/>{spin}'
                f'<inertial pos="0 0 0" mass="{light:.9g}" diaginertia="{_row(J)}"/>'
                f'<geom name="wheel:{w.name}" type="cylinder" size="{tyre.radius:.9g} {0.5 * tyre.width:.9g}" '
                f'euler="{0.5 * math.pi:.15g} 0 0" friction="{tyre.friction:.6g}" solref="{TREAD} 1"/></body>'
            )
        return found


def _wheel_tensor(wheel: Wheel, mass: float) -> Array:
    """Tensor of a wheel's disc of this mass, about its centre, (3, 3): m r^2/2 round, m (3 r^2 + w^2)/12 across."""
    r, w = wheel.tyre.radius, wheel.tyre.width
    across = mass * (3.0 * r * r + w * w) / 12.0
    return np.diag([across, 0.5 * mass * r * r, across])


def _about(d: Array) -> Array:
    """What a unit mass at d adds to a tensor, (3, 3)."""
    return float(d @ d) * np.eye(3) - np.outer(d, d)


def _inertial(part: tuple[float, Array, Array], frame: Array) -> str:
    mass, centre, J = part
    full = _row(np.array([J[0, 0], J[1, 1], J[2, 2], J[0, 1], J[0, 2], J[1, 2]]))
    return f'<inertial pos="{_row(centre - frame)}" mass="{mass:.12g}" fullinertia="{full}"/>'


def _shape(shape: Shape | Beam, frame: Array, name: str, friction: float) -> str:
    """A geom about a frame (3,), vehicle axes."""
    if isinstance(shape, Box):
        low, high = np.array(shape.low), np.array(shape.high)
        kind = f'type="box" pos="{_row(0.5 * (low + high) - frame)}" size="{_row(0.5 * (high - low))}"'
    elif isinstance(shape, Tube):
        ends = np.concatenate([np.array(shape.start) - frame, np.array(shape.end) - frame])
        kind = f'type="capsule" fromto="{_row(ends)}" size="{0.5 * shape.diameter:.9g}"'
    else:
        raise EngineError(f"{shape.name}: no geom of MuJoCo's for {shape.kind}")
    return f'<geom name="{name}" {kind} friction="{friction:.9g}"/>'


def _quaternion(R: Array) -> Array:
    """Unit quaternion of a matrix, scalar first."""
    from scipy.spatial.transform import Rotation

    x, y, z, w = Rotation.from_matrix(R).as_quat()
    return np.array([w, x, y, z])


def _row(values: Array) -> str:
    return " ".join(f"{v:.12g}" for v in np.asarray(values, dtype=float).ravel())

"""Where each channel stands in a recording for the viewer, and how it looks: path, name, unit, colour. Data only.

Paths are ``<group>/<channel with _ for />_<unit>/<source>``, source being ``simulated``, ``measured``, ``limit``,
``neighbours`` or ``peak``, so that a measured recording or a limit joins the same plot. People read kN, deg, mm and kJ.
"""

from __future__ import annotations

import math
import re
from dataclasses import dataclass

from rollover.spec.channels import describe, entry_of, is_known

TIMELINE = "sim_time"
FOLLOWED = "world/followed"  # goes with the vehicle without turning

# 0xRRGGBBAA. The same thing has the same colour in every view: what answers the question is blue.
SIMULATED, MEASURED, LIMIT = 0x5B9BFFFF, 0xFF8C26FF, 0xF0434EFF
AXIS = {"x": 0xE78AC3FF, "y": 0x8FCB6BFF, "z": 0xB79CF5FF, "w": 0xF2F2F2FF}  # w: of a quaternion
WHEEL = {
    "front_left": 0x66D9C2FF,
    "front_right": 0xF4D35EFF,
    "rear_left": 0x2FA58BFF,
    "rear_right": 0xD99A1CFF,
}
LEDGER = {
    "kinetic": 0x5B9BFFFF,
    "potential": 0xB79CF5FF,
    "soil": 0xB98A52FF,
    "tyre": 0x2FA58BFF,
    "rops": 0xF2C81EFF,
    "friction": 0xE78AC3FF,
    "collision": 0xFF7043FF,
    "axle": 0x8FCB6BFF,
    "device": 0xFF8C26FF,
    "lashing": 0x9FB4CCFF,
    "input": 0xF4D35EFF,
    "residual": 0xF5F5F5FF,
}
BODY = {  # a body's ground force, in the plots and as the arrow in the scene
    "rops": SIMULATED,
    "rops_upper": SIMULATED,
    "striker": SIMULATED,
    "chassis": 0xF2F2F2FF,
    "ground": SIMULATED,
    "device": MEASURED,
    "weight": 0xF2F2F2FF,
    **WHEEL,
}
PHASE = {
    "approach": 0x4A5B70FF,
    "support": 0x3D6391FF,
    "tipping": 0xC2A23CFF,
    "impact": 0xC24A44FF,
    "rest": 0x3F8A4BFF,
    "driven": 0x9A6A2FFF,
    "failed": 0xF0434EFF,
}
FILTERED, SCATTER = 0xFFFFFFFF, 0x8FCB6BFF
CYCLE = (0x66D9C2FF, 0xF4D35EFF, 0xE78AC3FF, 0x8FCB6BFF, 0xB79CF5FF, 0xFF7043FF, 0x9FB4CCFF)

# SI unit -> (unit for people, factor); what is not here is shown in SI
_SHOWN = {
    "N": ("kN", 1e-3),
    "J": ("kJ", 1e-3),
    "N m": ("kN m", 1e-3),
    "rad": ("deg", 180.0 / math.pi),
    "rad/s": ("deg/s", 180.0 / math.pi),
    "m/s2": ("m/s\N{SUPERSCRIPT TWO}", 1.0),
}
_BY_CHANNEL = {
    "ground/sinkage": ("mm", 1e3),
    "rops/deflection": ("mm", 1e3),
    "rops/post/NAME/set": ("mm", 1e3),
    "device/deflection": ("mm", 1e3),
    "ground/contact_area": ("cm\N{SUPERSCRIPT TWO}", 1e4),
}


@dataclass(frozen=True, kw_only=True)
class Series:
    """How one channel is shown: value for people = value in SI x `factor`, in `unit`."""

    channel: str
    group: str  # first part of the path: loads, wheels, mounts, sinkage, motion, energy, inputs, occupant, hitch, ...
    path: str  # without the source
    name: str  # without the unit, which stands in the title of a plot
    legend: str  # shorter, where the title says the rest
    unit: str  # for people; empty if the channel is unknown
    factor: float
    colour: int

    @property
    def simulated(self) -> str:
        """Path of the simulated values."""
        return f"{self.path}/simulated"

    @property
    def measured(self) -> str:
        """Path of the measured values, in the same plot."""
        return f"{self.path}/measured"

    @property
    def scatter(self) -> str:
        """Path of the mean over neighbouring starts."""
        return f"{self.path}/neighbours"

    @property
    def residual(self) -> str:
        """Path of measured less simulated over the noise."""
        return f"residual/{self.path.rpartition('/')[2]}"

    @property
    def peak(self) -> str:
        """Path of the marker at the raw peak."""
        return f"{self.path}/peak"

    @property
    def filtered_peak(self) -> str:
        """Path of the marker at the filtered peak."""
        return f"{self.path}/filtered_peak"


def escaped(part: str) -> str:
    """One part of an entity path: what is no letter, digit, ``_``, ``-`` or ``.`` is escaped by a backslash."""
    return re.sub(r"([^\w.-])", r"\\\1", part)


def force_path(scale: float, body: str) -> str:
    """Entity of a body's ground force arrow; its name says how long the arrow is: 1 m for `scale` N."""
    return f"world/{escaped(f'forces_1m_is_{1e-3 * scale:g}kN')}/{escaped(body)}"


def force_colour(body: str) -> int:
    """Colour of a body's ground force arrow; only the ROPS's is as blue as its curve, or others were taken for it."""
    return BODY.get(body, BODY["chassis"])


def shown(unit: str) -> tuple[str, float]:
    """Unit for people and its factor, for an SI unit: ``"N" -> ("kN", 1e-3)``."""
    return _SHOWN.get(unit, (unit, 1.0))


def series(channel: str) -> Series:
    """How a channel is shown; one that the table of channels lacks goes to the group ``other``, in SI.

    ``rops/mount/NAME/force``, which has no channel, is known as the magnitude of its components.
    """
    entry = next((c for c in (channel, f"{channel}_x") if is_known(c)), None)
    group, name, colour = _describe(channel) if entry is not None else ("other", channel, _any(channel))
    own_unit = _BY_CHANNEL.get(entry_of(entry)) if entry is not None else None
    unit, factor = own_unit or shown(describe(entry).unit if entry is not None else "")
    slug = unit.replace("/", "_").replace(" ", "").replace("\N{SUPERSCRIPT TWO}", "2")
    last = "_".join(filter(None, (channel.replace("/", "_"), slug)))
    return Series(
        channel=channel,
        group=group,
        path=f"{group}/{escaped(last)}",
        name=name,
        legend=channel[-1] if group == "mounts" else name,
        unit=unit,
        factor=factor,
        colour=colour,
    )


def _describe(channel: str) -> tuple[str, str, int]:
    """Group, name for people and colour of a known channel."""
    match channel.split("/"):
        case ["device", what]:
            group = {"force": "loads", "deflection": "sinkage", "energy": "energy"}[what]
            name = "energy put in" if what == "energy" else what
            return group, f"test stand, {name}", MEASURED
        case ["input", name, what]:
            return "inputs", f"{name.replace('_', ' ')}, {what}", MEASURED
        case ["rops", *rest]:
            return _describe_rops(channel, rest)
        case ["ground", "force_normal"]:
            return "loads", "ground force", BODY["ground"]
        case ["ground", "force_tangential"]:
            return "loads", "ground force, tangential", AXIS["x"]
        case ["ground", "impulse_normal"]:
            return "loads", "collision impulse", LEDGER["collision"]
        case ["ground", "contact_area"]:
            return "sinkage", "contact area", LEDGER["soil"]
        case ["ground", "sinkage"]:
            return "sinkage", "deepest sinkage", LEDGER["soil"]
        case ["wheel", name, what]:
            spin = ", spin" if what == "spin" else ""
            return "wheels", f"wheel {name.replace('_', ' ')}{spin}", WHEEL.get(name, _any(name))
        case ["sensor", name, what]:
            group, quantity, shade = "motion", *_motion("sensor", what)
            return group, f"{name.replace('_', ' ')}: {quantity}", shade
        case ["occupant" | "hitch" | "trailer" | "suspension" | "bogie" as of, *rest]:
            return _describe_linked(of, rest)
        case ["energy", name]:
            return "energy", name, LEDGER.get(name, _any(name))
        case ["axle", name, what]:
            return "motion", f"{name} axle {what}", CYCLE[1 if what == "angle" else 2]
        case ["chassis" | "striker" as body, what]:
            return "motion", *_motion(body, what)
    return "other", channel, _any(channel)


def _describe_rops(channel: str, rest: list[str]) -> tuple[str, str, int]:
    match rest:
        case ["force"]:
            return "loads", "ROPS force", BODY["rops"]
        case ["force_x" | "force_y" | "force_z" as what]:
            return "loads", f"ROPS force, {what[-1]}", AXIS[what[-1]]
        case ["mount" | "hinge" as what, name, "force" | "moment" as load]:
            return "mounts", f"{what} {name}" + (", moment" if load == "moment" else ""), SIMULATED
        case ["mount" | "hinge" as what, name, part]:
            quantity = "" if part.startswith("force") else f"{part[:-2]} "
            return "mounts", f"{what} {name}, {quantity}{part[-1]}", AXIS[part[-1]]
        case ["impulse"]:
            return "loads", "collision impulse on the ROPS", BODY["rops"]
        case ["deflection"]:
            return "sinkage", "ROPS deflection", LEDGER["rops"]
        case ["energy"]:
            return "energy", "absorbed by the ROPS", CYCLE[0]
        case ["post", name, "set"]:
            return "sinkage", f"set of post {name}", _any(channel)
        case ["post", name, "plastic_work"]:
            return "energy", f"plastic work of post {name}", _any(channel)
        case ["post", name, "use"]:
            return "use", f"use of post {name}", _any(channel)
    return "other", channel, _any(channel)


def _describe_linked(of: str, rest: list[str]) -> tuple[str, str, int]:
    """What links hold: a trailer, a bogie, a sprung wheel, an occupant."""
    if of in ("hitch", "trailer"):
        return "hitch", f"{of} {rest[0].replace('_', ' ')}", _any(f"{of} {rest[0]}")
    if of == "bogie":
        return "suspension", *_describe_occupant([of, *rest])
    return of, *_describe_occupant(rest)


def _describe_occupant(rest: list[str]) -> tuple[str, int]:
    *where, what = (part.replace("_", " ") for part in rest)
    part = " ".join(where)
    shade = AXIS[what[-1]] if what.startswith("acceleration") else _any(f"{part} {what}")
    return f"{part}, {what}", shade


def _motion(body: str, what: str) -> tuple[str, int]:
    quantity, _, axis = what.rpartition("_")
    angle = {"roll": "x", "pitch": "y", "yaw": "z"}.get(what, axis)
    name = {"x": "roll rate", "y": "pitch rate", "z": "yaw rate"}.get(axis) if quantity == "angular_velocity" else None
    # roll is what matters in a rollover, and a striker has but one direction
    main = body == "striker" or what in ("roll", "angular_velocity_x")
    return name or (what if not quantity else f"{body} {quantity} {axis}"), SIMULATED if main else AXIS[angle]


def _any(name: str) -> int:
    """A colour that stays with a name from run to run; Python's own hash does not."""
    return CYCLE[sum(ord(c) * (i + 1) for i, c in enumerate(name)) % len(CYCLE)]

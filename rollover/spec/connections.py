"""How a member's end is held: by a fillet weld, by bolts, by a cast piece; what each resists (data only).

Resistances are nominal, with a partial factor of 1, after EN 1993-1-8 and elastic theory (both recalled): they say
whether a tube or its joint gives way first. Forces are N (tension positive), V along depth and width, M that bends
along depth and width (where it is positive, what lies at a negative place is pulled), T.
"""

from __future__ import annotations

import math
from typing import Annotated, Literal

from ground.quantity import Label, Quantity, parameters
from rollover.spec.beam import Beam
from rollover.spec.sections import MM, Section
from rollover.spec.steel import Steel

Forces = tuple[float, float, float, float, float, float]
# EN 1993-1-8 table 4.1, the correlation factor: S235, S275, S355 by their tensile strength (Pa); 1 of S420, S460
CORRELATION = ((360e6, 0.80), (430e6, 0.85), (510e6, 0.90))
# coarse threads of ISO 261: pitch by diameter, mm; tensile strength by class (Pa) and the share of it in shear, EN
# 1993-1-8 table 3.4: 0.6, of class 10.9 0.5
PITCH = {8: 1.25, 10: 1.5, 12: 1.75, 14: 2.0, 16: 2.0, 18: 2.5, 20: 2.5, 22: 2.5, 24: 3.0, 27: 3.0, 30: 3.5, 36: 4.0}
CLASSES = {"4.6": (400e6, 0.6), "5.6": (500e6, 0.6), "8.8": (800e6, 0.6), "10.9": (1000e6, 0.5)}
TENSION, INCLINED = 0.9, 1.4  # F_t = 0.9 f_ub A_s; F_v/F_v,R + F_t/(1.4 F_t,R) <= 1


@parameters
class Weld:
    """A fillet weld all around the member's outline, its stress spread as in an elastic line of the throat's width."""

    throat: Annotated[float, Quantity("mm", "a, of the fillet", above=0, most=50)]

    def use(self, forces: Forces, section: Section, steel: Steel) -> float:
        """Stress at the worst corner over f_u/(sqrt(3) beta_w), EN 1993-1-8 4.5.3.3.

        Of an outline b x h: A = 2 (b + h) a, W_h = a (b h + h^2/3), torsion 2 b h a; of a round one pi d a, pi d^2 a/4,
        pi d^2 a/2.
        """
        n, v_h, v_b, m_h, m_b, torque = forces
        a, b, h = MM * self.throat, section.width, section.depth
        if section.is_round:
            area, twist = math.pi * b * a, 0.5 * math.pi * b * b * a
            bent = math.hypot(m_h, m_b) / (0.25 * math.pi * b * b * a)
        else:
            area, twist = 2.0 * (b + h) * a, 2.0 * b * h * a
            bent = abs(m_h) / (a * h * (b + h / 3.0)) + abs(m_b) / (a * b * (h + b / 3.0))
        across = math.hypot(v_h, v_b) / area + abs(torque) / twist
        return math.hypot(abs(n) / area + bent, across) / self.strength(steel)

    @staticmethod
    def strength(steel: Steel) -> float:
        """f_u/(sqrt(3) beta_w) of the steel that is welded, Pa."""
        most = steel.tensile_strength
        return most / (math.sqrt(3.0) * next((beta for limit, beta in CORRELATION if most <= limit), 1.0))


@parameters
class Bolts:
    """Bolts through a stiff flange that turns about their middle; what presses is borne by the flange itself."""

    size: Annotated[int, Quantity("mm", "of the coarse thread: 8, 10, 12, 14, 16, 18, 20, 22, 24, 27, 30, 36", above=0)]
    grade: Annotated[Literal["4.6", "5.6", "8.8", "10.9"], "property class, ISO 898-1"] = "8.8"
    places: Annotated[
        tuple[tuple[float, float], ...], Quantity("mm", "of each, along the member's depth and width from its axis")
    ]

    def validate(self) -> None:
        """Refuse threads that there are not, and bolts in one line, about which a flange would turn."""
        if self.size not in PITCH:
            raise ValueError(f"size: no coarse thread, got M{self.size}; one of {', '.join(map(str, PITCH))}")
        if len(self.places) < 2 or min(sum(x * x for x in side) for side in self._ways) < 1.0:
            got = [list(p) for p in self.places]
            raise ValueError(f"places: in one line, got {got}; bolts on both sides of depth and width")

    @property
    def _ways(self) -> tuple[list[float], list[float]]:
        """Places along depth and width from the bolts' middle, mm."""
        sides = [[p[k] for p in self.places] for k in (0, 1)]
        p, r = ([x - sum(side) / len(side) for x in side] for side in sides)
        return p, r

    @property
    def resistances(self) -> tuple[float, float]:
        """Of one bolt to tension and to shear through its thread, N; A_s = pi (d - 0.9382 P)^2/4 (ISO 898-1)."""
        stressed = 0.25 * math.pi * (MM * (self.size - 0.9382 * PITCH[self.size])) ** 2
        strength, share = CLASSES[self.grade]
        return TENSION * strength * stressed, share * strength * stressed

    def use(self, forces: Forces, section: Section, steel: Steel) -> float:
        """Of the worst bolt: F_t/F_t,R, and F_v/F_v,R + F_t/(1.4 F_t,R); F_t = N/n - M_h p/S_p - M_b r/S_r."""
        n, v_h, v_b, m_h, m_b, torque = forces
        tension, shear = self.resistances
        (p, r), count = self._ways, len(self.places)
        second_p, second_r = MM * sum(x * x for x in p), MM * sum(x * x for x in r)
        worst = 0.0
        for x, y in zip(p, r, strict=True):
            pulled = max(n / count - m_h * x / second_p - m_b * y / second_r, 0.0)
            turned = torque / (second_p + second_r)
            sheared = math.hypot(v_h / count - turned * y, v_b / count + turned * x)
            worst = max(worst, pulled / tension, sheared / shear + pulled / (INCLINED * tension))
        return worst


@parameters
class Cast:
    """A cast piece that carries as a bar of its own section, elastically: it may break where it yields."""

    section: Section
    strength: Annotated[
        float, Quantity("Pa", "of the piece as cast: its yield strength, or what it breaks at", above=0)
    ]

    def use(self, forces: Forces, section: Section, steel: Steel) -> float:
        """Mises' stress at the outermost fibre over the strength: N/A + M/W_el, T over the plastic torsion modulus."""
        n, v_h, v_b, m_h, m_b, torque = forces
        own = self.section.properties
        if self.section.is_round:
            bent = math.hypot(m_h, m_b) / own.elastic_h
        else:
            bent = abs(m_h) / own.elastic_h + abs(m_b) / own.elastic_b
        across = math.hypot(v_h, v_b) / own.area + abs(torque) / own.plastic_torsion
        return math.hypot(abs(n) / own.area + bent, math.sqrt(3.0) * across) / self.strength


@parameters
class Connection:
    """What holds one end of a member; one of `weld`, `bolts` and `cast`."""

    name: Annotated[str, Label()]
    member: Annotated[str, "name of the member, one with a section"]
    end: Annotated[Literal["start", "end"], "which end of it is held so"]
    weld: Weld | None = None
    bolts: Bolts | None = None
    cast: Cast | None = None

    def validate(self) -> None:
        """Refuse none of them and two."""
        given = [name for name in ("weld", "bolts", "cast") if getattr(self, name) is not None]
        if len(given) != 1:
            raise ValueError(f"weld: one of weld, bolts and cast, got {' and '.join(given) or 'none'}; one of them")

    @property
    def kind(self) -> str:
        """As a drawing has it."""
        if self.weld is not None:
            return f"fillet weld, throat {self.weld.throat:g} mm"
        if self.bolts is not None:
            return f"{len(self.bolts.places)} bolts M{self.bolts.size} of class {self.bolts.grade}"
        assert self.cast is not None
        return f"cast piece, {self.cast.section.text}"

    def use(self, forces: Forces, beam: Beam) -> float:
        """What the forces at the member's end take of it: 1 where it gives way."""
        holds = self.weld or self.bolts or self.cast
        assert holds is not None
        return holds.use(forces, beam.section, beam.material)

    def resistances(self, beam: Beam) -> tuple[float, float, float]:
        """N (N), M along depth and width (N m) that it carries, each alone."""
        alone = (
            (1.0, 0.0, 0.0, 0.0, 0.0, 0.0),
            (0.0, 0.0, 0.0, 1.0, 0.0, 0.0),
            (0.0, 0.0, 0.0, 0.0, 1.0, 0.0),
        )
        n, m_h, m_b = (1.0 / self.use(one, beam) for one in alone)
        return n, m_h, m_b


def check_connections(connections: tuple[Connection, ...], beams: tuple[Beam, ...]) -> None:
    """Raise ``ValueError`` for two of a name, and for ends of members that are none."""
    names = [c.name for c in connections]
    if len(set(names)) != len(names):
        raise ValueError(f"connections: two share a name, got {names}; each name once")
    known = [b.name for b in beams]
    for c in connections:
        if c.member not in known:
            allowed = ", ".join(known) or "a member with a section"
            raise ValueError(f"connections.{c.name}.member: no member with a section, got {c.member!r}; {allowed}")

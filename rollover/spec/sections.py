"""Cross-sections of members from their dimensions: areas, moments, moduli, plate slenderness, plastic resistance.

The depth h stands along the section's first axis, the width b along its second; `h` in a name means bending that moves
the member along the depth, `b` along the width.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Annotated, Literal

from ground.quantity import Quantity, parameters

MM = 1e-3
Corners = Literal["cold-formed", "hot-finished", "sharp"]
# outer and inner corner radius over the wall: EN 10219-2 (walls up to 6, up to 10, above), EN 10210-2; recalled, and
# held against the tables of both standards in the tests
_HOT = (1.5, 1.0)
_COLD = ((6.0, (2.0, 1.0)), (10.0, (2.5, 1.5)), (math.inf, (3.0, 2.0)))
# EN 1993-1-1 table 5.2, most c/t over epsilon of classes 1, 2, 3: parts in bending, parts in compression; most d/t over
# epsilon squared of round tubes; recalled
BENT, PRESSED, ROUND = (72.0, 83.0, 124.0), (33.0, 38.0, 42.0), (50.0, 70.0, 90.0)


@dataclass(frozen=True, kw_only=True)
class Properties:
    """Of a section, SI: A (m2), I and J (m4), elastic, plastic and plastic torsion moduli (m3)."""

    area: float
    second_h: float
    second_b: float
    torsion: float
    elastic_h: float
    elastic_b: float
    plastic_h: float
    plastic_b: float
    plastic_torsion: float


@parameters
class Section:
    """A cross-section by its outside dimensions, mm: one of `tube`, `round_tube`, `solid`, `plate`, `round_bar`."""

    tube: Annotated[
        tuple[float, float, float] | None, Quantity("mm", "rectangular hollow: width b, depth h, wall t", above=0)
    ] = None
    round_tube: Annotated[tuple[float, float] | None, Quantity("mm", "round hollow: diameter d, wall t", above=0)] = (
        None
    )
    solid: Annotated[tuple[float, float] | None, Quantity("mm", "rectangular bar: width b, depth h", above=0)] = None
    plate: Annotated[tuple[float, float] | None, Quantity("mm", "flat bar: width b, depth t", above=0)] = None
    round_bar: Annotated[float | None, Quantity("mm", "round bar: diameter d", above=0)] = None
    corners: Annotated[
        Corners,
        "of a rectangular hollow section: radii after EN 10219-2 (cold-formed) or EN 10210-2 (hot-finished), or none",
    ] = "cold-formed"

    def validate(self) -> None:
        """Refuse no section and two, and walls that leave no hollow or no room for their corners."""
        given = [name for name in KINDS if getattr(self, name) is not None]
        if len(given) != 1:
            got = " and ".join(given) or "none"
            raise ValueError(f"{given[1] if given else 'tube'}: one of {', '.join(KINDS)} is needed, got {got}; one")
        if self.tube is not None:
            b, h, t = self.tube
            least = 2.0 * max(1.0, self._radii[0]) * t
            if min(b, h) <= least:
                why = "walls" if least == 2.0 * t else f"walls and {self.corners} corners"
                raise ValueError(
                    f"tube: no room for its {why}, got {[b, h, t]} mm; b and h above {least:g} mm, a thinner wall"
                    + ("" if least == 2.0 * t else ", or corners: sharp")
                )
        if self.round_tube is not None and self.round_tube[0] <= 2.0 * self.round_tube[1]:
            d, t = self.round_tube
            raise ValueError(f"round_tube: no hollow, got {[d, t]} mm; t below {0.5 * d:g} mm, or a round_bar")

    @property
    def _radii(self) -> tuple[float, float]:
        """Outer and inner corner radius over the wall."""
        assert self.tube is not None
        if self.corners == "cold-formed":
            return next(radii for most, radii in _COLD if self.tube[2] <= most)
        return _HOT if self.corners == "hot-finished" else (0.0, 0.0)

    @property
    def width(self) -> float:
        """Outside dimension b, m."""
        return MM * (self.tube or self.solid or self.plate or self.round_tube or (self.round_bar or 0.0,))[0]

    @property
    def depth(self) -> float:
        """Outside dimension h, m; of a round section its diameter."""
        flat = self.tube or self.solid or self.plate
        return self.width if flat is None else MM * flat[1]

    @property
    def wall(self) -> float | None:
        """Wall of a hollow section, m; None of a solid one."""
        hollow = self.tube or self.round_tube
        return None if hollow is None else MM * hollow[-1]

    @property
    def is_round(self) -> bool:
        """Whether it is the same in every direction."""
        return self.round_tube is not None or self.round_bar is not None

    @property
    def text(self) -> str:
        """As a drawing has it: tube 60 x 60 x 4."""
        name = next(name for name in KINDS if getattr(self, name) is not None)
        value = getattr(self, name)
        return (
            f"{name.replace('_', ' ')} {' x '.join(f'{v:g}' for v in (value if isinstance(value, tuple) else [value]))}"
        )

    @property
    def properties(self) -> Properties:
        """Area, second moments and moduli by closed form; see `hollow`, `rectangle`, `ring`."""
        if self.tube is not None:
            (b, h, t), (outer, inner) = self.tube, self._radii
            return hollow(b * MM, h * MM, t * MM, outer * t * MM, inner * t * MM)
        if self.is_round:
            return ring(self.width, self.width - 2.0 * (self.wall or 0.5 * self.width))
        return rectangle(self.width, self.depth)

    def wall_class(self, yield_strength: float) -> dict[str, int]:
        """Classes 1 to 4 by EN 1993-1-1 table 5.2, of bending along `h` and `b` and of `compression`; solid ones are 1.

        c = b - 3 t, or b - 2 t between sharp corners; epsilon = sqrt(235 MPa / f_y). A flange is a part in compression,
        a web one in bending; the worse of them counts. 4 buckles before it yields, 3 before a plastic moment, 2 before
        it turns as far as a plastic hinge has to. `yield_strength` in Pa.
        """
        squared = 235e6 / yield_strength
        if self.round_tube is not None:
            one = _class(self.round_tube[0] / self.round_tube[1] / squared, ROUND)
            return {"h": one, "b": one, "compression": one}
        if self.tube is None:
            return {"h": 1, "b": 1, "compression": 1}
        b, h, t = self.tube
        corner = 2.0 if self.corners == "sharp" else 3.0
        over_b, over_h = ((side - corner * t) / t / math.sqrt(squared) for side in (b, h))
        return {
            "h": max(_class(over_b, PRESSED), _class(over_h, BENT)),
            "b": max(_class(over_h, PRESSED), _class(over_b, BENT)),
            "compression": max(_class(over_b, PRESSED), _class(over_h, PRESSED)),
        }

    def utilisation(self, n: float, m_h: float, m_b: float) -> float:
        """EN 1993-1-1, 6.2.9: N, M_h, M_b over their plastic resistances against the limit, 1 at a plastic hinge.

        (M_h / M_N,h)^alpha + (M_b / M_N,b)^beta with the moments M_N that an axial force leaves:
        rectangular hollow M_N,h = (1 - n)/(1 - a_w/2) <= 1, a_w = (A - 2 b t)/A <= 1/2, in b with a_f = (A - 2 h t)/A,
        alpha = beta = 1.66/(1 - 1.13 n^2) <= 6; round hollow 1 - n^1.7, alpha = 2; solid 1 - n^2, alpha = beta = 1.73
        + 1.8 n^3 (round bar: 2). The value returned is the factor on both moments, so that it is linear in them.
        """
        n = min(abs(n), 1.0 - 1e-9)
        left_h = left_b = 1.0 - n * n
        power = 2.0 if self.is_round else 1.73 + 1.8 * n**3
        if self.round_tube is not None:
            left_h = left_b = 1.0 - n**1.7
        elif self.tube is not None:
            (b, h, t), area = self.tube, self.properties.area / MM**2
            left_h = min((1.0 - n) / (1.0 - 0.5 * min((area - 2.0 * b * t) / area, 0.5)), 1.0)
            left_b = min((1.0 - n) / (1.0 - 0.5 * min((area - 2.0 * h * t) / area, 0.5)), 1.0)
            bracket = 1.0 - 1.13 * n * n
            power = 6.0 if bracket <= 1.66 / 6.0 else 1.66 / bracket
        return float(((abs(m_h) / left_h) ** power + (abs(m_b) / left_b) ** power) ** (1.0 / power))


KINDS = ("tube", "round_tube", "solid", "plate", "round_bar")


def hollow(b: float, h: float, t: float, outer: float = 0.0, inner: float = 0.0) -> Properties:
    """Rectangular hollow section with corner radii r_o, r_i, after EN 10210-2 and 10219-2 annex B.

    With A_c(r) = (1 - pi/4) r^2 cut off at each corner, its centroid at h/2 - (10 - 3 pi)/(12 - 3 pi) r and its own
    second moment (1/3 - pi/16 - 1/(3 (12 - 3 pi))) r^4:
    A = b h - (b-2t)(h-2t) - 4 A_c(r_o) + 4 A_c(r_i); I and W_pl likewise from those of the rectangles, b h^3/12 and
    b h^2/4; W_el = 2 I/h. J = t^3 p/3 + 2 K A_m with p = 2 (b + h - 2t) - 2 (4 - pi) r_m and
    A_m = (b-t)(h-t) - (4 - pi) r_m^2, K = 2 A_m t/p (Bredt). Plastic torsion 2 A_m t. Lengths m.
    """

    def corner(r: float, half: float) -> tuple[float, float, float]:
        area = (1.0 - 0.25 * math.pi) * r * r
        arm = half - (10.0 - 3.0 * math.pi) / (12.0 - 3.0 * math.pi) * r
        own = (1.0 / 3.0 - math.pi / 16.0 - 1.0 / (3.0 * (12.0 - 3.0 * math.pi))) * r**4
        return area, own + area * arm * arm, area * arm

    def about(b: float, h: float) -> tuple[float, float, float]:
        """A, I and W_pl of bending along h."""
        i, j = b - 2.0 * t, h - 2.0 * t
        out, ins = corner(outer, 0.5 * h), corner(inner, 0.5 * h - t)
        whole = (b * h - i * j, (b * h**3 - i * j**3) / 12.0, (b * h**2 - i * j**2) / 4.0)
        area, second, plastic = (w - 4.0 * o + 4.0 * n for w, o, n in zip(whole, out, ins, strict=True))
        return area, second, plastic

    area, second_h, plastic_h = about(b, h)
    _, second_b, plastic_b = about(h, b)
    middle = 0.5 * (outer + inner)
    around = 2.0 * (b + h - 2.0 * t) - 2.0 * (4.0 - math.pi) * middle
    enclosed = (b - t) * (h - t) - (4.0 - math.pi) * middle**2
    return Properties(
        area=area,
        second_h=second_h,
        second_b=second_b,
        torsion=t**3 * around / 3.0 + 4.0 * enclosed**2 * t / around,
        elastic_h=2.0 * second_h / h,
        elastic_b=2.0 * second_b / b,
        plastic_h=plastic_h,
        plastic_b=plastic_b,
        plastic_torsion=2.0 * enclosed * t,
    )


def rectangle(b: float, h: float) -> Properties:
    """Rectangular bar: I = b h^3/12, W_el = b h^2/6, W_pl = b h^2/4; lengths m.

    J = a^3 c (1/3 - 0.21 (a/c)(1 - a^4/(12 c^4))) with the shorter side a and the longer c (Roark, within 0.4 %);
    plastic torsion a^2 (3 c - a)/6 (sand heap).
    """
    a, c = min(b, h), max(b, h)
    return Properties(
        area=b * h,
        second_h=b * h**3 / 12.0,
        second_b=h * b**3 / 12.0,
        torsion=a**3 * c * (1.0 / 3.0 - 0.21 * a / c * (1.0 - a**4 / (12.0 * c**4))),
        elastic_h=b * h**2 / 6.0,
        elastic_b=h * b**2 / 6.0,
        plastic_h=b * h**2 / 4.0,
        plastic_b=h * b**2 / 4.0,
        plastic_torsion=a * a * (3.0 * c - a) / 6.0,
    )


def ring(outer: float, inner: float) -> Properties:
    """Round section between two diameters: A = pi (D^2 - d^2)/4, I = pi (D^4 - d^4)/64, J = 2 I, W_pl = (D^3 - d^3)/6.

    Plastic torsion pi (D^3 - d^3)/12; lengths m, an inner diameter of 0 is a bar.
    """
    second, plastic = math.pi * (outer**4 - inner**4) / 64.0, (outer**3 - inner**3) / 6.0
    return Properties(
        area=math.pi * (outer**2 - inner**2) / 4.0,
        second_h=second,
        second_b=second,
        torsion=2.0 * second,
        elastic_h=2.0 * second / outer,
        elastic_b=2.0 * second / outer,
        plastic_h=plastic,
        plastic_b=plastic,
        plastic_torsion=math.pi * (outer**3 - inner**3) / 12.0,
    )


def _class(slenderness: float, most: tuple[float, float, float]) -> int:
    return 1 + sum(slenderness > limit for limit in most)

"""What a ground law is: parameters only; the element's memory is handed in; the table of laws.

A law says which force one element of the reference area puts against the striker while it is being
pushed deeper: the **loading curve** ``F(z, v)``. The array does the rest for every law alike: it scales by
area, latches the impact speed, lets the co-moving mass take part, unloads plastically and keeps the rut.

The whole of a new law, in one file of this folder::

    @parameters
    class Peat(GroundLaw):
        '''F = k z: a linear soil.'''

        kind: Literal["peat"] = "peat"
        stiffness: Annotated[float, Quantity("N/m", "secant stiffness on the reference face", above=0)] = 3.0e4

        @staticmethod
        @force_law
        def force(p, s, z, v):
            return p[1] * z

``p`` holds the law's numbers in the order of its fields (``p[0]`` is `GroundLaw.recovery`), ``s`` the
element's memory: ``s[SPEED]`` the latched impact speed (m/s), ``s[MASS]`` the striker's mass (kg), ``s[BRANCH]``
the sinkage at which the loading curve changes branch (m, infinite if it never does), then `hidden` states
of the law's own, which ``begin(p, s)`` sets at the touch and ``advance(p, s, z, v, h)`` moves once for each
accepted step. ``force`` only reads: it is asked several times within a step.
"""

from __future__ import annotations

import importlib
import math
import pkgutil
import sys
from dataclasses import dataclass, fields
from pathlib import Path
from typing import Annotated, Any, ClassVar, Literal

import numpy as np
from numpy.typing import NDArray

from ground.quantity import Quantity, parameters
from ground.reference import REFERENCE_AREA as REFERENCE_AREA
from ground.reference import REFERENCE_MASS as REFERENCE_MASS

# places in an element's memory s
SPEED, MASS, BRANCH, HIDDEN = 0, 1, 2, 3
# of the sinkage where two branches cross: before it the first is the less, far beyond rounding, which spares a power
BEFORE = 0.999


@dataclass(frozen=True, kw_only=True)
class Domain:
    """Where a law was calibrated; a load from outside is legal and carries a flag (see `array.FLAGS`)."""

    speed_least: float = 0.0  # m/s, normal impact speed
    speed_most: float = math.inf
    momentum_most: float = math.inf  # N s, striker mass times impact speed
    area: float = math.nan  # m2, footprint; nan: any
    virgin_only: bool = False  # no second hit on the same rut
    obliquity_most: float = math.inf  # rad, angle between approach velocity and ground normal
    calibrated: bool = True  # False: nothing was measured, or nobody says what
    sinkage_most: float = math.inf  # m, deepest that was recorded or that the law's own assumption allows

    @property
    def vector(self) -> NDArray[np.float64]:
        """The bounds as the kernel reads them."""
        return np.array(
            [self.speed_least, self.speed_most, self.momentum_most, self.area, self.virgin_only, self.obliquity_most]
        )


@parameters
class Interval:
    """What a calibration says about one number of a law."""

    of: Annotated[str, "the number's name"]
    low: Annotated[float | None, "of the interval of 95 percent; none: not bounded"] = None
    high: Annotated[float | None, "of the interval of 95 percent; none: not bounded"] = None
    origin: Annotated[
        Literal["data", "kept", "neutral"],
        "from the drops; kept as published on demand; or neutral, as the drops say nothing about it",
    ] = "data"


@parameters
class Calibration:
    """Where a law's numbers come from if not from its own source, and how far they were tested."""

    source: Annotated[str, "in words"]
    recordings: Annotated[tuple[str, ...], "name and SHA-256 of each"] = ()
    speed_least: Annotated[float, Quantity("m/s", "normal impact speed", least=0)] = 0.0
    speed_most: Annotated[float, Quantity("m/s", "normal impact speed", above=0)] = 100.0
    momentum_most: Annotated[float, Quantity("N s", "mass in the law times impact speed", above=0)] = 1e6
    area: Annotated[float | None, Quantity("m2", "footprint; none: any", above=0)] = None
    sinkage_most: Annotated[float | None, Quantity("m", "deepest that was recorded", above=0)] = None
    log_scatter: Annotated[float | None, Quantity("1", "standard deviation of ln F about the law", least=0)] = None
    multiple_correlation: Annotated[float | None, Quantity("1", "of ln K'", least=0, most=1)] = None
    intervals: tuple[Interval, ...] = ()

    @property
    def domain(self) -> Domain:
        """The same as bounds; recorded drops are virgin soil hit at a right angle."""
        return Domain(
            speed_least=self.speed_least,
            speed_most=self.speed_most,
            momentum_most=self.momentum_most,
            area=math.nan if self.area is None else self.area,
            virgin_only=True,
            obliquity_most=math.radians(10.0),
            sinkage_most=math.inf if self.sinkage_most is None else self.sinkage_most,
        )


@parameters
class GroundLaw:
    """A loading curve F(z, v) on the reference area, and how the ground unloads."""

    recovery: Annotated[
        float,
        Quantity("1", "share of the deepest sinkage that springs back: K_u = K'(z_max)/recovery", above=0, below=1),
    ] = 0.02

    calibration: Annotated[Calibration | None, "where the numbers come from, if not from the law's own source"] = None

    force: ClassVar[Any]
    begin: ClassVar[Any] = None
    advance: ClassVar[Any] = None
    hidden: ClassVar[int] = 0
    plastic: ClassVar[bool] = True  # False: the loading curve is followed in both directions
    fluid: ClassVar[bool] = False  # True: a medium that keeps no shape, without layers, crust or strength
    memoryless: ClassVar[bool] = (
        False  # True: not plastic, and nothing stays at the place: contacts go along with the body
    )

    @property
    def p(self) -> NDArray[np.float64]:
        """The law's numbers in the order of its fields."""
        values = (getattr(self, f.name) for f in fields(self))
        return np.array([v for v in values if isinstance(v, (int, float)) and not isinstance(v, bool)], dtype=float)

    @property
    def unloading_line(self) -> tuple[float, float]:
        """k_0 (N/m) and A_u (N/m2) of K_u = k_0 + A_u z_max on the reference face; both 0: by `recovery`."""
        return 0.0, 0.0

    @property
    def unloads_at_rest_stiffness(self) -> bool:
        """Whether the literal eq (6) replaces plastic unloading."""
        return False

    @property
    def domain(self) -> Domain:
        """Where the law's numbers come from; a law that has no calibration and states no domain is uncalibrated."""
        return Domain(calibrated=False) if self.calibration is None else self.calibration.domain


def laws() -> dict[str, type[GroundLaw]]:
    """Every law of this folder by its `kind`; a name given twice is an error."""
    for module in pkgutil.iter_modules([str(Path(__file__).parent)]):
        importlib.import_module(f"ground.{module.name}")
    table: dict[str, type[GroundLaw]] = {}
    todo = list(GroundLaw.__subclasses__())
    while todo:
        law = todo.pop(0)
        todo += law.__subclasses__()
        if not is_current(law):
            continue
        kind = getattr(law, "kind", None)
        if not isinstance(kind, str):
            raise TypeError(f"{law.__module__}.{law.__name__}: a law needs a field `kind` with its name as default")
        if kind in table:
            raise TypeError(f"{law.__module__}.{law.__name__}: law name {kind!r} is taken by {table[kind].__module__}")
        table[kind] = law
    return dict(sorted(table.items()))


def is_current(kind: type) -> bool:
    """Whether a class is of a module that is loaded, which has no other one of its own by that name.

    One of a file that failed to import, or of an earlier import of it, is not; one that was made by ``type`` is.
    """
    module = sys.modules.get(kind.__module__)
    held = getattr(module, kind.__name__, None)
    is_replaced = isinstance(held, type) and held is not kind and held.__module__ == kind.__module__
    return module is not None and not is_replaced


def evaluate(law: GroundLaw, z: float, v: float = 0.0, *, speed: float, mass: float = REFERENCE_MASS) -> float:
    """F(z, v) of one element of the reference area on its loading curve, N, for plots, tests and fits.

    `z` sinkage (m, positive down), `v` sinkage rate (m/s), `speed` latched impact speed (m/s), `mass` (kg).
    """
    return float(along(law, np.array([z]), np.array([v]), speed=speed, mass=mass)[0])


def along(
    law: GroundLaw,
    z: NDArray[np.float64],
    v: NDArray[np.float64],
    *,
    speed: float,
    mass: float = REFERENCE_MASS,
) -> NDArray[np.float64]:
    """F(z, v) at sinkages (n,) and their rates (n,); see `evaluate`."""
    p, s = law.p, touched(law, speed=speed, mass=mass)
    at_p, at_s, force = _address(p), _address(s), law.force.ctypes
    return np.array([force(at_p, at_s, d, u) for d, u in zip(z.tolist(), v.tolist(), strict=True)], dtype=float)


def touched(law: GroundLaw, *, speed: float, mass: float = REFERENCE_MASS) -> NDArray[np.float64]:
    """Memory of an element of this law just after its first touch."""
    s = np.zeros(HIDDEN + law.hidden)
    s[SPEED], s[MASS], s[BRANCH] = speed, mass, math.inf
    if law.begin is not None:
        p = law.p
        law.begin.ctypes(_address(p), _address(s))
    return s


def _address(array: NDArray[np.float64]) -> Any:
    import ctypes

    return array.ctypes.data_as(ctypes.POINTER(ctypes.c_double))

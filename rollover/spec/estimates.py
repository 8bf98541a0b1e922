"""Values that a start needs and a vehicle file may leave out: worked out from what it states, and said to be so."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

from rollover.spec.provenance import Provenance
from rollover.spec.vehicle import Vehicle, Wheel

# kg/m2, mass of a wheel over radius times width of its tyre; the wheels of the utility tractor, of 62 and 150 kg, have
# 492 and 510
MASS_OVER_SIZE = 500.0
# of m r^2: a front wheel as a solid disc, a rear one with more of it in rim and tyre; as the utility tractor's
FRONT, REAR = 0.5, 0.6


@dataclass(frozen=True, kw_only=True)
class Estimate:
    """A value that no file states, by its path in the scenario, and how it was found."""

    path: str
    value: float
    unit: str
    provenance: Provenance

    @property
    def plain(self) -> dict[str, Any]:
        """As results tell it."""
        return {
            "path": self.path,
            "value": self.value,
            "unit": self.unit,
            "source": self.provenance.source,
            "confidence": self.provenance.confidence,
        }


def turning_inertia(vehicle: Vehicle, wheel: Wheel) -> float:
    """Inertia of a wheel about its axle, kg m2: the stated one, else that of a wheel of its tyre's size."""
    return wheel.inertia if wheel.inertia is not None else _share(vehicle, wheel) * _mass(wheel) * wheel.tyre.radius**2


def wheel_estimates(vehicle: Vehicle) -> tuple[Estimate, ...]:
    """The inertias of wheels that turn by themselves, of those wheels that state none."""
    return tuple(
        Estimate(
            path=f"vehicle.wheels.{wheel.name}.inertia",
            value=turning_inertia(vehicle, wheel),
            unit="kg m2",
            provenance=Provenance(
                of=(f"wheels.{wheel.name}.inertia",),
                source=f"{_share(vehicle, wheel):g} m r^2 with r = {wheel.tyre.radius:g} m and m = "
                f"{MASS_OVER_SIZE:g} kg/m2 x r x {wheel.tyre.width:g} m = {_mass(wheel):.3g} kg, by the tyre's size",
                confidence="estimate",
            ),
        )
        for wheel in vehicle.wheels
        if wheel.inertia is None
    )


def in_words(estimates: tuple[Estimate, ...]) -> str:
    """The estimates in one sentence, those that were found alike together."""
    alike: dict[tuple[str, str, str], list[str]] = {}
    for e in estimates:
        alike.setdefault((f"{e.value:.3g}", e.unit, e.provenance.source), []).append(e.path)
    sentences = [f"{', '.join(paths)} = {value} {unit} ({how})" for (value, unit, how), paths in alike.items()]
    return f"Estimated, for the vehicle states none: {'; '.join(sentences)}" if sentences else ""


def _share(vehicle: Vehicle, wheel: Wheel) -> float:
    return FRONT if vehicle.on_axle(wheel, "front") else REAR


def _mass(wheel: Wheel) -> float:
    return MASS_OVER_SIZE * wheel.tyre.radius * wheel.tyre.width

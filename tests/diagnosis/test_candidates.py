"""Where effects are looked for: as far as what falls may need."""

from __future__ import annotations

import pytest

from rollover.diagnosis.selection.candidates import candidates_of, size_of
from rollover.effects import EFFECTS, Search
from tests.diagnosis.drops import scenario
from tests.physics.scenes import shipped

FORCE, ADDED, DAMPING = (
    EFFECTS[name].search[p]
    for name, p in (("guide-friction", "force"), ("mass", "added"), ("soil-viscous-damping", "damping"))
)


def looked_for(name: str, mass: float, side: float) -> dict[str, Search]:
    """Ranges for a striker so many times as heavy and with a face so many times as long."""
    own = scenario()
    striker = own.vehicle
    changed = own.replaced({"vehicle.mass": mass * striker.mass, "vehicle.face_length": side * striker.face_length})  # type: ignore[union-attr]
    return dict(next(c for c in candidates_of((), (), "drop", changed, size_of(changed)) if c.id == name).search)


def test_ranges_scale_with_the_size_of_the_striker() -> None:
    """F_c and an error of the mass go with m, damping of the reference face with m over the face."""
    assert looked_for("guide-friction", 0.5, 1.0)["force"].high == pytest.approx(0.5 * FORCE.high)
    assert looked_for("guide-friction", 4.0, 1.0)["force"].high == pytest.approx(4.0 * FORCE.high)
    assert looked_for("guide-friction", 4.0, 1.0)["force"].low == looked_for("guide-friction", 1.0, 1.0)["force"].low
    assert looked_for("mass", 4.0, 1.0)["added"] == Search(4.0 * ADDED.low, 4.0 * ADDED.high, ADDED.scale)
    assert looked_for("soil-viscous-damping", 2.0, 1.0)["damping"].high == pytest.approx(2.0 * DAMPING.high)
    assert looked_for("soil-viscous-damping", 2.0, 4.0)["damping"].high == pytest.approx(DAMPING.high)
    assert looked_for("soil-viscous-damping", 2.0, 4.0)["damping"].low == pytest.approx(0.5 * DAMPING.low / 20.0)


def test_a_vehicle_is_as_large_as_the_ranges_are_for() -> None:
    assert size_of(shipped("side_overturn")) == (1.0, 1.0)

"""Where a frame yields along a load's curve: first yield, plastic hinges in their order, mounts, strain."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from rollover.dynamics.frame.equilibrium import STATIONS, Frame
from rollover.dynamics.frame.push import Point

Array = NDArray[np.float64]
# of the plastic moment: an elastic core of a quarter of a bar's depth carries 1/48 less, (1 - (1/4)^2/3)
HINGE = 0.98
APART = 3.0  # depths between two hinges of a member: nearer ones are one plastic zone
FLAT = 0.05  # of the first stiffness: what is left where a mechanism moves


def utilisation(frame: Frame, point: Point) -> tuple[Array, Array]:
    """Of each station, (m, 3): N, M_h, M_b against first yield, and against a plastic hinge by EN 1993-1-1 6.2.9."""
    elastic, plastic = np.zeros((2, len(frame.mesh.ends), 3))
    sections = point.state.tried.sections
    for i, b in enumerate(frame.mesh.beams):
        own = frame.mesh.beam == i
        p, fy = b.section.properties, b.material.yield_strength
        n, m_h, m_b, _ = b.plastic_resistance
        s = np.abs(sections[own])
        elastic[own] = (s[..., 0] / p.area + s[..., 1] / p.elastic_h + s[..., 2] / p.elastic_b) / fy
        share = s / np.array([n, m_h, m_b])
        rows = [b.section.utilisation(*map(float, x)) for x in share.reshape(-1, 3)]
        plastic[own] = np.reshape(rows, share.shape[:2])
    return elastic, plastic


def yielding(frame: Frame, points: Sequence[Point]) -> dict[str, Any]:
    """First yield, hinges in their order, mounts that yield, mechanism force and greatest strain of a load."""
    found: dict[str, Any] = {"first_yield": None, "hinges": [], "mounts": []}
    hinges: list[tuple[int, float]] = []
    where = frame.mesh.place[:, :1] + STATIONS * np.diff(frame.mesh.place, axis=1)
    begun = np.abs(points[0].state.memory.support.plastic)
    for point in points[1:]:
        elastic, plastic = utilisation(frame, point)
        at = {"deflection": point.deflection, "force": point.force}
        if found["first_yield"] is None and elastic.max() >= 1.0:
            k = int(np.argmax(elastic.max(axis=1)))
            found["first_yield"] = {**at, "member": frame.mesh.beams[frame.mesh.beam[k]].name}
        order = np.argwhere(plastic >= HINGE)
        for k, s in sorted(map(tuple, order), key=lambda ks: -plastic[ks]):
            i, place = int(frame.mesh.beam[k]), float(where[k, s])
            b = frame.mesh.beams[i]
            if all(i != j or abs(place - x) > APART * b.section.depth for j, x in hinges):
                hinges.append((i, place))
                moment = float(np.hypot(*point.state.tried.sections[k, s, 1:]))
                found["hinges"].append({**at, "member": b.name, "place": place, "of": b.length, "moment": moment})
        slips = np.abs(point.state.memory.support.plastic) > begun + 1e-9
        for spring, axes in zip(frame.springs, slips, strict=True):
            if axes.any() and spring.name not in [m["name"] for m in found["mounts"]]:
                found["mounts"].append({**at, "name": spring.name})
    return found | _mechanism(points) | _strain(frame, points[-1])


def _mechanism(points: Sequence[Point]) -> dict[str, Any]:
    """First stiffness, and the force at which only a twentieth of it is left, None where that does not come."""
    x, y = np.array([(p.deflection, p.force) for p in points]).T
    slope = np.diff(y) / np.diff(x)
    if not len(slope):
        return {"stiffness": None, "mechanism_force": None}
    flat = np.flatnonzero(slope <= FLAT * slope[0])
    return {"stiffness": float(slope[0]), "mechanism_force": float(y[flat[0]]) if len(flat) else None}


def _strain(frame: Frame, point: Point) -> dict[str, Any]:
    """Greatest fibre strain, where it is, and over the steel's uniform strain."""
    limits = np.array([b.material.uniform_strain for b in frame.mesh.beams])[frame.mesh.beam]
    share = point.state.tried.strain.max(axis=1) / limits
    k = int(np.argmax(share))
    return {
        "strain": float(point.state.tried.strain[k].max()),
        "strain_over_uniform": float(share[k]),
        "strained": frame.mesh.beams[frame.mesh.beam[k]].name,
    }

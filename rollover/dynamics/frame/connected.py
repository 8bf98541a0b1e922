"""What the ends of members ask of their welds, bolts and cast pieces along a load's curve."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from rollover.dynamics.frame.equilibrium import Frame
from rollover.dynamics.frame.push import Point
from rollover.spec.connections import Connection, Forces


def forces_at(frame: Frame, member: int, end: str, point: Point) -> Forces:
    """N, V along depth and width, M along them (N m), T at an end of a member; V is the slope of M along its piece."""
    own = np.flatnonzero(frame.mesh.beam == member)
    own = own[np.argsort(frame.mesh.place[own, 0])]
    k, station = (own[0], 0) if end == "start" else (own[-1], 2)
    tried = point.state.tried
    n, m_h, m_b = (float(x) for x in tried.sections[k, station])
    v_h, v_b = (float(x) for x in (tried.sections[k, 2, 1:] - tried.sections[k, 0, 1:]) / frame.L[k])
    return n, v_h, v_b, m_h, m_b, float(tried.twist[k])


def connected(frame: Frame, connections: Sequence[Connection], points: Sequence[Point]) -> dict[str, Any]:
    """Greatest use of each connection in a load, where it is 1, and the first that is; nothing without connections."""
    if not connections:
        return {}
    names = [b.name for b in frame.mesh.beams]
    rows: list[dict[str, Any]] = []
    for c in connections:
        i = names.index(c.member)
        use = np.array([c.use(forces_at(frame, i, c.end, p), frame.mesh.beams[i]) for p in points])
        rows.append({"name": c.name, "use": float(use.max()), "failed": _reached(points, use)})
    failed = [row | row["failed"] for row in rows if row["failed"] is not None]
    first = min(failed, key=lambda row: row["deflection"], default=None)
    return {"connections": rows, "broken": None if first is None else first["name"]}


def _reached(points: Sequence[Point], use: np.ndarray) -> dict[str, float] | None:
    """Deflection (m), force (N) and energy (J) where the use becomes 1, on a straight line between points."""
    beyond = np.flatnonzero(use > 1.0)
    if not len(beyond):
        return None
    k = int(beyond[0])
    if k == 0:
        return {"deflection": 0.0, "force": 0.0, "energy": 0.0}
    share, last, now = float((1.0 - use[k - 1]) / (use[k] - use[k - 1])), points[k - 1], points[k]
    return {
        name: getattr(last, name) + share * (getattr(now, name) - getattr(last, name))
        for name in ("deflection", "force", "energy")
    }

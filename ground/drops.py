"""A recorded drop, from the channels to force over depth: the way in for `identify`.

Along the fall, positive downwards, a striker of mass m_s in a medium of buoyancy B and drag k_d v^2 obeys

    m_s a = m_s g - B - k_d v^2 - F_s

so that a recording without a load cell still gives F_s, from the deceleration, and one without an accelerometer gives
a. The depth is the double integral of a plus a line and a parabola (start, speed, offset of the accelerometer): where
depth was recorded these follow from it, with their covariance, which `identify` carries on; otherwise from rest, where
the speed is zero and the acceleration too. Integrating twice leaves far less noise than a displacement gauge has, so
that K' = F/z can be formed close to the surface.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from ground.reference import REFERENCE_AREA

Array = NDArray[np.float64]
LEAST_ROWS = 20  # between touch and the deepest point


class UnusableDrop(ValueError):  # noqa: N818 - it is a drop, not an error of the program
    """This recording is no drop that a law can be identified from; the text says why."""


@dataclass(frozen=True, kw_only=True)
class Drop:
    """One recorded drop; arrays (n,), SI, time zero at first contact, gaps NaN; a channel not recorded is None."""

    name: str
    time: Array
    mass: float  # kg
    speed: float  # m/s, at first contact
    area: float = REFERENCE_AREA  # m2, of the face or of the cone's base
    force: Array | None = None  # F_s, ground on striker, without the collision
    sinkage: Array | None = None  # positive down
    acceleration: Array | None = None  # coordinate acceleration, positive down: +g in free fall
    cone_height: float = 0.0  # m, of a cone whose base has the area; 0: flat face
    gravity: float = 9.81
    buoyancy: float = 0.0  # N
    drag: float = 0.0  # N s2/m2, of the medium above the ground
    zero_error: float = 0.0  # s, 1 sigma of time zero
    to_depth: float = np.inf  # m, below which its rows are of another soil


@dataclass(frozen=True, kw_only=True)
class Loading:
    """From the touch to the deepest point: what the ground did to the striker, row by row."""

    drop: Drop
    time: Array
    depth: Array  # m, of the deepest point
    rate: Array  # m/s
    force: Array  # F = F_s - m_b1 a, N: K' z of eq (3)
    noise: float  # N, one standard deviation of a row
    shapes: Array  # (n, k): what the depth may be off by, as functions of time
    covariance: Array  # (k, k) of their amounts
    deepest: float  # m
    duration: float  # s
    rest_force: float  # N, F_s of the rows at rest; nan if it was not recorded until then
    assumed: tuple[str, ...]  # what was not recorded and what stands in for it


def loading(drop: Drop, fraction: float) -> Loading:
    """Force over depth of one drop; `fraction` is m_b1/m_s. Raises `UnusableDrop`."""
    force, acceleration, assumed = _completed(drop)
    rows = np.isfinite(force) & np.isfinite(acceleration) & (drop.time >= 0.0)
    if drop.sinkage is not None:
        rows &= np.isfinite(drop.sinkage)
    t, F, a = drop.time[rows], force[rows], acceleration[rows]
    if t.size < LEAST_ROWS:
        raise UnusableDrop(f"{drop.name}: too few rows after first contact, got {t.size}; at least {LEAST_ROWS}")
    speed, depth = _integral(t, a), np.zeros_like(t)
    depth = _integral(t, speed)
    shapes = np.stack([np.ones_like(t), t, 0.5 * t**2], axis=1)
    rates = np.stack([np.zeros_like(t), np.ones_like(t), t], axis=1)
    rest = _rest(t, a, drop.gravity)
    if drop.sinkage is not None:
        recorded = drop.sinkage[rows]
        fall = slice(0, max(int(np.argmax(recorded)), LEAST_ROWS))  # at the stop the acceleration has a jump
        amounts, covariance = _line_up(shapes[fall], (recorded - depth)[fall])
    elif rest is not None:
        offset = -float(np.mean(a[rest]))
        amounts = np.array([0.0, -float(np.mean(speed[rest] + offset * t[rest])), offset])
        scatter = float(np.std(a[rest]) / np.sqrt(max(rest.sum() / 20.0, 1.0)))
        covariance = np.diag([1e-6, (scatter * t[-1]) ** 2 + 1e-6, scatter**2 + 1e-6])
        assumed = (*assumed, "depth: double integral of the acceleration, at rest at the end")
    else:
        after = drop.speed / (1.0 + fraction)
        amounts, covariance = np.array([0.0, after, 0.0]), np.diag([1e-6, (0.02 * after) ** 2, 0.05**2])
        assumed = (*assumed, "depth: double integral of the acceleration from the speed at first contact")
    if drop.sinkage is None:  # nothing else tells how deep it is where the integral begins
        covariance[0, 0] += (drop.speed * drop.zero_error) ** 2
    z, v = depth + shapes @ amounts, speed + rates @ amounts
    doubt = np.sqrt(np.einsum("ni,ij,nj->n", rates, covariance, rates))
    for factor in (2.0, 4.0):  # zero, as far as the integral can tell
        turned = v <= np.maximum(0.01 * drop.speed, factor * doubt)
        turned[: max(2, t.size // 200)] = False
        if turned.any():
            break
    if not turned.any():
        raise UnusableDrop(
            f"{drop.name}: ends before the deepest point, got {v[-1]:.3g} m/s at the end; a longer record"
        )
    last = int(np.argmax(turned))
    soft = F - fraction * drop.mass * (a + amounts[2])
    below = np.arange(t.size) <= last
    below &= z > 0.0
    noise = _noise(soft[below])  # of few rows it would be too small
    below &= np.logical_and.accumulate(z <= drop.to_depth)
    if below.sum() < LEAST_ROWS:
        raise UnusableDrop(
            f"{drop.name}: too few rows below the surface, got {int(below.sum())}; at least {LEAST_ROWS}"
        )
    return Loading(
        drop=drop,
        time=t[below],
        depth=z[below],
        rate=v[below],
        force=soft[below],
        noise=noise,
        shapes=shapes[below],
        covariance=covariance,
        deepest=float(z[: last + 1].max()),
        duration=float(t[last]),
        rest_force=float(np.mean(F[rest])) if rest is not None else float("nan"),
        assumed=assumed,
    )


def stiffness(load: Loading, points: int = 60) -> tuple[Array, Array, Array]:
    """K' = (F_s - m_b1 a)/z, eq (3), of one drop with its face: depth, K' and its standard deviation, in bins."""
    edges = np.linspace(0.0, float(load.depth.max()), points + 1)
    which = np.clip(np.digitize(load.depth, edges) - 1, 0, points - 1)
    used = [np.flatnonzero(which == k) for k in range(points)]
    used = [rows for rows in used if rows.size]
    z = np.array([load.depth[rows].mean() for rows in used])
    force = np.array([load.force[rows].mean() for rows in used])
    off = np.array([load.shapes[rows].mean(axis=0) for rows in used])
    sd_depth = np.sqrt(np.einsum("ni,ij,nj->n", off, load.covariance, off))
    noise = load.noise / np.sqrt([rows.size for rows in used])
    return z, force / z, np.hypot(noise / z, force / z**2 * sd_depth)


def rest_stiffness(load: Loading) -> float:
    """K_b3 = 9.81 m_s/z_p,max, eq (6), N/m; in a medium with the weight that is left there."""
    drop = load.drop
    return (drop.gravity * drop.mass - drop.buoyancy) / load.deepest


def covered_area(drop: Drop, depth: Array) -> Array:
    """Area that bears at a depth of the deepest point, m2: of a cone pi (R z/h)^2 up to its base."""
    if drop.cone_height <= 0.0:
        return np.full_like(depth, drop.area)
    return np.asarray(drop.area * np.clip(depth / drop.cone_height, 0.0, 1.0) ** 2)


def mean_depth(drop: Drop, depth: Array) -> Array:
    """Depth of the middle of the covered area, m: of a cone two thirds of its covered height above the tip."""
    return np.asarray(depth - 2.0 / 3.0 * np.clip(depth, 0.0, drop.cone_height))


def with_terminal_drag(drop: Drop) -> Drop:
    """The drop with the drag that balances it just before first contact: k_d = (m_s (g - a) - B)/v^2.

    A body that has fallen far through water falls at its terminal speed. Raises `UnusableDrop` if it does not.
    """
    before = (drop.time < -0.12) & (drop.time > -0.32)
    if drop.acceleration is None or before.sum() < LEAST_ROWS:
        raise UnusableDrop(f"{drop.name}: drag needs the acceleration before first contact; 0.2 s of it")
    a = float(np.nanmean(drop.acceleration[before]))
    drag = (drop.mass * (drop.gravity - a) - drop.buoyancy) / drop.speed**2
    if drag < 0.0 or abs(a) > 0.25 * drop.gravity:
        raise UnusableDrop(f"{drop.name}: not at terminal speed before first contact, got {a:.2f} m/s2; about 0")
    return replace(drop, drag=drag)


def found_contact(drop: Drop) -> Drop:
    """The drop with its clock set to first contact, and the speed there: for records that state neither.

    The speed is integrated back from rest, the accelerometer's offset taken off there. Contact is where the
    deceleration leaves the level that it had from 0.6 to 0.2 s before its peak, for the last time before the peak, by
    three standard deviations; in soft ground that is known to some hundredths of a metre only, see
    `penetration.CONTACT_ERROR`. Raises `UnusableDrop` for what is no drop: no steady fall before, no rest behind.
    """
    if drop.acceleration is None:
        raise UnusableDrop(f"{drop.name}: neither clock nor speed is stated; they are found from an acceleration only")
    rows = np.isfinite(drop.acceleration)
    t, a = drop.time[rows], drop.acceleration[rows]
    rest = _rest(t, a, drop.gravity)
    if rest is None:
        raise UnusableDrop(f"{drop.name}: not at rest at the end; a record that goes on until it is")
    a = a - np.mean(a[rest])
    speed = _integral(t, a)
    speed -= np.mean(speed[rest])
    peak = int(np.argmin(a))
    before = (t > t[peak] - 0.6) & (t < t[peak] - 0.2)
    if before.sum() < LEAST_ROWS or speed[before].mean() < 0.5:
        raise UnusableDrop(f"{drop.name}: no fall of 0.5 m/s and more before the largest deceleration")
    level, spread = float(np.mean(a[before])), float(np.std(a[before]))
    still = np.flatnonzero(a[:peak] > level - 3.0 * spread)
    contact = int(still[-1])
    if speed[contact] < 0.5 * speed[before].mean():
        raise UnusableDrop(f"{drop.name}: slows down before first contact, got {speed[contact]:.2f} m/s; no clean drop")
    return replace(
        drop,
        time=drop.time - t[contact],
        zero_error=float(np.median(np.diff(t)) / np.sqrt(12.0)),  # it lies somewhere between two samples
        acceleration=drop.acceleration - float(np.mean(drop.acceleration[rows][rest])),
        speed=float(speed[contact]),
    )


def _completed(drop: Drop) -> tuple[Array, Array, tuple[str, ...]]:
    m, g = drop.mass, drop.gravity
    if drop.acceleration is None and drop.force is None:
        raise UnusableDrop(f"{drop.name}: neither force nor acceleration was recorded; one of both is needed")
    if drop.acceleration is None:
        assert drop.force is not None
        # without a medium; a rig in water has an accelerometer
        return drop.force, g - (drop.force + drop.buoyancy) / m, ("acceleration: a = g - F_s/m_s, no accelerometer",)
    if drop.force is not None:
        return drop.force, drop.acceleration, ()
    speed = np.zeros_like(drop.time)
    if drop.drag > 0.0:
        contact = int(np.searchsorted(drop.time, 0.0))
        gained = _integral(drop.time, np.nan_to_num(drop.acceleration))
        speed = np.maximum(drop.speed + gained - gained[min(contact, gained.size - 1)], 0.0)
    force = m * (g - drop.acceleration) - drop.buoyancy - drop.drag * speed**2
    text = "force: F_s = m_s (g - a) of the decelerating striker, no load cell"
    if drop.buoyancy > 0.0 or drop.drag > 0.0:
        text += f", less buoyancy {drop.buoyancy:.1f} N and drag {drop.drag:.2f} v^2"
    return force, drop.acceleration, (text,)


def _integral(t: Array, y: Array) -> Array:
    return np.concatenate([[0.0], np.cumsum(0.5 * (y[1:] + y[:-1]) * np.diff(t))])


def _rest(t: Array, a: Array, gravity: float) -> NDArray[np.bool_] | None:
    """Rows of the last tenth of a second or more in which nothing accelerates any more, if there are any."""
    late = t > t[-1] - max(0.1, 0.2 * (t[-1] - t[0]))
    if late.sum() < LEAST_ROWS or abs(np.mean(a[late])) > 0.03 * gravity or np.std(a[late]) > 0.1 * gravity:
        return None
    return np.asarray(late)


def _line_up(shapes: Array, gap: Array) -> tuple[Array, Array]:
    """Least squares of what the recorded depth is above the integrated one, with the covariance of the amounts."""
    size = np.abs(shapes).max(axis=0)
    scaled = shapes / size
    amounts = np.linalg.lstsq(scaled, gap, rcond=None)[0]
    left = gap - scaled @ amounts
    variance = float(left @ left) / max(gap.size - shapes.shape[1], 1) * correlated(left)
    covariance = variance * np.linalg.inv(scaled.T @ scaled)
    return amounts / size, covariance / np.outer(size, size)


def _noise(y: Array) -> float:
    """Standard deviation of white noise on a smooth signal, from second differences (variance 6 sigma^2)."""
    second = np.diff(y, 2)
    return float(max(1.4826 * np.median(np.abs(second)) / np.sqrt(6.0), 1e-9 * np.abs(y).max(), 1e-12))


def correlated(r: Array) -> float:
    """How many rows of a residual count as one: 1 + 2 sum of its autocorrelation up to where it is lost in chance."""
    r = r - r.mean()
    power = float(r @ r)
    if power <= 0.0 or r.size < 8:
        return 1.0
    total, chance = 1.0, 2.0 / np.sqrt(r.size)
    for lag in range(1, r.size // 2):
        rho = float(r[lag:] @ r[:-lag]) / power
        if rho < chance:
            break
        total += 2.0 * rho
    return total

"""Which law form fits drops on soft ground, face or cone, and its numbers; judged on drops that were left out.

Rows of force over depth of all drops are fitted at once; the depth of first contact of each drop is free within
`CONTACT_ERROR`, because a cone enters without a sharp beginning. A form is judged by leaving out one drop after the
other, simulating it from its speed at first contact, and comparing the largest deceleration and the deepest point.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.integrate import solve_ivp
from scipy.optimize import least_squares
from scipy.special import stdtrit

from ground.bearing import REFERENCE_DEPTH, Bearing
from ground.drops import Drop, Loading, UnusableDrop, correlated, covered_area, loading, mean_depth
from ground.law import REFERENCE_AREA, Calibration, Interval

Array = NDArray[np.float64]
Pressure = Callable[[Array, Array, Array], Array]  # parameters, mean depth (m), rate (m/s) -> Pa

CONTACT_ERROR = 0.02  # m, one standard deviation
_ROWS = 120  # of one drop in the fit
_RATE = 0.02  # m/s


@dataclass(frozen=True, kw_only=True)
class Form:
    """A form of the pressure on the covered area: its numbers with start and bounds."""

    name: str
    statement: str
    names: tuple[str, ...]
    start: tuple[float, ...]
    low: tuple[float, ...]
    high: tuple[float, ...]
    pressure: Pressure


def _bearing(x: Array, z: Array, v: Array) -> Array:
    static = 1e3 * (x[0] + x[1] * (np.maximum(z, 0.0) / REFERENCE_DEPTH) ** x[2])
    rate = x[3] if len(x) > 3 else 0.0
    return np.asarray(static * (1.0 + rate * np.arcsinh(np.maximum(v, 0.0) / (2.0 * _RATE)) / math.log(10.0)))


def _inertial(x: Array, z: Array, v: Array) -> Array:
    return np.asarray(_bearing(x[:3], z, v) + 1e3 * x[3] * np.maximum(v, 0.0) ** 2)


def _secant(x: Array, z: Array, v: Array) -> Array:
    depth = np.maximum(z, 1e-9)
    return np.asarray(1e3 * np.minimum(x[0] * depth, x[1] * (depth / REFERENCE_DEPTH) ** (1.0 + x[2])))


_THREE = ("surface_pressure", "depth_pressure", "depth_exponent")
FORMS: dict[str, Form] = {
    form.name: form
    for form in (
        Form(
            name="bearing",
            statement="q = q_0 + q_1 (z/0.1 m)^n, not dependent on rate",
            names=_THREE,
            start=(3.0, 10.0, 0.7),
            low=(0.0, 0.01, 0.05),
            high=(1e4, 1e4, 4.0),
            pressure=_bearing,
        ),
        Form(
            name="bearing-rate",
            statement="the same, more by beta for each decade of rate",
            names=(*_THREE, "rate_per_decade"),
            start=(3.0, 10.0, 0.7, 0.15),
            low=(0.0, 0.01, 0.05, 0.0),
            high=(1e4, 1e4, 4.0, 3.0),
            pressure=_bearing,
        ),
        Form(
            name="bearing-inertia",
            statement="without the rate term, and kappa v^2 for the soil that is pushed aside",
            names=(*_THREE, "inertial_density"),
            start=(3.0, 10.0, 0.7, 0.5),
            low=(0.0, 0.01, 0.05, 0.0),
            high=(1e4, 1e4, 4.0, 20.0),
            pressure=_inertial,
        ),
        Form(
            name="ye-2006",
            statement="q = min(K_b1 z, K_b2 z), eqs (3)-(5) of Ye 2006 at one speed, per area",
            names=("first", "second", "sinkage_exponent"),
            start=(500.0, 30.0, -0.3),
            low=(1.0, 0.01, -0.99),
            high=(1e6, 1e4, 0.0),
            pressure=_secant,
        ),
    )
}


@dataclass(frozen=True, kw_only=True)
class HeldOut:
    """One drop predicted by a law fitted to the others."""

    name: str
    deceleration: tuple[float, float]  # m/s2, largest: recorded, predicted
    depth: tuple[float, float]  # m, deepest: recorded, predicted


@dataclass(frozen=True, kw_only=True)
class Fitted:
    """A form with its numbers from all drops: 95 % intervals, scatter, and how it does on drops left out."""

    form: Form
    value: Array
    low: Array
    high: Array
    log_scatter: float  # sd of ln F about the law, rows above a fifth of the largest force
    between_drops: float  # sd of the drops' mean ln F about it
    contact: Array  # m, how much deeper each drop was found to be than its clock says
    residual: float  # root mean square force over the largest
    held_out: tuple[HeldOut, ...]

    @property
    def error(self) -> float:
        """Both held-out errors together."""
        return math.hypot(self.deceleration_error, self.depth_error)

    @property
    def deceleration_error(self) -> float:
        """Root mean square over the held-out drops, relative."""
        return _relative([drop.deceleration for drop in self.held_out])

    @property
    def depth_error(self) -> float:
        """Root mean square over the held-out drops, relative."""
        return _relative([drop.depth for drop in self.held_out])


def fit_forms(drops: Sequence[Drop]) -> dict[str, Fitted]:
    """Every form on the same drops. Raises `UnusableDrop`; there must be three or more for a held-out error."""
    if len(drops) < 3:
        raise UnusableDrop(f"{len(drops)} usable drops; at least 3 to leave one out")
    loads = [loading(drop, 0.0) for drop in drops]
    found = {}
    for form in FORMS.values():
        value, contact, J, left = _fit(form, loads)
        found[form.name] = _judged(form, loads, value, contact, J, left)
    return found


def chosen(found: dict[str, Fitted]) -> Fitted:
    """Of the forms of the law 'bearing' the one with the smallest held-out error of both quantities together."""
    offered = [f for f in found.values() if f.form.pressure is _bearing]
    return min(offered, key=lambda f: f.error)


def fit_form(form: Form, drops: Sequence[Drop]) -> tuple[Array, Array]:
    """One form's numbers, in its own units, from two drops or more, and how much deeper each was found to be, m."""
    value, contact, *_ = _fit(form, [loading(drop, 0.0) for drop in drops])
    return value, contact


def numbers_of(form: Form, value: Array) -> dict[str, Any]:
    """A form's numbers by the fields of the law `bearing`, SI."""
    unit = np.array([1e3 if name.endswith("pressure") else 1.0 for name in form.names])
    return dict(zip(form.names, (unit * value).tolist(), strict=True))


def law(fitted: Fitted, drops: Sequence[Drop], *, source: str, recordings: Sequence[str]) -> Bearing:
    """The law of `ground.bearing` with a fitted form's numbers. Raises ``ValueError`` for another form."""
    if fitted.form.pressure is not _bearing:
        raise ValueError(f"{fitted.form.name}: not a form of the law 'bearing'; {', '.join(_bearing_forms())}")
    unit = np.array([1e3 if name.endswith("pressure") else 1.0 for name in fitted.form.names])
    value = numbers_of(fitted.form, fitted.value)
    speeds = [drop.speed for drop in drops]
    loads = [loading(drop, 0.0) for drop in drops]
    bounds = zip(fitted.form.names, (unit * fitted.low).tolist(), (unit * fitted.high).tolist(), strict=True)
    calibration = Calibration(
        source=source,
        recordings=tuple(recordings),
        speed_least=min(speeds),
        speed_most=max(speeds),
        momentum_most=max(132.0 * speed for speed in speeds),  # as the array counts it: per reference face
        sinkage_most=max(load.deepest for load in loads),
        log_scatter=fitted.log_scatter,
        intervals=tuple(Interval(of=name, low=low, high=high) for name, low, high in bounds),
    )
    return Bearing(**value, calibration=calibration)


def predicted(form: Form, value: Array, drop: Drop) -> tuple[float, float]:
    """Largest deceleration (m/s2) and deepest point (m) of a drop from its speed at first contact."""
    m, weight = drop.mass, drop.mass * drop.gravity - drop.buoyancy

    def rhs(_t: float, y: Array) -> tuple[float, float]:
        z, v = np.array([max(y[0], 0.0)]), np.array([y[1]])
        ground = covered_area(drop, z) * form.pressure(value, mean_depth(drop, z), v)
        return y[1], float((weight - drop.drag * y[1] * abs(y[1]) - ground[0]) / m)

    def stopped(_t: float, y: Array) -> float:
        return float(y[1])

    stopped.terminal, stopped.direction = True, -1.0  # type: ignore[attr-defined]
    done = solve_ivp(rhs, (0.0, 3.0), (0.0, drop.speed), events=stopped, max_step=2e-3, rtol=1e-6, atol=1e-9)
    largest = max(-rhs(0.0, y)[1] for y in done.y.T)
    return largest, float(done.y[0, -1])


def _fit(form: Form, loads: Sequence[Loading]) -> tuple[Array, Array, Array, list[Array]]:
    rows = [np.unique(np.linspace(0, len(load.depth) - 1, _ROWS).astype(int)) for load in loads]
    k = len(form.names)
    largest = max(float(load.force.max()) for load in loads)

    def parts(x: Array) -> list[Array]:
        found = []
        for load, at, off in zip(loads, rows, x[k:], strict=True):
            z = load.depth[at] + off
            model = covered_area(load.drop, z) * form.pressure(x[:k], mean_depth(load.drop, z), load.rate[at])
            found.append((load.force[at] - model) / largest)
        return found

    def residual(x: Array) -> Array:
        # one percent of the largest force: what rows and contact errors are weighed against each other by
        return np.concatenate([*(100.0 * part for part in parts(x)), x[k:] / CONTACT_ERROR])

    box = ([*form.low, *[-0.1] * len(loads)], [*form.high, *[0.1] * len(loads)])
    start = [*form.start, *[0.0] * len(loads)]
    done = least_squares(
        residual, start, bounds=box, x_scale=[*np.maximum(np.abs(form.start), 0.1), *[0.01] * len(loads)]
    )
    return done.x[:k], done.x[k:], done.jac, parts(done.x)


def _judged(form: Form, loads: Sequence[Loading], value: Array, contact: Array, J: Array, left: list[Array]) -> Fitted:
    k = len(form.names)
    # neighbouring rows say the same: their misfit counts as often as it is independent
    count = sum(part.size for part in left)
    alike = float(np.mean([correlated(part) for part in left]))
    variance = 1e4 * sum(float(part @ part) for part in left) / max(count - k - len(left), 1) * alike
    data, stated = J[:count], J[count:]  # the contact errors are known as well as they are, whatever the misfit
    V = np.linalg.pinv(data.T @ data / variance + stated.T @ stated)[:k, :k]
    quantile = float(stdtrit(max(count / alike - k - len(left), 1.0), 0.975))
    half = quantile * np.sqrt(np.diag(V))
    ratios = []
    for load, off in zip(loads, contact, strict=True):
        z = load.depth + off
        model = covered_area(load.drop, z) * form.pressure(value, mean_depth(load.drop, z), load.rate)
        strong = (load.force > 0.2 * load.force.max()) & (model > 0.0)
        ratios.append(np.log(load.force[strong] / model[strong]))
    held_out = []
    for j, load in enumerate(loads):
        others, *_ = _fit(form, [other for i, other in enumerate(loads) if i != j])
        deceleration, depth = predicted(form, others, load.drop)
        mass, drop = load.drop.mass, load.drop
        recorded = (load.force + drop.drag * load.rate**2 - mass * drop.gravity + drop.buoyancy) / mass
        held_out.append(
            HeldOut(name=drop.name, deceleration=(float(recorded.max()), deceleration), depth=(load.deepest, depth))
        )
    return Fitted(
        form=form,
        value=value,
        low=np.maximum(value - half, form.low),
        high=np.minimum(value + half, form.high),
        log_scatter=float(np.sqrt(np.mean(np.concatenate(ratios) ** 2))),
        between_drops=float(np.std([r.mean() for r in ratios], ddof=1)),
        contact=contact,
        residual=float(np.sqrt(np.mean(np.concatenate(left) ** 2))),
        held_out=tuple(held_out),
    )


def _relative(pairs: Sequence[tuple[float, float]]) -> float:
    return float(np.sqrt(np.mean([(predicted_ / recorded - 1.0) ** 2 for recorded, predicted_ in pairs])))


def _bearing_forms() -> list[str]:
    return [name for name, form in FORMS.items() if form.pressure is _bearing]


__all__ = [
    "CONTACT_ERROR",
    "FORMS",
    "REFERENCE_AREA",
    "Fitted",
    "Form",
    "chosen",
    "fit_form",
    "fit_forms",
    "law",
    "numbers_of",
    "predicted",
]

"""The drop test of Ye (2006) solved on its own: no line of it comes from `ground` or `rollover`.

A striker of mass m meets the ground at `speed`. The co-moving mass m_b1 = fraction * m takes part at once
(restitution 0), so both go on at speed/(1 + fraction), and

    (m + m_b1) z'' = m g [+ m_b1 g] - F(z),   F = area_ratio * min(K_b1, K_b2) * z.

The spring changes branch at one sinkage. The integration stops there by an event and starts anew on the other
branch, so that no step of the integrator ever lies across the kink; it ends by an event at z' = 0. Eqs (4) and (5)
are written out again below.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.integrate import solve_ivp

REFERENCE_MASS = 132.0  # kg, in eq (5): the law is per area, whatever mass strikes
_LONGEST = 100.0  # s; a drop that has not come to rest by then has no bottom
Series = Callable[[ArrayLike], NDArray[np.float64]]


@dataclass(frozen=True, kw_only=True)
class DropSolution:
    """A drop from the touch (t = 0) to the deepest point (t = t_max); SI units, z positive down."""

    z_max: float  # m
    t_max: float  # s
    spring_force: float  # N, K' z at z_max
    load_cell_peak: float  # N, largest force between striker and soil after the exchange of momentum
    branch_sinkage: float  # m, where K_b1 = K_b2
    branch_force: float  # N, there
    branch_time: float  # s; nan if it stops before
    speed_after: float  # m/s, behind the exchange of momentum
    impulse: float  # N s, of the exchange
    collision_loss: float  # J, of the exchange, by the energies before and after it
    spring_work: float  # J, integral of K' z dz to z_max
    z: Series  # m at times in s
    v: Series  # m/s
    a: Series  # m/s2
    load_cell: Series  # N, F_s = K' z + m_b1 a, without the impulse at t = 0
    spring: Series  # N at sinkages in m


def solve(
    speed: float,
    mass: float = 132.0,
    fraction: float = 0.1,
    gravity: float = 9.81,
    gravity_on_soil: bool = False,
    area_ratio: float = 1.0,
    law_mass: float = REFERENCE_MASS,
) -> DropSolution:
    """Solve one drop; `area_ratio` is the face over that of the reference striker, `law_mass` the m_s of eq (5)."""
    first = area_ratio * (4.9e-6 * speed**18.71 + 75_000.0)  # (4)
    second = area_ratio * 1e3 * 1300.0 * 0.89 ** (law_mass * speed / 100.0)  # (5) without (1e3 z)^-0.736
    change = 1e-3 * (second / first) ** (1.0 / 0.736)
    soil = fraction * mass
    total = mass + soil
    weight = gravity * (total if gravity_on_soil else mass)
    after = speed / (1.0 + fraction)

    def stiff(z: Any) -> Any:
        return first * z

    def soft(z: Any) -> Any:
        # z stays above the change of branch, where the power is smooth
        return second * 1e-3 * (1e3 * z) ** 0.264

    def spring(z: ArrayLike) -> NDArray[np.float64]:
        depth = np.asarray(z, dtype=float)
        force: NDArray[np.float64] = np.where(depth <= change, stiff(depth), soft(np.maximum(depth, change)))
        return force

    def piece(force: Callable[[Any], Any], start: tuple[float, float, float], until: float | None) -> Any:
        def rhs(t: float, y: NDArray[np.float64]) -> tuple[float, float, float]:
            f = force(y[0])
            return y[1], (weight - f) / total, f * y[1]

        def stopped(t: float, y: NDArray[np.float64]) -> float:
            return float(y[1])

        def changed(t: float, y: NDArray[np.float64]) -> float:
            return float(y[0] - until) if until is not None else 1.0

        for event, direction in ((stopped, -1.0), (changed, 1.0)):
            event.terminal, event.direction = True, direction  # type: ignore[attr-defined]
        result = solve_ivp(
            rhs, (0.0, _LONGEST), start, method="DOP853", rtol=1e-12, atol=1e-14, dense_output=True,
            events=(stopped, changed),
        )  # fmt: skip
        if result.status != 1:
            raise RuntimeError(f"drop at {speed} m/s: neither stops nor changes branch within {_LONGEST} s")
        return result

    pieces = [piece(stiff, (0.0, after, 0.0), change)]
    branch_time = np.nan
    if pieces[0].t_events[1].size:
        branch_time = float(pieces[0].t[-1])
        _, v_change, work_change = pieces[0].y[:, -1]
        pieces.append(piece(soft, (change, float(v_change), float(work_change)), None))
    z_max, _, spring_work = (float(number) for number in pieces[-1].y[:, -1])
    t_max = float(sum(part.t[-1] for part in pieces))

    def states(t: ArrayLike) -> NDArray[np.float64]:
        time = np.asarray(t, dtype=float)
        y: NDArray[np.float64] = pieces[0].sol(np.clip(time, 0.0, pieces[0].t[-1]))
        if len(pieces) == 2:
            y = np.where(time > branch_time, pieces[1].sol(np.clip(time - branch_time, 0.0, pieces[1].t[-1])), y)
        return y

    def acceleration(t: ArrayLike) -> NDArray[np.float64]:
        return (weight - spring(states(t)[0])) / total

    def load_cell(t: ArrayLike) -> NDArray[np.float64]:
        # on the soil: m_b1 a = F_s [+ m_b1 g] - K' z
        return spring(states(t)[0]) + soil * acceleration(t) - (soil * gravity if gravity_on_soil else 0.0)

    return DropSolution(
        z_max=z_max,
        t_max=t_max,
        spring_force=float(spring(z_max)),
        # F_s rises with K' z alone (slope m/(m + m_b1)), and K' z with z: the peak is at the deepest point
        load_cell_peak=float(load_cell(t_max)),
        branch_sinkage=change,
        branch_force=first * change,
        branch_time=branch_time,
        speed_after=after,
        impulse=mass * (speed - after),
        collision_loss=0.5 * mass * speed**2 - 0.5 * total * after**2,
        spring_work=spring_work,
        z=lambda t: states(t)[0],
        v=lambda t: states(t)[1],
        a=acceleration,
        load_cell=load_cell,
        spring=spring,
    )

"""A frame pushed along one direction: step after step of deflection, Newton's iteration in each, then let go."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from rollover.dynamics.frame.equilibrium import Frame, Memory, Tried

Array = NDArray[np.float64]
ITERATIONS = 15
RESIDUAL = 1e-7  # of the sum of all internal forces; a step's error in the load is far below a millionth
HALVINGS = 12
STILL = 1e-10  # m or rad: a step below this is round-off, and so is what is left of the residual
FAR = 1.0  # m or rad that no step of a frame is: the iteration has run away
FIRST = 8.0  # part of a step that a load begins with: a stiff frame is at a crushing force within a millimetre
CLOSE = 1e-6  # of the goal, within which it is met
UNLOADING = 4  # steps in which a load is let go: what flows back does so in the order of the forces
NO_BALANCE = "no balance beyond here: the frame collapses"


class Goal(Protocol):
    """What a load is pushed for."""

    @property
    def size(self) -> float:
        """What is asked for now, J or N."""

    def missing(self, point: Point) -> float:
        """What a point still lacks of it; the curve is given a point where that becomes nothing."""

    def reached(self, points: list[Point]) -> bool:
        """Whether the last point ends the load."""


@dataclass(frozen=True, kw_only=True)
class State:
    """Displacements (6 n,), what is plastic, and the last trial's answer."""

    u: Array
    tried: Tried

    @property
    def memory(self) -> Memory:
        """What is plastic."""
        return self.tried.memory


@dataclass(frozen=True, kw_only=True)
class Point:
    """One point of a load's curve: deflection (m), force (N), energy absorbed (J), with the frame as it is there."""

    deflection: float
    force: float
    energy: float
    state: State


def at_rest(frame: Frame) -> State:
    """The frame before any load."""
    u = np.zeros(6 * len(frame.mesh.nodes))
    return State(u=u, tried=frame.tried(u, frame.start))


def moved(frame: Frame, state: State, c: Array, way: float, force: float, speed: float = 0.0) -> tuple[State, float]:
    """The balance where `c` u has grown by `way` (m), and the force along c that it takes; `force` is a first guess.

    At a `speed` (m/s) it takes a time; at 0 the steel has all the time there is. Raises ``ArithmeticError``.
    """
    free, u, target = frame.free, state.u.copy(), float(c @ state.u) + way
    cf, moves = c[free], FAR
    h = way / speed if speed > 0.0 else np.inf
    for _ in range(ITERATIONS):
        tried = frame.tried(u, state.memory, h)
        residual = tried.force[free] - force * cf
        gap = float(c @ u) - target
        worst, scale = float(np.abs(residual).max()), np.abs(tried.force).sum() + abs(force) + 1e-3
        if abs(gap) <= 1e-12 and (worst <= RESIDUAL * scale or moves <= STILL):
            return State(u=u, tried=tried), force
        back, along = frame.solved(tried.band, np.stack([residual, cf], axis=1)).T
        change = float((cf @ back - gap) / (cf @ along))
        step = change * along - back
        moves = float(np.abs(step).max())
        if not moves < FAR:
            break
        u[free] += step
        force += change
    raise ArithmeticError(NO_BALANCE)


def let_go(frame: Frame, state: State, c: Array, force: float, h: float = np.inf) -> State:
    """The frame without the load that it carries along c, taken off within `h` (s). Raises ``ArithmeticError``."""
    free = frame.free
    for share in np.linspace(force, 0.0, UNLOADING + 1)[1:]:
        u, moves = state.u.copy(), FAR
        for _ in range(ITERATIONS):
            tried = frame.tried(u, state.memory, h / UNLOADING)
            residual = tried.force[free] - share * c[free]
            if moves <= STILL or np.abs(residual).max() <= RESIDUAL * (np.abs(tried.force).sum() + abs(force) + 1e-3):
                break
            step = frame.solved(tried.band, residual)
            u[free] -= step
            moves = float(np.abs(step).max())
        else:
            raise ArithmeticError(NO_BALANCE)
        state = State(u=u, tried=tried)
    return state


def push(
    frame: Frame,
    state: State,
    c: Array,
    *,
    step: float,
    most: float,
    goal: Goal,
    speed: float = 0.0,
) -> tuple[list[Point], str]:
    """Curve of a load along c: from no force in steps of deflection up to `step` (m) until the goal or `most` (m).

    `speed` (m/s) is that of the deflection, as in `moved`. Returns the points and how it ended: reached, given up: ...
    """
    points = [Point(deflection=0.0, force=0.0, energy=0.0, state=state)]
    size, halved = step / FIRST, 0
    while True:
        last = points[-1]
        guess = _ahead(points, size)
        try:
            after, force = moved(frame, last.state, c, size, guess, speed)
        except ArithmeticError as e:
            halved += 1
            if halved > HALVINGS:
                return points, f"given up: {e}"
            size *= 0.5
            continue
        now = _next(last, size, force, after)
        if goal.missing(now) <= 0.0 < goal.missing(last):
            now = _met(frame, c, goal, last, now, speed)
        points.append(now)
        if goal.reached(points):
            return points, "reached"
        if points[-1].deflection >= most:
            return points, f"given up: deflected by more than {1e3 * most:.0f} mm"
        if size < step:
            size, halved = min(step, 2.0 * size), max(halved - 1, 0)


def _met(frame: Frame, c: Array, goal: Goal, last: Point, beyond: Point, speed: float) -> Point:
    """The point between two at which the goal is met, by false position; a little beyond it, never before."""
    low, high, size = (0.0, goal.missing(last)), (1.0, goal.missing(beyond)), beyond.deflection - last.deflection
    for _ in range(ITERATIONS):
        if -high[1] <= CLOSE * goal.size:
            break
        share = low[0] + (high[0] - low[0]) * low[1] / (low[1] - high[1])
        share += CLOSE * (high[0] - share)  # just beyond, so that both ends close in
        way = share * size
        after, force = moved(frame, last.state, c, way, last.force, speed)
        now = _next(last, way, force, after)
        if (left := goal.missing(now)) > 0.0:
            low = (share, left)
        else:
            high, beyond = (share, left), now
    return beyond


def _ahead(points: list[Point], size: float) -> float:
    last = points[-1]
    if len(points) < 2:
        return last.force
    before = points[-2]
    return last.force + size * (last.force - before.force) / (last.deflection - before.deflection)


def _next(last: Point, size: float, force: float, state: State) -> Point:
    """By the trapezoidal rule, whose error is that of the curve's bend over a step."""
    energy = last.energy + 0.5 * size * (last.force + force)
    return Point(deflection=last.deflection + size, force=force, energy=energy, state=state)

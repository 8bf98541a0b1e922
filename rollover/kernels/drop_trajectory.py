"""Compiled: the track of a fall, and rows read from it at any times: a clock that is moved asks for no second fall."""

from __future__ import annotations

from typing import Any

import numpy as np

from ground.compiled import compiled, leaf
from ground.kernel import COLUMNS, IDLE, MODE, SINKAGE, STATE_COLUMNS
from rollover.kernels.cubic import between_ends
from rollover.kernels.striker import (
    AIR,
    CREEP,
    CRISIS,
    GRAVITY,
    GUIDE,
    HEIGHT,
    MASS,
    SPEED,
    SPRING,
    THIN,
    accelerate,
    along,
)
from rollover.kernels.terms import fall_back, free

# columns of what comes out
OUT_FORCE, OUT_SINKAGE, OUT_X, OUT_V, OUT_A, OUT_IMPULSE, OUT_COLUMNS = 0, 1, 2, 3, 4, 5, 6
# columns of a track, a row a step: from (s), how long (s), mode (`RESTS` at last), whether nothing gives way yet,
# impulse (N s), force at rest (N), which element, state at both ends (4 each), accelerations at the first (2)
FROM, LONG, HOW, BOUND, HIT, PRESSED, ELEMENT, START, END, FIRST, TRACK_COLUMNS = 0, 1, 2, 3, 4, 5, 6, 7, 11, 15, 17
RESTS = -1.0  # mode of the last step of a track that has come to rest
SAME = 1e-7  # of an acceleration, up to which one at the end of a step is that at the beginning of the next
ROOM = 256  # steps that a track has room for at first; of an element that changes less often a quarter


@compiled
def wider(table: Any) -> Any:
    """The same table with room for twice as many rows."""
    found = np.empty((2 * table.shape[0], table.shape[1]))
    for i in range(table.shape[0]):
        for k in range(table.shape[1]):
            found[i, k] = table[i, k]
    return found


@leaf
def is_another(elements: Any, last: int, row: Any, s: Any) -> bool:
    """Whether an element is another than the last one noted, by more than how deep it was pressed."""
    if last < 0:
        return True
    for k in range(COLUMNS):
        if elements[last, k] != row[k] and k != SINKAGE:
            return True
    for k in range(s.size):  # noqa: SIM110, compiled
        if elements[last, COLUMNS + k] != s[k]:
            return True
    return False


@leaf
def put(elements: Any, element: int, row: Any, s: Any) -> None:
    """Put an element as it was noted into the tables that the kernel reads."""
    for k in range(COLUMNS):
        row[k] = elements[element, k]
    for k in range(s.size):
        s[k] = elements[element, COLUMNS + k]


@compiled
def read_off(law: Any, p: Any, f: Any, track: Any, elements: Any, times: Any, out: Any) -> None:
    """Rows (OUT_COLUMNS) of a track at `times` (s, rising, none after its end) into `out`."""
    at, now, end, last = np.zeros(4), np.zeros(2), np.zeros(4), np.zeros(2)
    row, state, s = np.zeros(COLUMNS), np.zeros(STATE_COLUMNS, np.int64), np.zeros(elements.shape[1] - COLUMNS)
    i, n, element = 0, times.size, -1
    g, m, guide, creep, air, crisis, thin = f[GRAVITY], f[MASS], f[GUIDE], f[CREEP], f[AIR], f[CRISIS], f[THIN]
    while i < n and times[i] < 0.0:
        x, v = fall_back(g, m, guide, creep, air, crisis, thin, f[SPEED], -times[i])
        out[i, OUT_FORCE], out[i, OUT_SINKAGE], out[i, OUT_IMPULSE] = 0.0, 0.0, 0.0
        out[i, OUT_X], out[i, OUT_V], out[i, OUT_A] = x - f[HEIGHT], v, free(g, m, guide, creep, air, crisis, thin, v)
        i += 1
    bound = f.copy()
    bound[SPRING] = 0.0
    for j in range(track.shape[0]):
        step = track[j]
        t, h = step[FROM], step[LONG]
        if i >= n:
            break
        if times[i] > t + h:
            continue
        if step[HOW] == RESTS:
            for k in range(i, n):
                out[k, OUT_FORCE], out[k, OUT_SINKAGE], out[k, OUT_IMPULSE] = step[PRESSED], step[START], step[HIT]
                out[k, OUT_X], out[k, OUT_V], out[k, OUT_A] = step[START + 2], 0.0, 0.0
            break
        if element != int(step[ELEMENT]):
            element = int(step[ELEMENT])
            put(elements, element, row, s)
        state[MODE] = int(step[HOW])
        for k in range(4):
            end[k] = step[END + k]
        own = bound if step[BOUND] != 0.0 else f
        accelerate(law, p, s, row, state, own, end, last)
        while i < n and times[i] <= t + h:
            theta = max((times[i] - t) / h, 0.0)
            for k in range(2):
                x, v = 2 * k, 2 * k + 1
                at[x] = between_ends(theta, h, step[START + x], step[START + v], end[x], end[v])
                at[v] = between_ends(theta, h, step[START + v], step[FIRST + k], end[v], last[k])
            force = accelerate(law, p, s, row, state, own, at, now)
            touching = state[MODE] != IDLE
            # (1) without the collision: F_s = F + m_b1 a
            out[i, OUT_FORCE] = force + along(law, p, row, own, at[0]) * now[0] if touching else 0.0
            out[i, OUT_SINKAGE] = at[0] if touching else 0.0
            out[i, OUT_X], out[i, OUT_V], out[i, OUT_A] = at[2], at[3], now[1]
            out[i, OUT_IMPULSE] = step[HIT]
            i += 1


@compiled
def turns(law: Any, p: Any, f: Any, track: Any, elements: Any, until: float, beside: float) -> Any:
    """Instants (k,), s, at which another way of moving begins, what the columns differ by (k, OUT_COLUMNS), max |F|.

    They are read off `beside` (s) to either side, those that are not beyond `until` (s).
    """
    count = 0
    at, times = np.empty(track.shape[0]), np.empty(2 * track.shape[0])
    end, last = np.zeros(4), np.zeros(2)
    row, state, s = np.zeros(COLUMNS), np.zeros(STATE_COLUMNS, np.int64), np.zeros(elements.shape[1] - COLUMNS)
    bound = f.copy()
    bound[SPRING] = 0.0
    for j in range(track.shape[0]):
        is_new = j == 0 or track[j, HOW] != track[j - 1, HOW] or track[j, BOUND] != track[j - 1, BOUND]
        if not is_new and track[j, ELEMENT] != track[j - 1, ELEMENT]:
            # as long as no acceleration jumps it is the same element further on, as at nearly every step
            put(elements, int(track[j - 1, ELEMENT]), row, s)
            state[MODE] = int(track[j - 1, HOW])
            for k in range(4):
                end[k] = track[j - 1, END + k]
            accelerate(law, p, s, row, state, bound if track[j - 1, BOUND] != 0.0 else f, end, last)
            for k in range(2):
                is_new = is_new or abs(track[j, FIRST + k] - last[k]) > SAME * max(abs(last[k]), f[GRAVITY])
        if is_new and track[j, FROM] + beside <= until:
            at[count] = track[j, FROM]
            times[2 * count], times[2 * count + 1] = at[count] - beside, at[count] + beside
            count += 1
    rows = np.empty((2 * count, OUT_COLUMNS))
    read_off(law, p, f, track, elements, times[: 2 * count], rows)
    apart, largest = np.empty((count, OUT_COLUMNS)), 0.0
    for i in range(count):
        before, after = rows[2 * i], rows[2 * i + 1]
        apart[i] = after - before
        largest = max(largest, abs(before[OUT_FORCE]), abs(after[OUT_FORCE]))
    return at[:count], apart, largest

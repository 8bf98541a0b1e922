"""Attitudes are compared as attitudes: of all the numbers that say the same, those on one branch.

Roll is the same a turn further, a quaternion with its sign turned, and roll, pitch, yaw are roll + 180, 180 - pitch,
yaw + 180 degrees. `continuous` takes one branch along a recording; `beside` the one of a reference, the simulation it
is compared with, which also tells what gaps and slow sampling leave open. Where only some of the angles are recorded,
they differ by their difference on the nearest branch. Where all three are, so they do away from a pitch of 90 degrees;
near it, where a small turn is a large one of roll and yaw, by what the turn phi from the reference R_s to R is,

    phi = log(R_s' R),    v = R_y(p/2) R_x(r) phi,                                                      (A1)
    v_1 + v_3 = (c - s)(dr + dy),   v_1 - v_3 = (c + s)(dr - dy),   v_2 = dp,   c, s = cos, sin(p/2)      (A2)

dr, dp, dy are differences of roll, pitch and yaw to the first order, r, p those of the reference. Near the lock one of
c - s and c + s vanishes; it is held at `LEAST`, so that all parts of phi show and none without bound.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from rollover.recording import Recording
from rollover.spec.channels import CHANNELS, TURN
from rollover.spec.frames import SAME, across_wraps, one_branch, other_branch, unwrapped, wrapped

Array = NDArray[np.float64]
Mask = NDArray[np.bool_]

ANGLES = ("chassis/roll", "chassis/pitch", "chassis/yaw")
QUATERNION = tuple(f"chassis/quaternion_{axis}" for axis in "wxyz")
RATES = tuple(f"chassis/angular_velocity_{axis}" for axis in "xyz")
PERIODIC = frozenset(name for name, channel in CHANNELS.items() if channel.period == TURN)
# cos - sin of half a pitch of 50 degrees, from which (A1) is mixed in, and of 60, from which it stands alone
NEAR, LEAST = 0.484, 0.366
GAP = 2.5  # times the usual step: beyond, the branch may have been lost
FAST = 1.0  # rad between samples of the reference: a measured turn beyond pi is near
BEGINNING = 9  # samples whose median tells the branch: more than a few may be disturbed
HALF = 0.5 * math.pi  # rad between samples: of twice that, whole turns cannot be told


def continuous(recording: Recording) -> Recording:
    """The recording with its attitude on one branch along time, by itself; the same one if nothing is to be changed.

    A note says where it turns so far between samples that whole turns cannot be told. Samples that a logger averaged
    over a wrap say nothing of where it was: they become gaps, which a note says too.
    """
    if not has_attitude(recording):
        return recording
    recording = _without_means(recording)
    own, found = recording.channels, {}
    for name in PERIODIC.difference(ANGLES).intersection(own):
        found[name] = unwrapped(own[name])
    if any(name in own for name in ANGLES):
        rpy = one_branch(_columns(recording, ANGLES))
        if _has_only_pitch(own):
            rpy[:, 1] = _upright(rpy[:, 1])
        found |= {name: rpy[:, k] for k, name in enumerate(ANGLES) if name in own}
    if all(name in own for name in QUATERNION):
        q = _columns(recording, QUATERNION)
        q = q * _signs(q)[:, None]
        found |= {name: q[:, k] for k, name in enumerate(QUATERNION)}
    changed = {name: values for name, values in found.items() if not np.array_equal(values, own[name], equal_nan=True)}
    notes = [note for note in _too_fast(recording, found) if note not in recording.notes]
    if not changed and not notes:
        return recording
    return replace(recording, channels={**own, **changed}, notes=(*recording.notes, *notes))


def on_other_branch(recording: Recording) -> Mask:
    """Which samples (n,) are on the other branch of roll, pitch, yaw than the one that goes on along time."""
    rpy = _columns(recording, ANGLES)
    return np.asarray(np.nanmax(np.abs(wrapped(one_branch(rpy) - rpy)), axis=1, initial=0.0) > SAME)


def means_over_wraps(recording: Recording) -> dict[str, Mask]:
    """Which samples (n,) of each angle that turns whole turns are means over a wrap; where the branch changes, none."""
    turned = on_other_branch(recording)
    to_another = turned[1:] != turned[:-1]
    crossing = np.concatenate([[False], to_another]) | np.concatenate([to_another, [False]])
    none = np.zeros(recording.time.size, dtype=bool)
    return {
        name: across_wraps(recording[name]) & ~(crossing if name in ANGLES else none)
        for name in sorted(PERIODIC.intersection(recording.channels))
    }


def _without_means(recording: Recording) -> Recording:
    """The recording with gaps for samples that are means over a wrap."""
    channels, notes = dict(recording.channels), list(recording.notes)
    for name, means in means_over_wraps(recording).items():
        if count := int(means.sum()):
            channels[name] = np.where(means, np.nan, channels[name])
            first = float(recording.time[np.argmax(means)])
            what = "a sample is a mean" if count == 1 else f"{count} samples are means"
            notes.append(f"{name}: {what} over a wrap of its range, first at {first:.6g} s, and taken as gaps")
    if len(notes) == len(recording.notes):
        return recording
    return replace(recording, channels=channels, notes=tuple(notes))


def beside(recording: Recording, reference: Recording | None) -> Recording:
    """The recording with its attitude on the branch of a reference, for each stamp the nearest that is continuous.

    The reference has the chassis' angles and quaternion on one branch; it stands still before its first row and after
    its last. A recording without attitude, or None to compare with, is itself.
    """
    if reference is None or not has_attitude(recording):
        return recording
    recording = continuous(recording)
    found = dict(recording.channels)
    time = recording.time
    for name in PERIODIC.difference(ANGLES).intersection(found, reference.channels):
        found[name] = found[name] + _turns(found[name] - np.interp(time, reference.time, reference[name]))
    if any(name in found for name in ANGLES) and all(name in reference.channels for name in ANGLES):
        rpy = _angles_beside(recording, reference)
        found |= {name: rpy[:, k] for k, name in enumerate(ANGLES) if name in found}
    recorded = [name for name in QUATERNION if name in found]
    if recorded and all(name in reference.channels for name in QUATERNION):
        q, own = _columns(recording, QUATERNION), _at(time, reference, QUATERNION)
        if len(recorded) == len(QUATERNION):
            sign = _signs(_relative(own, q), first=True)
        else:  # of a part the sign along time is not known
            sign = np.where(np.nansum(q * own, axis=1) < 0.0, -1.0, 1.0)
        found |= {name: sign * q[:, k] for k, name in enumerate(QUATERNION) if name in recorded}
    return replace(recording, channels=found)


def reference_of(simulated: Recording) -> Recording:
    """What of a simulation its recordings are put beside: the channels of attitude alone."""
    return replace(simulated, channels={n: v for n, v in simulated.channels.items() if _is_attitude(n)})


def as_recorded(simulated: Recording, recording: Recording) -> Recording:
    """A simulation with the pitch in the range that a recording of pitch alone keeps to: up to a right angle.

    Beside a roll or yaw, and where the recording itself goes beyond, the branch is told otherwise.
    """
    if ANGLES[1] not in simulated.channels or not _has_only_pitch(recording.channels):
        return simulated
    pitch = _upright(unwrapped(recording[ANGLES[1]]))
    if np.nanmax(np.abs(pitch), initial=0.0) > HALF + SAME:
        return simulated
    own = simulated[ANGLES[1]]
    folded = np.where(np.abs(own) > HALF, np.arcsin(np.sin(own)), own)
    return replace(simulated, channels={**simulated.channels, ANGLES[1]: folded})


def has_attitude(recording: Recording) -> bool:
    """Whether any channel is one of attitude, or of an angle that is the same a turn further."""
    return any(_is_attitude(name) for name in recording.channels)


def is_locked(name: str, recording: Recording, reference: Recording) -> bool:
    """Whether a channel is a roll or yaw that tells no time: about the lock it stands by the reference's, unshifted."""
    if name not in ANGLES or name == ANGLES[1] or any(n not in recording.channels for n in ANGLES):
        return False
    return bool(np.any(_nearness(np.interp(recording.time, reference.time, reference[ANGLES[1]])) > 0.0))


def _is_attitude(name: str) -> bool:
    return name in PERIODIC or name in QUATERNION


def _has_only_pitch(channels: Mapping[str, Array]) -> bool:
    return [name for name in ANGLES if name in channels] == [ANGLES[1]]


def _columns(recording: Recording, names: tuple[str, ...]) -> Array:
    """Channels (n, k), NaN for those that are not recorded."""
    none = np.full(recording.time.size, np.nan)
    return np.column_stack([recording.channels.get(name, none) for name in names])


def _at(time: Array, reference: Recording, names: tuple[str, ...]) -> Array:
    return np.column_stack([np.interp(time, reference.time, reference[name]) for name in names])


def _upright(pitch: Array) -> Array:
    """A pitch alone (n,) as of a vehicle that begins upright; within a right angle if it jumps about beyond that."""
    known = pitch[np.isfinite(pitch)]
    if known.size and np.max(np.abs(np.diff(known)), initial=0.0) > HALF:
        return np.asarray(np.arcsin(np.sin(pitch)))
    begun = float(np.median(known[:BEGINNING])) if known.size else 0.0
    if math.cos(begun) < 0.0:
        pitch, begun = math.pi - pitch, math.pi - begun
    turns = TURN * round(begun / TURN)
    return pitch - turns if turns else pitch


def _too_fast(recording: Recording, found: Mapping[str, Array]) -> Iterator[str]:
    """A note on each channel that turns further than `HALF` from sample to sample, by itself or by its gyroscopes."""
    rates = [np.abs(recording[name][np.isfinite(recording[name])]) for name in RATES if name in recording.channels]
    fastest = max((float(np.sort(r)[-3:].min()) for r in rates if r.size), default=0.0)  # two may be disturbed
    for name in sorted(PERIODIC.intersection(found)):
        known = np.isfinite(found[name])
        time, values = recording.time[known], found[name][known]
        if time.size < 3:
            continue
        # over two steps: a single sample that is disturbed comes back
        step = float(np.median(np.diff(time)))
        near = time[2:] - time[:-2] < 2.0 * GAP * step
        seen = 0.5 * float(np.max(np.abs(values[2:] - values[:-2])[near], initial=0.0))
        most = max(seen, fastest * step if name in ANGLES else 0.0)
        if most > HALF:
            yield (
                f"{name}: turns by up to {math.degrees(most):.0f} degrees from one sample to the next; whole turns in "
                "between are not determined by it, and are taken from what it is compared with"
            )


def _signs(q: Array, first: bool = False) -> Array:
    """Signs (n,) by which quaternions (n, 4) do not jump along n; with `first` those of the beginning are positive."""
    sign: Array = np.ones(q.shape[0])
    rows = np.flatnonzero(np.isfinite(q).sum(axis=1) >= 3)
    rows = rows[np.nansum(q[rows] ** 2, axis=1) > 0.0]
    along = np.nansum(q[rows[1:]] * q[rows[:-1]], axis=1)
    sign[rows[1:]] = np.where(along < 0.0, -1.0, 1.0)
    sign = np.asarray(np.cumprod(sign))
    if first and rows.size:
        w = np.median(sign[rows[:BEGINNING]] * np.nan_to_num(q[rows[:BEGINNING], 0]))
        sign = sign if w >= 0.0 else -sign
    return sign


def _relative(own: Array, q: Array) -> Array:
    """conj(own) q of quaternions scalar first (n, 4), NaN where any part is."""
    w, v = own[:, :1], own[:, 1:]
    return np.column_stack(
        [np.sum(own * q, axis=1), w * q[:, 1:] - q[:, :1] * v - np.cross(v, q[:, 1:])],
    )


def _turns(residual: Array) -> Array:
    """Whole turns (n,) that make a residual continuous, and least at its beginning; 0 for gaps."""
    known = np.isfinite(residual)
    if not known.any():
        return np.zeros(residual.size)
    along = np.unwrap(residual[known])
    begun = float(np.median(along[:BEGINNING]))
    along -= TURN * math.ceil((begun - math.pi) / TURN - SAME)  # half a turn is +180 degrees, whatever rounding says
    found = np.zeros(residual.size)
    found[known] = TURN * np.round((along - residual[known]) / TURN)
    return found


def _angles_beside(recording: Recording, reference: Recording) -> Array:
    """Roll, pitch, yaw (n, 3) on the branch of the reference, NaN for those that are not recorded."""
    rpy, own = _columns(recording, ANGLES), _at(recording.time, reference, ANGLES)
    known = np.isfinite(rpy)
    there = np.asarray(known.any(axis=1))
    count = [name in recording.channels for name in ANGLES]
    n, is_alone = recording.time.size, sum(count) == 1
    share = np.zeros(n) if is_alone else _nearness(own[:, 1])
    # alone, a roll or yaw may be of the other branch only where the reference has its pitch beyond a right angle
    over = (np.cos(own[:, 1]) < 0.0) & (not count[1]) if is_alone else np.ones(n, dtype=bool)
    changed = _stretches(recording.time, own[:, count], np.column_stack([share > 0.0, over]), there)
    here, other = (np.nansum(wrapped(b - own) ** 2, axis=1) for b in (rpy, other_branch(rpy)))
    crossed = over & np.where(share > 0.0, other < here - SAME, _by_stretch(changed, here, other, there))
    rpy = np.where(crossed[:, None], other_branch(rpy), rpy)
    locked, same = (share > 0.0) & known.all(axis=1), np.all(rpy == own, axis=1)
    if locked.any():
        away = _parts(own[locked], _attitude(recording.time[locked], reference, own[locked]), rpy[locked])
        branch = _nearer(rpy[locked] - own[locked], other_branch(rpy[locked]) - own[locked], away)
        part = share[locked][:, None]
        rpy[locked] = own[locked] + part * away + (1.0 - part) * branch
        rpy[same] = own[same]
    for k in range(3):
        rpy[:, k] += _turns(rpy[:, k] - own[:, k])
    return rpy


def _nearer(one: Array, other: Array, near: Array) -> Array:
    """Of two differences of angles (n, 3) the one nearest to a third, by whole turns too."""
    a, b = (near + wrapped(d - near) for d in (one, other))
    nearer = np.sum((b - near) ** 2, axis=1) < np.sum((a - near) ** 2, axis=1) - SAME
    return np.where(nearer[:, None], b, a)


def _stretches(time: Array, own: Array, kind: Mask, known: Mask) -> NDArray[np.int64]:
    """Number (n,) of the stretch that each sample is in, in all of which one branch goes on; gaps have the one before.

    A new one begins after a gap, where the reference turns fast between samples, and where `kind` (n, k) changes.
    """
    rows = np.flatnonzero(known)
    found = np.zeros(time.size, dtype=np.int64)
    if rows.size > 1:
        steps = np.diff(time[rows])
        new = (steps > GAP * np.median(steps)) | (np.abs(np.diff(own[rows], axis=0)).max(axis=1) > FAST)
        found[rows[1:]] = new | np.any(kind[rows[1:]] != kind[rows[:-1]], axis=1)
    return np.cumsum(found)


def _by_stretch(stretch: NDArray[np.int64], here: Array, other: Array, known: Mask) -> Mask:
    """Whether the other branch is nearer at the beginning of each sample's stretch, (n,)."""
    rows = np.flatnonzero(known)
    crossed = np.zeros(int(stretch[-1]) + 1 if stretch.size else 0, dtype=bool)
    starts = np.flatnonzero(np.diff(stretch[rows], prepend=-1))
    for start, end in zip(starts, [*starts[1:], rows.size], strict=True):
        first = rows[start : min(end, start + BEGINNING)]
        crossed[stretch[first[0]]] = np.median(other[first] - here[first]) < -SAME
    return np.asarray(crossed[stretch])


def _nearness(pitch: Array) -> Array:
    """How much (A1) counts at a pitch of the reference, 0 to 1, (n,)."""
    edge = np.minimum(*(np.abs(f) for f in _factors(pitch)))
    return np.clip((NEAR - edge) / (NEAR - LEAST), 0.0, 1.0)


def _factors(pitch: Array) -> tuple[Array, Array]:
    """c - s and c + s of (A2), (n,) each."""
    c, s = np.cos(0.5 * pitch), np.sin(0.5 * pitch)
    return c - s, c + s


def _attitude(time: Array, reference: Recording, own: Array) -> Rotation:
    """Attitude of the reference (n,), by its quaternion if it has one: near the lock its angles turn fast."""
    if all(name in reference.channels for name in QUATERNION):
        return Rotation.from_quat(_at(time, reference, QUATERNION)[:, [1, 2, 3, 0]])
    return Rotation.from_euler("ZYX", own[:, ::-1])


def _parts(own: Array, attitude: Rotation, rpy: Array) -> Array:
    """Parts (n, 3) by (A1) and (A2) of the turn from the reference to roll, pitch, yaw (n, 3)."""
    away = attitude.inv() * Rotation.from_euler("ZYX", rpy[:, ::-1])
    half = Rotation.from_euler("Y", 0.5 * own[:, 1:2]) * Rotation.from_euler("X", own[:, :1])
    v = half.apply(away.as_rotvec())
    minus, plus = (np.where(f < 0.0, -1.0, 1.0) * np.maximum(np.abs(f), LEAST) for f in _factors(own[:, 1]))
    both, apart = (v[:, 0] + v[:, 2]) / minus, (v[:, 0] - v[:, 2]) / plus
    return np.column_stack([0.5 * (both + apart), v[:, 1], 0.5 * (both - apart)])

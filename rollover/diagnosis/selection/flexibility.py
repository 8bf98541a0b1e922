"""Curves that effects can be bent to: of one sensor, that gain and offset make a straight line of, and of the soil."""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np
from numpy.typing import NDArray

from rollover.diagnosis.fit.levenberg_marquardt import Problem
from rollover.diagnosis.fit.linearisation import Fitted, without_shift_direction
from rollover.diagnosis.fit.parameterisation import Candidate
from rollover.diagnosis.settings import SETTINGS

Array = NDArray[np.float64]
STRAIGHT = ("sensor-gain", "sensor-scale", "sensor-bias")
BACK = ("soil-elastic-rebound", "soil-adhesion")  # effects of the soil that act on the way back alone
TUNING = SETTINGS.selection.flexibility


def is_a_curve(problem: Problem, fitted: Fitted) -> bool:
    """Whether effects that make a straight line of a channel leave a curve of it, or one that drifts."""
    channels = {str(c.channel) for c in fitted.candidates if c.id in STRAIGHT}
    return any(
        curvature_gain(problem, fitted, channel, term) > TUNING.curve_gain
        for channel in sorted(channels)
        for term in (square, drift)
    )


def is_straight_line(candidates: Sequence[Candidate]) -> bool:
    """Whether all of several effects make a straight line of one channel."""
    return len({c.channel for c in candidates}) == 1 and all(c.id in STRAIGHT for c in candidates)


def square(read: Array, time: Array) -> Array:
    """What a sensor of curved characteristic adds to what is read (n,)."""
    del time
    return read * read


def drift(read: Array, time: Array) -> Array:
    """What one adds whose gain changes as it warms, at times (n,) s."""
    return np.asarray(read * (time - time.mean()))


def curvature_gain(
    problem: Problem, fitted: Fitted, channel: str, term: Callable[[Array, Array], Array] = square
) -> float:
    """Gain of a term in what a channel reads, over its range, beside all effects of a fit and the time shifts.

    Of noise alone it is chi-square of one degree of freedom: z = q'e/|q|, q the term, whitened, freed of the fit's
    own directions; less where runs scatter, whose samples count less than their scatter asks for.
    """
    terms, misfits, held = [], [], []
    for r, block in enumerate(fitted.blocks):
        raw = problem.raw(r, fitted.candidates, fitted.x, block.shift)
        if raw is None:
            return 0.0
        e, added = problem.dataset[r], np.zeros_like(raw)
        for signal, part in e.spans():
            if signal.channel == channel:
                added[part] = term(raw[part] / signal.span, e.recording.time[signal.rows])
        own = np.column_stack([block.counted(e.whitened(added)), block.residual, block.J])
        own = without_shift_direction(own, block)
        terms.append(own[:, 0])
        misfits.append(own[:, 1])
        held.append(own[:, 2:])
    q, misfit = np.concatenate(terms), np.concatenate(misfits)
    basis, _ = np.linalg.qr(np.concatenate(held))
    q, misfit = q - basis @ (basis.T @ q), misfit - basis @ (basis.T @ misfit)
    return float((q @ misfit) ** 2 / max(float(q @ q), 1e-300))


def is_over_flexible(candidates: Sequence[Candidate]) -> bool:
    """Whether they draw any curve: as many effects as may be, all of one sensor or of the soil, or two bent ones.

    Two effects of the soil that both take another form than their usual one are curves enough, whatever joins them. The
    soil draws one on the way down and another on the way back.
    """
    subjects = [c.channel or _subject(c) for c in candidates]
    varied = [s for s, c in zip(subjects, candidates, strict=True) if c.has_secondary]
    return (len(candidates) == TUNING.most_effects and len(set(subjects)) == 1) or len(set(varied)) < len(varied)


def _subject(c: Candidate) -> str:
    """What an effect is of that is no sensor's."""
    return "way back" if c.id in BACK else "soil" if c.id.startswith("soil-") else c.id


def is_flexible_soil(candidates: Sequence[Candidate]) -> bool:
    """Whether several are of the soil, and one of these takes another shape or form than its usual one."""
    soil = [c for c in candidates if c.id.startswith("soil-")]
    return len(soil) > 1 and any(c.has_secondary for c in soil)

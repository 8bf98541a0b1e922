"""How far a simulation can be trusted, sample by sample: the scatter of neighbours that nobody could tell apart.

After some contacts an overturn depends on where the grid's elements lie and on how long a step is. What neighbours
differ by there is no mismatch. With scatter s(t) beside the noise sigma, each sample counts

    w(t) = sigma / sqrt(sigma^2 + c L s(t)^2)                                                                  (D3)

of what it would: L samples of the scatter go together, so that each of them is worth 1/L of one that stands alone;
c makes up for the few neighbours.

Few neighbours do not show every course that a run may take. One that takes another after an impact begins it anew from
a state of d = 14 numbers, place and speed of the chassis in six degrees of freedom and of the front axle in one, which
nobody knows the size of. What such a state leaves beyond the E that is expected, x, has the likelihood of d normal
numbers of unknown variance,

    -2 ln p = E + d ln(1 + x/d)                                                                                (D9)

in place of E + x. Another course shows in all channels: x is E (m - 1), m the middle one of what the channels leave
over what they are expected to. What one channel leaves alone is not forgiven. A change of x changes (D9) by

    w = d / (d + x)                                                                                           (D11)

of itself, far less than (D9) is of E + x: sums of squares are of samples times sqrt(w), and what (D9) is beyond them is
added. Such a sum lies above (D9) wherever it does not touch it, so that what lowers it lowers (D9) by more:

    g becomes -d ln(1 - g/d)                                                                                  (D12)

for a sum that falls by g, up to all of x; so much is gained along a straight line.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from rollover.diagnosis.data.dataset import Dataset, Signal
from rollover.diagnosis.forward.interface import first_impact_of
from rollover.diagnosis.settings import SETTINGS

Array = NDArray[np.float64]
TUNING = SETTINGS.noise.ensemble


def with_sample_weights(e: Dataset, perturbed: Sequence[Mapping[str, Array]]) -> Dataset:
    """The dataset with each sample's weight (D3); `perturbed` are the deviations of perturbed runs at its stamps."""
    first_impact = first_impact_of(e.simulator)
    perturbed = without_diverged(e, perturbed, first_impact)
    if not perturbed:
        return e
    signals = tuple(_weighted(e, s, np.stack([d[s.channel][s.rows] for d in perturbed])) for s in e.signals)
    stacked = [e.raw(d) for d in perturbed]
    return replace(
        e, signals=signals, perturbed=tuple(d for d in stacked if np.all(np.isfinite(d))), first_impact=first_impact
    )


def without_diverged(
    e: Dataset, perturbed: Sequence[Mapping[str, Array]], first_impact: float
) -> list[Mapping[str, Array]]:
    """Perturbed runs without those that diverge clearly after the `first_impact` (s): (D9) is for the others."""
    late = [(s, s.rows[e.recording.time[s.rows] >= first_impact]) for s in e.signals]
    power = [sum(float(np.nansum((d[s.channel][rows] / s.sigma) ** 2)) for s, rows in late) for d in perturbed]
    most = TUNING.outlier_power * float(np.median(power)) if power else 0.0
    return [d for d, p in zip(perturbed, power, strict=True) if p <= most]


def _weighted(e: Dataset, s: Signal, perturbed: Array) -> Signal:
    """A signal with its weights; `perturbed` (k, n), SI."""
    perturbed = perturbed[np.all(np.isfinite(perturbed), axis=1)]
    if not len(perturbed):
        return s
    time = e.recording.time[s.rows]
    scatter = running_mean(np.mean(perturbed**2, axis=0), time)
    together = min(memory(perturbed), max(1.0, TUNING.longest_memory / float(np.median(np.diff(time)))))
    weight = s.sigma / np.sqrt(s.sigma**2 + TUNING.few_factor * together * scatter)
    return s if weight.min() > TUNING.full_weight else replace(s, weight=weight)


def running_mean(squares: Array, time: Array) -> Array:
    """Running mean of (n,) over `window`, centred, fewer values at the ends."""
    half = max(1, round(0.5 * TUNING.window / float(np.median(np.diff(time)))))
    sums = np.concatenate([[0.0], np.cumsum(squares)])
    k = np.arange(squares.size)
    low, high = np.maximum(k - half, 0), np.minimum(k + half + 1, squares.size)
    return np.asarray((sums[high] - sums[low]) / (high - low))


def memory(perturbed: Array) -> float:
    """How many samples of deviations (k, n) go together: (1 + rho)/(1 - rho), rho from one sample to the next."""
    power = float(np.sum(perturbed**2))
    if power <= 0.0:
        return 1.0
    rho = float(np.sum(perturbed[:, 1:] * perturbed[:, :-1])) / power
    return max(1.0, (1.0 + rho) / max(1.0 - rho, 1e-3))


@dataclass(frozen=True, kw_only=True)
class HeavyTail:
    """What samples count in sums of squares where a run took another course, and what is added to such a sum.

    `samples` (n,) are the roots of (D11), 1 before the impact; `share` is (D9) over the plain sum of what comes after.
    """

    samples: Array
    share: float
    more: float

    @property
    def late(self) -> NDArray[np.bool_]:
        """Samples (n,) after the impact."""
        return self.samples < 1.0

    @property
    def slope(self) -> float:
        """(D11)."""
        return float(self.samples.min()) ** 2


def heavy_tail(e: Dataset, residual: Array) -> HeavyTail | None:
    """How a whitened misfit (n,) counts by (D9); None where all samples count in full."""
    found = _beyond(e, residual**2)
    if found is None:
        return None
    expected, beyond, inside = found
    share = _share(expected, beyond)
    slope = TUNING.state_size / (TUNING.state_size + beyond)
    chi2 = float(np.sum(residual[inside] ** 2))
    return HeavyTail(samples=np.where(inside, np.sqrt(slope), 1.0), share=share, more=(share - slope) * chi2)


def leave_one_out_scatter(e: Dataset) -> Array:
    """Neighbours (k, n), whitened, each weighed by what the others scatter: the recording is none of them either."""
    found = []
    for k, perturbed_run in enumerate(e.perturbed):
        others = [d for j, d in enumerate(e.perturbed) if j != k]
        alone = tuple(
            _weighted(e, replace(s, weight=None), np.stack([d[part] for d in others]))
            if len(others) >= TUNING.least_perturbed
            else s
            for s, part in e.spans()
        )
        found.append(e.marginalised(replace(e, signals=alone).whitened(perturbed_run)))
    return np.array(found).reshape(-1, e.count)


def shares(e: Dataset, perturbed: Array) -> Array:
    """(k,): what a recording that differs as neighbours (k, n) do counts after the impact, of its sum of squares."""
    found = [_beyond(e, e.due + perturbed_run**2) for perturbed_run in perturbed]
    return np.array([1.0 if f is None else _share(f[0], f[1]) for f in found])


def _share(expected: float, beyond: float) -> float:
    """(D9) over the plain sum of squares."""
    return float((expected + TUNING.state_size * np.log1p(beyond / TUNING.state_size)) / (expected + beyond))


def _beyond(e: Dataset, squares: Array) -> tuple[float, float, NDArray[np.bool_]] | None:
    """E and x of (D9), and the samples after the impact, of squares (n,) of a misfit; None where x is not above 0.

    None too of a recording that begins after it: nothing shows that it came to the impact as its run did.
    """
    if len(e.signals) < TUNING.least_channels or not any(s.weight is not None for s in e.signals) or not e.early.any():
        return None
    over, expected, inside = [], 0.0, np.zeros(squares.size, dtype=bool)
    for s, part in e.spans():
        later = e.recording.time[s.rows] >= e.first_impact
        if not later.any():
            continue
        inside[part] = later
        own = max(float(np.sum(e.due[part][later])), 1.0)
        over.append(float(np.sum(squares[part][later])) / own)
        expected += own
    if len(over) < TUNING.least_channels:
        return None
    chi2 = float(np.sum(squares[inside]))
    beyond = min(float(np.median(over)) * expected, chi2) - expected  # never more than there is
    return (expected, beyond, inside) if beyond > 0.0 else None


def gained(less: Array, slope: float) -> Array:
    """(D12): gains by sums of squares (m,) that fall by `less` where they count `slope` (D11); all where that is 1."""
    if slope == 1.0:
        return less
    most = (1.0 - slope) * TUNING.state_size  # all of x
    within = np.minimum(less, most)
    return np.asarray(-TUNING.state_size * np.log1p(-within / TUNING.state_size) + (less - within) / slope)


def has_diverged(found: HeavyTail | None) -> bool:
    """Whether a recording diverges clearly from its run after an impact."""
    return found is not None and found.share < TUNING.diverged_share


def p_value_of_divergence(others: int, of: int) -> float:
    """p-value of so many recordings that diverge, where each may in `divergence_rate` of all cases."""
    from scipy.special import bdtrc

    return float(bdtrc(others - 1, of, TUNING.divergence_rate)) if others else 1.0

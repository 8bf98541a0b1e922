"""Level and autocorrelation of the noise of each channel, from all recordings of one recorder together.

Recordings at the same rate, behind the same filter class, share a channel's noise; each alone is too short to tell a
long memory. First from the quiet stretches; where an explanation leaves little more than that, from all it leaves.
Neither takes a line in the spectrum for noise, nor a misfit that is much slower than what is quiet: both are something.
"""

from __future__ import annotations

import functools
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from rollover.diagnosis.data.dataset import Dataset, Signal, noise_from_differences
from rollover.diagnosis.forward.interface import first_impact_of
from rollover.diagnosis.noise.drift import is_recorder_noise
from rollover.diagnosis.noise.spectral_lines import lines, without, without_outliers
from rollover.diagnosis.settings import SETTINGS
from rollover.recording.filters import attenuation, least_rate
from rollover.recording.noise_floor import LENGTH, NoiseFloor, grown, noise_floor

Array = NDArray[np.float64]
Member = tuple[int, int, Signal, slice]  # a recording, the place of a signal of it, that, and its part of the stack
NoiseEstimate = tuple[int, int, Signal, float, tuple[float, ...]]  # the same with a noise and its memory
Memory = Callable[[Sequence[Array]], tuple[float, tuple[float, ...]]]
TUNING = SETTINGS.noise.autoregression
ENOUGH = 2 * TUNING.least_windows * LENGTH  # samples that have as many


def with_noise_of_quiet_stretches(dataset: Sequence[Dataset], residuals: Sequence[Array]) -> list[Dataset]:
    """The dataset with its noise from the quiet stretches of the misfits (SI, stacked), recordings alike together."""
    found = [list(e.signals) for e in dataset]
    humming = line_spectra(dataset, residuals)
    for members in signals_of_one_recorder(dataset):
        misfits, values = [], []
        for r, _, s, part in members:
            estimates = _before_the_impact(dataset[r], s)
            without_lines = _cleaned(dataset[r], s, residuals[r][part], humming)
            misfits.append((without_lines / s.heteroscedasticity)[estimates])
            values.append(((s.values - residuals[r][part] + without_lines) / s.heteroscedasticity)[estimates])
        sizes = level_ratio(misfits, values)
        misfits, values = ([v / size for v, size in zip(each, sizes, strict=True)] for each in (misfits, values))
        common = _quieter(misfits, values)
        if common is None:
            continue  # too short: what each says by itself stands
        for (r, k, s, _), misfit, value, size in zip(members, misfits, values, sizes, strict=True):
            own = _quieter([misfit], [value])
            noisy = (
                own is not None and own.windows >= TUNING.least_windows and own.sigma > TUNING.own_level * common.sigma
            )
            best = own if own is not None and noisy else common
            found[r][k] = replace(s, noise=best.sigma * size, ar=best.ar)
    found = [
        [replace(with_noise(s, s.noise, s.ar, e.model_error_of(s)), at_rest=(s.noise, s.ar)) for s in f]
        for e, f in zip(dataset, found, strict=True)
    ]
    return [replace(e, signals=tuple(s)) for e, s in zip(dataset, found, strict=True)]


def level_ratio(misfits: Sequence[Array], values: Sequence[Array]) -> Array:
    """How many times as loud each of several short recordings is as they are on the whole, (n,); 1 if chance makes it.

    An amplifier may have been set for each test. What has many windows tells its own noise by these; by second
    differences few samples tell it too, ln sigma to 1.6/sqrt(n), and hardly anything else that is in a channel.
    """
    from scipy.special import chdtrc

    even = np.ones(len(misfits))
    if max((v.size for v in misfits), default=0) < LENGTH or all(v.size >= ENOUGH for v in misfits):
        return even
    levels = np.array([min(map(noise_from_differences, both)) for both in zip(misfits, values, strict=True)])
    if len(misfits) == 1 or levels.min() <= 0.0:
        return even
    worth = np.array([v.size for v in misfits]) / TUNING.level_error**2
    apart = np.log(levels) - np.average(np.log(levels), weights=worth)
    return np.exp(apart) if chdtrc(len(misfits) - 1, float(worth @ apart**2)) < TUNING.level_p_value else even


def _before_the_impact(e: Dataset, s: Signal) -> slice:
    """Samples that tell a noise: after an impact what chance makes of a run is quiet nowhere; all if too few."""
    n = int(np.searchsorted(e.recording.time[s.rows], first_impact_of(e.simulator)))
    return slice(n if n >= LENGTH else None)


def with_noise_of_residuals(dataset: Sequence[Dataset], residuals: Sequence[Array]) -> list[Dataset]:
    """The dataset with its noise from all of the misfits: an autoregression by least squares, recordings together."""
    found = [list(e.signals) for e in dataset]
    humming = line_spectra(dataset, residuals)
    shared: list[tuple[list[Member], list[Array]]] = []
    for members in signals_of_one_recorder(dataset):
        members = [m for m in members if not dataset[m[0]].model_error_dominates(m[2])]
        parts = [
            _cleaned(dataset[r], s, residuals[r][part], humming) / s.heteroscedasticity for r, _, s, part in members
        ]
        # what comes now and then is no noise
        if members and not any(is_bursting(m[2], part, _level(part)) for m, part in zip(members, parts, strict=True)):
            shared.append((members, parts))
    estimates = [one for both in shared for one in _pooled_noise(*both, autoregression)]
    slow = channels_with_slow_residuals(estimates)
    misfits: dict[str, list[tuple[Dataset, Signal, Array]]] = {}
    for members, parts in shared:
        each = ((dataset[r], s, p) for (r, _, s, _), p in zip(members, parts, strict=True))
        misfits.setdefault(members[0][2].channel, []).extend(each)
    far = {channel for channel, every in misfits.items() if is_recorder_noise(every)}
    if slow <= far:
        estimates = [one for one in estimates if one[2].channel not in far]
        estimates += [
            one for both in shared if both[0][0][2].channel in far for one in _pooled_noise(*both, long_memory)
        ]
        slow = set()
    for r, k, s, sigma, ar in estimates:
        if s.channel not in slow:
            found[r][k] = with_noise(s, sigma, ar, dataset[r].model_error_of(s))
    return [replace(e, signals=tuple(s)) for e, s in zip(dataset, found, strict=True)]


def _pooled_noise(members: Sequence[Member], parts: Sequence[Array], memory: Memory) -> list[NoiseEstimate]:
    """Noise of recordings alike by what each leaves: one autocorrelation, one level unless they clearly differ."""
    levels = np.array([_level(p) for p in parts])
    _, ar = memory([p / level for p, level in zip(parts, levels, strict=True)])
    # of one recorder unless they differ by more than so few samples can, each worth less for its memory
    worth = np.array([p.size for p in parts]) * max(1.0 - sum(ar), 0.02) / (1.0 + max(sum(ar), 0.0))
    common = float(np.sqrt(np.sum(levels**2 * worth) / worth.sum()))
    if not np.any(np.abs(np.log(levels / common)) > TUNING.level_errors / np.sqrt(2.0 * worth)):
        levels = np.full(levels.size, common)  # a level of each by itself would make the memory too short
    sigma, ar = memory([p / level for p, level in zip(parts, levels, strict=True)])
    # where samples are weighed what is left is the model's error as well
    each = zip(members, levels, strict=True)
    return [(r, k, s, sigma * float(level), ar) for (r, k, s, _), level in each if s.weight is None]


def _level(misfit: Array) -> float:
    return max(float(np.sqrt(np.mean(misfit**2))), 1e-300)


def line_spectra(dataset: Sequence[Dataset], residuals: Sequence[Array]) -> dict[str, tuple[float, ...]]:
    """Lines (Hz) in the misfits of each channel."""
    found: dict[str, tuple[list[Array], list[Array]]] = {}
    for e, residual in zip(dataset, residuals, strict=True):
        for s, part in e.spans():
            times, misfits = found.setdefault(s.channel, ([], []))
            times.append(e.recording.time[s.rows])
            misfits.append(residual[part])
    return {channel: lines(*both) for channel, both in found.items()}


def _cleaned(e: Dataset, s: Signal, misfit: Array, humming: Mapping[str, tuple[float, ...]]) -> Array:
    """A misfit without the lines of its channel."""
    return without(e.recording.time[s.rows], misfit, humming[s.channel])


def channels_with_slow_residuals(estimates: Sequence[NoiseEstimate]) -> set[str]:
    """Channels whose misfits are so much slower than their quiet stretches that they are no noise."""
    by: dict[str, list[tuple[float, float, int]]] = {}
    for _, _, s, sigma, ar in estimates:
        noise, own = s.quiet
        if noise > 0.0 and sigma > 0.0:
            more = np.log(low_frequency_level(sigma, ar) / low_frequency_level(noise, own))
            # what is only louder was not quiet there: all of it, what is rough too
            more -= max(np.log(sigma / grown(ar) / (noise / grown(own))), 0.0)
            by.setdefault(s.channel, []).append(
                (float(more), min(max(sum(own), 0.0), TUNING.largest_root), s.rows.size)
            )
    slow = set()
    for channel, each in by.items():
        weights = [float(n) for *_, n in each]
        allowed = [slow_noise_margin(memory, sum(weights)) for _, memory, _ in each]
        if np.average([m for m, *_ in each], weights=weights) > np.average(allowed, weights=weights):
            slow.add(channel)
    return slow


def slow_noise_margin(memory: float, count: float) -> float:
    """Logarithm by which slow noise may exceed what quiet stretches say of it: sigma sqrt((1 + a)/(1 - a)).

    A memory a, told by `count` samples with a standard error of sqrt((1 - a^2)/count), moves that by its (1 - a)th.
    """
    if memory > TUNING.long_memory:
        return TUNING.level_tolerance * (1.0 + TUNING.memory_tolerance * memory / (1.0 - memory))
    return TUNING.level_tolerance + TUNING.level_chance * float(
        np.sqrt((1.0 + memory) / ((1.0 - memory) * max(count, 1.0)))
    )


def is_bursting(s: Signal, misfit: Array, level: float) -> bool:
    """Whether a misfit (n,) is much less beside its bursts; digits that jump are none."""
    return s.step == 0.0 and level > SETTINGS.noise.outliers.outlier_ratio * float(
        np.sqrt(np.mean(without_outliers(misfit) ** 2))
    )


def low_frequency_level(sigma: float, ar: tuple[float, ...]) -> float:
    """Level of what is slow in a noise: sqrt of its spectral density at no frequency, per sample."""
    return sigma / grown(ar) / max(1.0 - sum(ar), 1.0 - TUNING.largest_root)


def signals_of_one_recorder(dataset: Sequence[Dataset]) -> list[list[Member]]:
    """Signals (recording, place, signal, its part of the stack) of one channel that share a recorder.

    The same rate, as many samples averaged, the same filter class.
    """
    groups: list[tuple[tuple[str, int | None, int], float, list[Member]]] = []
    for r, e in enumerate(dataset):
        for k, (s, part) in enumerate(e.spans()):
            what = (s.channel, e.recording.cfc.get(s.channel), e.averaged)
            rate = -float(np.log(np.median(np.diff(e.recording.time[s.rows]))))
            for other, at, members in groups:
                if other == what and abs(at - rate) < TUNING.same_rate:
                    members.append((r, k, s, part))
                    break
            else:
                groups.append((what, rate, [(r, k, s, part)]))
    return [members for _, _, members in groups]


@dataclass(frozen=True, kw_only=True)
class Rest:
    """Spectrum of what whitening leaves of a noise, 1 where it leaves it white; `correlation` is the noise's own.

    The short memory that few quiet windows tell is not all that a filter does: behind CFC 60 at 250 Hz it leaves a
    tenth less of what is slow than of all.
    """

    correlation: Array | None = None  # (k,), of lags 0, 1, ...
    ar: tuple[float, ...] = ()

    def at(self, frequencies: Array) -> Array:
        """Power at frequencies (m,), cycles per sample, over its mean at all of them."""
        if self.correlation is None:
            return np.ones(frequencies.size)
        both = np.concatenate([self.correlation[:0:-1], self.correlation])
        whitening = np.array([1.0, *(-a for a in self.ar)])
        left = np.convolve(both, np.convolve(whitening, whitening[::-1]))[both.size // 2 + len(self.ar) :]
        return np.asarray(
            1.0 + 2.0 * np.cos(2.0 * np.pi * np.outer(frequencies, np.arange(1, left.size))) @ (left[1:] / left[0])
        )


def rests(dataset: Sequence[Dataset]) -> list[dict[str, Rest]]:
    """What is left of each recording's noises by channel: of white noise behind the filter class that is declared.

    Only where samples are weighed: elsewhere noise is held against its own roughness, not against what is expected.
    """
    found: list[dict[str, Rest]] = [{s.channel: Rest() for s in e.signals} for e in dataset]
    for members in signals_of_one_recorder(dataset):
        estimates = sum(int(dataset[r].early[part].sum()) for r, _, _, part in members)
        for r, _, s, _ in members:
            e = dataset[r]
            cfc = e.recording.cfc.get(s.channel)
            if s.weight is None or cfc is None or e.averaged > 1 or len(s.ar) != 1:
                continue
            step = float(np.median(np.diff(e.recording.time)))
            if 1.0 / step < least_rate(cfc):
                continue
            filtered = _correlation(step, float(np.median(np.diff(s.rows))), cfc)
            if abs(s.ar[0] - filtered[1]) * np.sqrt(estimates) < TUNING.filter_errors:
                found[r][s.channel] = Rest(correlation=filtered, ar=s.ar)
    return found


@functools.lru_cache(maxsize=64)
def _correlation(step: float, every: float, cfc: int) -> Array:
    """Autocorrelation (LONGEST + 1,) of white noise behind a filter class, of so many samples one, `step` s apart."""
    f = (np.arange(TUNING.bands) + 0.5) / (2.0 * TUNING.bands * step)
    power = np.array([attenuation(float(v), step, cfc) for v in f]) ** 2
    covariance = np.cos(2.0 * np.pi * every * step * np.outer(np.arange(TUNING.longest_memory + 1), f)) @ power
    return np.asarray(covariance / covariance[0])


def autoregression(residuals: Sequence[Array], most: int = TUNING.longest_memory) -> tuple[float, tuple[float, ...]]:
    """Standard deviation and coefficients of one autoregression behind several series; its order by BIC."""
    most = min(most, max(0, min(v.size for v in residuals) // 8))
    return _driven(residuals, [(k, k) for k in range(1, most + 1)])


def long_memory(residuals: Sequence[Array]) -> tuple[float, tuple[float, ...]]:
    """The same of a noise of 1/f: one coefficient for lag 1, for 2, for 3 and 4, for 5 to 8 and on, twice as far each.

    Heterogeneous autoregression, Corsi (2009), in octaves.
    """
    most = min(v.size for v in residuals) // 8
    return _driven(residuals, [(k // 2 + 1, k) for k in TUNING.octaves if k <= most], TUNING.coefficient_cost)


def _driven(
    residuals: Sequence[Array], lags: Sequence[tuple[int, int]], dear: float | None = None
) -> tuple[float, tuple[float, ...]]:
    """An autoregression on means of the past over `lags` (first, last), on so many of the first as BIC asks for.

    Or as a criterion in which each costs as `dear`.
    """
    most = lags[-1][1] if lags else 0
    sums = [np.concatenate([[0.0], np.cumsum(v)]) for v in residuals]
    past = [
        np.concatenate([v[most - last : v.size - last] for v in residuals])
        if first == last
        else np.concatenate([c[most - first + 1 : c.size - first] - c[most - last : c.size - last - 1] for c in sums])
        / (last - first + 1)
        for first, last in lags
    ]
    y = np.concatenate([v[most:] for v in residuals])
    n = y.size
    best: tuple[float, float, tuple[float, ...]] | None = None
    for order in range(len(lags) + 1):
        X = np.stack(past[:order], axis=1) if order else np.zeros((n, 0))
        b = np.linalg.lstsq(X, y, rcond=None)[0] if order else np.zeros(0)
        a = np.concatenate([np.full(k - j + 1, v / (k - j + 1)) for v, (j, k) in zip(b, lags, strict=False)] or [b])
        roots = np.roots([1.0, *(-a)])
        if order and (
            np.max(np.abs(roots)) > TUNING.largest_root
            or np.any((np.abs(roots) > TUNING.oscillating_root) & (np.abs(roots.imag) > 0.0))
        ):
            continue  # no process, or one that rings at one frequency: hum is no noise
        power = float(np.mean((y - X @ b) ** 2)) * n / max(n - order, 1)
        score = n * np.log(max(power, 1e-300)) + order * (np.log(n) if dear is None else dear)
        if best is None or score < best[0]:
            fair = 1.0 + 2.0 / n if order == 1 else 1.0  # least squares makes the memory too short by 2/n of itself
            if order == 1 and abs(fair * a[0]) >= 1.0:  # of a short series beyond every process
                fair = TUNING.largest_root / abs(a[0])
            best = (score, power, tuple(float(v) for v in fair * a))
    assert best is not None
    return float(np.sqrt(best[1])) * grown(best[2]), best[2]


def with_noise(s: Signal, noise: float, ar: tuple[float, ...], model_error: float) -> Signal:
    """The signal held against another noise."""
    sigma = float(np.hypot(np.hypot(noise, model_error * s.span), s.scatter))
    return replace(s, noise=noise, sigma=sigma, ar=ar if noise >= TUNING.least_noise_share * sigma else ())


def with_own_model_error(e: Dataset) -> Dataset:
    """The dataset with each part of a channel, where it has two, held against what the model may miss there."""
    if not any(s.phase for s in e.signals):
        return e
    return replace(e, signals=tuple(with_noise(s, s.noise, s.quiet[1], e.model_error_of(s)) for s in e.signals))


def _quieter(misfits: Sequence[Array], own: Sequence[Array]) -> NoiseFloor | None:
    """Noise of misfits, or of the channels themselves where that shows clearly less; None of too little."""
    if sum(v.size // LENGTH for v in misfits) < 1:
        return None
    best, other = _floor(misfits), _floor(own)
    best = other if other.sigma < SETTINGS.data.dataset.own_noise_below * best.sigma else best
    beside = _floor([without_outliers(v) for v in misfits])
    return beside if 0.0 < SETTINGS.noise.outliers.outlier_ratio * beside.sigma < best.sigma else best


def _floor(values: Sequence[Array]) -> NoiseFloor:
    """Level and memory of the quiet windows of several series, none across two, counted from their ends."""
    joined = np.concatenate([v[v.size % LENGTH :] for v in values if v.size >= LENGTH])
    return noise_floor(joined, order=1, strides=(1,))

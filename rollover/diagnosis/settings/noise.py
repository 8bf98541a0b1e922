"""What is not explained by physics: noise, drift, scatter of runs."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np


@dataclass(frozen=True, kw_only=True)
class Autoregression:
    """Memory of the noise."""

    same_rate: float = 0.05  # ln of the sampling rate: recordings within it were taken alike; chosen
    own_level: float = 1.5  # ratio to the common noise: above it a recording has its own; chosen
    level_errors: float = 4.0  # standard errors: levels that differ by more are not one recorder's; chosen
    least_windows: int = 4  # quiet windows from which on an own level is believed; chosen
    longest_memory: int = 8  # samples: longest memory; chosen
    # cost of a coefficient in -2 ln L; Akaike's criterion; distant octaves say little each, and count
    coefficient_cost: float = 2.0
    octaves: tuple[int, ...] = (1, 2, 4, 8, 16, 32, 64)  # samples: lags of a noise of 1/f; chosen
    # share of the whole error that is noise: below it no memory is estimated, the model's error prevails; chosen
    least_noise_share: float = 0.7
    oscillating_root: float = 0.9  # modulus of a complex root at most; chosen
    level_tolerance: float = 0.4  # ln of the slow noise's level: a misfit may exceed what is quiet by it; chosen
    level_chance: float = 4.0  # standard errors that are chance beside `level_tolerance`; chosen
    long_memory: float = 0.7  # sum of coefficients: above it windows of 48 samples underestimate the memory; chosen
    memory_tolerance: float = 0.8  # factor of `level_tolerance` for each sample of such a memory; chosen
    largest_root: float = 0.995  # modulus of a memory's largest root; chosen
    filter_errors: float = 2.0  # standard errors within which a memory is that of a filter; chosen
    bands: int = 2048  # frequencies over which the noise behind a filter is summed; chosen
    level_error: float = 1.6  # standard error of ln sigma times sqrt(samples); chosen
    level_p_value: float = 1e-4  # p-value below which levels are not alike; chosen


@dataclass(frozen=True, kw_only=True)
class Drift:
    """Drift of a channel."""

    drift_terms: int = 5  # cosines of a stretch, the first of them its mean; chosen
    contact_terms: int = 8  # cosines of all that follows the contact; chosen
    least_samples: int = 24  # samples of an approach; chosen
    least_recordings: int = 3  # recordings that show what they share; chosen
    least_ratio: float = 1.5  # ratio to the expected sum of squares; chosen
    largest_memory: float = 0.99  # sum of coefficients of a quiet noise at most; chosen
    slow_p_value: float = 0.01  # p-value of (A1): below it a channel is slow; chosen
    louder_p_value: float = 0.01  # p-value of (A2): below it, it is louder after the contact; chosen
    shared_p_value: float = 0.02  # p-value of (A3): below it, recordings share the course; chosen


@dataclass(frozen=True, kw_only=True)
class Ensemble:
    """Scatter of runs with many contacts."""

    # s: over which squares of neighbours are averaged, since errors in time are errors in size; chosen
    window: float = 0.02
    few_factor: float = 1.5  # factor c of the scatter; six neighbours
    longest_memory: float = 0.1  # s: longest memory of the scatter; chosen
    full_weight: float = 0.99  # weight: channels above it everywhere are not reweighted; chosen
    state_size: int = 14  # numbers (d): dimension of the vehicle's state; position and velocity of a body, and an axle
    least_channels: int = 3  # channels: with fewer none is distinguished from another course; chosen
    diverged_share: float = 0.5  # share of a recording's full weight: below it the recording has diverged; chosen
    divergence_rate: float = 0.15  # probability that one recording diverges from its run; chosen
    divergence_p_value: float = 0.02  # p-value of the number that diverged: below it that is no chance; chosen
    least_perturbed: int = 2  # perturbed runs that show how far one more may go; chosen
    outlier_power: float = 9.0  # ratio to the median power of perturbed runs: beyond it one has diverged; chosen


@dataclass(frozen=True, kw_only=True)
class Heteroscedasticity:
    """Noise that grows with the value."""

    bins: int = 12  # bins of values; chosen
    least_samples: int = 14  # samples of a bin; chosen
    # ln of a ratio: noise of the largest quarter over that of the smallest; ln 2, twice the noise
    least_rise: float = float(np.log(2.0))
    least_errors: float = 4.0  # standard errors of that rise; chosen
    least_range: float = 8.0  # noise units: distance of large values from small ones; chosen
    even_tolerance: float = 0.02  # share of the sampling interval, and of stamps: deviation of even stamps; chosen
    # standard error of ln sigma times sqrt(samples); of a median (1.17), of overlapping differences (sqrt 3)
    level_error: float = 1.17 * 3.0**0.5
    smoothing: int = 9  # samples over which the value is averaged; chosen


@dataclass(frozen=True, kw_only=True)
class Offsets:
    """Zero offsets of channels."""

    early_share: float = 0.6  # share of the time before the first contact, as clocks may be wrong; chosen
    flat_prediction: float = 0.5  # noise units: change of the prediction there at most; chosen
    reported_ratio: float = 1.5  # ratio to a zero's error: differences of zeros that are reported; chosen
    least_samples: int = 8  # samples of the approach; chosen
    least_recordings: int = 3  # recordings that show what they have in common; chosen
    wave_terms: int = 3  # cosines beyond the mean; chosen
    slow_p_value: float = 0.01  # p-value of these: below it a channel drifts; chosen
    differ_p_value: float = 1e-4  # p-value of (Z1): below it zeros differ; chosen
    # p-value of a common zero: below it the common zero is no chance of zeros that differ; chosen
    shared_p_value: float = 0.01


@dataclass(frozen=True, kw_only=True)
class Outliers:
    """Bursts."""

    median_width: int = 13  # samples of the running median; chosen
    # ratio to the usual distance from the median: beyond it a sample is in a burst; chosen
    outlier_distance: float = 5.0
    outlier_ratio: float = 1.5  # ratio to the noise beside bursts: above it bursts are no noise; chosen
    least_clean_share: float = 0.7  # share of the samples beside bursts; chosen
    outlier_rate: float = 0.01  # share of a channel's samples that may be outliers of any noise; chosen


@dataclass(frozen=True, kw_only=True)
class SpectralLines:
    """Hum."""

    padding: int = 4  # factor by which a periodogram is padded; chosen
    median_half_width: int = 12  # frequencies of a periodogram on either side in the running median; chosen
    least_periods: float = 8.0  # periods in a recording: with fewer it is no line; chosen
    highest_frequency: float = 0.4  # share of the sampling rate; chosen
    p_value: float = 1e-6  # p-value of a line; chosen
    most_lines: int = 3  # lines at most; chosen
    least_samples: int = 64  # samples of a recording; chosen
    fine_count: int = 17  # frequencies about the best; chosen


@dataclass(frozen=True, kw_only=True)
class Truncation:
    """End of a recording that is left out."""

    retained_after_impact: float = 0.6  # s after the impact that are always kept; chosen
    least_cut: float = 0.1  # s: a shorter end is not cut off; chosen
    least_weight: float = 0.3  # share of full weight on average: from it on the end is kept; chosen
    least_misfit: float = 3.0  # ratio to what noise and scatter leave: an end that is missed by more is kept; chosen
    least_samples: int = 8  # samples of a signal; chosen


@dataclass(frozen=True, kw_only=True)
class Noise:
    """What is not explained by physics: noise, drift, scatter of runs."""

    autoregression: Autoregression = Autoregression()  # memory of the noise
    drift: Drift = Drift()  # drift of a channel
    ensemble: Ensemble = Ensemble()  # scatter of runs with many contacts
    heteroscedasticity: Heteroscedasticity = Heteroscedasticity()  # noise that grows with the value
    offsets: Offsets = Offsets()  # zero offsets of channels
    outliers: Outliers = Outliers()  # bursts
    spectral_lines: SpectralLines = SpectralLines()  # hum
    truncation: Truncation = Truncation()  # end of a recording that is left out

"""Recordings: their signals, clocks, conditions and faults."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True, kw_only=True)
class ConditionUncertainty:
    """Errors of the stated conditions."""

    # share of the largest singular value: directions below are rounding; chosen
    least_singular_value: float = 1e-9


@dataclass(frozen=True, kw_only=True)
class Dataset:
    """Signals of a recording, their noise and time shift."""

    # share of a channel's range: what integrators differ by is no mismatch; chosen
    model_error: float = 2e-4
    # s, standard deviation: prior of the time shift of a recording whose clock has no known zero; chosen
    loose_shift_prior: float = 0.02
    own_noise_below: float = 0.75  # ratio to the misfit's noise: below it the channel's own noise is believed; chosen
    memory_windows: int = 10  # quiet windows: from so many on a memory of two samples is estimated; chosen
    other_error_share: float = 0.5  # ratio to the noise: from it on another error has a large part; chosen
    # ratio to the noise: a discrepancy below is hidden by it, and held to be as large; 2 % above `other_error_share`
    hidden_discrepancy: float = 1.02 * other_error_share
    # Hz per filter class (CFC): corner frequency of the filter, forward and backward; definition of the CFC filter
    # (SAE J211)
    corner_per_class: float = 2.0775
    # s, standard deviation: prior of the time shift of a recording whose zero is known; chosen
    shift_prior: float = 1e-3


@dataclass(frozen=True, kw_only=True)
class Inconsistent:
    """Channels that contradict each other in sign, unit or name."""

    # absolute correlation: from it on two signals are one, but for a factor and what is missing; chosen
    least_correlation: float = 0.7
    factor_tolerance: float = 0.25  # ln of a factor: error that missing physics may cause; chosen
    # ln of a factor: error that all recordings of a channel may have in common; chosen
    common_factor_tolerance: float = 0.6
    shift_width: float = 3.0  # standard deviations of the prior: half width of the search for a time shift; chosen
    shift_steps: int = 61  # time shifts that are tried; chosen
    # factor, or its inverse: the least that is called a wrong unit; above what ground 3 times as stiff does
    least_unit_factor: float = 5.0


@dataclass(frozen=True, kw_only=True)
class Onset:
    """First contacts."""

    # standard deviations: a zero that is no further from the stated one is the stated one; chosen
    same_zero: float = 0.01


@dataclass(frozen=True, kw_only=True)
class Phases:
    """Phases of a drop."""

    first_contact: float = 0.005  # s: length of the first contact after the impact; chosen
    around_peak: float = 0.10  # share of the time to the deepest point: half width of the phase about it; chosen
    settling: float = 0.06  # s: from the deepest point to the begin of rest; chosen


@dataclass(frozen=True, kw_only=True)
class Quantisation:
    """Steps of a digitised channel."""

    whole_step_tolerance: float = 0.02  # share of a step: deviation of a level from a whole number of steps; chosen
    least_levels: int = 3  # levels of a digitised channel, at least; chosen
    least_common_error: float = 0.03  # share of half a step: less in common is no error of quantisation; chosen
    most_levels: float = 0.5  # levels per sample: with so many, or more, steps do not matter; chosen
    equal_within: float = 1e-9  # relative difference: values within it are equal; chosen
    least_at_end: int = 5  # samples: so many equal extremes are an end of the range; chosen


@dataclass(frozen=True, kw_only=True)
class Repeatability:
    """Recordings of one test held against each other."""

    # s: error of a clock that is stated to be right, beyond which the clock is to be named; chosen
    most_late: float = 0.1
    ignored_samples: int = 3  # samples: largest differences beside a jump that are left out; chosen
    scatter_above: float = 1.2  # ratio to the noise: from it on there is scatter; chosen
    least_samples: int = 16  # samples in common: with fewer nothing is said; chosen
    coarse_step: float = 1e-3  # s: step of the first scan of a time shift; chosen
    fine_steps: tuple[float, ...] = (1e-4, 1e-5)  # s: steps of the scans beside the best time shift; chosen
    fine_count: int = 21  # time shifts in each of the finer scans; chosen
    reported_difference: float = 0.02  # share of a channel's range: smaller differences are not reported; chosen
    # share of a channel's range: from it on recordings of one test contradict each other; chosen
    contradiction: float = 0.1


@dataclass(frozen=True, kw_only=True)
class Rounding:
    """Rounding of stated conditions."""

    most_decimals: int = 15  # decimal digits: a value with as many was not rounded; digits of double precision
    least_rounding: float = 3e-4  # share of a value: a finer rounding does not matter; chosen
    most_rounding: float = 1e-2  # share of a value: a value rounded more coarsely may be nominal; chosen


@dataclass(frozen=True, kw_only=True)
class Data:
    """Recordings: their signals, clocks, conditions and faults."""

    condition_uncertainty: ConditionUncertainty = ConditionUncertainty()  # errors of the stated conditions
    dataset: Dataset = Dataset()  # signals of a recording, their noise and time shift
    inconsistent: Inconsistent = Inconsistent()  # channels that contradict each other in sign, unit or name
    onset: Onset = Onset()  # first contacts
    phases: Phases = Phases()  # phases of a drop
    quantisation: Quantisation = Quantisation()  # steps of a digitised channel
    repeatability: Repeatability = Repeatability()  # recordings of one test held against each other
    rounding: Rounding = Rounding()  # rounding of stated conditions

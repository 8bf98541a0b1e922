"""Tests, intervals and what a mismatch depends on."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True, kw_only=True)
class Adequacy:
    """Mismatches that do not matter."""

    negligible: float = 0.001  # share of a channel's range: smaller changes need no name; chosen


@dataclass(frozen=True, kw_only=True)
class Chassis:
    """Rates of the chassis."""

    smoothing: float = 0.012  # s: window over which a gyroscope is differentiated; chosen


@dataclass(frozen=True, kw_only=True)
class Clipping:
    """Sensors that are clipped."""

    flat_top_chance: float = 1e-3  # probability that a sound channel shows a flat top; chosen
    same_limit: float = 1e-6  # share of a value: limits within it are one; chosen


@dataclass(frozen=True, kw_only=True)
class CoarseSampling:
    """Coarse digits."""

    least_step: float = 0.05  # share of a channel's range in all recordings: steps of its digits that matter; chosen


@dataclass(frozen=True, kw_only=True)
class ConditionPulls:
    """How far recordings pull what is stated of their conditions."""

    least_pull: float = 1.0  # standard deviations: less is what the statement itself expects of two in three


@dataclass(frozen=True, kw_only=True)
class Discrepancy:
    """Prior of a model's discrepancy."""

    # shares of a channel's range: 5 % and 95 % quantiles of a model's discrepancy; chosen
    usual_range: tuple[float, ...] = (0.01, 0.10)
    normal_quantile: float = 1.645  # 95 % quantile of the standard normal distribution; definition
    least_scale: float = 1e-4  # share of a channel's range: least discrepancy that is tried; chosen
    largest_scale: float = 1.0  # share of a channel's range: largest discrepancy that is tried; chosen
    scale_count: int = 801  # discrepancies that are tried; steps of 1.2 %, the widest that no digit of a report shows
    refit_below: float = 0.7  # ratio of two estimates: a smaller one is worth another fit; chosen
    usual_most: float = 0.05  # share of a channel's range: three quarters of all models miss less; from `usual_range`
    draws: float = 2.0  # independent draws in a channel of a drop; loading, and unloading with rest
    # share of the way down: least correlation time of a discrepancy, as it keeps its sign over a good part of a phase
    # (a wave of two turns on the way down: 1/(2*6 ln 2) = 0.12); what is quicker and repeats is none
    shortest: float = 0.1
    # references that teach a course: of two each would be predicted by one other, which tells no mean from its own
    least_references: int = 3


@dataclass(frozen=True, kw_only=True)
class DropDependence:
    """What a mismatch of drops depends on."""

    force_knots: tuple[int, ...] = (2, 3, 6, 12, 24, 48)  # numbers of knots of a force that are tried; chosen
    sensor_knots: tuple[int, ...] = (6, 24, 96, 192)  # numbers of knots of a sensor's curve that are tried; chosen
    decay_times: tuple[float, ...] = (0.005, 0.01, 0.02, 0.04, 0.08, 0.16)  # s: decay times of a force; chosen
    least_share: float = 0.3  # share of the excess misfit: a quantity that explains less is not named; chosen
    sensor_share: float = 0.5  # the same where one channel alone is wrong: what it depends on would explain all; chosen
    smoothness: float = 1e-5  # 1/variance of steps between knots: beyond the data a function stays constant; chosen
    others_excess: float = 0.1  # share of the excess misfit that channels beside a faulty one may have; chosen
    same_shift: float = 0.05  # standard deviations of the prior: time shifts within it are one; chosen
    most_shifts: int = 4  # time shifts that are tried; chosen
    better_than_force: float = 0.5  # ratio to what the best force leaves: a sensor must leave less; chosen
    chance: float = 2.0  # standard deviations of a sum of squares that are chance; chosen


@dataclass(frozen=True, kw_only=True)
class Intervals:
    """Intervals of parameters."""

    outside_range: float = 1.0  # ranges beyond an end where an interval ends at the latest; chosen
    near_end: float = 0.1  # share of a value: distance of a range's end from the fit; chosen
    end_error: float = 1e-3  # share of such an end: half width of its interval; chosen
    least_rise: float = 0.4  # share of the due rise of the misfit; chosen
    # rise of the misfit that is no chance; misfits of means of runs scatter by 3 (1 sd) from place to place
    model_error_rise: float = 8.0
    # factors of the half width at which one looks behind a rise; chosen
    scan_factors: tuple[float, ...] = (1.0, 1.5, 2.0, 3.0, 4.0, 6.0, 8.0)
    widen_above: float = 1.2  # factor: below it an interval that is too narrow is chance; chosen
    least_recordings: int = 3  # recordings that can disagree; chosen
    halvings: int = 7  # bisections of the way to the end of a range; chosen
    widen_factor: float = 2.0  # factor by which an interval is widened at a time; chosen
    widen_most: float = 30.0  # factor by which an interval is widened at most; chosen
    ridge_factor: float = 1.3  # factor of a step along a ridge; chosen
    ridge_steps: int = 9  # steps along a ridge; chosen
    held_rounds: int = 8  # rounds of a fit with one coordinate held; chosen


@dataclass(frozen=True, kw_only=True)
class LackOfFit:
    """Test for a mismatch."""

    p_value: float = 1e-3  # p-value below which there is a mismatch; chosen
    most_dispersion: float = 4.0  # ratio to the noise's power: what is rough beyond is no noise; chosen
    most_waves: int = 12  # cosines of the slow basis of a cell, at most; chosen


@dataclass(frozen=True, kw_only=True)
class LocalQuadratic:
    """Misfit of means of runs about a fit."""

    # standard errors: places on either side, stage by stage, the nearest first; chosen
    stages: tuple[tuple[float, ...], ...] = ((1.0, 2.0, 3.0, 4.0), (6.0, 8.0), (12.0, 16.0), (24.0, 32.0))
    # ratio to what scatter alone makes of it: a slope is well determined; as of weak instruments (Staiger and Stock
    # 1997)
    clear_slope: float = 10.0
    some_slope: float = 1.0  # the same ratio: a slope is determined at all; chosen
    least_points: int = 6  # places that determine a slope; chosen
    same_slope: float = 0.8  # share of the slope at the fit: from it on the mean's is the same; chosen
    normal_quantile: float = 1.96  # two-sided 95 % quantile of the standard normal distribution; definition
    # ratio to the rise that slopes predict: above it, and `outlier_rise`, a run took another course; chosen
    outlier_ratio: float = 4.0
    outlier_rise: float = 10.0  # ratio to the due rise: see `outlier_ratio`; chosen


@dataclass(frozen=True, kw_only=True)
class LostSamples:
    """Lost samples."""

    least_breaks: int = 2  # breaks of one channel at least; chosen


@dataclass(frozen=True, kw_only=True)
class ResidualForce:
    """Force that a drop's mismatch asks for."""

    step: float = 5e-4  # s: time step of the motion; chosen
    duration: float = 0.4  # s: length of the motion at most; chosen
    stopped_speed: float = 0.03  # share of the speed just after the impact: below it the body has stopped; chosen
    free_knots: int = 56  # knots of a free force; chosen
    tangent_step: float = 1e-4  # m: step of a tangent stiffness; chosen
    knot_power: float = 1.6  # power of the knots' spacing: knots are denser soon after the impact; chosen
    force_prior: float = 1.0  # share of the largest force: prior standard deviation of a free force; chosen
    speed_prior: float = 0.1  # share of the speed just after the impact: its prior standard deviation; chosen
    stiffness_rounds: int = 2  # rounds in which the stiffness on the measured way is renewed; chosen


@dataclass(frozen=True, kw_only=True)
class ResidualLaw:
    """Ground law regressed from the mismatch."""

    simulated_sets: int = 3  # sets of terms that are simulated; chosen
    least_term_gain: float = 0.15  # ln of the held-out error: least gain of a further term; chosen
    least_errors: float = 2.0  # standard errors that a gain must exceed; chosen
    least_law_gain: float = 0.1  # ln of the held-out errors' ratio: below it a law is not offered; chosen
    ridge: float = 1e-6  # share of a column's square: ridge of the regression; chosen
    search_width: float = 1.5  # ratio to the regression's force: half width of the search; chosen


@dataclass(frozen=True, kw_only=True)
class Scores:
    """Scores of single recordings."""

    rating_samples: int = 1500  # samples on which a rating is calculated; chosen
    least_samples: int = 24  # samples before an impact: with fewer nothing is said; chosen


@dataclass(frozen=True, kw_only=True)
class VehicleDependence:
    """What a mismatch of full runs depends on."""

    knots: int = 7  # knots of a function; chosen
    most_quantities: int = 2  # quantities that are named at most; chosen
    least_second_share: float = 0.05  # share of the excess misfit that a second quantity must add; chosen


@dataclass(frozen=True, kw_only=True)
class WeakForm:
    """Weak form of the equation of motion."""

    windows: int = 18  # windows of each recording; chosen
    overlap: int = 2  # marks from a window's centre to its ends; chosen
    window_power: float = 1.5  # power of the windows' spacing: windows are denser soon after the contact; chosen
    least_half_width: float = 3.0  # sampling intervals: least half width of a window; chosen
    least_rows: int = 40  # rows during penetration at least; chosen
    most_rows: int = 240  # rows of a recording at most; chosen


@dataclass(frozen=True, kw_only=True)
class WrongCondition:
    """Stated conditions that one recording contradicts."""

    least_recordings: int = 4  # recordings; three on a line, and the one beside it
    least_scatter: float = 0.015  # ln of a factor: standard error at least; chosen
    least_deviation: float = 0.15  # ln of a factor: deviation from the line at least; chosen
    least_errors: float = 5.0  # standard errors: deviation from the line at least; chosen
    least_speed_change: float = 0.1  # ln of a speed: least that is called another speed; chosen
    most_speed_change: float = 0.8  # ln of a speed: furthest that is searched; chosen
    most_power: float = 4.0  # ratio to the largest power of the others: misfit at the other speed; chosen
    least_fall: float = 4.0  # ratio: times less misfit than at the stated speed; chosen


@dataclass(frozen=True, kw_only=True)
class Inference:
    """Tests, intervals and what a mismatch depends on."""

    adequacy: Adequacy = Adequacy()  # mismatches that do not matter
    chassis: Chassis = Chassis()  # rates of the chassis
    clipping: Clipping = Clipping()  # sensors that are clipped
    coarse_sampling: CoarseSampling = CoarseSampling()  # coarse digits
    condition_pulls: ConditionPulls = ConditionPulls()  # pulls of stated conditions
    discrepancy: Discrepancy = Discrepancy()  # prior of a model's discrepancy
    drop_dependence: DropDependence = DropDependence()  # what a mismatch of drops depends on
    intervals: Intervals = Intervals()  # intervals of parameters
    lack_of_fit: LackOfFit = LackOfFit()  # test for a mismatch
    local_quadratic: LocalQuadratic = LocalQuadratic()  # misfit of means of runs about a fit
    lost_samples: LostSamples = LostSamples()  # lost samples
    residual_force: ResidualForce = ResidualForce()  # force that a drop's mismatch asks for
    residual_law: ResidualLaw = ResidualLaw()  # ground law regressed from the mismatch
    scores: Scores = Scores()  # scores of single recordings
    vehicle_dependence: VehicleDependence = VehicleDependence()  # what a mismatch of full runs depends on
    weak_form: WeakForm = WeakForm()  # weak form of the equation of motion
    wrong_condition: WrongCondition = WrongCondition()  # stated conditions that one recording contradicts

"""Least-squares fits of parameters."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True, kw_only=True)
class CrossValidation:
    """Prediction of held-out recordings."""

    # ratio to what a fit leaves: above it a linear prediction of held-out recordings is doubted; chosen
    nonlinear_above: float = 1.2
    shift_rounds: int = 3  # rounds of fitting a held-out recording's time shift; chosen
    noise_alone: float = 1.5  # misfit over the noise: up to it the statistics of the noise decide; chosen


@dataclass(frozen=True, kw_only=True)
class EnsembleMean:
    """Fits to means of perturbed runs."""

    accepted_misfit: float = 1.15  # ratio to the least misfit: up to it a step is accepted; chosen
    longest_step: float = 0.15  # coordinate (0 to 1): longest step by one mean; chosen
    most_steps: int = 5  # steps at most; chosen
    finer_parts: int = 4  # parts of the scenario's time step in runs of shorter steps; chosen
    finer_steps: int = 2  # steps by runs in shorter time steps; each costs as many runs as `finer_parts` others; chosen
    whole_step: float = 1.0  # share of a step that is tried first; chosen
    # shares of a step that are tried where a run jumps to another course beside it; chosen
    other_steps: tuple[float, ...] = (0.5, 1.5)
    least_gain: float = 2.0  # sum of squares over the noise: promised gain that pays for a step; chosen
    # share of the misfit beyond noise and scatter: the same where more is missing; chosen
    least_gain_share: float = 0.05


@dataclass(frozen=True, kw_only=True)
class FiniteDifferences:
    """Steps of finite differences."""

    sensor_step: float = 5e-3  # coordinate (0 to 1): step for sensors, whose differences are free of scatter; chosen
    shift_rounds: int = 3  # rounds: moves of a time shift to where it fits; chosen
    least_signal: float = 12.0  # ratio to the scatter's sum of squares: a difference below it is widened; chosen
    target_change: float = 1.0  # noise units: change of a recording that a step should make where a fit ends; chosen
    most_change: float = 4.0  # ratio to `target_change`: above it the step was too wide; chosen
    doubted_ratio: float = 2.0  # ratio of two slopes: above it the steeper one is doubted; chosen
    # ratio of the sums of squares of both sides: above it a run jumps to another course; chosen
    discontinuity_ratio: float = 4.0
    fine_share: float = 0.25  # share of a step: for parameters that act only near their value; chosen


@dataclass(frozen=True, kw_only=True)
class LevenbergMarquardt:
    """Damped least squares."""

    lengthen_above: float = 3.0  # misfit over the noise: above it a step may be lengthened; chosen
    lengthen_factor: float = 2.0  # factor of one lengthening; chosen
    most_lengthenings: int = 6  # lengthenings of one step; chosen
    step_retries: int = 4  # trials of a step, each damped more; chosen
    local_slopes_below: float = 2.0  # misfit over the noise: up to it slopes are those of the place itself; chosen
    # share of the promised gain: with less the Jacobian of what is held is renewed; chosen
    reuse_least_share: float = 0.7
    reuse_least_gain: float = 0.01  # share of the misfit: with less the Jacobian of what is held is renewed; chosen
    # shares of a time shift's step that are tried where all of it leads nowhere; chosen
    shorter_shifts: tuple[float, ...] = (0.5, 0.0)
    # share of the misfit beyond the noise: least gain of a round for drops where much is left; chosen
    converged_share: float = 1e-3
    noise_left: float = 1.04  # misfit over the noise: below it no further search is needed; chosen
    converged_gain: float = 0.3  # sum of squares over the noise: gain of a round below which a search stops; chosen
    converged_gain_fine: float = 1e-3  # the same where a fit is ended; chosen
    least_promise: float = 0.3  # share of the least gain: slopes that promise less end the search; chosen
    least_promise_far: float = 0.1  # the same, of the gain that is enough where much is left; chosen


@dataclass(frozen=True, kw_only=True)
class Linearisation:
    """Normal equations."""

    widest_shift: float = 4.0  # standard deviations of the prior: largest time shift; chosen
    weak_prior: float = 1e-4  # 1/variance of a coordinate: keeps undetermined coordinates where they are; chosen


@dataclass(frozen=True, kw_only=True)
class LocalSearch:
    """Search about a fit that may be a local minimum."""

    # coordinates (0 to 1) of a damping that lets an oscillation last; chosen
    light_damping: tuple[float, ...] = (0.3, 0.5)
    coarse_secondary: int = 6  # places of a shape that is varied with an oscillation; chosen
    fine_secondary: int = 40  # places of a shape that is varied alone; chosen
    abandon_above: float = 2.0  # ratio to what another explanation leaves: beyond it a fit is abandoned; chosen
    most_shift_trials: int = 40  # trials of a time shift at most; chosen
    condition_rounds: int = 3  # rounds of a fit with errors of the conditions as they act beside it; chosen
    first_count: int = 11  # places on a first coordinate; chosen
    first_half_width: float = 0.05  # coordinate (0 to 1): half width of these about the fit; chosen
    second_count: int = 20  # places on the second coordinate, over its whole range; chosen
    frequency_count: int = 57  # frequencies of an oscillation that are tried; chosen
    frequency_half_width: float = 0.225  # coordinate (0 to 1): half width of these about the fit; three octaves
    starts: int = 3  # best places from which fits begin; chosen
    start_distance: float = 0.06  # coordinate (0 to 1): least distance of two starts; chosen
    shift_step: float = 8e-5  # s: first step of a time shift to either side; chosen
    shift_step_least: float = 5e-6  # s: smallest step of a time shift; chosen
    shift_step_factor: float = 0.4  # factor of a step after a round without gain; chosen
    repeats: int = 2  # repetitions of the search; chosen
    least_gain: float = 1.0  # sum of squares over the noise: a smaller gain needs no repetition; chosen


@dataclass(frozen=True, kw_only=True)
class ModelVariants:
    """Forms of an effect, each fitted with its shape."""

    least_gain: float = 12.0  # sum of squares over the noise: gain that pays for a shape; chosen
    short_rounds: int = 4  # rounds of a short fit that shows where to begin; chosen
    followed_misfit: float = 1.5  # ratio to the best short fit's misfit: up to it others are followed; chosen
    much_left: float = 2.0  # misfit over the noise: from it on much is left; chosen
    # ratio to an effect's misfit without a shape: a short fit with its true shape leaves less; chosen
    secondary_misfit: float = 0.95
    same_point: float = 0.003  # coordinate (0 to 1): two short fits within it have met; chosen
    same_misfit: float = 0.01  # relative difference of misfits: fits near each other within it will meet; chosen
    # ratio to what another explanation leaves: above it a curved valley is not followed; chosen
    no_ridge_above: float = 1.2
    # coordinate (0 to 1), from the fit: where the scan of another form's threshold begins; chosen
    threshold_low: float = -0.1
    threshold_high: float = 0.05  # coordinate (0 to 1), from the fit: where it ends; chosen
    threshold_count: int = 13  # places of that scan; chosen
    # coordinates (0 to 1) of a parameter that only this form has; chosen
    new_points: tuple[float, ...] = (0.2, 0.35, 0.5, 0.65, 0.8)
    meeting_rounds: int = 3  # rounds of all recordings, after which fits are compared; chosen
    meeting_distance: float = 0.1  # coordinate (0 to 1): fits within it then lead to one place; chosen
    # per sample: misfit of a short fit beyond another explanation's that leaves noise; chosen
    short_excess: float = 0.5
    followed_excess: float = 0.35  # per sample: the same of a fit that was followed; chosen


@dataclass(frozen=True, kw_only=True)
class Notebook:
    """Kept predictions."""

    most_bytes: int = 5 * 10**8  # bytes: memory of kept predictions; chosen
    # 1: kept Jacobians; of six drops a fourth is asked for again, four in five of these within it; chosen
    most_linearised: int = 256


@dataclass(frozen=True, kw_only=True)
class Parameterisation:
    """Coordinates of an effect and where its fits begin."""

    # coordinates (0 to 1) of a shape at which fits begin; chosen
    secondary_starts: tuple[float, ...] = (0.1, 0.3, 0.5, 0.7, 0.9)
    zero_step: float = 0.01  # coordinate (0 to 1): step off an effect's zero at which it is looked at; chosen
    # coordinates (0 to 1): steps at which a clock is looked at; chosen
    clock_steps: tuple[float, ...] = (0.08, 0.16, 0.3)
    threshold_count: int = 10  # places at which a parameter without a zero is looked at; chosen
    grid_of_one: tuple[int, ...] = (5,)  # places on the axis of an effect of one parameter; chosen
    grid_of_several: tuple[int, ...] = (8, 4, 3)  # places on the axes of an effect of several parameters; chosen
    run_step: float = 0.08  # coordinate (0 to 1): step off zero where each place costs a full run; chosen
    limit_points: tuple[float, ...] = (0.12, 0.3)  # coordinates (0 to 1): further places of a limit; chosen
    # coordinates (0 to 1): places of a depth or length that has no zero; chosen
    length_points: tuple[float, ...] = (0.12, 0.3, 0.6)
    end_distance: float = 0.01  # coordinate (0 to 1): distance of a start from the ends of its range; chosen
    sliding_tilt: float = 2.0  # tangent of the tilt at which a load slides; chosen
    strong_shares: tuple[float, ...] = (0.35, 0.9)  # shares of the way from an effect's zero to an end; chosen


@dataclass(frozen=True, kw_only=True)
class ThresholdScan:
    """Scan over a threshold."""

    minima: int = 3  # minima on either side in which fits begin; chosen
    short_rounds: int = 4  # rounds of a fit that shows whether a minimum is worth more; chosen
    wide_count: int = 80  # places over the whole range; chosen
    near_step: float = 0.002  # coordinate (0 to 1): distance of places about a fit; chosen
    near_count: int = 20  # places about a fit on either side; chosen


@dataclass(frozen=True, kw_only=True)
class TimeShift:
    """Time shift of a recording against its simulation."""

    search_width: float = 3.0  # standard deviations of the prior: half width of the search; chosen
    search_count: int = 241  # time shifts that are tried; chosen
    search_at_once: int = 16  # of them that are compared in one go, so that runs stay in the cache; chosen
    quiet_median: float = 2.0  # noise units: median misfit of a fall, up to which it is met; chosen
    model_error: float = 0.1  # share of a channel's change: error of the model soon after the contact; chosen
    # standard deviations of the prior: larger shifts are the model's fault where the clock's zero is known; chosen
    believed_width: float = 2.0
    largest_error: float = 0.25  # s: error of a clock that should have none; chosen
    least_overlap: float = 0.5  # share of a recording that must be left to compare; chosen
    # ratio: times less misfit than at the stated time, for rows that are means about another contact; chosen
    least_fall: float = 30.0
    contact_window: float = 1e-3  # s: search about a first contact found without a model; chosen
    end_share: float = 0.9  # share of `contact_window`: from it on the search ended at its end; chosen
    early_window: float = 8e-3  # s after the first contact that determine it; chosen
    early_samples: int = 4  # samples after the first contact that determine it, at least; chosen
    accepted_power: float = 2.0  # ratio to the noise's power: most that is left where a shift is right; chosen
    least_improvement: float = 4.0  # ratio of power: least that the stated time leaves over the shifted; chosen
    no_physics: float = 0.02  # s: shift beyond which no physics imitates it; chosen
    least_fall_far: float = 10.0  # ratio: the same as `least_fall` for shifts beyond `no_physics`; chosen
    least_rise: float = 1.5  # ratio: rise of the power at `no_physics` to either side; chosen


@dataclass(frozen=True, kw_only=True)
class OwnModel:
    """First fits of a model of one's own."""

    beside: tuple[float, ...] = (-0.1, 0.1)  # coordinate (0 to 1): starts to either side of the stated one; chosen
    repeats: int = 10  # fits that go on where the one before ended, at most; chosen
    least_gain: float = 0.1  # sum of squares over the noise: with less a fit has ended; 1/40 of what decides (3.84)


@dataclass(frozen=True, kw_only=True)
class Fit:
    """Least-squares fits of parameters."""

    cross_validation: CrossValidation = CrossValidation()  # prediction of held-out recordings
    ensemble_mean: EnsembleMean = EnsembleMean()  # fits to means of perturbed runs
    finite_differences: FiniteDifferences = FiniteDifferences()  # steps of finite differences
    levenberg_marquardt: LevenbergMarquardt = LevenbergMarquardt()  # damped least squares
    linearisation: Linearisation = Linearisation()  # normal equations
    local_search: LocalSearch = LocalSearch()  # search about a fit that may be a local minimum
    model_variants: ModelVariants = ModelVariants()  # forms of an effect, each fitted with its shape
    notebook: Notebook = Notebook()  # kept predictions
    parameterisation: Parameterisation = Parameterisation()  # coordinates of an effect and where its fits begin
    threshold_scan: ThresholdScan = ThresholdScan()  # scan over a threshold
    time_shift: TimeShift = TimeShift()  # time shift of a recording against its simulation
    own_model: OwnModel = OwnModel()  # first fits of a model of one's own

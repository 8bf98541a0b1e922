"""Which effects explain a mismatch."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True, kw_only=True)
class Candidates:
    """Candidates of an explanation."""

    # correlation with the reversed simulation: from it on a channel has the wrong sign; chosen
    reversed_correlation: float = 0.8
    faintest: float = 20.0  # factor: strengths so many times below an effect's usual range are searched; chosen


@dataclass(frozen=True, kw_only=True)
class Decision:
    """Decision on an explanation."""

    scan_share: float = 0.05  # share of all errors for the look at candidates, where runs scatter; chosen
    largest_p_value: float = 1.0 - 1e-12  # p-value: largest whose logarithm is taken; chosen
    # share of the excess misfit, were it structured, that one named effect may leave; chosen
    left_structure: float = 0.005
    # share of the excess misfit that effects must take where far more than noise is left; chosen
    little_share: float = 0.1
    most_exchanges: int = 1  # exchanges of one of as many effects as allowed; with more, any would do; chosen
    held_out_ratio: float = 1.2  # ratio to a tolerance: what an explanation leaves of held-out recordings; chosen


@dataclass(frozen=True, kw_only=True)
class EnsembleValidation:
    """Effects validated by means of runs."""

    # p-value of a candidate's own score: above it its fit to runs that scatter is chance; chosen
    own_p_value: float = 0.05
    rival_share: float = 0.5  # share of the best's gain, by the mean of its runs, that a rival must have; chosen
    least_gain: float = 25.0  # sum of squares over what is left per sample: gain of an effect beside all others; chosen
    shared_gain: float = 9.0  # the same that all recordings but the best must bring together; chosen
    # ratio to a linear interval: a strength beyond it differs from zero without further runs; chosen
    sure_width: float = 4.0
    retained_width: float = 10.0  # ratio to a linear interval: an effect beyond it is needed; chosen


@dataclass(frozen=True, kw_only=True)
class Flexibility:
    """Explanations that could fit anything."""

    most_effects: int = 3  # effects in one explanation; chosen
    curve_gain: float = 16.0  # sum of squares: gain of a curve or drift beside a line; four standard errors squared


@dataclass(frozen=True, kw_only=True)
class ForwardStep:
    """One step of forward selection."""

    followed_misfit: float = 6.0  # ratio to the best misfit: up to it a first fit is followed; chosen
    # share of the best's gain: with less a first fit is no rival, where fits cost much; chosen
    rival_share: float = 0.4
    least_score: float = 0.05  # share of the best score: below it none is fitted where fits cost much; chosen
    polished_misfit: float = 100.0  # ratio to the best misfit: up to it a fit of two parameters is polished; chosen
    arithmetic_share: float = 0.002  # share of the misfit that is arithmetic; chosen
    simpler_errors: float = 1.0  # standard errors within which the simpler one is preferred; chosen
    excluded_errors: float = 2.0  # standard errors beyond which a rival is excluded; chosen
    same_misfit: float = 0.3  # sum of squares over the noise: fits no further apart are one and the same; chosen
    nearly_noise: float = 1.3  # misfit over the noise: up to it the noise's own memory is believed; chosen
    like_noise: float = 2.2  # misfit over the noise: up to it, it may be underrated noise; chosen
    short_rounds: int = 4  # rounds of a fit that is begun anew; chosen
    short_share: float = 0.5  # share of the best's gain that such a fit must gain; chosen


@dataclass(frozen=True, kw_only=True)
class PairScore:
    """Joint scores of two effects."""

    same_direction: float = 1e-3  # sine squared between two directions: below it they are one; chosen
    most_pairs: int = 40  # pairs that are reported; chosen


@dataclass(frozen=True, kw_only=True)
class Pairs:
    """Search by pairs of effects."""

    scored: int = 16  # further partners, by their first score; chosen
    # (rounds, fits kept) of each stage of short fits to few recordings; chosen
    short_fits: tuple[tuple[int, int], ...] = ((2, 40), (2, 14), (6, 6))
    least_share: float = 0.1  # share of the excess misfit of the best single effect that a pair must take; chosen
    better_share: float = 0.5  # ratio of the excess misfits: another explanation leaves less; chosen
    # ratio to the best misfit: up to it an oscillation's shape may make another the best; chosen
    same_misfit: float = 2.0
    leading: int = 4  # first effects that are tried two by two; chosen
    following: int = 4  # effects of each later step that are tried two by two; chosen
    placed_misfit: float = 1.5  # ratio to the best misfit: up to it other places are tried; chosen
    placed: int = 2  # pairs that are tried at other places; chosen


@dataclass(frozen=True, kw_only=True)
class Restarts:
    """Fits that are begun anew elsewhere."""

    # misfit over the noise that the best leaves: from it on a better minimum may exist; chosen
    rugged_above: float = 2.0
    leading_misfit: float = 1.5  # ratio to the best misfit: up to it a better minimum is searched; chosen
    # share of the median recording's misfit by the best: below it an effect is the better one there; chosen
    better_share: float = 0.25
    # share of the best score, and of an own score: scores above and gains below call for another shape; chosen
    promised_share: float = 0.5
    tied_misfit: float = 1.2  # ratio to the best misfit: up to it time shifts are tried; chosen
    chance_p_value: float = 0.01  # p-value of what is left: above it no other form is searched; chosen
    same_shift: float = 2e-5  # s: time shifts within it are one; chosen
    parts: int = 4  # parts into which places are split for workers; chosen
    most_oscillations: int = 60  # places of an oscillation, by one recording, that few recordings are asked for; chosen
    # share of the base's excess misfit, and of the best's gain: from it on shape and time shifts are fitted too;
    # chosen
    least_share: float = 0.1
    shaped_misfit: float = 4.0  # ratio to the best misfit: up to it an effect's shape is fitted too; chosen


@dataclass(frozen=True, kw_only=True)
class Scan:
    """Search where candidates act elsewhere."""

    # p-value: above it what candidates move elsewhere shows that none is missing here; chosen
    hint_p_value: float = 0.2
    clear_share: float = 0.8  # ratio to the misfit without it: up to it a strong effect is followed; chosen


@dataclass(frozen=True, kw_only=True)
class ScoreTest:
    """Score test of candidates."""

    draws: int = 4000  # draws of the null distribution; chosen
    least_direction: float = 1e-3  # noise units: a direction that moves the whole by less is arithmetic; chosen
    visible: float = 5.0  # standard errors of the noise at which an effect shows; chosen
    jitter: float = 1e-9  # added to a correlation matrix's diagonal, per row; chosen
    ways: int = 2  # places of one effect at which fits begin; chosen
    close_points: int = 8  # places of one effect that are looked at closely; chosen


@dataclass(frozen=True, kw_only=True)
class Screening:
    """Screening of candidates."""

    scored: int = 18  # candidates that are looked at closely, by their score; chosen
    # misfit over the noise: from it on fitted time shifts are biased by what is missing; chosen
    biased_shifts: float = 1.2
    fixed_shifts: float = 3.0  # misfit over the noise: from it on time shifts are not fitted in a first look; chosen
    start_distance: float = 0.2  # coordinate (0 to 1): least distance of two starts; chosen
    no_change: float = 1e-12  # sum of squares over the noise: up to it a start changes nothing; chosen


@dataclass(frozen=True, kw_only=True)
class Simplification:
    """Simpler explanations."""

    # p-value of what as many effects as allowed leave: below it they are no explanation; chosen
    full_p_value: float = 0.05
    rivals: int = 3  # rivals of a step that are begun anew beside a better fit of the earlier ones; chosen
    # rivals of fewer parameters that are begun anew beside a fit at an end of its range; chosen
    simpler_rivals: int = 4
    simpler_effects: int = 3  # effects of fewer parameters that are followed after a short fit; chosen
    chi_square: float = 10.8  # chi-square of one parameter; p = 0.001


@dataclass(frozen=True, kw_only=True)
class Stepwise:
    """Stepwise selection."""

    admitting_p_value: float = 0.005  # p-value of the best of all candidates that admits it; chosen
    # the same where runs scatter and there is a mismatch: fits, and gains that last, decide; chosen
    admitting_p_value_runs: float = 0.1
    negligible_share: float = 0.25  # share of a negligible change that a part of more must make; chosen
    # ratio to the second effect's gain: with more left beyond the noise no third is searched, which would have come
    # first; chosen
    no_third_above: float = 3.0
    # diverged recordings that are weighted down although a candidate scores beyond chance, one fewer; chosen
    most_diverged: int = 2
    # share of the first excess misfit that two effects leave: above it no exchange of one helps; chosen
    hopeless_share: float = 0.7
    hopeless: float = 2.0  # misfit over the noise: above it much is left; chosen
    # shares of the first excess misfit (drops, full runs): above, what is left is much where noise is little; chosen
    little_noise: tuple[float, ...] = (0.1, 0.01)


@dataclass(frozen=True, kw_only=True)
class TruncatedStart:
    """Begin with the way down alone."""

    filter_ahead: float = 0.05  # s that are simulated after an end, for filters that look ahead; chosen
    rivals: int = 5  # rivals held against the best over the whole way; chosen
    # ratios to the time of the deepest point: ends after it, before a rebound ends; chosen
    later_truncations: tuple[float, ...] = (1.2, 2.0)
    rest: float = 1.2  # ratio to the time of the deepest point: from it on the way back begins; chosen
    deepest: float = 0.999  # share of the largest depth that counts as deepest; chosen
    # share of the excess misfit that must change there for the way back to be a reason; chosen
    least_share: float = 0.02


@dataclass(frozen=True, kw_only=True)
class Selection:
    """Which effects explain a mismatch."""

    candidates: Candidates = Candidates()  # candidates of an explanation
    decision: Decision = Decision()  # decision on an explanation
    ensemble_validation: EnsembleValidation = EnsembleValidation()  # effects validated by means of runs
    flexibility: Flexibility = Flexibility()  # explanations that could fit anything
    forward_step: ForwardStep = ForwardStep()  # one step of forward selection
    pair_score: PairScore = PairScore()  # joint scores of two effects
    pairs: Pairs = Pairs()  # search by pairs of effects
    restarts: Restarts = Restarts()  # fits that are begun anew elsewhere
    scan: Scan = Scan()  # search where candidates act elsewhere
    score_test: ScoreTest = ScoreTest()  # score test of candidates
    screening: Screening = Screening()  # screening of candidates
    simplification: Simplification = Simplification()  # simpler explanations
    stepwise: Stepwise = Stepwise()  # stepwise selection
    truncated_start: TruncatedStart = TruncatedStart()  # begin with the way down alone

"""Tests that are planned: what is asked of them, and what instruments are taken to be like."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True, kw_only=True)
class Planning:
    """Planned tests."""

    power: float = 0.9  # probability: what is seen less often is not called detectable; usual in the design of tests
    false_alarm: float = 0.05  # probability that noise alone shows any effect; usual in the design of tests
    told_apart: float = 0.95  # probability: from it on a test separates two effects; chosen
    rate: float = 1000.0  # Hz: sampling rate; that of `synthesize`
    noise: float = 0.005  # share of a channel's range, standard deviation; that of `synthesize`
    # share, standard deviation: error of a channel's gain; typical errors of gains are 1 to 5 %
    gain: float = 0.01
    memory: float = 0.1  # share of the record: time over which a discrepancy is one error; of the order of a contact
    # samples: memory of the autoregression that stands for noise and discrepancy; chosen
    order: int = 8
    rounds: int = 8  # rounds of a rival's fit to another effect's traces; chosen
    starts: int = 2  # places at which a rival's fit begins; chosen
    # noncentrality beyond which a pair is told apart whatever a better fit leaves: 0.5 erfc(sqrt(400/8)) = 3e-23
    beyond_doubt: float = 400.0
    # ratio to the noncentrality that is just detectable, at which effects are held against each other: twice as strong
    clearly: float = 4.0
    approaches: int = 12  # steps towards the least strength that shows; a step is exact where the response is linear
    nothing: float = 1e-3  # noncentrality: an effect below it does not act in a test at all; chosen
    # share: a noncentrality that exceeds by more what is asked for is met at an end of a range; far beyond `close`
    at_an_end: float = 0.2
    close: float = 0.02  # share: a noncentrality this near to the one that is asked for is it; chosen
    # ratios of a next condition to the scenario's: from 3 m/s down to the gentlest drop that soils are identified by,
    # and up to twice the speed; chosen
    ratios: tuple[float, ...] = (0.33, 0.5, 0.67, 1.0, 1.2, 1.5, 2.0)
    faster: float = 4.0  # ratio: a higher sampling rate that is tried last; chosen
    few: int = 3  # pairs for which a next test is looked for where none are named; chosen

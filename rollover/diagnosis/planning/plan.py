"""What a planned test would show: detectable effects, pairs that it tells apart, and what to measure beside it."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import asdict, dataclass
from typing import Any

from rollover.assessment.results import plain, versions
from rollover.diagnosis.fit.parameterisation import Candidate, is_limit, null_of
from rollover.diagnosis.forward.forward_model import set_up
from rollover.diagnosis.planning.next_test import Advice, Grid, advice, varied
from rollover.diagnosis.planning.planned import Instruments, planned
from rollover.diagnosis.planning.separation import (
    Apart,
    Tests,
    detection,
    of_one,
    point_where_it_acts,
    required_noncentrality,
    strength_with,
    usual,
)
from rollover.diagnosis.selection.candidates import candidates_of, size_of
from rollover.diagnosis.settings import SETTINGS
from rollover.dynamics.drop_test import COLUMNS, unfit
from rollover.effects import EFFECTS, spoken, units_of
from rollover.scenario import Scenario
from rollover.system.errors import Fault, InputError, hint

FORMAT = "rollover-plan/1"
JSON, PAGE = "plan.json", "report.html"
FILES = (JSON, PAGE)

TUNING = SETTINGS.planning


@dataclass(frozen=True, kw_only=True)
class Detectable:
    """An effect, and how strong it must be to be seen: `least` of `parameter`, None where its range ends before.

    `is_end` says that it shows at an end of its range already, `is_limit` that it is the stronger the lower it is.
    `usual` is its usual value and `power` the probability of seeing that, None where there is none. `judged` is the
    value at which it is held against others, beside its `others`.
    """

    effect: str
    kind: str
    parameter: str
    unit: str
    least: float | None
    usual: float | None
    power: float | None
    judged: float | None
    others: Mapping[str, float]
    is_end: bool = False
    is_limit: bool = False

    @property
    def least_in_words(self) -> str:
        """The least strength, with what it is the least of."""
        if self.least is None:
            return "never within its range"
        return f"{'<= ' if self.is_limit or self.is_end else ''}{spoken(self.least)}"


@dataclass(frozen=True, kw_only=True)
class Pair:
    """A true effect beside a rival that is fitted to it: noncentrality, probability that the true one is chosen."""

    effect: str
    rival: str
    noncentrality: float
    probability: float


@dataclass(frozen=True, kw_only=True)
class Plan:
    """What a test would show, before it is made."""

    conditions: tuple[Mapping[str, Any], ...]
    noise: Mapping[str, float]
    rate: float
    tolerance: float
    gain: float
    power: float
    false_alarm: float
    size: float
    noncentrality: float
    distinguishable: float
    effects: tuple[Detectable, ...]
    pairs: tuple[Pair, ...]
    next_tests: tuple[Advice, ...]

    def of(self, effect: str, rival: str) -> float | None:
        """Probability of choosing an effect rightly over a rival; None for a pair that was not looked at."""
        return next((p.probability for p in self.pairs if (p.effect, p.rival) == (effect, rival)), None)

    def confused(self) -> list[Pair]:
        """Pairs that are not told apart, the worst first."""
        return sorted((p for p in self.pairs if p.probability < self.distinguishable), key=lambda p: p.probability)

    @property
    def times(self) -> float:
        """How many times as strong as just detectable effects are held against each other."""
        return math.sqrt(TUNING.clearly)


def plan(
    scenario: Scenario,
    *,
    conditions: Sequence[Mapping[str, Any]] = ({},),
    instruments: Instruments | None = None,
    between: Sequence[tuple[str, str]] = (),
    say: Callable[[str], None] = lambda _: None,
) -> Plan:
    """What drops under `conditions` (values by path) would show of effects, and of pairs `between` which to choose.

    Without pairs every effect is held against each other. Raises `InputError` for a scenario that is no drop test, an
    unknown condition, channel or effect.
    """
    if reason := unfit(scenario):
        raise InputError(Fault(message=f"{reason}; drops of a striker on level ground can be planned"))
    instruments = instruments or Instruments(noise=usual_noise(scenario))
    made = [planned(scenario, c, instruments) for c in conditions]
    dataset = [e for e in made if e is not None]
    if len(dataset) < len(made):
        raise InputError(Fault(message="a drop that cannot be simulated, got no channel of it; other conditions"))
    tests = Tests(dataset)
    every = candidates_of(dataset, scenario.effects, "drop", scenario, size_of(set_up(scenario, dataset[0].recording)))
    chosen = _chosen(every, between)
    size = of_one(TUNING.false_alarm, len(every))
    enough = required_noncentrality(TUNING.power, size)
    say(f"{len(chosen)} effects in {len(dataset)} drops")
    effects, judged = [], {}
    for c in chosen:
        found, point = _detectable(tests, c, size, enough)
        effects.append(found)
        if point is not None:
            judged[c.key] = (c, point)
    asked = between or [(a, b) for a in judged for b in judged if a < b]
    wanted = dict.fromkeys(pair for a, b in asked for pair in ((a, b), (b, a)))
    say(f"{len(wanted)} pairs")
    pairs = []
    for a, b in wanted:
        if a in judged:
            apart = tests.apart(*judged[a], next(c for c in chosen if c.key == b))
            if apart is not None:
                pairs.append(_pair(a, b, apart))
    named = list(between) or _closest(pairs)
    grid = Grid(scenario=scenario, dataset=tuple(dataset), instruments=instruments, path=varied(scenario))
    found_tests = []
    for a, b in named:
        if a in judged and b in judged:
            say(f"what would tell {a} and {b} apart")
            found_tests.append(advice(grid, judged[a], judged[b], _mean(pairs, a, b)))
    return Plan(
        conditions=tuple(conditions),
        noise=instruments.noise,
        rate=instruments.rate,
        tolerance=instruments.tolerance,
        gain=instruments.gain,
        power=TUNING.power,
        false_alarm=TUNING.false_alarm,
        size=size,
        noncentrality=enough,
        distinguishable=TUNING.distinguishable,
        effects=tuple(effects),
        pairs=tuple(pairs),
        next_tests=tuple(found_tests),
    )


def usual_noise(
    scenario: Scenario,
    channels: Sequence[str] = (),
    share: float = TUNING.noise,
    sigmas: Mapping[str, float] | None = None,
    usually: Sequence[str] = (),
) -> dict[str, float]:
    """1 sigma (SI) of some channels, or of those `usually` recorded: what `sigmas` says, or a share of their range.

    Raises `InputError` for a channel that a drop does not have.
    """
    given = dict(sigmas or {})
    for channel in (*channels, *given):
        if channel not in COLUMNS:
            message = f"no channel of a drop test, got {channel!r}; {hint(channel, COLUMNS)}"
            raise InputError(Fault(file="--sensor" if channel in channels else "--noise", message=message))
    names = list(dict.fromkeys([*(channels or usually or COLUMNS), *given]))
    unit = planned(scenario, {}, Instruments(noise=dict.fromkeys(names, 1.0), gain=0.0))
    spans = {} if unit is None else {s.channel: s.span for s in unit.signals}
    return {name: given.get(name, share * spans.get(name, 0.0)) for name in names if name in spans}


def _chosen(every: Sequence[Candidate], between: Sequence[tuple[str, str]]) -> list[Candidate]:
    """Candidates that are named in pairs, by id or by id:channel; all without pairs. Raises `InputError`."""
    known = {c.key: c for c in every}
    for name in (name for pair in between for name in pair):
        if name not in known:
            several = [key for key in known if key.startswith(f"{name}:")]
            cure = f"one of {', '.join(several)}" if several else hint(name, known)
            raise InputError(
                Fault(file="--between", message=f"no effect that this test can have, got {name!r}; {cure}")
            )
    names = {name for pair in between for name in pair}
    return [c for c in every if not names or c.key in names]


def _detectable(tests: Tests, c: Candidate, size: float, enough: float) -> tuple[Detectable, tuple[float, ...] | None]:
    """How strong an effect must be, and the coordinates at which it is held against others, if any."""

    def shows(x: tuple[float, ...]) -> float:
        return tests.unexplained(c, x)

    name, _ = null_of(c)
    own, unit = usual(c), units_of(EFFECTS[c.id], c.channel)[name]
    at = point_where_it_acts(c, shows)
    least = None if at is None else strength_with(c, at, shows, enough)
    judged = None if at is None or least is None else strength_with(c, least, shows, TUNING.clearly * enough) or least
    values = {} if judged is None else c.values(judged)
    return Detectable(
        effect=c.key,
        kind=c.kind,
        parameter=name,
        unit=unit,
        least=None if least is None else c.values(least)[name],
        usual=None if own is None else c.values(own)[name],
        power=None if own is None else detection(shows(own), size),
        judged=values.get(name),
        others={n: v for n, v in values.items() if n != name},
        is_end=least is not None and shows(least) > enough * (1.0 + TUNING.at_an_end),
        is_limit=is_limit(c),
    ), judged


def _pair(effect: str, rival: str, apart: Apart) -> Pair:
    return Pair(effect=effect, rival=rival, noncentrality=apart.noncentrality, probability=apart.probability)


def _mean(pairs: Sequence[Pair], a: str, b: str) -> float:
    """Probability of choosing rightly where each of two effects is as likely to be the true one."""
    found = [p.probability for p in pairs if {p.effect, p.rival} == {a, b}]
    return sum(found) / len(found) if found else 0.5


def _closest(pairs: Sequence[Pair]) -> list[tuple[str, str]]:
    """The pairs that are told apart the least, if no better than is asked for."""
    mean = {tuple(sorted((p.effect, p.rival))): 0.0 for p in pairs}
    for a, b in mean:
        mean[a, b] = _mean(pairs, a, b)
    close = sorted((value, pair) for pair, value in mean.items() if value < TUNING.distinguishable)
    return [(a, b) for _, (a, b) in close[: TUNING.few]]


def json_of(found: Plan, about: Mapping[str, Any] | None = None) -> dict[str, Any]:
    """What plan.json says, bare JSON values; `about` names what was asked."""
    fields = asdict(found)
    effects, pairs, tests = (fields.pop(key) for key in ("effects", "pairs", "next_tests"))
    answer: dict[str, Any] = plain(
        {
            "format": FORMAT,
            **(about or {}),
            **fields,
            "effects": effects,
            "pairs": [{**p, "is_distinguishable": p["probability"] >= found.distinguishable} for p in pairs],
            "next_tests": tests,
            "versions": versions(),
        }
    )
    return answer

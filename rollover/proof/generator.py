"""Concealed cases: drop tests with a known truth, made without the simulator that a diagnosis fits to them.

for case in cases(20, seed=1):
    write_case(case, folder / case.name)      # scenario and recordings, nothing else
    case.truth                                # to be sealed
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from rollover.proof import campaign, foreign, library, outside
from rollover.proof.background import DRAWN, Background, drawn_share
from rollover.proof.background import background as discrepancy
from rollover.proof.campaign import ACCELERATION, DEPTH, FORCE, PLACE, SPEED, Campaign, Shot
from rollover.proof.effect_size import entry, strength
from rollover.proof.library import Change, Setting
from rollover.proof.readings import REBOUND, Reading, instruments_of, measured, rig_of, span, spread_of
from rollover.proof.reference_solver import CHANNELS, Descent, descend
from rollover.recording import Clock, Recording

Array = NDArray[np.float64]

# kind -> share of the cases
KINDS: dict[str, float] = {
    "null": 0.20,
    "decoy": 0.06,
    "negligible": 0.06,
    "single": 0.44,
    "pair": 0.12,
    "outside": 0.12,
}
MORE_KINDS = ("scatter", "other-form", "foreign-form", "background")  # asked for by name only
TYPICAL = {FORCE: 3500.0, DEPTH: 0.35, PLACE: 0.5, SPEED: 3.5, ACCELERATION: 25.0}
NULLS_SAY_NOTHING = (*KINDS, *MORE_KINDS, "truth", "concealed", "proof", "effect", "outside", "clean")
LEAST, LARGEST = 0.001, 0.3  # of a background that may be asked for, share of the range of the force
_PLAN = 2**32 - 1


@dataclass(frozen=True, kw_only=True)
class Order:
    """Which case to make: everything else follows from it."""

    index: int
    seed: int
    kind: str
    ids: tuple[str, ...] = ()
    background: float = 0.0  # share of the range of the force by which a smooth discrepancy is off; 0: none

    @property
    def name(self) -> str:
        """Says nothing of what is in it."""
        return f"case-{self.index + 1:04d}"


@dataclass(frozen=True, kw_only=True)
class Case:
    """Scenario text and recordings for the diagnosis, and the truth (bare JSON values) that stays here.

    `references` are recordings of the same rig in which nothing is missing but what it misses always.
    """

    name: str
    scenario: str
    recordings: tuple[Recording, ...]
    truth: Mapping[str, Any]
    references: tuple[Recording, ...] = ()


def plan(
    count: int,
    seed: int,
    kinds: Sequence[str] = (),
    effects: Sequence[str] = (),
    background: float | str | None = None,
) -> list[Order]:
    """Orders of a proof: shares of `KINDS` (or even ones of `kinds`), each effect as often as any other, shuffled.

    `effects` keeps only cases about these; ids of `library.EFFECTS` and `outside.OUTSIDE`. With a `background` (share
    of the range, or `DRAWN`), or `background` among the kinds, every case has one. Raises ``ValueError``.
    """
    known = (*KINDS, *MORE_KINDS)
    for kind in kinds:
        if kind not in known:
            raise ValueError(f"kinds: no such kind, got {kind!r}; {', '.join(known)} are allowed")
    for id in effects:
        if id not in library.EFFECTS and id not in outside.OUTSIDE:
            raise ValueError(f"effects: no such effect, got {id!r}; {', '.join([*library.EFFECTS, *outside.OUTSIDE])}")
    background = _checked(background, kinds)
    random = np.random.default_rng([seed, _PLAN])
    shares = dict.fromkeys(kinds, 1.0) if kinds else dict(KINDS)
    if effects and not kinds:
        shares = {"single": 1.0} if any(e in library.EFFECTS for e in effects) else {}
        shares |= {"outside": 1.0} if any(e in outside.OUTSIDE for e in effects) else {}
    scale = count / sum(shares.values())
    ends = np.round(np.cumsum([share * scale for share in shares.values()])).astype(int)
    many = np.diff(ends, prepend=0)
    of_kind = [kind for kind, n in zip(shares, many, strict=True) for _ in range(n)]
    of_kind = [of_kind[i] for i in random.permutation(len(of_kind))]
    listed = [e for e in library.EFFECTS if e in effects or not effects]
    named = [e for e in listed if effects or e not in library.NEGLIGIBLE]
    turns = {
        "single": _turns(random, named),
        "other-form": _turns(random, named),
        "foreign-form": _turns(random, [e for e in foreign.EFFECTS if e in effects or not effects]),
        "outside": _turns(random, [e for e in outside.OUTSIDE if e in effects or not effects] or list(outside.OUTSIDE)),
    }
    orders = []
    for i, kind in enumerate(of_kind):
        ids: tuple[str, ...] = ()
        if kind in turns:
            turn = next(turns[kind], None)
            if turn is None:
                able = ", ".join(foreign.EFFECTS if kind == "foreign-form" else library.EFFECTS)
                raise ValueError(f"effects: none of kind {kind}, got {', '.join(effects)}; {able} are allowed")
            ids = (turn,)
        elif kind == "pair":
            ids = _two(random, listed)
        elif kind == "negligible":
            ids = (str(random.choice(["air-drag", "soil-adhesion", "soil-inertial-drag", "guide-friction"])),)
        orders.append(Order(index=i, seed=seed, kind=kind, ids=ids, background=_share(background, seed, i)))
    return orders


def _checked(background: float | str | None, kinds: Sequence[str]) -> float | str | None:
    """A share that is one, `DRAWN`, or none."""
    if background is None:
        return DRAWN if "background" in kinds else None
    if background == DRAWN or (isinstance(background, float) and LEAST <= background <= LARGEST):
        return background
    allowed = f"{DRAWN} and {LEAST:g} to {LARGEST:g} are allowed"
    raise ValueError(f"background: no share of the force's range, got {background}; {allowed}")


def _share(background: float | str | None, seed: int, index: int) -> float:
    if isinstance(background, str):
        return drawn_share(seed, index)
    return background or 0.0


def _turns(random: np.random.Generator, ids: list[str]) -> Iterator[str]:
    while ids:
        yield from (ids[i] for i in random.permutation(len(ids)))


def _two(random: np.random.Generator, listed: list[str]) -> tuple[str, ...]:
    able = [e for e in library.EFFECTS if e not in (*library.NEGLIGIBLE, "soil-adhesion")]
    while True:
        first = str(random.choice([e for e in able if e in listed] or able))
        ids = (first, str(random.choice([e for e in able if e != first])))
        if frozenset(ids) not in library.NEVER_TOGETHER:
            return ids


def cases(count: int, seed: int, kinds: Sequence[str] = (), effects: Sequence[str] = ()) -> Iterator[Case]:
    """Make the cases of a `plan`, one after another."""
    return map(make, plan(count, seed, kinds, effects))


def extent(order: Order) -> tuple[int, int]:
    """How many drops a case has, and about how many samples in all, without making it."""
    held = _begun(order)[1]
    return len(held.shots), len(held.channels) * round(sum((s.end - s.start) * s.rate for s in held.shots))


def _begun(order: Order) -> tuple[np.random.Generator, Campaign]:
    random = np.random.default_rng([order.seed, order.index])
    needs = tuple(c for id in order.ids for c in _needs(random, id))
    return random, campaign.draw(random, needs, hard=order.kind == "decoy")


@dataclass(frozen=True, kw_only=True)
class Drawn:
    """What is drawn of a case before anything is measured: the tests, and what is in them that a diagnosis may find.

    `plain` are the drops with nothing in them.
    """

    random: np.random.Generator
    campaign: Campaign
    changes: tuple[Change, ...]
    plain: tuple[Descent, ...]


def drawn(order: Order) -> Drawn:
    """Draw a case, but for its background and noise: the same for the same order, to the last bit."""
    random, held = _begun(order)
    rebounds = order.kind != "negligible" and (order.ids == ("soil-adhesion",) or random.random() < 0.04)
    rebounds = rebounds and "soil-elastic-rebound" not in order.ids
    held = replace(held, rebounds=rebounds)
    if order.kind == "scatter":
        spread = campaign.log_uniform(random, 0.01, 0.06)
        held = replace(
            held, shots=tuple(replace(s, scatter=float(np.exp(random.normal(0, spread)))) for s in held.shots)
        )
    plain = tuple(descend(rig_of(held, shot, ()), *span(shot)) for shot in held.shots)
    setting = _setting(held, plain, order.kind == "other-form")
    changes = tuple(_drawn(random, order, id, setting) for id in order.ids)
    return Drawn(random=random, campaign=held, changes=changes, plain=plain)


def make(order: Order) -> Case:
    """Make one case: the same for the same order, to the last bit."""
    case = drawn(order)
    random, held, changes, plain = case.random, case.campaign, case.changes, case.plain
    around = None
    if order.background:
        rigs = [rig_of(held, shot, ()) for shot in held.shots]
        around = discrepancy(order.seed, order.index, order.background, rigs, plain)
    bare = measured(held, (), plain)
    nothing = bare if around is None else measured(held, (), None, around)
    made = measured(held, changes, None, around) if changes else nothing
    noise = {c: held.noise(c, spread_of(made, c)) for c in held.channels}
    recordings = tuple(
        _recorded(i, held, shot, reading, changes, {c: noise[c] for c in held.channels}, random)
        for i, (shot, reading) in enumerate(zip(held.shots, made, strict=True))
    )
    sigma = {c: n.sigma for c, n in noise.items()}
    worth = [{c: noise[c].independence(1.0 / shot.rate) for c in held.channels} for shot in held.shots]
    times = [reading.times for reading in made]

    off = None if around is None else _off(around, held, bare, nothing)

    def between(
        shown: Sequence[Reading], other: Sequence[Reading], over: Mapping[str, float] = sigma
    ) -> dict[str, Any]:
        return strength(times, [m.values for m in shown], [o.values for o in other], over, worth)

    def against(other: Sequence[Reading]) -> dict[str, Any]:
        found = between(made, other)
        if off is None:
            return found
        size = {c: max(off[c]["rms"] * spread_of(bare, c), 1e-9 * sigma[c]) for c in held.channels}
        return found | {"over_background": between(made, other, size)["over_noise"]}

    each = []
    for k in range(len(changes)):
        rest = changes[:k] + changes[k + 1 :]
        each.append(against(measured(held, rest, None, around) if rest else nothing))
    truth = _truth(order, held, changes, each, against(nothing) if changes else None, sigma, recordings)
    if around is not None:
        truth["background"] = around.summary(order.background) | {"channels": off}
        if changes:  # of the mean square of what is missing, over the noise
            whole, rest = (between(shown, bare)["signal_to_noise"] ** 2 for shown in (made, nothing))
            truth["explains"] = 1.0 - rest / whole if whole > 0.0 else None
    return Case(name=order.name, scenario=_scenario(held), recordings=recordings, truth=truth)


def _needs(random: np.random.Generator, id: str) -> tuple[str, ...]:
    if id in library.NEEDS:
        return library.NEEDS[id]
    return (str(random.choice([FORCE, DEPTH, ACCELERATION])),) if id.startswith(("sensor-", "outside:")) else ()


def _off(
    around: Background, held: Campaign, bare: Sequence[Reading], shown: Sequence[Reading]
) -> dict[str, dict[str, float]]:
    """How far a background moves each channel on the ways down, as a share of the channel's range."""
    found = {}
    for c in held.channels:
        squares, most = [], 0.0
        for shot, one, two, until in zip(held.shots, bare, shown, around.until, strict=True):
            t, moved = one.times - shot.late, two.values[c] - one.values[c]
            moved = moved[(t >= 0.0) & (t <= until) & np.isfinite(moved)] / spread_of(bare, c)
            if moved.size:
                squares.append(float(np.mean(moved**2)))
                most = max(most, float(np.max(np.abs(moved))))
        found[c] = {"rms": float(np.sqrt(np.mean(squares))) if squares else 0.0, "most": most}
    return found


def _setting(held: Campaign, plain: Sequence[Descent], other_forms: bool) -> Setting:
    made = measured(held, (), plain)
    return Setting(
        depths=tuple(d.deepest()[1] for d in plain),
        spans={c: spread_of(made, c) for c in held.channels},
        peaks={c: max(float(np.nanmax(np.abs(m.values[c]))) for m in made) for c in held.channels},
        channels=held.channels,
        other_forms=other_forms,
    )


def _drawn(random: np.random.Generator, order: Order, id: str, setting: Setting) -> Change:
    known = foreign.EFFECTS if order.kind == "foreign-form" else {**library.EFFECTS, **outside.OUTSIDE}
    change = known[id](random, setting)
    if order.kind == "negligible" and id == "soil-inertial-drag":
        return replace(change, parameters={"coefficient": 0.002}, rig={"drag": 0.5 * 0.002 * 1800.0 * 0.0063})
    if order.kind == "negligible" and id == "guide-friction":
        return replace(change, parameters={"force": 0.05}, rig={"guide": 0.05})
    return change


def _recorded(
    index: int,
    held: Campaign,
    shot: Shot,
    reading: Reading,
    changes: Sequence[Change],
    noise: Mapping[str, Any],
    random: np.random.Generator,
) -> Recording:
    """The reading with its noise, as a file would hold it."""
    instruments = instruments_of(changes)
    channels = {}
    for channel in CHANNELS:
        if channel not in held.channels:
            continue
        drawn = noise[channel].drawn(reading.times.size, 1.0 / shot.rate, random)
        silent = np.random.default_rng(index)
        channels[channel] = instruments.limited(reading.values[channel] + drawn, reading.times, channel, silent)
    return Recording(
        title=f"Drop {index + 1}",
        time=reading.times,
        channels=channels,
        source="drop rig, 132 kg striker on natural clay",
        conditions={"initiation.speed": shot.speed},
        noise={c: float(f"{n.sigma:.3g}") for c, n in noise.items()} if held.states_noise else {},
        cfc={c: cfc for c, cfc in held.cfc.items() if c in channels},
        clock=Clock(zero="known" if shot.zero_known else "unknown"),
    )


def _scenario(held: Campaign) -> str:
    """The scenario that a diagnosis starts from."""
    knows = ", ".join(f"{name}: {value}" for name, value in REBOUND.items())
    effects = f"effects:\n  soil-elastic-rebound: {{{knows}}}\n" if held.rebounds else ""
    return (
        "# Drop tests of a striker of 132 kg on natural clay; the speed of each is in its recording.\n"
        "format: rollover-scenario/1\n"
        "title: Drop tests, 132 kg striker on natural clay\n"
        "vehicle: {kind: striker, mass: 132.0, face_length: 0.140, face_width: 0.045}\n"
        "ground:\n"
        "  elements: {length: 0.140, width: 0.045, spacing: [0.140, 0.045]}\n"
        "  law: soils/natural_clay.yaml\n"
        "  friction: {coefficient: 0.0}\n"
        "  co_moving_mass: {fraction: 0.10}\n"
        "initiation: {kind: drop, speed: 3.0, lead_time: 0.1}\n"
        f"{effects}"
        "simulation: {duration: 0.8, step: 0.0002, output_step: 0.0002}\n"
    )


def _truth(
    order: Order,
    held: Campaign,
    changes: Sequence[Change],
    each: Sequence[Mapping[str, Any]],
    whole: Mapping[str, Any] | None,
    sigma: Mapping[str, float],
    recordings: Sequence[Recording],
) -> dict[str, Any]:
    verdicts = {"physics": "missing-physics", "parameter": "parameter", "sensor": "sensor", "outside": "unexplained"}
    verdict = "no-mismatch"
    if changes and order.kind != "negligible":
        strongest = max(range(len(changes)), key=lambda k: float(each[k]["signal_to_noise"]))
        verdict = verdicts[changes[strongest].kind]
    return {
        "format": "rollover-truth/1",
        "case": order.name,
        "kind": order.kind,
        "seed": order.seed,
        "index": order.index,
        "verdict": verdict,
        "effects": [entry(change, parameters) for change, parameters in zip(changes, each, strict=True)],
        "over_noise": float(whole["over_noise"]) if whole is not None else 0.0,
        "signal_to_noise": float(whole["signal_to_noise"]) if whole is not None else 0.0,
        "where": whole["where"] if whole is not None else [],
        "noise": {c: float(value) for c, value in sigma.items()},
        "noise_share": {c: float(value) for c, value in held.noise_share.items()},
        "colour": dict(held.colour),
        "cfc": dict(held.cfc),
        "states_noise": held.states_noise,
        "rebounds": held.rebounds,
        "recordings": [
            {
                "title": r.title,
                "speed": s.speed,
                "rate": s.rate,
                "late": s.late,
                "scatter": s.scatter,
                "samples": r.time.size,
            }
            for r, s in zip(recordings, held.shots, strict=True)
        ],
    }

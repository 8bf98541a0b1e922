"""Concealed cases: four side overturns each, recorded by accelerometers, gyroscopes and load cells in the ROPS mounts.

`plan` and `make` are those of `rollover.proof.generator` for overturns; the folder, seal, score and table are the same.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from rollover.dynamics.simulate import run
from rollover.proof.campaign import log_uniform
from rollover.proof.effect_size import entry, strength
from rollover.proof.generator import Case, Order
from rollover.proof.instruments import Fault, Noise, channel_filter
from rollover.proof.overturns import engine, foreign, library
from rollover.proof.overturns.library import Change, Draw
from rollover.proof.overturns.outside import OUTSIDE
from rollover.recording import Recording
from rollover.scenario import Scenario, load

Array = NDArray[np.float64]

KINDS: dict[str, float] = {"null": 0.20, "negligible": 0.05, "single": 0.55, "pair": 0.10, "outside": 0.10}
BY_ENGINE = ("foreign-engine", "background")  # one effect beside another engine, or that alone
MORE_KINDS = ("foreign-form", *BY_ENGINE)  # asked for by name only
CHANNELS = (
    *(f"chassis/acceleration_{axis}" for axis in "xyz"),
    *(f"chassis/angular_velocity_{axis}" for axis in "xyz"),
    "rops/mount/left/force_y",
    "rops/mount/left/force_z",
    "rops/mount/right/force_y",
)
CLASS = 60
RATE = 1000.0  # Hz
LENGTH = 0.6  # s of a recording: tipping, the blow on the tyres' side walls, and the ROPS
LEAD = 0.06  # s more of the run behind the record, that the filter sees
STEP, SPECTRAL_RADIUS = 2.5e-4, 0.85
SPACING, POINTS = (0.035, 0.035), 0.016  # m, of elements and of contact points
SHIFTED = 0.02  # m, by which the grid lies elsewhere, at most
PERTURBED_RUNS = 2  # of each test, that scatter is told from
REFERENCES = 4  # overturns by another engine in which nothing is missing: as many as are diagnosed
WINDOW = 0.02  # s, over which it is averaged
NOTHING = {"over_noise": 0.0, "over_scatter": 0.0, "signal_to_noise": 0.0, "where": [], "channels": {}}
_PLAN = 2**31 - 1


class FailedOverturnError(RuntimeError):
    """An overturn could not be simulated."""


@dataclass(frozen=True, kw_only=True)
class Laboratory:
    """Who makes the recordings: the channels, the run of a scenario, and what may be missing in it, by id."""

    channels: tuple[str, ...]
    run: Callable[[Scenario], Recording]
    effects: Mapping[str, Draw]


@dataclass(frozen=True, kw_only=True)
class Shot:
    """One test: how it began, the ground's inclination down towards a direction (deg), and the clock's lateness (s)."""

    side: str
    excess: float
    rate: float
    inclination: float
    direction: float
    late: float
    shifted: tuple[float, float]

    @property
    def conditions(self) -> dict[str, Any]:
        """Values of the scenario that this test was run with, as written down."""
        return {
            "initiation.side": self.side,
            "initiation.excess_deg": self.excess,
            "initiation.roll_rate": self.rate,
            "ground.surface.angle_deg": self.inclination,
            "ground.surface.direction_deg": self.direction,
        }


def plan(count: int, seed: int, kinds: Sequence[str] = (), effects: Sequence[str] = ()) -> list[Order]:
    """Orders of a proof: shares of `KINDS` (or even ones of `kinds`), each effect as often as any other, shuffled.

    Raises ``ValueError`` for a kind or an effect that there is none of, and for pairs of less than two effects.
    """
    for kind in kinds:
        if kind not in KINDS and kind not in MORE_KINDS:
            known = ", ".join((*KINDS, *MORE_KINDS))
            raise ValueError(f"kinds: no such kind of overturns, got {kind!r}; {known} are allowed")
    for id in effects:
        if id not in library.EFFECTS and id not in OUTSIDE:
            raise ValueError(f"effects: none of overturns, got {id!r}; {', '.join([*library.EFFECTS, *OUTSIDE])}")
    random = np.random.default_rng([seed, _PLAN])
    shares = dict.fromkeys(kinds, 1.0) if kinds else dict(KINDS)
    if effects and not kinds:
        shares = {"single": 1.0} if any(e in library.EFFECTS for e in effects) else {}
        shares |= {"outside": 1.0} if any(e in OUTSIDE for e in effects) else {}
    ends = np.round(np.cumsum(list(shares.values())) * count / sum(shares.values())).astype(int)
    of_kind = [kind for kind, n in zip(shares, np.diff(ends, prepend=0), strict=True) for _ in range(n)]
    listed = [id for id in library.EFFECTS if id in effects] or list(library.EFFECTS)
    if len(listed) < 2 and "pair" in shares:
        raise ValueError(f"effects: a pair needs two, got {', '.join(effects)}")
    outside = [id for id in OUTSIDE if id in effects] or list(OUTSIDE)
    formed = [id for id in foreign.EFFECTS if id in effects or not effects]
    by_engine = [id for id in engine.EFFECTS if id in effects or not effects]
    for kind, able in (("foreign-form", list(foreign.EFFECTS)), ("foreign-engine", list(engine.EFFECTS))):
        if kind in shares and not (formed if kind == "foreign-form" else by_engine):
            raise ValueError(f"effects: none of kind {kind}, got {', '.join(effects)}; {', '.join(able)} are allowed")
    if shares.keys() & set(BY_ENGINE) and not engine.is_installed():
        raise ValueError(f"kinds: of another engine, got {', '.join(kinds)}; {engine.NEEDED}")
    among = {"single": listed, "pair": listed, "outside": outside, "foreign-form": formed, "foreign-engine": by_engine}
    turns: dict[str, list[str]] = {kind: [] for kind in among}
    orders = []
    for i, kind in enumerate(of_kind[k] for k in random.permutation(len(of_kind))):
        ids: tuple[str, ...] = tuple(library.NEGLIGIBLE) if kind == "negligible" else ()
        for _ in range(2 if kind == "pair" else int(kind in among)):
            ids += (_next(turns[kind], among[kind], ids, random),)
        orders.append(Order(index=i, seed=seed, kind=kind, ids=ids))
    return orders


def _next(turn: list[str], all_: Sequence[str], taken: Sequence[str], random: np.random.Generator) -> str:
    """The next of a shuffled turn that is not taken yet; a new turn where it is used up."""
    if not [id for id in turn if id not in taken]:
        turn.extend(all_[k] for k in random.permutation(len(all_)))
    found = next(id for id in turn if id not in taken)
    turn.remove(found)
    return found


def make(order: Order) -> Case:
    """Make one case: the same for the same order. Raises `FailedOverturnError`."""
    random = np.random.default_rng([order.seed, order.index, 1])
    lab = _laboratory(order.kind)
    shots = [_shot(random, k) for k in range(4)]
    share = log_uniform(random, 0.005, 0.02)
    plain = [_solved(lab, shot, ()) for shot in shots]
    nothing = [_read(lab, shot, solved, ()) for shot, solved in zip(shots, plain, strict=True)]
    spans = {c: max(float(np.ptp(one[c])) for one in nothing) for c in lab.channels}
    changes: tuple[Change, ...] = ()
    for id in order.ids:
        free = {c: span for c, span in spans.items() if c not in [one.channel for one in changes]}
        changes += (lab.effects[id](random, free),)
    made = _measured(lab, shots, plain, changes)
    noise = {c: Noise(sigma=share * spans[c], cfc=CLASS) for c in lab.channels}
    recordings = tuple(
        _recorded(lab, k, shot, one, noise, random) for k, (shot, one) in enumerate(zip(shots, made, strict=True))
    )
    worth = {c: noise[c].independence(1.0 / RATE) for c in lab.channels}
    sigma = {c: n.sigma for c, n in noise.items()}
    scatter = _scatter(lab, shots, nothing, np.random.default_rng([order.seed, order.index, 2])) if changes else []

    def shows(without: Sequence[Mapping[str, Array]]) -> dict[str, Any]:
        """Strength of what tells the case from the one without, over the noise, and over the scatter as well."""
        stamps = [_stamps(shot) for shot in shots]
        found = strength(stamps, made, without, sigma, [worth] * len(shots))
        over = [_over(one, sigma, s) for one, s in zip(made, scatter, strict=True)]
        rest = [_over(one, sigma, s) for one, s in zip(without, scatter, strict=True)]
        unit = dict.fromkeys(lab.channels, 1.0)
        return {**found, "over_scatter": strength(stamps, over, rest, unit, [worth] * len(shots))["over_noise"]}

    rests = (
        [nothing]
        if len(changes) == 1
        else [_measured(lab, shots, plain, [o for o in changes if o is not c]) for c in changes]
    )
    return Case(
        name=order.name,
        scenario=_SCENARIO,
        recordings=recordings,
        truth=_truth(
            order,
            changes,
            [shows(rest) for rest in rests] if changes else [],
            shows(nothing) if changes else NOTHING,
            noise,
            share,
            shots,
            recordings,
        ),
        references=_references(lab, order, noise) if order.kind in BY_ENGINE else (),
    )


def _references(lab: Laboratory, order: Order, noise: Mapping[str, Noise]) -> tuple[Recording, ...]:
    """Overturns of the same rig begun otherwise, in which nothing is missing: they teach what another engine misses."""
    random = np.random.default_rng([order.seed, order.index, 3])
    shots = [_shot(random, k) for k in range(REFERENCES)]
    made = [_read(lab, shot, _solved(lab, shot, ()), ()) for shot in shots]
    return tuple(_recorded(lab, k, s, one, noise, random) for k, (s, one) in enumerate(zip(shots, made, strict=True)))


def _laboratory(kind: str) -> Laboratory:
    """Who makes the recordings of a kind of cases."""
    if kind in BY_ENGINE:
        return Laboratory(channels=engine.CHANNELS, run=engine.overturn, effects=engine.EFFECTS)
    every = {**library.EFFECTS, **library.NEGLIGIBLE, **OUTSIDE}
    return Laboratory(channels=CHANNELS, run=_run, effects=foreign.EFFECTS if kind == "foreign-form" else every)


def _run(scenario: Scenario) -> Recording:
    solved = run(scenario)
    if solved.status == "failed":
        raise FailedOverturnError(solved.sentence)
    return solved.recording


def _measured(
    lab: Laboratory, shots: Sequence[Shot], plain: Sequence[Recording], changes: Sequence[Change]
) -> list[dict[str, Array]]:
    """What the instruments make of all tests with these changes; `plain` are the overturns without any."""
    moved = any(c.moves for c in changes)
    solved = [_solved(lab, shot, changes) for shot in shots] if moved else plain
    return [_read(lab, shot, one, changes) for shot, one in zip(shots, solved, strict=True)]


def _scatter(
    lab: Laboratory, shots: Sequence[Shot], nothing: Sequence[Mapping[str, Array]], random: np.random.Generator
) -> list[dict[str, Array]]:
    """Root mean square that overturns on grids elsewhere differ by from these, channels (n,) of each test."""
    found = []
    for shot, one in zip(shots, nothing, strict=True):
        squares = dict.fromkeys(lab.channels, np.zeros(_stamps(shot).size))
        for _ in range(PERTURBED_RUNS):
            x, y = random.uniform(-SHIFTED, SHIFTED, 2)
            there = replace(shot, shifted=(float(x), float(y)))
            other = _read(lab, there, _solved(lab, there, ()), ())
            squares = {c: squares[c] + (other[c] - one[c]) ** 2 / PERTURBED_RUNS for c in lab.channels}
        window = np.ones(round(WINDOW * RATE)) / round(WINDOW * RATE)
        found.append({c: np.sqrt(np.convolve(squares[c], window, mode="same")) for c in lab.channels})
    return found


def _over(made: Mapping[str, Array], sigma: Mapping[str, float], scatter: Mapping[str, Array]) -> dict[str, Array]:
    """Channels over noise and scatter together."""
    return {c: made[c] / np.hypot(sigma[c], scatter[c]) for c in made}


def _shot(random: np.random.Generator, k: int) -> Shot:
    """The k-th test: to the left and to the right in turn, on ground that falls across and a little along."""
    side = ("left", "right")[k % 2]
    across = -90.0 if side == "left" else 90.0
    return Shot(
        side=side,
        excess=round(float(random.uniform(4.0, 8.0)), 2),
        rate=round(float(random.uniform(1.2, 2.0)), 3),
        inclination=round(float(random.uniform(1.0, 14.0)), 1),
        direction=round(across + float(random.uniform(-35.0, 35.0)), 0),
        late=float(random.normal(0.0, 3e-4)),
        shifted=(float(random.uniform(-SHIFTED, SHIFTED)), float(random.uniform(-SHIFTED, SHIFTED))),
    )


def _solved(lab: Laboratory, shot: Shot, changes: Sequence[Change]) -> Recording:
    """The overturn in finer steps, on a finer grid, with what the changes say written into its scenario."""
    values: dict[str, Any] = dict(shot.conditions)
    for change in changes:
        values |= change.values
        values["ground.surface.angle_deg"] = values["ground.surface.angle_deg"] + math.degrees(change.tilt)
        values["initiation.roll_rate"] = values["initiation.roll_rate"] * change.pushed
    base = _base().replaced(values)
    x, y = base.ground.elements.centre
    finer = base.replaced(
        {
            "ground.elements.spacing": SPACING,
            "ground.elements.centre": (x + shot.shifted[0], y + shot.shifted[1]),
            "vehicle.contact_spacing": POINTS,
            "simulation.step": STEP,
            "simulation.spectral_radius": SPECTRAL_RADIUS,
        }
    )
    try:
        return lab.run(finer)
    except engine.EngineError as e:
        raise FailedOverturnError(str(e)) from e


def _base() -> Scenario:
    import tempfile
    from pathlib import Path

    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "scenario.yaml"
        path.write_text(_SCENARIO, encoding="utf-8")
        return load(path)


def _stamps(shot: Shot) -> Array:
    return np.asarray(np.round(np.arange(int(LENGTH * RATE) + 1) / RATE + shot.late, 9))


def _read(lab: Laboratory, shot: Shot, solved: Recording, changes: Sequence[Change]) -> dict[str, Array]:
    """What the instruments make of an overturn at the recorder's stamps, behind their filters, without noise."""
    wrong = {c.channel: c.fault for c in changes if c.channel}
    times = _stamps(shot) - shot.late
    found = {}
    for c in lab.channels:
        fault = wrong.get(c)
        late = fault.offset if fault else 0.0
        step = float(np.median(np.diff(solved.time)))
        behind = channel_filter(solved[c], step, CLASS)
        values = np.interp(times - late, solved.time, behind)
        found[c] = _spoiled(values, times, fault) if fault else values
    return found


def _spoiled(values: Array, times: Array, fault: Fault) -> Array:
    """What an instrument that is wrong makes of a channel (n,) at times (n,)."""
    warm = 1.0 + fault.warming / (1.0 + np.exp(-(times - fault.middle) / fault.width))
    values = values * fault.gain * warm * (1.0 + fault.curved * np.abs(values)) + fault.bias
    if fault.hum:
        values = values + fault.hum * np.sin(2.0 * math.pi * fault.frequency * times + fault.phase)
    if fault.dropouts:  # so often in each test, at places that only the fault's own numbers decide
        rate, lasting = fault.dropouts, fault.lasting
        random = np.random.default_rng([round(1e6 * rate), round(1e9 * lasting), round(1e9 * abs(float(values.sum())))])
        for start in random.uniform(times[0], times[-1], max(1, round(rate * (times[-1] - times[0])))):
            values = np.where((times >= start) & (times < start + lasting), 0.0, values)
    return np.asarray(values)


def _recorded(
    lab: Laboratory,
    k: int,
    shot: Shot,
    made: Mapping[str, Array],
    noise: Mapping[str, Noise],
    random: np.random.Generator,
) -> Recording:
    time = _stamps(shot)
    return Recording(
        title=f"Side overturn {k + 1}",
        source="overturning site, utility tractor on natural clay",
        time=time,
        channels={c: made[c] + noise[c].drawn(time.size, 1.0 / RATE, random) for c in lab.channels},
        conditions=shot.conditions,
        cfc=dict.fromkeys(lab.channels, CLASS),
    )


def _truth(
    order: Order,
    changes: Sequence[Change],
    each: Sequence[Mapping[str, Any]],
    whole: Mapping[str, Any],
    noise: Mapping[str, Noise],
    share: float,
    shots: Sequence[Shot],
    recordings: Sequence[Recording],
) -> dict[str, Any]:
    verdict = "no-mismatch"
    if changes and order.kind != "negligible":
        strongest = max(zip(changes, each, strict=True), key=lambda pair: float(pair[1]["signal_to_noise"]))[0]
        verdict = {"physics": "missing-physics", "outside": "unexplained"}.get(strongest.kind, strongest.kind)
    return {
        "format": "rollover-truth/1",
        "rig": "overturn",
        "case": order.name,
        "kind": order.kind,
        "seed": order.seed,
        "index": order.index,
        "verdict": verdict,
        "effects": [
            entry(change, found) | {"over_scatter": float(found["over_scatter"])}
            for change, found in zip(changes, each, strict=True)
        ],
        "over_noise": float(whole["over_noise"]),
        "over_scatter": float(whole["over_scatter"]),
        "signal_to_noise": float(whole["signal_to_noise"]),
        "where": whole["where"],
        "noise": {c: float(n.sigma) for c, n in noise.items()},
        "noise_share": dict.fromkeys(noise, share),
        "recordings": [
            {"title": r.title, "conditions": s.conditions, "late": s.late, "samples": r.time.size}
            for r, s in zip(recordings, shots, strict=True)
        ],
    }  # fmt: skip


_SCENARIO = f"""# Side overturns of a utility tractor; how each began, and its ground, is in its recording.
format: rollover-scenario/1
title: Side overturns of a 3 t utility tractor
vehicle: vehicles/utility_tractor.yaml
ground:
  surface: {{kind: slope, angle_deg: 5.0, direction_deg: -90.0}}
  elements: {{length: 8.0, width: 16.0, centre: [0.9, 0.0], spacing: [0.04, 0.04]}}
  law: soils/natural_clay.yaml
  friction: {{coefficient: 0.5}}
initiation: {{kind: tip-over, side: left, excess_deg: 4.0, roll_rate: 1.2}}
simulation: {{duration: {LENGTH + LEAD}, step: 0.001, output_step: 0.001}}
"""

"""What the corpus consists of, written down by seed: a list that no later change of the generators' own plans moves."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import TypeVar

T = TypeVar("T")

DROPS = (
    "soil-viscous-damping", "soil-rate-hardening", "soil-inertial-drag", "soil-added-mass-growth",
    "soil-elastic-rebound", "soil-adhesion", "soil-layer", "soil-crust", "structural-compliance", "guide-friction",
    "mass", "impact-speed", "soil-stiffness", "co-moving-mass", "sensor-scale", "sensor-gain", "sensor-bias",
    "sensor-clipping", "sensor-lag", "sensor-clock-offset", "sensor-clock-drift",
)  # fmt: skip
UNLISTED_DROPS = tuple(
    f"outside:{name}"
    for name in (
        "ringing", "brake", "memory", "bands", "stone", "cubic", "edge", "resonance", "side-load",
        "stiffness-by-impact-speed", "warming", "coarse", "hum", "loose-contact", "curved",
    )
)  # fmt: skip
# singles and pairs of overturns together hold each of the thirteen effects
OVERTURNS = (
    "ground-friction", "rops-plasticity", "tyre-damping", "centre-of-mass", "sensor-gain", "axle-stop",
    "payload-shift", "slope", "soil-layer",
)  # fmt: skip
OVERTURN_PAIRS = (
    ("tank-slosh", "inertia"), ("sensor-bias", "slope"), ("sensor-clock-offset", "ground-friction"),
    ("rops-plasticity", "soil-layer"),
)  # fmt: skip
UNLISTED_OVERTURNS = ("outside:flat-tyre", "outside:pushed", "outside:warming", "outside:loose-contact")
DROP_SEED, OVERTURN_SEED = 20_281_000, 20_282_000

# scenarios whose channels are hashed: one of each kind of test that takes seconds
HASHED = ("drop_test", "side_overturn", "pendulum", "static_rops_test", "tilt_table", "vibrating_plate")
# scenarios that have no baseline: the peaks of one run stand for it
WITHOUT_BASELINE = ("ball_drop", "cone_drop", "cube_toss", "penetrometer_drop")
BASELINES = (
    "drop_test", "rops_drop", "vibrating_plate", "side_overturn", "side_overturn_slope", "rear_overturn",
    "bank_overturn", "kerb_trip", "pendulum", "tractor_drop_corner", "field_upset_side", "tilt_table",
    "static_rops_test", "driven_pile", "multiple_roll",
)  # fmt: skip


@dataclass(frozen=True, kw_only=True)
class Job:
    """One entry of the corpus: a sealed case (`task` prove), a run, or the peaks of a baseline (regress)."""

    id: str
    task: str  # prove, run, regress
    scenario: str = ""
    rig: str = ""
    kind: str = ""
    effects: tuple[str, ...] = ()
    seed: int = 0


def plan(share: float = 1.0) -> list[Job]:
    """Jobs in the order they are done: runs, drops, peaks, overturns; of each the first `share`, at least one.

    Kinds of cases are interleaved, so that any beginning holds them in nearly the shares of the whole.
    """
    runs = [Job(id=f"run-{name}", task="run", scenario=name) for name in (*HASHED, *WITHOUT_BASELINE)]
    peaks = [Job(id=f"peaks-{name}", task="regress", scenario=name) for name in BASELINES]
    parts = (runs, _cases("drop", DROP_SEED, _drops()), peaks, _cases("overturn", OVERTURN_SEED, _overturns()))
    return [job for part in parts for job in part[: max(1, round(share * len(part)))]]


Kind = tuple[str, tuple[str, ...]]


def _drops() -> list[Kind]:
    none: tuple[str, ...] = ()
    return _interleaved(
        [("single", (DROPS[k % len(DROPS)],)) for k in range(60)],
        [("null", none)] * 24,
        [("decoy", none)] * 8,
        [("negligible", none)] * 8,
        [("pair", none)] * 24,
        [("outside", (UNLISTED_DROPS[k % len(UNLISTED_DROPS)],)) for k in range(24)],
    )


def _overturns() -> list[Kind]:
    return _interleaved(
        [("single", (id,)) for id in OVERTURNS],
        [("null", ())] * 4,
        [("pair", ids) for ids in OVERTURN_PAIRS],
        [("outside", (id,)) for id in UNLISTED_OVERTURNS],
    )


def _cases(rig: str, seed: int, kinds: Iterable[Kind]) -> list[Job]:
    return [
        Job(id=f"{rig}-{k + 1:03d}-{kind}", task="prove", rig=rig, kind=kind, effects=ids, seed=seed + k)
        for k, (kind, ids) in enumerate(kinds)
    ]


def _interleaved(*lists: Sequence[T]) -> list[T]:
    """All lists in one, the members of each evenly spread over it."""
    placed = [((k + 0.5) / len(one), n, x) for n, one in enumerate(lists) for k, x in enumerate(one)]
    return [x for _, _, x in sorted(placed, key=lambda p: p[:2])]

"""Recordings that are short, gappy, contradictory, misaligned or of one channel: no crash, and no name by chance."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest

from rollover.diagnosis import diagnose, grades, json_of
from rollover.recording import Recording
from tests.diagnosis.drops import DEPTH, FORCE, recorded, scenario

Recordings = list[tuple[str, Recording]]
SPEEDS = (1.5, 2.5)


def short(made: Recordings) -> Recordings:
    """Nine samples in the middle of each."""
    return [(n, _rows(r, np.arange(40, 49))) for n, r in made]


def gappy(made: Recordings) -> Recordings:
    """Nine samples of ten are missing, each channel's own, in stretches."""
    rng = np.random.default_rng(11)
    found = []
    for name, r in made:
        channels = {}
        for c, values in r.channels.items():
            keep = np.repeat(rng.random(r.time.size // 6 + 1) < 0.12, 6)[: r.time.size]
            channels[c] = np.where(keep, values, np.nan)
        found.append((name, replace(r, channels=channels)))
    return found


def one_channel(made: Recordings) -> Recordings:
    """The depth alone."""
    return [(n, replace(r, channels={DEPTH: r[DEPTH]})) for n, r in made]


def misaligned(made: Recordings) -> Recordings:
    """Clocks that say they are right and are 30 ms off, one early and one late."""
    return [(n, replace(r, time=r.time + off)) for (n, r), off in zip(made, (0.03, -0.03), strict=True)]


def before_contact(made: Recordings) -> Recordings:
    """Nothing but the fall."""
    return [(n, _rows(r, np.flatnonzero(r.time < -0.002))) for n, r in made]


def flat(made: Recordings) -> Recordings:
    """A load cell that was not plugged in, and a depth gauge that stuck."""
    return [(n, replace(r, channels={FORCE: 0.0 * r[FORCE], DEPTH: 0.0 * r[DEPTH] + 0.01})) for n, r in made]


def drowned(made: Recordings) -> Recordings:
    """As much noise as signal."""
    rng = np.random.default_rng(12)
    return [
        (n, replace(r, channels={c: v + rng.normal(0.0, np.ptp(v), v.size) for c, v in r.channels.items()}))
        for n, r in made
    ]


def alone(made: Recordings) -> Recordings:
    """One recording, so that nothing can be held out."""
    return made[:1]


def _rows(r: Recording, rows: np.ndarray) -> Recording:
    return replace(r, time=r.time[rows], channels={c: v[rows] for c, v in r.channels.items()})


DAMAGES: tuple[Callable[[Recordings], Recordings], ...] = (
    short, gappy, one_channel, before_contact, flat, drowned, alone,
)  # fmt: skip


@pytest.mark.parametrize("damaged", DAMAGES, ids=lambda d: d.__name__)
def test_damaged_recordings_of_the_scenario_name_no_effect(damaged: Callable[[Recordings], Recordings]) -> None:
    found = diagnose(scenario(), damaged(recorded({}, 21, speeds=SPEEDS)))
    assert found.verdict in ("no-mismatch", "cannot-tell"), (found.verdict, found.sentence)
    assert not found.effects
    if damaged in (before_contact, flat):
        assert found.verdict == "cannot-tell", found.sentence
    assert ("nothing can be said of the ground" in found.sentence) == (damaged is before_contact)
    assert any("is constant" in note for note in found.notes) == (damaged is flat)
    assert json_of(found)["verdict"] == found.verdict
    assert found.sentence


def test_clocks_that_are_wrong_are_no_physics() -> None:
    found = diagnose(scenario(), misaligned(recorded({}, 22, speeds=SPEEDS)))
    assert all(e.kind == "sensor" for e in found.effects), found.sentence
    assert found.verdict in ("sensor", "unexplained")
    assert "ms late (v1.5)" in found.sentence
    assert "ms early (v2.5)" in found.sentence
    assert found.simulations < 1500, "no effect is looked for where clocks are all"


def test_recordings_that_contradict_each_other_are_not_explained() -> None:
    """The same drop, once on ground that is twice as stiff: no value of anything makes both."""
    made = recorded({}, 23, speeds=SPEEDS)
    other = recorded({"effects.soil-stiffness.scale": 2.0}, 24, speeds=SPEEDS)
    found = diagnose(scenario(), [*made, *((f"{n} again", r) for n, r in other)])
    assert not found.effects, found.sentence
    assert found.verdict == "cannot-tell"
    assert "They contradict each other: v1.5, v1.5 again: one condition" in found.sentence


@pytest.mark.parametrize(
    ("detectable", "is_underpowered"),
    [
        (
            {"payload-shift": 400.0, "tank-slosh": 400.0, "mount-play": 1e-5},
            False,
        ),  # a pendulum's impact, no ground acts
        ({"payload-shift": 400.0, "tank-slosh": 400.0, "mount-play": 1.0}, True),
        ({"payload-shift": 400.0, "soil-adhesion": 1e6, "soil-viscous-damping": 10.0}, True),
        ({"payload-shift": 10.0, "soil-adhesion": 1e6, "soil-viscous-damping": 10.0}, False),
        ({"rops-plasticity": 1.0, "mass": 1.0}, True),  # of a limit, and of a value, nothing is usual
    ],
)
def test_recordings_that_show_no_usual_strength_are_too_weak(
    detectable: dict[str, float], is_underpowered: bool
) -> None:
    assert grades.is_underpowered(detectable) is is_underpowered


def test_millimetres_stated_as_metres_are_a_channels_scale() -> None:
    made = recorded({}, 25, speeds=(1.0, 2.0, 3.0))
    found = diagnose(scenario(), [(n, replace(r, channels={**r.channels, DEPTH: 1e3 * r[DEPTH]})) for n, r in made])
    assert [(e.id, e.channel) for e in found.effects] == [("sensor-scale", DEPTH)], found.sentence
    scale = found.effects[0].parameters["scale"]
    assert scale.low < 1e3 < scale.high

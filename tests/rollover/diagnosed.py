"""Made-up diagnoses, for tests of what is written and shown."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from rollover.diagnosis import Diagnosis
from rollover.diagnosis.overlay import Overlay, Track
from rollover.diagnosis.result import Considered, Interval, Location, Named, Score

FORCE = "ground/force_normal"


def sensor_at_fault() -> Diagnosis:
    """The load cell of two drops reads 8 % too much; a rival and a remainder are there."""
    gain = Interval(value=1.08, low=1.07, high=1.09, unit="-", at_bound=True)
    where = Location(
        recording="one",
        channel=FORCE,
        phase="loading",
        start=0.005,
        end=0.1,
        share=0.7,
        depends_on="striker/velocity_z",
    )
    bad, good = (
        Score(nrmse=9.0, iso18571=0.8, peak_force_error=0.08),
        Score(nrmse=1.25, iso18571=None, peak_force_error=None),
    )
    return Diagnosis(
        verdict="sensor",
        sentence="The load cell reads 8 % too much.",
        p_value=1e-20,
        noise={FORCE: 40.0},
        where=(where,),
        effects=(
            Named(
                id="sensor-gain",
                kind="sensor",
                statement="The load cell reads 8 % too much.",
                parameters={"gain": gain},
                settings={"gain": 1.08, "channel": FORCE},
                channel=FORCE,
                p_value=1e-9,
                indistinguishable_from=("soil-stiffness",),
                discriminating_test="weigh the striker at rest",
            ),
        ),
        remaining_significant=True,
        remaining_p_value=1e-6,
        remaining_where=(replace(where, phase="rest", share=0.4),),
        depends_on="striker/velocity_z",
        dependencies=(("striker/velocity_z", 0.9), ("time", -0.2)),
        smallest_detectable={"soil-viscous-damping": 120.0, f"sensor-gain:{FORCE}": float("inf")},
        training=("one",),
        held_out=("two",),
        before={"training": bad, "held_out": bad},
        after={"training": good, "held_out": good},
        per_recording=(("one", 9.0, 1.2), ("two", 9.1, 1.3)),
        candidates=(
            Considered(id="sensor-gain", channel=FORCE, held_out_gain=1.9, reason="chosen"),
            Considered(id="air-drag", channel=None, held_out_gain=0.0, reason="moves little"),
        ),
        simulations=123,
        seconds=4.5,
        notes=("<one>: a note",),
    )


def nothing_found() -> Diagnosis:
    """The recordings agree with the scenario."""
    return replace(
        sensor_at_fault(),
        verdict="no-mismatch",
        sentence="They agree.",
        p_value=0.4,
        where=(),
        effects=(),
        remaining_significant=False,
        remaining_where=(),
        depends_on=None,
    )


def overlays(*, with_after: bool = True) -> tuple[Overlay, ...]:
    """Two recordings over time, the second held out, with a gap; `before` is 8 % too low."""
    t = np.concatenate([np.arange(-0.02, 0.1, 1e-3), np.arange(0.12, 0.2, 1e-3)])
    force = 3000.0 * np.clip(t, 0.0, None) / 0.2
    measured = force + 40.0 * np.sin(1e4 * t)
    track = Track(
        channel=FORCE, time=t, measured=measured, before=force / 1.08, after=force if with_after else None, noise=40.0
    )
    phases = ((-0.02, "free-fall"), (0.0, "first-contact"), (0.005, "loading"))

    def one(name: str, held_out: bool) -> Overlay:
        return Overlay(recording=name, title=name, held_out=held_out, phases=phases, shift=2e-5, tracks=(track,))

    return (one("one", False), one("two", True))

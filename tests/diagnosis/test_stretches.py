"""A discrepancy on either side of a first impact: its scales, an effect beside it, and what references teach."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, cast

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.optimize import brentq

from rollover.diagnosis import pipeline
from rollover.diagnosis.data.dataset import Dataset, Signal
from rollover.diagnosis.data.stretches import BEFORE, before, channel_of, onset, parted
from rollover.diagnosis.fit.levenberg_marquardt import Problem
from rollover.diagnosis.fit.linearisation import Fitted
from rollover.diagnosis.fit.parameterisation import Candidate
from rollover.diagnosis.forward.interface import Simulator
from rollover.diagnosis.inference.discrepancy import (
    MEDIAN,
    SPREAD,
    Discrepancy,
    estimated,
    learned_from_references,
    with_discrepancy,
)
from rollover.diagnosis.inference.taught_course import taught_by
from rollover.diagnosis.noise.autoregression import with_noise, with_own_model_error
from rollover.diagnosis.settings import SETTINGS
from rollover.effects import Search
from rollover.recording import Recording
from rollover.recording.importers import write_recording

Array = NDArray[np.float64]
ROLL, RATE = "chassis/roll", "chassis/angular_velocity_x"
TIME = np.arange(0.0, 0.6, 0.002)
IMPACT, NOISE = 0.3, 0.002
LATE = TIME >= IMPACT
HEIGHT = Candidate(
    id="centre-of-mass", kind="parameter", family="", search={"height": Search(-0.1, 0.1)}, fixed={}, null=(0.5,)
)  # fmt: skip


@dataclass(frozen=True)
class Overturn:
    """A stand-in for full runs: a course of unit range to one side, which a higher centre of mass bends early on."""

    side: float = 1.0
    effort = replace(SETTINGS.forward.drops, is_timed=False)
    contact = float("inf")

    def predict(self, changes: Mapping[str, Any], shift: float) -> dict[str, Array]:
        curved = sum(changes.values()) * np.sin(np.pi * TIME / IMPACT) ** 2 * ~LATE
        course = 0.5 - 0.5 * np.cos(np.pi * TIME / TIME[-1])
        return dict.fromkeys((ROLL, RATE), self.side * course + curved)

    def marks(self) -> tuple[tuple[float, str], ...]:
        return ((0.0, "tipping"), (IMPACT, "impact"))


def wave(seed: int, early: float, late: float) -> Array:
    """A slow error of these root mean squares before the impact and after it, begun anew for each seed."""
    at = np.random.default_rng(seed).uniform(0.0, 2.0 * np.pi)
    slow = np.sin(2.0 * np.pi * TIME / 0.3 + at)
    return np.where(LATE, late / np.sqrt(np.mean(slow[LATE] ** 2)), early / np.sqrt(np.mean(slow[~LATE] ** 2))) * slow


def recorded(errors: Sequence[Array], sides: Sequence[float] = (), height: float = 0.0) -> list[Dataset]:
    """Recordings of as many overturns, each missed by its error in both channels, with white noise."""
    rng, found = np.random.default_rng(7), []
    for k, error in enumerate(errors):
        simulator = Overturn(sides[k] if sides else 1.0)
        made = simulator.predict({"height": height}, 0.0)
        values = {c: made[c] + error + NOISE * rng.standard_normal(TIME.size) for c in made}
        signals = tuple(
            Signal(channel=c, rows=np.arange(TIME.size), values=v, sigma=NOISE, noise=NOISE, ar=(), span=1.0)
            for c, v in values.items()
        )
        recording = Recording(title="", time=TIME, channels=values)
        found.append(
            Dataset(
                name=f"r{k}", recording=recording, simulator=cast(Simulator, simulator), signals=signals,
                shift_prior=1e-3, condition=f"{k}", first_impact=IMPACT,
            )
        )  # fmt: skip
    return found


def base_of(problem: Problem) -> Fitted:
    base = problem.fit((), ())
    assert base is not None
    return base


def held_against(every: Sequence[Dataset], found: Discrepancy) -> Problem:
    each = [with_own_model_error(parted(e)) for e in with_discrepancy(every, found)]
    is_parted = any(s.phase for e in each for s in e.signals)
    return Problem(each if is_parted else [as_a_whole(e) for e in each])


def as_a_whole(e: Dataset) -> Dataset:
    """With one scale of a channel throughout, as drops and stated tolerances have it."""
    return replace(e, signals=tuple(with_noise(s, s.noise, (), e.model_error_of(s)) for s in e.signals))


@pytest.mark.parametrize(("early", "late"), [(0.01, 0.2), (0.05, 0.05)])
def test_each_side_of_the_impact_has_its_own_scale(early: float, late: float) -> None:
    """Of a remainder u the most probable s is where d/d ln s of (D17) vanishes: n (u^2/s^2 - 1) = ln(s/m)/q^2."""
    problem = Problem(recorded([wave(k, early, late) for k in range(4)]))
    found = estimated(problem, base_of(problem), [])
    n = SETTINGS.inference.discrepancy.draws
    for key, u in ((before(ROLL), early), (ROLL, late)):
        most = brentq(lambda s, u=u: n * (u**2 / s**2 - 1.0) - np.log(s / MEDIAN) / SPREAD**2, 1e-3, 1.0)
        assert found.scales[key] == pytest.approx(most, rel=0.02)  # steps of 1.2 %, and a hundredth of noise in u
        assert channel_of(key) == ROLL


def test_what_is_tolerated_of_a_channel_bounds_both_sides() -> None:
    found = Discrepancy(scales={before(ROLL): 0.03, ROLL: 0.2, before(RATE): 0.03}).at_most({ROLL: 0.05})
    assert found.scales == {before(ROLL): 0.03, ROLL: 0.05, before(RATE): 0.03}
    assert found.at_most({ROLL: 0.02}).scales[before(ROLL)] == 0.02


def test_a_part_of_a_channel_is_held_against_its_own_scale() -> None:
    scales = {before(ROLL): 0.01, ROLL: 0.2, RATE: 0.1}
    (whole,) = recorded([wave(0, 0.0, 0.0)])
    problem = held_against([whole], Discrepancy(scales=scales))
    (e,) = problem.dataset
    assert [(s.channel, s.phase) for s in e.signals] == [(ROLL, BEFORE), (ROLL, ""), (RATE, BEFORE), (RATE, "")]
    assert [s.sigma for s in e.signals[:2]] == pytest.approx(np.hypot(NOISE, [0.01, 0.2]), rel=1e-3)
    assert e.signals[2].sigma == e.signals[3].sigma == pytest.approx(np.hypot(NOISE, 0.1), rel=0.01)
    np.testing.assert_array_equal(e.values, whole.values)  # samples stand where they stood
    assert parted(whole) is whole  # and nothing is parted where nothing is known by sides


def test_an_early_effect_shows_beside_a_late_difference() -> None:
    """A bump of 5 % of the range (rms) before the impact, beside errors of 0.2 % there and 25 % after it.

    A channel is one draw, (D21): 2 channels gain 2 (0.05/s)^2, 34 by s of 1.2 % on this side, 0.2 by 15 % for both.
    """
    every = recorded([wave(k, 0.002, 0.25) for k in range(4)], height=0.08)
    plain = Problem(every)
    base = base_of(plain)
    learned = estimated(plain, base, [fit] if (fit := plain.fit((HEIGHT,), (0.5,))) else [])
    gains = {}
    for how, scales in (("sides", learned.scales), ("one", {c: learned.scales[c] for c in (ROLL, RATE)})):
        problem = held_against(every, replace(learned, scales=scales, times={}))
        fitted = problem.fit((HEIGHT,), (0.5,))
        assert fitted is not None
        gains[how] = (base_of(problem).chi2 - fitted.chi2) / problem.samples_per_draw
        if how == "sides":
            assert -0.1 + 0.2 * fitted.x[0] == pytest.approx(0.08, abs=0.002)
    # beyond what the best of a hundred candidates gains by chance, Sidak's 1 - 1e-3/100 quantile of chi^2 of one: 19.5
    assert gains["sides"] > 19.5
    assert gains["one"] < 1.0


@pytest.mark.parametrize("sides", [(1.0, 1.0, 1.0, 1.0), (1.0, -1.0, 1.0, -1.0)])
def test_references_teach_what_a_rig_repeats_over_time(sides: tuple[float, ...]) -> None:
    """Turned round with what is simulated; on either side of the impact by as much as others repeat it there."""
    same = wave(0, 0.01, 0.2)
    own = [wave(10 + k, 0.004, 0.02) for k in range(5)]
    errors = [side * same + o for side, o in zip((*sides, -1.0), own, strict=True)]
    every = recorded(errors, (*sides, -1.0))
    references, tested = Problem(every[:4]), every[4]
    found = taught_by(references, base_of(references))
    assert found is not None
    taught, rest = found
    # of a course known by three others to a variance of v/3 a share p/(p + v/3) is repeated, p its power
    assert taught.repeated[ROLL] == pytest.approx(1.0 / (1.0 + 0.02**2 / 0.2**2 / 3.0), abs=0.1)
    left = tested.values - tested.raw(tested.simulator.predict({}, 0.0) or {})
    less = taught.without(tested).values - tested.values + left
    late = np.concatenate([LATE, LATE])
    assert np.sqrt(np.mean(left[late] ** 2)) > 0.17
    assert np.sqrt(np.mean(less[late] ** 2)) < 2.0 * np.hypot(0.02, 0.01)  # its own, and the mean's error
    scales = [learned_from_references(p, base_of(p)) for p in (references, rest)]
    assert scales[0] is not None
    assert scales[1] is not None
    assert scales[1].scales[ROLL] < 0.25 * scales[0].scales[ROLL]


def test_what_references_do_not_repeat_is_not_taken_off() -> None:
    signs = (1.0, -1.0, 1.0, -1.0)  # each by the others' mean: turned round
    problem = Problem(recorded([sign * wave(0, 0.01, 0.2) for sign in signs]))
    assert taught_by(problem, base_of(problem)) is None
    two = Problem(recorded([wave(0, 0.01, 0.2)] * 2))
    assert taught_by(two, base_of(two)) is None  # too few to tell a mean


@pytest.mark.parametrize(("taught", "times"), [(0, 4.0), (4, 1.0 + 3.0 / 5.0), (10**9, 1.0)])
def test_what_is_left_of_what_is_taught_is_new_each_time(taught: int, times: float) -> None:
    """Of own errors of variance v and their mean of v/m off all: R draws are R/(1 + (R - 1)/(m + 1)) independent."""
    scales = {ROLL: 0.1, RATE: 0.1}
    problem = held_against(recorded([wave(0, 0.0, 0.0)] * 4), Discrepancy(scales=scales, taught_by=taught))
    assert problem.samples_per_error > 1.0
    assert problem.samples_per_draw == pytest.approx(times * problem.samples_per_error)


def test_a_folder_says_by_names_which_are_references(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    for name in ("r1", "r2", "reference1", "reference2"):
        write_recording(Recording(title=name, time=TIME, channels={ROLL: TIME}), tmp_path / f"{name}.parquet")
    seen: list[Any] = []

    def kept(_: object, recordings: Sequence[tuple[str, Recording]], *, reference: Sequence[str], **__: object) -> None:
        seen.append(([name for name, _ in recordings], list(reference)))

    for name, stand_in in (("diagnose", kept), ("load", lambda _: None), ("json_of", lambda _: {})):
        monkeypatch.setattr(pipeline, name, stand_in)
    assert pipeline.diagnose_folder(tmp_path) == {}
    assert seen == [(["r1", "r2", "reference1", "reference2"], ["reference1", "reference2"])]


def test_a_discrepancy_begins_with_the_impact_of_a_run() -> None:
    (e,) = recorded([wave(0, 0.0, 0.0)])
    assert onset(e) == IMPACT

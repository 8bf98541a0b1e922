"""Steps of digits and spikes are the recorder's: no mismatch, and not a sample that a model is held against."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from rollover.diagnosis import diagnose
from rollover.diagnosis.data.dataset import Dataset, dataset_of
from rollover.diagnosis.data.quantisation import resolution, with_quantisation, without_spikes
from rollover.diagnosis.fit.cross_validation import held_out
from rollover.diagnosis.fit.linearisation import Fitted, ResidualBlock, first_effect_last
from rollover.diagnosis.fit.parameterisation import Candidate
from rollover.diagnosis.forward.forward_model import simulator_of
from rollover.diagnosis.selection.forward_step import largest_change
from rollover.effects import Search
from rollover.recording import Recording
from tests.diagnosis.drops import DEPTH, FORCE, linear_blocks, recorded, scenario, signal

Recordings = list[tuple[str, Recording]]


def each(recordings: Recordings, read: Callable[[np.ndarray], np.ndarray]) -> Recordings:
    return [(n, replace(r, channels={c: read(v) for c, v in r.channels.items()})) for n, r in recordings]


def test_the_step_of_a_digitised_channel_is_its_own() -> None:
    rng = np.random.default_rng(1)
    x = np.cumsum(rng.standard_normal(2000))
    assert resolution(np.round(x / 0.25) * 0.25 + 3.1) == pytest.approx(0.25, rel=1e-9)
    assert resolution(np.append(np.round(x), np.nan)) == 1.0
    assert resolution(x) == 0.0
    assert resolution(np.where(x > 0.0, 1.0, 0.0)) == 0.0  # a switch
    assert resolution(np.sort(rng.choice(rng.uniform(0.0, 1.0, 40), 2000))) == 0.0  # levels without a common step


def test_coarse_digits_are_no_mismatch_and_hide_no_large_one() -> None:
    """One part in 128 of the range, no noise: the error of neighbouring samples is one, and looks like structure."""
    coarse = lambda v: np.round(v / np.ptp(v) * 128.0) * np.ptp(v) / 128.0  # noqa: E731
    conditions = {"speeds": (1.2, 2.0, 3.0), "noise": 0.0, "rate": 1000.0}
    agrees = diagnose(scenario(), each(recorded({}, **conditions), coarse))
    assert agrees.verdict == "no-mismatch"
    assert any(n.startswith(f"{FORCE}: recorded in steps of") for n in agrees.notes)
    heavier = recorded({"effects.mass.added": 25.0}, **conditions)
    found = diagnose(scenario(), each(heavier, coarse))
    assert [e.id for e in found.effects] == ["mass"]
    assert found.effects[0].parameters["added"].value == pytest.approx(25.0, rel=0.05)


@pytest.mark.parametrize(("noise", "shared"), [(0.0, 0.5), (0.2, 0.5 * np.exp(-0.08 * np.pi**2)), (0.6, 0.0)])
def test_noise_makes_the_rounding_of_each_sample_its_own(noise: float, shared: float) -> None:
    """Widrow: with s of noise before a step d, exp(-2 pi^2 s^2/d^2) of what rounding does is left on the average."""
    name, r = recorded({}, speeds=(2.0,), noise=0.0, rate=1000.0)[0]
    one = dataset_of(name, r, simulator_of(scenario(), r))
    assert one is not None
    step = 0.02 * float(np.ptp(r[FORCE]))
    noisy = r[FORCE] + noise * step * np.random.default_rng(5).standard_normal(r.time.size)
    rough = replace(r, channels={**r.channels, FORCE: np.round(noisy / step) * step})
    total = step * float(np.sqrt(noise**2 + 1.0 / 12.0))
    told = replace(one, signals=tuple(replace(s, noise=total) for s in one.signals))
    force = next(s for s in with_quantisation([told], [rough])[0].signals if s.channel == FORCE)
    assert force.scatter == pytest.approx(shared * step, rel=1e-6)


def test_a_digit_flipping_at_an_edge_is_no_noise() -> None:
    """Of two recordings of one channel the quieter one tells how much noise there is before the steps."""
    name, r = recorded({}, speeds=(2.0,), noise=0.0, rate=1000.0)[0]
    one = dataset_of(name, r, simulator_of(scenario(), r))
    assert one is not None
    step = 0.02 * float(np.ptp(r[FORCE]))
    rough = replace(r, channels={**r.channels, FORCE: np.round(r[FORCE] / step) * step})

    def seen(noise: float) -> Dataset:
        return replace(one, signals=tuple(replace(s, noise=noise * step) for s in one.signals))

    both = with_quantisation([seen(0.0), seen(0.5)], [rough, rough])
    assert [s.scatter for e in both for s in e.signals if s.channel == FORCE] == pytest.approx([0.5 * step] * 2)
    (alone,) = with_quantisation([seen(0.5)], [rough])
    assert next(s for s in alone.signals if s.channel == FORCE).scatter < 0.1 * step


def test_noise_within_coarse_digits_is_no_structure() -> None:
    """A share of the range, on a channel with noise below that: its error is one for many samples."""
    made = recorded({}, speeds=(1.2, 2.0, 3.0), rate=1000.0)

    def in_steps(many: int) -> list[tuple[str, Recording]]:
        own = [(n, r, np.ptp(r[FORCE]) / many) for n, r in made]
        return [(n, replace(r, channels={**r.channels, FORCE: np.round(r[FORCE] / d) * d})) for n, r, d in own]

    found = diagnose(scenario(), in_steps(16))
    assert "in steps of" in found.sentence  # and no more than that, see test_coarse
    assert found.remaining_p_value > 0.01, found.sentence
    found = diagnose(scenario(), in_steps(25))
    assert found.verdict == "no-mismatch"
    assert found.p_value > 0.01, found.sentence


def test_spikes_are_left_aside_and_said_so() -> None:
    made, clean = [], recorded({}, speeds=(1.5, 3.0), rate=4000.0)
    for name, r in clean:
        values = r[FORCE].copy()
        values[[500, 840, 1200]] += 0.6 * np.ptp(values)
        made.append((name, replace(r, channels={**r.channels, FORCE: values})))
    kept, lines = without_spikes(made[0][1])
    assert lines == [f"{FORCE}: 3 spikes were excluded"]
    assert (
        np.flatnonzero(np.isnan(kept[FORCE])).tolist()
        == np.flatnonzero(made[0][1][FORCE] != clean[0][1][FORCE]).tolist()
    )
    assert without_spikes(clean[0][1]) == (clean[0][1], [])
    early, lines = without_spikes(made[0][1], before=float(made[0][1].time[700]))
    assert lines == [f"{FORCE}: one spike was excluded"]
    assert np.flatnonzero(np.isnan(early[FORCE])).tolist() == [500]
    found = diagnose(scenario(), made)
    assert found.verdict == "no-mismatch"
    assert sum("spikes were excluded" in note for note in found.notes) == 2


def test_a_fit_with_its_first_effect_last_is_the_same_fit() -> None:
    rng = np.random.default_rng(2)
    truth = np.array([0.3, -0.2, 0.5])
    two = Candidate(id="soil-layer", kind="physics", family="", search={"a": Search(0, 1), "b": Search(0, 1)})
    one = Candidate(id="mass", kind="parameter", family="", search={"c": Search(0, 1)}, channel=DEPTH)
    fitted = Fitted(candidates=(two, one), x=(0.1, 0.2, 0.3), blocks=tuple(linear_blocks(rng, 3, 40, truth)))
    other = first_effect_last(fitted)
    assert [c.id for c in other.candidates] == ["mass", "soil-layer"]
    assert other.x == (0.3, 0.1, 0.2)
    assert np.array_equal(other.blocks[1].J[:, 0], fitted.blocks[1].J[:, 2])
    groups = [[0], [1], [2]]
    assert held_out(other, groups).chi2 == pytest.approx(held_out(fitted, groups).chi2, rel=1e-9)


def test_within_half_a_step_of_its_digits_nothing_has_moved() -> None:
    """An offset of 0.4 of a step is what rounding makes of a value that does not change; one of 0.6 is none."""
    values = np.linspace(0.0, 20.0, 100)
    for share, told in ((0.4, 0.0), (0.6, 0.6 / 20.0)):
        s = replace(signal(values, 0.1), step=1.0, span=20.0)
        e: Any = SimpleNamespace(spans=lambda s=s: [(s, slice(0, 100))])
        problem: Any = SimpleNamespace(dataset=[e])
        blocks = [
            ResidualBlock(
                residual=np.full(100, off / 0.1), J=np.zeros((100, 0)), slope=np.zeros(100), shift=0.0, prior=1.0
            )
            for off in (share, 0.0)
        ]
        base, fitted = (Fitted(candidates=(), x=(), blocks=(b,)) for b in blocks)
        assert largest_change(problem, base, fitted) == pytest.approx(told)

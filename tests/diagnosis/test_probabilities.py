"""Probabilities over names: what they add up to, when nothing, an effect, or none that is listed leads."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any, cast

import numpy as np
import pytest

from rollover.diagnosis import probabilities as module
from rollover.diagnosis.fit.levenberg_marquardt import Problem
from rollover.diagnosis.probabilities import credible, log_touched, log_usual, probabilities
from rollover.diagnosis.selection.explanation import Explanation
from tests.diagnosis.test_beside import DROPS, explanation, fitted

CHANNELS = ("ground/force_normal", "ground/sinkage", "striker/acceleration_z")
SIGNALS = [SimpleNamespace(channel=c, key=c, noise=0.003, span=1.0, rows=np.arange(400)) for c in CHANNELS]
PROBLEM = cast(Problem, SimpleNamespace(dataset=[SimpleNamespace(signals=SIGNALS)] * DROPS))


def beside(
    monkeypatch: pytest.MonkeyPatch, nothing: float, each: dict[str, float], p_value: float = 1.0
) -> dict[str, float]:
    """Probabilities where nothing, and each effect, leaves so much (share of the range) of every channel."""
    left = {"": nothing, **each}

    def residual_rms(_: Problem, f: Any) -> dict[str, float]:
        return dict.fromkeys(CHANNELS, left[f.candidates[-1].id if f.candidates else ""])

    monkeypatch.setattr(module, "residual_rms", residual_rms)
    best, *others = (fitted(id, (1.0,) * DROPS) for id in each)
    tried = explanation((2.0,) * DROPS, best, *others)
    return probabilities(PROBLEM, tried, tried, 40, is_noise=False, p_value=p_value)


def test_what_conditions_held_out_tell_bounds_nothing(monkeypatch: pytest.MonkeyPatch) -> None:
    """Two in five before, three in five for the others: odds of 2/3 times -e p ln p at most."""
    left = 0.02, {"soil-layer": 0.016, "soil-crust": 0.018}
    free, by_chance, certain = (beside(monkeypatch, *left, p_value=p) for p in (1.0, 0.5, 1e-4))
    assert by_chance == free
    assert certain["nothing"] / (1.0 - certain["nothing"]) == pytest.approx(2 / 3 * np.e * 1e-4 * np.log(1e4))
    ratio = free["soil-layer"] / free["soil-crust"]
    assert certain["soil-layer"] / certain["soil-crust"] == pytest.approx(ratio)
    assert beside(monkeypatch, *left, p_value=0.0)["nothing"] == 0.0
    # what leaves so much that it is out of the question stays so
    assert beside(monkeypatch, 0.3, left[1], p_value=0.3)["nothing"] == beside(monkeypatch, 0.3, left[1])["nothing"]


def test_what_leaves_least_leads_and_all_add_up_to_one(monkeypatch: pytest.MonkeyPatch) -> None:
    found = beside(monkeypatch, 0.1, {"soil-layer": 0.02, "soil-crust": 0.06, "guide-friction": 0.09})
    assert sum(found.values()) == pytest.approx(1.0)
    assert next(iter(found)) == "soil-layer"
    assert found["soil-layer"] > 0.9
    assert set(found) == {"soil-layer", "soil-crust", "guide-friction", "nothing", "not-listed"}


def test_what_leaves_as_much_is_as_probable(monkeypatch: pytest.MonkeyPatch) -> None:
    found = beside(monkeypatch, 0.1, {"soil-layer": 0.02, "soil-crust": 0.02})
    assert found["soil-layer"] == pytest.approx(found["soil-crust"])
    assert found["soil-layer"] > 0.45


def test_of_two_alike_the_one_of_fewer_numbers_is_likelier(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(module, "residual_rms", lambda _, f: dict.fromkeys(CHANNELS, 0.02 if f.candidates else 0.1))
    tried = explanation((2.0,) * DROPS, fitted("soil-layer", (1.0,) * DROPS, 2), fitted("mass", (1.0,) * DROPS))
    found = probabilities(PROBLEM, tried, tried, 40, is_noise=False)
    assert found["mass"] == pytest.approx(found["soil-layer"] * np.sqrt(2.0 * len(CHANNELS)))


def test_a_fall_alone_says_nothing_of_names(monkeypatch: pytest.MonkeyPatch) -> None:
    """No channel is left of what comes after a contact: no probability, and none of several is excluded."""
    monkeypatch.setattr(module, "residual_rms", lambda *_: {})
    one, other = fitted("air-drag", (1.0,) * DROPS), fitted("sensor-scale", (3.0,) * DROPS, 2)
    tried = explanation((9.0,) * DROPS, one, other)
    assert probabilities(PROBLEM, tried, tried, 40, is_noise=False) == {}
    assert credible(PROBLEM, [one, other]) == [one, other]


def test_what_models_usually_miss_is_nothing(monkeypatch: pytest.MonkeyPatch) -> None:
    found = beside(monkeypatch, 0.02, {"soil-layer": 0.016, "soil-crust": 0.018})
    assert found["nothing"] > 0.6
    assert found["soil-layer"] < 0.1


def test_what_no_effect_meets_is_not_listed(monkeypatch: pytest.MonkeyPatch) -> None:
    found = beside(monkeypatch, 0.3, {"soil-layer": 0.25, "soil-crust": 0.28})
    assert next(iter(found)) == "not-listed"
    assert found["not-listed"] > 0.8


def test_an_untouched_channel_speaks_against_not_listed() -> None:
    """Beside a usual remainder an unknown effect adds more than is seen; beside a large one it is likelier."""
    little, much = (log_touched(v, 1e-4) - log_usual(v, 1e-4) for v in (0.005, 0.3))
    assert little < -0.3
    assert much > 1.0


@pytest.mark.parametrize(
    ("others", "offered"),
    [
        ((0.06, 0.09), 1),  # far more is left by the others
        ((0.025, 0.09), 2),  # 0.79 and 0.21 of the two
        ((0.025, 0.022), 3),
        ((0.019, 0.09), 2),
    ],
)
def test_the_fewest_are_offered_that_hold_the_right_one(
    monkeypatch: pytest.MonkeyPatch, others: tuple[float, float], offered: int
) -> None:
    left = dict(zip(("soil-layer", "soil-stiffness", "guide-friction"), (0.02, *others), strict=True))
    monkeypatch.setattr(module, "residual_rms", lambda _, f: dict.fromkeys(CHANNELS, left[f.candidates[-1].id]))
    found = credible(PROBLEM, [fitted(id, (1.0,) * DROPS) for id in left])
    assert [f.candidates[-1].id for f in found] == sorted(left, key=lambda id: left[id])[:offered]


@pytest.mark.parametrize(
    ("left", "leads", "least"),
    [
        ((0.98, 0.97, 0.99, 0.98, 0.97, 0.99), "nothing", 0.8),  # five of 240 squares: chance
        ((0.50, 0.40, 0.50, 0.60, 0.50, 0.40), "soil-layer", 0.8),
    ],
)
def test_beside_noise_samples_tell(left: tuple[float, ...], leads: str, least: float) -> None:
    base = (1.0,) * DROPS if leads == "nothing" else (3.0,) * DROPS
    tried: Explanation = explanation(
        base, fitted("soil-layer", left), fitted("soil-crust", tuple(v + 0.4 for v in left))
    )
    found = probabilities(PROBLEM, tried, tried, 40, is_noise=True)
    assert sum(found.values()) == pytest.approx(1.0)
    assert next(iter(found)) == leads
    assert found[leads] > least
    assert 0.01 < found["not-listed"] < 0.2

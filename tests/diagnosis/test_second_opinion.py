"""What a user is told who states nothing: an estimated background only where nothing explains the recordings."""

from __future__ import annotations

from typing import Any

import pytest

from rollover.diagnosis import account, diagnose
from tests.diagnosis.drops import FORCE, recorded, scenario
from tests.diagnosis.test_discrepancy import bent

LAYER = {"effects.soil-layer.depth": 0.1, "effects.soil-layer.stiffness_ratio": 1.8}


@pytest.fixture(scope="module")
def beside_a_wave() -> dict[bool | None, Any]:
    """A layer beside a slow wave that no table holds, with nothing stated and without an estimate."""
    recordings = bent(0.01, changes=LAYER)
    return {how: diagnose(scenario(), recordings, estimate=how) for how in (None, False)}


def test_nothing_stated_an_effect_is_named_beside_a_background(beside_a_wave: dict[bool | None, Any]) -> None:
    found = beside_a_wave[None]
    assert [e.id for e in found.effects] == ["soil-layer"]
    assert (found.verdict, found.broken) == ("missing-physics", ())
    assert found.answer in ("whole", "likeness")
    shares = f"of {FORCE}"
    assert "A background was estimated beside it" in found.sentence
    assert shares in found.sentence


def test_without_an_estimate_it_is_unexplained(beside_a_wave: dict[bool | None, Any]) -> None:
    found = beside_a_wave[False]
    assert (found.verdict, found.effects, dict(found.discrepancy)) == ("unexplained", (), {})


def test_what_noise_explains_is_answered_as_without_an_estimate() -> None:
    recordings = recorded(LAYER, 3, noise=0.01)
    told = []
    for how in (None, False):
        said = account(diagnose(scenario(), recordings, estimate=how))
        said.pop("seconds")
        told.append(said)
    assert told[0] == told[1]
    assert [e["id"] for e in told[0]["effects"]] == ["soil-layer"]


@pytest.mark.parametrize("stated", [{"tolerance": 0.001}, {"tolerance": {FORCE: 0.001}}])
def test_beside_what_is_stated_nothing_is_estimated(stated: dict[str, Any]) -> None:
    found = diagnose(scenario(), bent(0.02), **stated)
    assert found.verdict == "unexplained"
    assert not found.discrepancy or found.discrepancy[FORCE].scale < 10.0  # N, of a range of 3 kN: as stated

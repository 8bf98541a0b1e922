"""A second opinion: an estimated background in place of `unexplained` alone, never more than a likeness or a part."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest

from rollover.diagnosis import conclusion, diagnose, pipeline
from rollover.diagnosis.alone import fit_single_effect
from rollover.diagnosis.conclusion import Asked, Conclusion
from rollover.diagnosis.fit.jobs import Executor
from rollover.diagnosis.io import recordings_in
from rollover.diagnosis.result import Diagnosis, Estimate, Verdict
from rollover.proof.generator import Order, make
from rollover.proof.handover import write_case
from rollover.scenario import load
from tests.diagnosis.drops import FORCE, recorded, scenario
from tests.rollover.diagnosed import nothing_found


@pytest.mark.parametrize(
    ("first", "stated", "second"),
    [
        ("unexplained", {}, True),
        ("unexplained", {"estimate": False}, False),
        ("missing-physics", {}, False),  # what noise explains stays as it is
        ("no-mismatch", {}, False),
        ("unexplained", {"tolerance": 0.01}, False),  # somebody knows how far it misses
        ("unexplained", {"tolerance": {FORCE: 0.01}}, False),
        ("unexplained", {"estimate": True}, True),
    ],
)
def test_a_second_opinion_is_asked_of_what_is_unexplained(
    monkeypatch: pytest.MonkeyPatch, first: Verdict, stated: dict[str, Any], second: bool
) -> None:
    def concluded(asked: Asked, *_: object) -> Conclusion:
        found = object.__new__(Conclusion)
        for name, value in (("asked", asked), ("verdict", first), ("grade", "whole")):
            object.__setattr__(found, name, value)
        return found

    monkeypatch.setattr(pipeline, "concluded", concluded)
    monkeypatch.setattr(pipeline, "reported", lambda c: replace(nothing_found(), verdict=c.verdict))
    monkeypatch.setattr(pipeline, "_second_opinion", lambda *_: replace(nothing_found(), verdict="parameter"))
    found = diagnose(scenario(), recorded({}, 3, speeds=(2.0,)), **stated)
    assert found.verdict == ("parameter" if second else first)


@pytest.fixture(scope="module")
def opinions(tmp_path_factory: pytest.TempPathFactory) -> dict[Estimate, Diagnosis]:
    """Six drops on ground that hardens by Herschel and Bulkley's law, beside a background of 3 % of the force."""
    ids = ("soil-rate-hardening",)
    folder = tmp_path_factory.mktemp("cases") / "case"
    write_case(make(Order(index=23, seed=20270101, kind="foreign-form", ids=ids, background=0.03)), folder)
    chosen, recordings = load(folder / "scenario.yaml"), recordings_in(Path(folder))
    with pytest.MonkeyPatch.context() as patch, Executor(1) as executor:
        patch.setattr(conclusion, "explained", fit_single_effect)  # one effect at first too: a fifth of the time
        how: tuple[Estimate, ...] = (False, "unexplained")
        return {one: diagnose(chosen, recordings, estimate=one, executor=executor) for one in how}


def test_noise_alone_leaves_a_foreign_form_unexplained(opinions: dict[Estimate, Diagnosis]) -> None:
    found = opinions[False]
    assert (found.verdict, found.effects, dict(found.discrepancy)) == ("unexplained", (), {})


def test_beside_a_background_a_foreign_form_is_a_likeness(opinions: dict[Estimate, Diagnosis]) -> None:
    found = opinions["unexplained"]
    assert (found.verdict, found.answer, found.broken) == ("missing-physics", "likeness", ())
    (effect,) = found.effects
    assert effect.id == "soil-rate-hardening"
    assert effect.explains is not None
    assert effect.explains.share > 0.5
    assert effect.explains.low > 0.0
    assert "A background was estimated beside it" in found.sentence
    assert f"% of {FORCE}" in found.sentence
    assert found.discrepancy[FORCE].scale > 0.0


def test_a_background_that_an_effect_resembles_has_no_name(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """An added mass predicts 0.56 (0.28 at least) of it, drop for drop: of a background that all drops repeat."""
    write_case(make(Order(index=2, seed=20270402, kind="background", ids=(), background=0.03)), tmp_path / "case")
    chosen, recordings = load(tmp_path / "case" / "scenario.yaml"), recordings_in(tmp_path / "case")
    monkeypatch.setattr(conclusion, "explained", fit_single_effect)
    with Executor(1) as executor:
        found = diagnose(chosen, recordings, executor=executor)
    assert (found.effects, found.broken) == ((), ())

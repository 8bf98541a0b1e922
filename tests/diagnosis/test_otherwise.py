"""Fits begun otherwise, where a first look promised more than its usual shape gave."""

from __future__ import annotations

from dataclasses import replace
from types import SimpleNamespace
from typing import Any, cast

import numpy as np
import pytest

from rollover.diagnosis.candidates import Candidate
from rollover.diagnosis.fit import Fitted
from rollover.diagnosis.gate import Gate
from rollover.diagnosis.inquiry import Inquiry
from rollover.diagnosis.otherwise import begun_otherwise
from rollover.effects import Search
from tests.diagnosis.drops import linear_blocks

PLAIN = Candidate(id="mass", kind="parameter", family="", search={"added": Search(-1, 1)})
SHAPED = replace(PLAIN, id="soil-adhesion", search={"stress": Search(1, 2)}, shapes={"reach": Search(1, 2)})


def begun(promised: float, gained: float) -> list[str]:
    """What is scanned where the shaped effect's slopes promised so much, of which its fit gained so much."""
    blocks = tuple(linear_blocks(np.random.default_rng(4), 2, 40, np.zeros(1)))
    base = Fitted(candidates=(), x=(), blocks=blocks)
    left = base.left

    def fitted(c: Candidate, gain: float) -> Fitted:
        short = tuple(replace(b, residual=b.residual * np.sqrt(max(1.0 - gain / left, 0.0))) for b in blocks)
        return Fitted(candidates=(c,), x=(0.5,), blocks=short)

    asked: list[str] = []

    def fits(jobs: list[Any]) -> list[None]:
        asked.extend(f"{j.how} {j.candidates[-1].id} {j.start}" for j in jobs)
        return [None] * len(jobs)

    inquiry = SimpleNamespace(free=lambda _: [PLAIN, SHAPED], fits=fits)
    looked = Gate(
        score=40.0, scores={"mass": 40.0, "soil-adhesion": promised}, null=np.zeros(9), detectable={},
        starts={"soil-adhesion": ((0.7,),)},
    )  # fmt: skip
    met = sorted([fitted(PLAIN, 10.0), fitted(SHAPED, gained)], key=lambda f: f.left)
    assert begun_otherwise(cast(Inquiry, inquiry), base, met, looked, (0.0, 0.0)) == met
    return asked


@pytest.mark.parametrize(("promised", "gained", "scanned"), [(35.0, 5.0, 1), (35.0, 30.0, 0), (15.0, 0.0, 0)])
def test_what_promised_much_and_gained_little_is_fitted_with_its_shape(
    promised: float, gained: float, scanned: int
) -> None:
    assert begun(promised, gained) == ["scan soil-adhesion (0.7,)"] * scanned

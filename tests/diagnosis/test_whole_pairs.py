"""Two effects at once, of which one is nearly hidden by the other: concealed cases diagnosed from their folders."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

from rollover.diagnosis import diagnose_folder
from rollover.proof.generator import make, plan
from rollover.proof.handover import write_case


@pytest.mark.parametrize(
    ("seed", "index"),
    [
        (20263705, 24),  # a rate of 5 times the noise, all but 0.1 % of the range of which another stiffness does
        (20263801, 4),  # growing mass of a third of the noise in 28,000 samples, beside a rate
    ],
)
def test_both_are_named_and_their_intervals_hold(seed: int, index: int, tmp_path: Path) -> None:
    case = make(plan(40, seed, ["pair"])[index])
    write_case(case, tmp_path / "case")
    found = diagnose_folder(tmp_path / "case", tmp_path / "out", workers=1)
    true = {e["id"]: e["parameters"] for e in case.truth["effects"]}
    assert {e["id"] for e in found["effects"]} == true.keys(), json.dumps(found["effects"])
    for effect in found["effects"]:
        for name, told in effect["parameters"].items():
            assert told["low"] <= true[effect["id"]][name] <= told["high"], (effect["id"], name)

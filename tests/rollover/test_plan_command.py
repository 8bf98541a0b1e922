"""`rollover plan`: what it writes and says, and how wrong input is answered."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import pytest
from typer.testing import CliRunner

from rollover.cli.main import app

SHORT = ["--rate", "200", "--sensor", "ground/force_normal", "--sensor", "ground/sinkage"]


def asked(*words: str) -> Any:
    return CliRunner().invoke(app, ["plan", *words], env={"COLUMNS": "300", "TERM": "dumb", "NO_COLOR": "1"})


def test_a_plan_is_written_said_and_drawn(tmp_path: Path) -> None:
    out = tmp_path / "plan"
    words = ["drop_test", *SHORT, "--tolerance", "0.02", "--vary", "initiation.speed=1,3", "--out", str(out)]
    pairs = ["--between", "soil-stiffness,mass", "--between", "mass,guide-friction"]
    done = asked(*words, *pairs, "--noise", "ground/force_normal=30")
    assert done.exit_code == 0, done.output
    answer = json.loads((out / "plan.json").read_text())
    assert answer["format"] == "rollover-plan/1"
    assert answer["noise"]["ground/force_normal"] == 30.0
    assert set(answer["noise"]) == {"ground/force_normal", "ground/sinkage"}
    assert answer["conditions"] == [{"initiation.speed": 1.0}, {"initiation.speed": 3.0}]
    assert {(p["effect"], p["rival"]) for p in answer["pairs"]} == {
        ("soil-stiffness", "mass"), ("mass", "soil-stiffness"), ("mass", "guide-friction"), ("guide-friction", "mass"),
    }  # fmt: skip
    assert all(0.5 <= p["probability"] <= 1.0 for p in answer["pairs"])
    assert [t["effects"] for t in answer["next_tests"]] == [["soil-stiffness", "mass"], ["mass", "guide-friction"]]
    for e in answer["effects"]:
        assert e["effect"] in done.output
        assert e["least"] is not None
    for t in answer["next_tests"]:
        assert (
            f"{t['effects'][0]} and {t['effects'][1]}: told apart with {t['probability']:.0%} as planned" in done.output
        )
    page = (out / "report.html").read_text()
    assert "<svg" in page
    apart = [set(t["effects"]) for t in answer["next_tests"] if t["probability"] < 0.95]
    assert f"effects would show in these drops, {2 - len(apart)} of 2 pairs told apart with 95% or more." in page
    best = [t["best"] for t in answer["next_tests"] if t["best"] is not None]
    assert ("Next: " in page) is bool(best)
    assert "What to measure next" in page
    assert "rollover plan drop_test" in page
    again = asked(*words, *pairs, "--noise", "ground/force_normal=30", "--json")
    assert again.exit_code == 0, again.output
    assert json.loads(again.stdout)["pairs"] == answer["pairs"]
    other = asked(*words, "--noise", "ground/force_normal=30")
    assert other.exit_code == 2
    assert "holds results of something else" in other.output


@pytest.mark.parametrize(
    ("words", "said"),
    [
        ("side_overturn", "not a drop test, got 'vehicle'; 'striker' is needed"),
        ("drop_test --between soil-layer", "not two effects, got 'soil-layer'"),
        ("drop_test --between soil-layer,soil-layer", "not two effects"),
        ("drop_test --between soil-layer,soil-crusty", "did you mean 'soil-crust'"),
        ("drop_test --between tank-slosh,mass", "no effect that this test can have, got 'tank-slosh'"),
        ("drop_test --sensor ground/sinkag", "did you mean 'ground/sinkage'"),
        ("drop_test --sensor chassis/roll", "no channel of a drop test, got 'chassis/roll'"),
        ("drop_test --noise ground/sinkage=-1", "not a noise, got 'ground/sinkage=-1'"),
        ("drop_test --noise 0", "no noise at all, got 0"),
        ("drop_test --vary initiation.speed", "not a path with values"),
        ("drop_test --vary initiation.speed=1,fast", "not a number, got 'fast'"),
        ("drop_test --vary initiation.speed=1,1.0", "a value given twice"),
        ("drop_test --vary initiation.sped=1", "did you mean 'initiation.speed'"),
        ("drop_test --vary initiation.speed=300", "initiation.speed"),
        ("drop_test --uncertain initiation.speed=0", "not a standard deviation"),
        ("drop_test --uncertain initiation.sped=0.1", "did you mean 'initiation.speed'"),
    ],
)
def test_wrong_input_is_a_line_and_nothing_is_written(words: str, said: str, tmp_path: Path) -> None:
    out = tmp_path / "plan"
    done = asked(*words.split(), "--out", str(out))
    assert done.exit_code == 2, done.output
    assert said in done.output
    assert "Traceback" not in done.output
    assert not out.exists()

"""A tenth of the frozen answers, made anew; and what a comparison says and does not say."""

from __future__ import annotations

import copy
import json
from pathlib import Path
from typing import Any

import pytest

from tests.corpus import make as making
from tests.corpus.__main__ import main
from tests.corpus.adapter import digest
from tests.corpus.compare import compared, differences
from tests.corpus.make import read, worked_off, write
from tests.corpus.plan import plan

FROZEN = Path(__file__).with_name("frozen.json")
# the cheapest of each kind, about a tenth of the drops: together they take a minute, in which no overturn is diagnosed
TENTH = (
    "drop-126-null", "drop-137-null", "drop-076-null", "drop-089-null", "drop-027-decoy", "drop-101-decoy",
    "drop-010-negligible", "drop-047-negligible", "drop-144-single", "drop-088-single", "drop-056-single",
    "drop-016-pair", "drop-115-outside",
)  # fmt: skip
# of an interval's width, of a misfit, of a p-value: sums in another order (OpenBLAS for Nehalem) move these by 2e-6 at
# most, and no search by a step; 50 times that, for other machines, is a tenth of what ends of intervals are sought to
TOLERANCE = 1e-4


def _corpus(*ids: str, share: float = 1.0) -> dict[str, Any]:
    """What the frozen corpus says of some entries."""
    found = read(FROZEN)
    return {**found, "share": share, "entries": {id: copy.deepcopy(found["entries"][id]) for id in ids}}


@pytest.fixture(scope="module")
def anew() -> dict[str, Any]:
    """The tenth, made by the sources as they are; one process for all, as most of a small case is the start."""
    return {entry["id"]: entry for entry in worked_off(TENTH)}


@pytest.mark.parametrize("id", TENTH)
def test_a_tenth_is_answered_as_it_was(id: str, anew: dict[str, Any]) -> None:
    was, now = read(FROZEN)["entries"][id], anew[id]
    for key in ("verdict", "false_names", "depends_on", "failure", "score", "covers"):
        assert now[key] == was[key], key
    assert [(n["id"], n["channel"], n["set"]) for n in now["names"]] == [
        (n["id"], n["channel"], n["set"]) for n in was["names"]
    ]
    for name, other in zip(now["names"], was["names"], strict=True):
        assert name["values"].keys() == other["values"].keys()
        for key, (value, low, high) in other["values"].items():
            assert name["values"][key] == pytest.approx([value, low, high], rel=0, abs=TOLERANCE * (high - low)), key
    assert now["held_out"] == pytest.approx(was["held_out"], rel=TOLERANCE)
    assert [now["p_value"], now["remaining"]] == pytest.approx([was["p_value"], was["remaining"]], abs=TOLERANCE)


def test_kinds_are_as_planned_and_any_beginning_holds_each() -> None:
    cases = [job for job in plan() if job.task == "prove"]
    drops = [job.kind for job in cases if job.rig == "drop"]
    overturns = [job.kind for job in cases if job.rig == "overturn"]
    assert [drops.count(k) for k in ("single", "pair", "outside")] == [60, 24, 24]
    assert sum(drops.count(k) for k in ("null", "decoy", "negligible")) == 40
    assert [overturns.count(k) for k in ("single", "pair", "outside", "null")] == [9, 4, 4, 4]
    assert len({(job.rig, job.seed) for job in cases}) == len(cases)
    for end in range(20, len(drops)):
        assert drops[:end].count("single") == pytest.approx(60 / 148 * end, abs=2.0)


def test_each_entry_of_the_plan_is_frozen_once_at_most() -> None:
    assert set(read(FROZEN)["entries"]) <= {job.id for job in plan()}
    assert FROZEN.stat().st_size < 500_000


def test_times_alone_are_no_difference() -> None:
    old, new = _corpus("drop-001-single"), _corpus("drop-001-single")
    new["entries"]["drop-001-single"] |= {"cpu": 1.0, "wall": 2.0}
    assert list(differences(old["entries"]["drop-001-single"], new["entries"]["drop-001-single"])) == []


@pytest.mark.parametrize(
    ("change", "said"),
    [
        ({"verdict": "unexplained"}, "verdict: missing-physics -> unexplained"),
        ({"simulations": 6310}, "simulations: 5048 -> 6310 (+0.2)"),
        ({"names": []}, "names: ['soil-viscous-damping'] -> []"),
        ({"recordings": "0"}, "recordings: "),
        ({"failure": "took longer"}, "failure:  -> took longer"),
    ],
)
def test_what_changed_is_named(change: dict[str, Any], said: str) -> None:
    old = _corpus("drop-001-single")["entries"]["drop-001-single"]
    (line,) = differences(old, {**old, **change})
    assert line.startswith(said)


def test_a_last_bit_of_an_interval_is_a_difference() -> None:
    old = _corpus("drop-001-single")["entries"]["drop-001-single"]
    new = copy.deepcopy(old)
    value, low, high = new["names"][0]["values"]["damping"]
    new["names"][0]["values"]["damping"] = [value, low * (1.0 + 4e-16), high]
    (line,) = differences(old, new)
    assert line.startswith("names[soil-viscous-damping].values.damping[1]: 127.")
    assert line.endswith("e-16)")


def test_a_missing_entry_is_a_difference_if_asked_for() -> None:
    ids = [job.id for job in plan(0.001)]
    old = _corpus("drop-001-single", share=0.001)
    old["entries"] = dict.fromkeys(ids, old["entries"]["drop-001-single"])
    new = {**old, "entries": {id: old["entries"][id] for id in ids[:-1]}}
    assert compared(old, old)[1]
    text, is_same = compared(old, new)
    assert not is_same
    assert f"{ids[-1]}: not in NEW" in text
    assert compared({**old, "share": 1.0}, old)[1]
    assert not compared(old, {**old, "entries": {}})[1]


def test_counts_have_their_intervals() -> None:
    old = _corpus("drop-001-single")
    one = old["entries"]["drop-001-single"]
    old["entries"] = {j.id: {**copy.deepcopy(one), "id": j.id} for j in plan() if (j.rig, j.kind) == ("drop", "single")}
    new = copy.deepcopy(old)
    for entry in [*new["entries"].values()][:30]:
        entry["score"]["alone"] = False
        entry["false_names"] = ["mass"]
    text, _ = compared(old, new)
    assert "60 of 60 (94 to 100 %)" in text
    assert "30 of 60 (37 to 63 %)" in text  # Clopper and Pearson, Biometrika 26 (1934), chart for n = 60
    assert "drop: cases with a false name" in text


def test_numbers_are_hashed_to_the_last_bit_without_names() -> None:
    tree = {"a": [0.1, {"b": 2}], "c": "prose", "d": True}
    assert digest(tree) == digest([{"z": 2}, 0.1, "other prose"])
    assert digest(tree) != digest({"a": [0.1 + 2e-17, {"b": 2}]})
    assert digest(tree) != digest({"a": [0.1, {"b": 2.0}]})


def test_what_is_finished_is_kept_and_what_failed_is_tried_again(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    asked: list[str] = []
    broken = "run-drop_test"

    def work(ids: list[str]) -> list[dict[str, Any]]:
        asked.extend(ids)
        if broken in ids:
            raise RuntimeError(f"{ids[0]}: exit status 1: broken")
        return [{"id": ids[0], "status": "done", "cpu": 1.0, "wall": 1.0}]

    monkeypatch.setattr(making, "worked_off", work)
    out = tmp_path / "corpus.json"
    assert main(["make", "--out", str(out), "--share", "0.01"]) == 1
    first, broken = list(asked), ""
    asked.clear()
    assert main(["make", "--out", str(out), "--share", "0.01"]) == 0
    assert asked == ["run-drop_test"]
    assert [entry["id"] for entry in json.loads(out.read_text())["entries"]] == first
    monkeypatch.setattr(making, "sources", lambda: "others")
    assert main(["make", "--out", str(out), "--share", "0.01"]) == 2


def test_a_file_that_is_no_corpus_is_said_to_be_none(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    path = tmp_path / "other.json"
    path.write_text('{"format": "rollover-proof/1"}')
    assert main(["compare", str(path), str(FROZEN)]) == 2
    assert f"{path}: no corpus: ValueError: format: got 'rollover-proof/1'" in capsys.readouterr().err


def test_a_corpus_is_written_as_it_is_read(tmp_path: Path) -> None:
    write(tmp_path / "again.json", read(FROZEN))
    assert (tmp_path / "again.json").read_bytes() == FROZEN.read_bytes()


def test_a_worker_that_ends_with_a_fault_says_which_entry() -> None:
    with pytest.raises(RuntimeError, match="drop-000-none: exit status 1: KeyError"):
        worked_off(["drop-000-none"])

"""Baselines: what is compared with what, which tolerance is refused, what an update keeps. Loads are made up."""

from __future__ import annotations

import os
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from rollover.scenario import load
from rollover.spec import document
from rollover.studies import baseline as baselines
from rollover.studies import regression
from rollover.studies.baseline import Baseline, Load, against, allowed, baseline_from
from rollover.studies.ensemble import Extreme, Spread, perturbed_starts
from rollover.system.errors import InputError


def start(force: float, *, impulse: float = 12.0, quiet: float = 0.0) -> tuple[Extreme, ...]:
    """The extremes of one run."""
    return (
        Extreme(load="rops/force", filter="CFC 60", unit="N", value=force, time=2.4),
        Extreme(load="rops/force", filter="impulse", unit="N s", value=impulse, time=4.0),
        Extreme(load="wheel/front_right/force_normal", filter="raw", unit="N", value=quiet, time=0.0),
    )


SCENARIO = load("drop_test")
SMOOTH = [start(1000.0)] + [start(1000.0 * (1 + k * 1e-7)) for k in (1, -1, 2, -2)]
CHAOTIC = [start(f) for f in (1000.0, 1010.0, 985.0, 1020.0, 990.0)]
FINER = [start(1.002 * e[0].value) for e in SMOOTH]


def drawn(ensemble: list[tuple[Extreme, ...]], before: Baseline | None = None, reason: str = "first") -> Baseline:
    finer = [start(1.002 * e[0].value) for e in ensemble]
    return baseline_from("drop_test", SCENARIO, ensemble, finer, reason, before)


def test_smooth_loads_need_one_start_and_hold_to_half_step() -> None:
    made = drawn(SMOOTH)
    force, impulse, quiet = made.loads
    assert made.starts == 1
    assert force.value == 1000.0
    assert (force.half_step_change, force.tolerance, force.reason) == (0.002, 0.002, "what half the step changes")
    assert (impulse.tolerance, impulse.reason) == (1e-6, "another processor or mathematical library")
    assert quiet.value == 0.0
    assert against(made, SCENARIO, [start(1001.99)]).verdict == "same"
    answer = against(made, SCENARIO, [start(1002.1)])
    assert (answer.verdict, answer.ok) == ("changed", False)
    assert answer.sentence == "1 of 3 loads changed, rops/force, CFC 60: +0.21 %, 0.2 % allowed"


def test_chaotic_loads_are_compared_by_their_mean() -> None:
    made = drawn(CHAOTIC)
    force = made.loads[0]
    assert made.starts == 5
    assert force.value == 1001.0
    # s^2 = (1 + 81 + 256 + 361 + 121)/4 N^2 in both, so s = 14.318 N over 1001 N, rounded up to three figures;
    # Student's t of 8 degrees of freedom, one in a thousand both ways: 5.041
    assert force.scatter == 0.0144
    assert force.tolerance == pytest.approx(5.041 * 0.0144 * (2 / 5) ** 0.5, rel=3e-3)
    assert "means of 5 starts" in force.reason
    alike = [start(e[0].value + 30.0) for e in CHAOTIC]
    assert against(made, SCENARIO, alike).ok
    other = [start(e[0].value + 55.0) for e in CHAOTIC]
    assert not against(made, SCENARIO, other).ok


def test_equal_ensembles_exceed_tolerance_once_in_a_thousand() -> None:
    # 20 000 pairs: 20 are expected, with a standard deviation of 4.5
    draw = np.random.default_rng(7).normal(1.0, 0.015, size=(20_000, 3, 5))
    was, finer, now = draw[:, 0], draw[:, 1], draw[:, 2]
    pooled = np.sqrt(0.5 * (was.var(axis=1, ddof=1) + finer.var(axis=1, ddof=1)))
    moved = np.abs(now.mean(axis=1) - was.mean(axis=1))
    false_alarms = sum(m > allowed(0.0, float(s), 5)[0] for m, s in zip(moved, pooled, strict=True))
    assert 5 <= false_alarms <= 38


def test_loads_that_come_and_go_are_changes() -> None:
    made = drawn(SMOOTH)
    gone = against(made, SCENARIO, [start(1000.0)[1:]])
    assert "rops/force, CFC 60: a load that is gone" in gone.sentence
    extra = Extreme(load="rops/energy", filter="raw", unit="J", value=1.0, time=0.0)
    assert (
        "rops/energy, raw: a load that the baseline lacks"
        in against(made, SCENARIO, [(*start(1000.0), extra)]).sentence
    )
    assert "was none, is 2 N" in against(made, SCENARIO, [start(1000.0, quiet=2.0)]).sentence
    assert against(made, SCENARIO, [start(1000.0, quiet=1e-4)]).ok


def test_other_values_and_versions_are_said() -> None:
    made = replace(drawn(SMOOTH), versions=("rollover 0.0.9",))
    answer = against(made, SCENARIO.replaced({"initiation.speed": 2.0}), [start(1000.0)])
    assert answer.ok
    assert answer.notes[0] == "the scenario's own values have changed since its baseline"
    assert answer.notes[1].startswith("made with rollover 0.0.9, compared with ")


def test_a_tolerance_below_the_discretisation_error_is_refused(tmp_path: Path) -> None:
    path = tmp_path / "drop_test.yaml"
    baselines.write({path: drawn(SMOOTH)})
    text = path.read_text()
    path.write_text(text.replace("tolerance: 0.002\n", "tolerance: 0.0019\n"))
    with pytest.raises(
        InputError, match=r"below the discretisation error of rops/force, CFC 60, got 0\.0019; at least 0"
    ) as e:
        baselines.read(path)
    assert [(f.file, f.line is not None) for f in e.value.faults] == [(str(path), True)]


def test_a_manual_tolerance_lasts_until_it_is_too_small() -> None:
    made = drawn(SMOOTH)
    by_hand = replace(made.loads[0], tolerance=0.05, reason="the customer's criterion")
    kept = replace(made, loads=(by_hand, *made.loads[1:]))
    later = [start(1100.0)] + [start(1100.0 * (1 + k * 1e-7)) for k in (1, -1, 2, -2)]
    again = drawn(later, kept, "stiffer soil")
    assert (again.loads[0].value, again.loads[0].tolerance) == (1100.0, 0.05)
    assert again.loads[0].reason == "the customer's criterion"
    rough = [start(1.06 * e[0].value) for e in later]
    with pytest.raises(InputError, match=r"baselines/drop_test\.yaml: tolerance: below the discretisation error"):
        baseline_from("drop_test", SCENARIO, later, rough, "x", kept)


def test_history_grows_by_what_changed_and_by_nothing_else(tmp_path: Path) -> None:
    first = drawn(SMOOTH)
    assert drawn(SMOOTH, first, "no reason at all") is first
    second = drawn(CHAOTIC, first, "softer soil")
    third = drawn(SMOOTH, second, "back again")
    assert (third.reason, [f.reason for f in third.history]) == ("back again", ["softer soil", "first"])
    assert third.history[1].values[0] == "rops/force, CFC 60: 1000 N"
    path = tmp_path / "drop_test.yaml"
    baselines.write({path: third})
    assert baselines.read(path) == third


@pytest.mark.parametrize("reason", [RuntimeError, KeyboardInterrupt])
def test_an_update_that_breaks_off_leaves_the_old_file(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, reason: type[BaseException]
) -> None:
    path = tmp_path / "drop_test.yaml"
    baselines.write({path: drawn(SMOOTH)})
    before = path.read_bytes()

    def breaks(*_: object) -> None:
        raise reason

    monkeypatch.setattr(os, "replace", breaks)
    with pytest.raises(reason):
        baselines.write({path: drawn(CHAOTIC)})
    assert path.read_bytes() == before
    assert [p.name for p in tmp_path.iterdir()] == ["drop_test.yaml"]


def test_an_update_that_breaks_off_writes_no_file(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    dump, asked = document.dump, []

    def breaks_the_second_time(thing: object, head: str = "") -> str:
        asked.append(head)
        if len(asked) == 2:
            raise KeyboardInterrupt
        return dump(thing, head)

    monkeypatch.setattr(document, "dump", breaks_the_second_time)
    with pytest.raises(KeyboardInterrupt):
        baselines.write({tmp_path / "a.yaml": drawn(SMOOTH), tmp_path / "b.yaml": drawn(SMOOTH)})
    assert list(tmp_path.iterdir()) == []


def test_a_baseline_under_another_name(tmp_path: Path) -> None:
    baselines.write({tmp_path / "other.yaml": drawn(SMOOTH)})
    with pytest.raises(InputError, match=r"other\.yaml: scenario: got 'drop_test'; the file's name, 'other'"):
        baselines.read(tmp_path / "other.yaml")


def test_perturbed_starts_differ_by_nothing_that_matters() -> None:
    group = perturbed_starts(SCENARIO, 5)
    assert group[0] is SCENARIO
    assert [round((s.gravity / 9.81 - 1.0) * 1e6, 3) for s in group] == [0.0, 1.0, -1.0, 2.0, -2.0]
    assert all(s.replaced({"gravity": 9.81}) == SCENARIO for s in group)
    with pytest.raises(InputError, match="gravity: an ensemble varies gravity, got 0"):
        perturbed_starts(SCENARIO.replaced({"gravity": 0.0}), 2)


def test_scatter_of_nothing_is_none() -> None:
    one = Spread(load="x", filter="raw", unit="N", mean=1.0, time=0.0, values=(1.0,))
    assert one.scatter == 0.0
    assert replace(one, mean=0.0, values=(0.0, 0.0)).scatter == 0.0


def test_every_shipped_scenario_has_a_baseline_or_a_reason() -> None:
    choice = regression.chosen([])
    assert [a.sentence for a in choice.answers] == []
    left_out = baselines.excluded(document.shipped_folder())
    without = [f.stem for f in choice.files if not baselines.path_of(f).is_file() and f.stem not in left_out]
    assert without == [], "rollover regress NAME --update --reason TEXT"
    for file in choice.files:
        if file.stem not in left_out:
            assert all(isinstance(x, Load) for x in baselines.read(baselines.path_of(file)).loads)


def test_shipped_baselines_are_of_the_scenarios_as_they_are() -> None:
    """A key that is added later is no part of a hash until it is set (`Later`): no baseline is of another scenario."""
    folder = document.shipped_folder() / "baselines"
    names = {path.stem for path in folder.glob("*.yaml")} - {"excluded"}
    of = {name: baselines.read(folder / f"{name}.yaml").scenario_hash for name in names}
    assert {name for name in names if of[name] != document.content_hash(load(name))} == set()

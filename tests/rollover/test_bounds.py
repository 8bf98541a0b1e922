"""What a file claims is summed before it is made room for: a few bytes cost as little as they are."""

from __future__ import annotations

import time
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from rollover.spec import document
from rollover.spec.document import tree
from rollover.studies import load
from rollover.studies.design import points
from rollover.system import budget
from rollover.system.errors import InputError
from tests.rollover.bounds import line_of, yaml

# --- YAML


def aliases(each: int) -> str:
    """A kB that stands for about each^3 values."""
    ones = ", ".join(["one"] * each)
    return f"a: &a [{ones}]\nb: &b [{', '.join(['*a'] * each)}]\nc: [{', '.join(['*b'] * each)}]\n"


def test_aliases_count_in_full(tmp_path: Path, cheap: None, monkeypatch: pytest.MonkeyPatch) -> None:
    text = aliases(100)
    assert len(text) < 2000
    line = line_of(lambda: tree.read(yaml(tmp_path, text)))
    assert "a.yaml:1: too many values, aliases counted in full, got 1020307; at most 30000 are allowed" in line
    monkeypatch.setenv(budget.VARIABLE, "0.01")
    assert "got 925; at most 300 are allowed" in line_of(lambda: tree.read(yaml(tmp_path, aliases(9))))
    monkeypatch.setenv(budget.VARIABLE, "0.04")
    assert tree.read(yaml(tmp_path, aliases(9))).plain["c"] == [[["one"] * 9] * 9] * 9


def test_aliases_of_rows_of_numbers_count_too(tmp_path: Path, cheap: None) -> None:
    row = ", ".join(["1.5"] * 1000)
    text = f"a: &a [{row}]\nb: &b [{', '.join(['*a'] * 100)}]\nc: [{', '.join(['*b'] * 10)}]\n"
    assert "too many values, aliases counted in full" in line_of(lambda: tree.read(yaml(tmp_path, text)))


def test_a_mb_of_numbers_is_read(tmp_path: Path) -> None:
    began = time.process_time()
    found = tree.read(yaml(tmp_path, "a: [" + "1,2.5," * 150_000 + "-3e2]\n")).plain["a"]
    assert time.process_time() - began < 5.0  # one value after the other takes 17 s
    assert (len(found), found[:3], found[-1], type(found[0])) == (300_001, [1, 2.5, 1], -300.0, int)


def test_a_mb_of_words_is_refused_where_they_are_too_many(tmp_path: Path, cheap: None) -> None:
    text = "title: x\nevents:\n" + "  - e\n" * 160_000
    line = line_of(lambda: tree.read(yaml(tmp_path, text)))
    assert "a.yaml:29998: too many values, got 30001; at most 30000 are allowed" in line


def test_text_beside_rows_of_numbers_is_bounded(tmp_path: Path, cheap: None) -> None:
    text = "a: 1\n" + f"# {'c' * 98}\n" * 11_000
    line = line_of(lambda: tree.read(yaml(tmp_path, text)))
    assert "too many characters beside rows of numbers, got 1111005; at most 1000000" in line
    sparse = tmp_path / "sparse.yaml"
    with sparse.open("wb") as file:
        file.truncate(10**10)
    assert "sparse.yaml: too many bytes, got 10000000000" in line_of(lambda: tree.read(sparse))


ROWS = [
    "a: [1, -2, 3.5, 1e3, -1.25E-2, 0, 0.0]\n",
    "- [1, 2,\n   3,\n\n   4\n  ]\n- [ 5 , 6 ]\n- [[7, 8], [9, 10]]\n",
    "a: &r [1, 2, 3]\nb: [*r, {c: *r}]\nd: '[1, 2]'\ne: |\n  [1, 2]\nf: x [1, 2]\n",
    "a: [01, 2]\nb: [1_0, 2]\nc: [1, 2, x]\nd: [1, .5]\ne: [1, ~]\nf: [0x1, 2]\ng: [1.0.0, 2]\n",
    "h: [1e5, 1.e5]\ni: [1, 2,]\n",
    "a: [1, 2] # [3, 4]\nb: {c: [5, 6], d: [7, 8]}\ne: !!seq [1, 2]\n",
    "a: [123456789012345678901234567890, 1]\nb: [1e400, 2]\nc: [-0, -0.0]\n",
]


@pytest.mark.parametrize("text", ROWS)
def test_a_row_of_numbers_is_what_it_was(text: str, monkeypatch: pytest.MonkeyPatch) -> None:
    """Values, their types and their lines are those of one value after the other."""
    import re

    from rollover.spec.document import yaml_reader

    def told(node: tree.Node) -> Any:
        below = node.value.values() if isinstance(node.value, dict) else node.value
        inner = [told(child) for child in below] if isinstance(node.value, (dict, tuple)) else repr(node.value)
        return node.place.line, node.key.line, inner

    start = tree.Place(file="a", line=1, folder=Path())
    by_rows = told(tree.parse(text, start))
    monkeypatch.setattr(yaml_reader, "_ROW", re.compile("(?!)"))
    tree._parsed.cache_clear()
    assert told(tree.parse(text, start)) == by_rows


@pytest.mark.parametrize("text", ["[1, 2]: x\n", "a: [1, 2] 3\n", "a: [1, 2]]\n", "a: [1, 2\nb: 3\n"])
def test_a_row_where_none_may_stand_is_refused(text: str) -> None:
    with pytest.raises(InputError):
        tree.parse(text, tree.Place(file="a", line=1, folder=Path()))


def test_the_largest_grid_of_heights_that_is_written_can_be_read(tmp_path: Path) -> None:
    rows = np.random.default_rng(1).random((700, 700)).tolist()
    text = document.dump_mapping({"heights": rows[:2]})
    text = text + "".join(f"  - [{', '.join(map(repr, row))}]\n" for row in rows[2:])
    assert tree.read(yaml(tmp_path, text)).plain["heights"] == rows


def test_a_factor_that_is_none_is_said(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv(budget.VARIABLE, "lots")
    assert str(line_of(budget.factor, cure="usually 1")).startswith("ROLLOVER_BUDGET: not a factor, got 'lots'; ")


# --- studies

STUDY = """\
format: rollover-study/1
title: many
scenario: {{base: drop_test}}
axes:
  - {{name: v, paths: [initiation.speed], {axis}}}
  - {{name: m, paths: [vehicle.mass], kind: uniform, low: 100.0, high: 101.0}}
plan: {plan}
outputs: [{{name: ground/force_normal}}]
"""


@pytest.mark.parametrize(
    ("axis", "plan", "said"),
    [
        (
            "kind: range, low: 1.0, high: 3.0, count: 300000000",
            "{kind: grid}",
            "axes.v.count: too many levels, got 300",
        ),
        ("kind: uniform, low: 1.0, high: 3.0", "{kind: grid, levels: 40000}", "plan: too many cases, got 1600000000"),
        ("kind: uniform, low: 1.0, high: 3.0", "{kind: lhs, count: 900000000}", "plan: too many cases, got 900000000"),
        ("kind: uniform, low: 1.0, high: 3.0", "{kind: morris, count: 400000}", "plan: too many cases, got 1200000"),
        ("kind: uniform, low: 1.0, high: 3.0", f"{{kind: random, count: 1{'0' * 20}}}", "got more than 1e15"),
    ],
)
def test_cases_are_counted_before_they_are_made(tmp_path: Path, cheap: None, axis: str, plan: str, said: str) -> None:
    path = yaml(tmp_path, STUDY.format(axis=axis, plan=plan))
    assert said in line_of(lambda: points(load(path)))


def test_values_of_many_axes_are_counted(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    monkeypatch.setattr(budget, "POINTS", 30)
    path = yaml(tmp_path, STUDY.format(axis="kind: uniform, low: 1.0, high: 3.0", plan="{kind: random, count: 16}"))
    assert "too many values, of 16 cases on 2 axes, got 32; at most 30" in line_of(lambda: points(load(path)))


def test_an_axis_is_tried_at_some_levels_and_its_ends(tmp_path: Path) -> None:
    began = time.process_time()
    good = "kind: range, low: 1.0, high: 3.0, count: 100000"
    assert len(load(yaml(tmp_path, STUDY.format(axis=good, plan="{kind: grid}"))).axes[0].levels(2)) == 100_000
    assert time.process_time() - began < 10.0  # all of them take 500 s
    bad = "kind: range, low: -1.0, high: 3.0, count: 100000"
    assert "axes.0: v = -1.0" in line_of(
        lambda: load(yaml(tmp_path, STUDY.format(axis=bad, plan="{kind: grid}"))), cure=""
    )

"""JSON files of earlier commands, damaged: their readers say in one line what is wrong, whatever stands in them."""

from __future__ import annotations

import json
import re
from pathlib import Path

import pytest
from typer.testing import CliRunner

from rollover.cli.main import app
from rollover.comparison.curves import read_curves
from rollover.studies import case_store
from rollover.system.errors import InputError
from rollover.system.own_json import COUNT, NUMBER, TEXT, read_json
from rollover.system.transaction import JOURNAL, finish

DEEP = "[" * 100_000
# what JSON can hold where a mapping, a list, or text is expected
ODD = {
    "a list": "[]",
    "text": '"x"',
    "a number": "1e3",
    "null": "null",
    "nested": DEEP,
    "cut": '{"format": ',
    "none": "",
}
VALUES = {"list": [["a"]], "mapping": {"a": 1}, "number": 3, "null": None, "in a list": [{}], "true": [True]}


@pytest.mark.parametrize("text", ODD.values(), ids=ODD)
def test_what_is_no_mapping_is_no_answer(text: str, tmp_path: Path) -> None:
    (tmp_path / "a.json").write_text(text)
    with pytest.raises(ValueError, match=r"mapping|Expecting"):
        read_json(tmp_path / "a.json")


def test_a_value_of_another_kind_is_named_by_its_path(tmp_path: Path) -> None:
    shape = {"rows": [{"name": TEXT, "n": COUNT, "x": (NUMBER,)}]}
    good = {"rows": [{"name": "a", "n": 1, "x": None}, {"name": "b", "n": 2, "x": 0.5}], "more": 1}
    (tmp_path / "a.json").write_text(json.dumps(good))
    assert read_json(tmp_path / "a.json", shape) == good
    good["rows"][1]["n"] = 0.5
    (tmp_path / "a.json").write_text(json.dumps(good))
    with pytest.raises(ValueError, match=re.escape("rows.1.n: not a whole number, got 0.5")):
        read_json(tmp_path / "a.json", shape)


@pytest.mark.parametrize("value", VALUES.values(), ids=VALUES)
def test_a_comparison_of_another_kind_is_refused(value: object, tmp_path: Path) -> None:
    for about in (
        {"format": "rollover-compare/1", "recordings": value},
        {"format": value},
        {"format": "rollover-compare-runs/1", "baseline": value, "candidate": {"folder": "b"}},
    ):
        (tmp_path / "compare.json").write_text(json.dumps(about))
        with pytest.raises(InputError) as refused:
            read_curves(tmp_path)
        assert len(refused.value.faults) == 1
        assert "compare" in str(refused.value)


@pytest.mark.parametrize("text", ODD.values(), ids=ODD)
def test_a_report_that_is_none_leaves_a_study_alone(text: str, tmp_path: Path) -> None:
    (tmp_path / case_store.REPORT).write_text(text)
    (tmp_path / case_store.CASES).mkdir()
    done = CliRunner().invoke(app, ["study", "rops_stiffness", "--out", str(tmp_path)])
    assert done.exit_code == 2
    assert "another --out, or --force" in done.stderr
    assert (tmp_path / case_store.REPORT).read_text() == text


@pytest.mark.parametrize("value", VALUES.values(), ids=VALUES)
def test_a_journal_that_is_none_moves_nothing(value: object, tmp_path: Path) -> None:
    for key in ("format", "files", "account", "journals"):
        told = {"format": "rollover-update/1", "files": [], "account": ["a", "b"], "journals": [], key: value}
        (tmp_path / JOURNAL).write_text(json.dumps(told))
        with pytest.raises(InputError, match="remove it to go on"):
            finish(tmp_path / JOURNAL)
        assert (tmp_path / JOURNAL).exists()

"""Files that are written say the same to readers of YAML 1.1 and 1.2: numbers are numbers, text stays text."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
import yaml
from ruamel.yaml import YAML

from rollover.scenario import load
from rollover.spec import document
from rollover.spec.document import tree
from rollover.spec.document.tree import Place
from rollover.system.errors import InputError

PLACE = Place(file="a.yaml", line=1, folder=Path())
FLOATS = (1e-05, 1.0, -1e22, 1.5e-7, 0.1 + 0.2, 1e16, 123456789.0, 5e-324, float(np.nextafter(1.0, 2.0)), -0.0)
TEXTS = (
    "on",
    "Off",
    "yes",
    "NO",
    "y",
    "N",
    "true",
    "~",
    "null",
    "1_000",
    "1:30",
    "190:20:30.15",
    "010",
    "0x1f",
    "0b11",
)
TEXTS += ("1e-05", "1e5", "1.5", ".5", "+.inf", ".nan", "2001-12-14", "2001-12-14 21:59:43.10", "<<", "=", "12", "0o14")
TEXTS += ("plain", "a: b", "# none", "1:99", "drop 3", "-", "")


def read(text: str, version: str) -> Any:
    if version == "1.1":
        return yaml.safe_load(text)
    return YAML(typ="safe", pure=True).load(text)


@pytest.mark.parametrize("version", ["1.1", "1.2"])
def test_what_is_written_is_read_alike(version: str) -> None:
    tree = {"floats": list(FLOATS), "alone": 1e-05, "texts": list(TEXTS), "keys": {t: 1 for t in TEXTS if t}}
    found = read(document.dump_mapping(tree), version)
    assert found == tree
    for given, got in zip(FLOATS, found["floats"], strict=True):
        assert (type(got), repr(got)) == (float, repr(given))


def test_every_shipped_scenario_says_the_same_to_both() -> None:
    for name in ("side_overturn", "drop_test", "field_upset_side", "static_rops_test"):
        text = document.dump(load(name))
        assert read(text, "1.1") == read(text, "1.2"), name


@pytest.mark.parametrize("number", ["0x" + "f" * 5000, "-0x" + "1" * 4000, "0o" + "7" * 9000, "9" * 5000])
def test_a_whole_number_too_long_to_be_written_is_text(number: str) -> None:
    """Python reads one of base 16 of any length and refuses to write it: no message could say what was got."""
    assert document.parse(f"a: {number}\n", PLACE).plain == {"a": number}


@pytest.mark.parametrize("number", ["0x1F", "0x" + "f" * 300, "0o17", "9" * 400])
def test_other_whole_numbers_are_numbers(number: str) -> None:
    assert document.parse(f"a: {number}\n", PLACE).plain == {"a": int(number, 0)}


@pytest.mark.parametrize("number", ["0x" + "f" * 5000, "0o" + "7" * 9000])
def test_a_number_of_any_base_is_one_line(number: str, tmp_path: Path) -> None:
    (tmp_path / "s.yaml").write_text(f"base: drop_test\nvehicle: {{mass: {number}}}\n")
    with pytest.raises(InputError) as caught:
        load(tmp_path / "s.yaml")
    (line,) = str(caught.value).splitlines()
    assert line.startswith(f"{tmp_path / 's.yaml'}:2: vehicle.mass: not a number, got text '0")


@pytest.mark.parametrize("text", ["", "''", "_", "maybe", "0b2", "1:2:x", ".", "+", "1" * 5000])
@pytest.mark.parametrize("tag", ["int", "float", "bool", "null"])
def test_a_stated_tag_that_its_text_is_none_of_leaves_text(tag: str, text: str) -> None:
    value = tree.parse(f"a: !!{tag} {text}\n", PLACE).plain["a"]
    assert value == text.strip("'") or tag == "null" or isinstance(value, float)

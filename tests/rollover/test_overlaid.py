"""A fault of two keys, of which one stands in a base: the line that is named is one that the user can change."""

from __future__ import annotations

from pathlib import Path
from textwrap import indent

import pytest

from rollover.scenario import load
from rollover.system.errors import Fault, InputError

LIGHT = "base: vineyard_tractor\nwhole: {mass: 60.0}\n"
STRIKER = "kind: striker\nname: A\nmass: 9.0\nface_length: 0.1\nface_width: 0.1\n"
BODY = "kind: body\nname: A\nwhole: {mass: 1.0, centre_of_mass: [0, 0, 0], inertia: [1, 1, 1]}\noutline: []\n"
# files -> the line that is named, its path, where else it stands: s.yaml is read
BROKEN: dict[str, tuple[dict[str, str], str, int, str, str]] = {
    "a step over a shipped output step": (
        {"s.yaml": "base: drop_test\ntitle: mine\nsimulation:\n  duration: 0.4\n  step: 0.0003\n"},
        "s.yaml", 5, "simulation.output_step", "drop_test.yaml:17",
    ),
    "a filter class over a shipped output step": (
        {"s.yaml": "base: drop_test\ntitle: mine\nloads: {cfc: 1000}\nsimulation: {duration: 0.4}\n"},
        "s.yaml", 3, "simulation.output_step", "drop_test.yaml:17",
    ),
    "the named key itself": (
        {"s.yaml": "base: drop_test\nsimulation:\n  duration: 0.4\n  output_step: 0.0003\n"},
        "s.yaml", 4, "simulation.output_step", "",
    ),
    "in a vehicle of the user's": (
        {"s.yaml": "base: side_overturn\ntitle: mine\nvehicle: v.yaml\n", "v.yaml": LIGHT},
        "v.yaml", 2, "vehicle.whole.mass", "",
    ),
    "a base of the user's that is broken itself": (
        {
            "s.yaml": "base: mid.yaml\nsimulation: {duration: 0.4}\n",
            "mid.yaml": "base: drop_test\nsimulation:\n  step: 0.0003\n",
        },
        "mid.yaml", 3, "simulation.output_step", "drop_test.yaml:17",
    ),
    "a base that is broken, without one of its own": (
        {"s.yaml": "base: drop_test\nvehicle: u.yaml\n", "u.yaml": "base: v.yaml\nname: Mine\n", "v.yaml": BODY},
        "v.yaml", 4, "vehicle.outline", "",
    ),
    "a start that the shipped vehicle cannot make": (
        {"s.yaml": "base: drop_test\ntitle: mine\ninitiation: {kind: tip-over, side: left}\n"},
        "s.yaml", 3, "initiation.kind", "",
    ),
    "a vehicle that cannot begin as the shipped start": (
        {"s.yaml": "base: side_overturn\ntitle: mine\nvehicle:\n" + indent(STRIKER, "  ")},
        "s.yaml", 3, "initiation.kind", "side_overturn.yaml:",
    ),
    "a file that is named": (
        {"s.yaml": "base: side_overturn\ntitle: mine\nvehicle: a.yaml\n", "a.yaml": STRIKER},
        "s.yaml", 3, "initiation.kind", "side_overturn.yaml:",
    ),
    "two keys that break it together": (
        {"s.yaml": "base: drop_test\nsimulation:\n  step: 0.0003\n  output_step: 0.0005\n  duration: 0.4\n"},
        "s.yaml", 4, "simulation.output_step", "",
    ),
}  # fmt: skip


def faults(folder: Path, files: dict[str, str]) -> tuple[Fault, ...]:
    for name, text in files.items():
        (folder / name).write_text(text)
    with pytest.raises(InputError) as caught:
        load(folder / "s.yaml")
    return caught.value.faults


@pytest.mark.parametrize("case", BROKEN)
def test_the_line_that_is_named_can_be_changed(case: str, tmp_path: Path) -> None:
    files, name, line, path, beside = BROKEN[case]
    (fault,) = faults(tmp_path, files)
    assert (Path(fault.file or "").name, fault.line, fault.path) == (name, line, path)
    _, _, where = fault.message.partition(" stands in ")
    assert beside in where
    assert bool(where) is bool(beside)


def test_without_the_line_that_is_named_the_rest_holds(tmp_path: Path) -> None:
    (tmp_path / "s.yaml").write_text("base: drop_test\nsimulation:\n  duration: 0.4\n  step: 0.0003\n")
    lines = (tmp_path / "s.yaml").read_text().splitlines(keepends=True)
    with pytest.raises(InputError) as caught:
        load(tmp_path / "s.yaml")
    (fault,) = caught.value.faults
    assert fault.line is not None
    (tmp_path / "s.yaml").write_text("".join(lines[: fault.line - 1] + lines[fault.line :]))
    assert load(tmp_path / "s.yaml").simulation.duration == 0.4

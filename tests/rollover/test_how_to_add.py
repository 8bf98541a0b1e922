"""The diffs of docs/how_to_add.md: short, applied to a copy of the project, and tried."""

from __future__ import annotations

import os
import re
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]
PAGE = ROOT / "docs" / "how_to_add.md"
MOST = 40  # lines of a diff
MAIN = "from rollover.cli.main import main; main()"
NAMES = ("a ground law", "an effect", "a vehicle", "a scenario", "an importer")


def diffs() -> dict[str, str]:
    text = PAGE.read_text(encoding="utf-8")
    found = re.findall(r"^## (.*?)\n.*?^```diff\n(.*?)^```$", text, flags=re.MULTILINE | re.DOTALL)
    return {title.lower(): body for title, body in found}


def applied(copy: Path, *names: str) -> None:
    for name in names:
        done = subprocess.run(
            ["git", "apply", "--whitespace=error", "-"], input=diffs()[name], cwd=copy, text=True, capture_output=True
        )
        assert done.returncode == 0, done.stderr


def python(copy: Path, *words: str) -> str:
    """What a fresh process says whose own project is the copy, and what the copy lacks comes from here."""
    paths = os.pathsep.join([str(copy), str(ROOT)])
    done = subprocess.run(
        [sys.executable, *words], cwd=copy, text=True, capture_output=True, env={**os.environ, "PYTHONPATH": paths}
    )
    assert done.returncode == 0, done.stdout + done.stderr
    return done.stdout


def copied(tmp_path: Path, *folders: str) -> Path:
    for folder in folders:
        shutil.copytree(ROOT / folder, tmp_path / folder, ignore=shutil.ignore_patterns("__pycache__"))
    return tmp_path


@pytest.mark.parametrize("name", NAMES)
def test_it_is_short(name: str) -> None:
    lines = diffs()[name].splitlines()
    assert 5 < len(lines) <= MOST
    assert max(map(len, lines)) <= 121


def test_nothing_else_is_shown() -> None:
    assert tuple(diffs()) == NAMES


def test_a_law_is_found_and_keeps_the_contract(tmp_path: Path) -> None:
    copy = copied(tmp_path, "ground", "tests/ground")
    (copy / "tests" / "__init__.py").write_text("")
    applied(copy, "a ground law")
    asked = "from ground.law import laws, evaluate; print(evaluate(laws()['linear'](), 0.1, speed=2.0))"
    assert float(python(copy, "-c", asked)) == pytest.approx(3e4 * 1.1 * 0.1)
    contract = ["-m", "pytest", "-q", "-n", "0", "-p", "no:cacheprovider", "tests/ground/test_laws_contract.py"]
    said = python(copy, *contract, "-k", "linear or every_law_has or left_over")
    assert " passed" in said
    assert re.search(r"(\d+) passed", said)[1] > "1"  # type: ignore[index]


def test_an_effect_of_ones_own_acts(tmp_path: Path) -> None:
    applied(tmp_path, "an effect")
    assert "soil-roots" in python(tmp_path, "-c", MAIN, "--effects", "roots.py", "list", "effects")
    acting = (
        "import sys; from rollover import scenario; from rollover.dynamics import simulate\n"
        "from rollover.effects import effects; effects()\n"
        "drop = scenario.load('drop_test').replaced({'simulation.duration': 0.02})\n"
        "rooted = drop.replaced({'effects.soil-roots.stiffness': 3e4})\n"
        "print(*(simulate.run(s).recording['ground/force_normal'].max() for s in (drop, rooted)))"
    )
    os.environ["ROLLOVER_EFFECTS"] = str(tmp_path / "roots.py")
    try:
        plain, rooted = map(float, python(tmp_path, "-c", acting).split())
    finally:
        del os.environ["ROLLOVER_EFFECTS"]
    assert rooted > 1.2 * plain


def test_a_vehicle_and_a_scenario_are_in_order_and_run(tmp_path: Path) -> None:
    copy = copied(tmp_path, "scenarios")
    applied(copy, "a vehicle", "a scenario")
    files = ["scenarios/vehicles/orchard_tractor.yaml", "scenarios/orchard_overturn.yaml"]
    said = python(copy, "-c", MAIN, "check", *files)
    assert [line.split(": ")[1] for line in said.splitlines()] == ["vehicle, valid", "scenario, valid"]
    short = ["--no-half-step", "--set", "simulation.duration=0.02", "--out", "out"]
    assert "orchard tractor" in python(copy, "-c", MAIN, "run", files[1], *short)
    assert (copy / "out" / "recording.rrd").is_file()


def test_an_importer_is_listed_and_reads(tmp_path: Path) -> None:
    copy = copied(tmp_path, "rollover")
    applied(copy, "an importer")
    assert "labbook" in python(copy, "-c", MAIN, "list", "importers")
    (copy / "drop7.txt").write_text("#labbook Drop 7\n0 0 0\n1 0.5 1.5\n2 0.9 2.9\n")
    reads = (
        "from rollover.recording.importers import read_recording as r; d = r('drop7.txt');"
        "print(d.title, *d.time, *d['ground/force_normal'], *d['ground/sinkage'], sep='|')"
    )
    title, *numbers = python(copy, "-c", reads).strip().split("|")
    assert title == "Drop 7"
    assert [float(n) for n in numbers] == pytest.approx([0, 0.001, 0.002, 0, 500, 900, 0, 0.0015, 0.0029])

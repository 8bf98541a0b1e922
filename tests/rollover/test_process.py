"""The program as a process: what it imports, how it ends, what a signal leaves, whose packages it finds."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from rollover.assessment import results
from rollover.recording import runs
from rollover.scenario import load
from tests.rollover.example import run_of

ROOT = Path(__file__).resolve().parents[2]


def python(code: str, **environment: str) -> subprocess.CompletedProcess[str]:
    env = {**os.environ, "PYTHONPATH": str(ROOT), **environment}
    return subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, env=env, check=False)


MAIN = "import sys; sys.argv = ['rollover', {arguments}]; from rollover.cli.main import main; main()"


def test_help_imports_nothing_heavy() -> None:
    code = MAIN.format(arguments="'--help'").replace("main()", "app(standalone_mode=False)").replace("main;", "app;")
    heavy = {"exudyn", "matplotlib", "numba", "numpy", "pyarrow", "pydantic_core", "rerun", "scipy"}
    done = python(f"{code}\nprint(sorted({heavy} & set(sys.modules)))")
    assert done.stdout.splitlines()[-1] == "[]", done.stderr


def test_a_diagnosis_imports_nothing_it_does_not_need(tmp_path: Path) -> None:
    """pyarrow's own ways to and from NumPy import pandas: a second for each process."""
    recording = run_of(load("drop_test")).recording
    runs.write_parquet(recording, tmp_path / "run.parquet")
    code = (
        "import sys, rollover.diagnosis.fit.warmup\nfrom pathlib import Path\n"
        "from rollover.recording.importers import read_recording\n"
        "from rollover.recording import runs, tables\n"
        f"found = read_recording(Path({str(tmp_path / 'run.parquet')!r}))\n"
        f"runs.write_parquet(found, Path({str(tmp_path / 'again.parquet')!r}))\n"
        f"tables.write_parquet_columns(dict(found.channels), Path({str(tmp_path / 'columns.parquet')!r}))\n"
        f"gaps, csv = found.time * float('nan'), Path({str(tmp_path / 'columns.csv')!r})\n"
        "tables.write_csv({'gaps': gaps, **found.channels}, csv)\n"
        "assert set(map(str, tables.read_csv(csv, ['gaps'])['gaps'])) == {'nan'}\n"
        "print(found.time.size, sorted({'exudyn', 'matplotlib', 'pandas', 'rerun', 'scipy.stats'} & set(sys.modules)))"
    )
    done = python(code)
    assert done.stdout.splitlines() == [f"{recording.time.size} []"], done.stderr
    again = runs.read_parquet(tmp_path / "again.parquet")
    assert all(np.array_equal(again[name], values, equal_nan=True) for name, values in recording.channels.items())


def test_a_bug_shows_its_traceback_and_is_neither_of_the_answers() -> None:
    code = "import rollover.cli.catalogue as c\nc.TABLES['laws'] = lambda: 1 / 0\n" + MAIN.format(
        arguments="'list', 'laws'"
    )
    done = python(code)
    assert done.returncode == 70
    assert "ZeroDivisionError" in done.stderr
    assert "Traceback" in done.stderr


def test_wrong_usage_is_2() -> None:
    assert python(MAIN.format(arguments="'rn'")).returncode == 2
    assert python(MAIN.format(arguments="'run'")).returncode == 2
    assert python(MAIN.format(arguments="'run', 'drop_test', '--jbs', '3'")).returncode == 2


SLOW = """
import signal, sys, time
signal.signal(signal.SIGINT, signal.default_int_handler)  # a shell that runs tests in the background ignores it
from rollover.assessment import results
from rollover.scenario import load
from tests.rollover.example import run_of

def picture(path):
    path.write_bytes(b"half")
    print("writing", flush=True)
    time.sleep(60.0)

from pathlib import Path
import rollover.cli.catalogue as c
c.TABLES["laws"] = lambda: results.write(Path("out/slow"), run_of(load("drop_test")), (), picture=picture)
"""


@pytest.mark.parametrize(("number", "status"), [(signal.SIGINT, 130), (signal.SIGTERM, 143)])
def test_a_signal_while_writing_leaves_nothing(tmp_path: Path, number: signal.Signals, status: int) -> None:
    code = SLOW + MAIN.format(arguments="'list', 'laws'")
    env = {**os.environ, "PYTHONPATH": str(ROOT)}
    with subprocess.Popen(
        [sys.executable, "-c", code], cwd=tmp_path, env=env, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True
    ) as child:
        assert child.stdout is not None
        assert child.stdout.readline() == "writing\n"
        child.send_signal(number)
        child.communicate(timeout=30)
    assert child.returncode == status
    assert list(tmp_path.iterdir()) == []  # not even the folder that was made for it


# ---------------------------------------------------------------- import names that others own


def last_line(done: subprocess.CompletedProcess[str]) -> str:
    assert done.returncode == 1, done.stderr
    return done.stderr.strip().splitlines()[-1]


@pytest.mark.parametrize("name", ["ground", "viz"])
def test_a_foreign_package_of_our_name_is_named(tmp_path: Path, name: str) -> None:
    (tmp_path / name).mkdir()
    (tmp_path / name / "__init__.py").write_text("raise SystemExit('foreign code ran')\n")
    line = last_line(python(f"import sys; sys.path[:0] = [{str(tmp_path)!r}]; import rollover"))
    assert line.startswith(
        f"ImportError: import {name}: taken by another package, got {tmp_path / name / '__init__.py'}; "
    )
    (tmp_path / name / "__init__.py").unlink()
    done = python(f"import sys; sys.path[:0] = [{str(tmp_path)!r}]; import rollover")
    assert done.returncode == 0, "a folder without __init__ does not stand before a package"


@pytest.mark.parametrize("name", ["ground", "viz"])
def test_a_file_of_our_name_in_the_users_folder_is_named(tmp_path: Path, name: str) -> None:
    (tmp_path / f"{name}.py").write_text("raise SystemExit('foreign code ran')\n")
    (tmp_path / "study.py").write_text("import rollover\n")
    done = subprocess.run(
        [sys.executable, str(tmp_path / "study.py")], cwd=tmp_path, capture_output=True, text=True, check=False
    )
    line = last_line(done)
    assert line.startswith(f"ImportError: import {name}: taken by another package, got {tmp_path / name}.py; ")
    assert line.endswith("or rename that file or take it off the import path")


@pytest.mark.parametrize("name", ["ground", "viz"])
@pytest.mark.parametrize("text", ["__version__ = '3'\n", '# not DISTRIBUTION = "rollover"\n', "", "\xff"])
def test_a_foreign_package_installed_over_ours_is_named(tmp_path: Path, name: str, text: str) -> None:
    site = tmp_path / "site"
    for file in ("rollover/__init__.py", "rollover/system/__init__.py", "rollover/system/import_names.py"):
        (site / file).parent.mkdir(parents=True, exist_ok=True)
        (site / file).write_text((ROOT / file).read_text())
    for package in ("ground", "viz"):
        (site / package).mkdir()
        (site / package / "__init__.py").write_text((ROOT / package / "__init__.py").read_text())
    code = f"import sys; sys.path[:0] = [{str(site)!r}]; import rollover; print(rollover.__file__)"
    done = python(code)
    assert done.stdout.strip() == str(site / "rollover" / "__init__.py"), done.stderr
    (site / name / "__init__.py").write_bytes(text.encode("latin-1"))
    about = site / "other_tool-3.0.dist-info"
    about.mkdir()
    (about / "METADATA").write_text("Metadata-Version: 2.1\nName: other-tool\nVersion: 3.0\n")
    (about / "RECORD").write_text(f"{name}/__init__.py,,\n")
    line = last_line(python(code))
    place = site / name / "__init__.py"
    assert line.startswith(f"ImportError: import {name}: taken by another package, got {place} of the distribution")
    assert "other-tool in the place of rollover's own; " in line
    assert line.endswith("install rollover anew")


def test_the_version_is_that_of_the_distribution() -> None:
    import rollover as package

    assert results.versions()["rollover"] == package.__version__

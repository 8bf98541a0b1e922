"""Folders of foreign recordings under one profile: each with its own name and conditions, all of them or none."""

from __future__ import annotations

import json
import time
from pathlib import Path
from typing import Any

import pytest
from typer.testing import CliRunner

from rollover.cli.main import app
from rollover.recording.importers import name_of, read_named, read_profile, read_recording, write_recording
from rollover.recording.importers.conditions import MOST_PARTS, matched, parts_of
from rollover.system.errors import InputError

PROFILE = """\
format: rollover-profile/1
csv: {delimiter: ";", decimal: ","}
conditions: {vehicle.mass: 132.0}
%s
channels:
  t: {channel: time, unit: s}
  F: {channel: ground/force_normal, unit: kN}
"""
TABLE = "t;F\n0;1,5\n0,1;%s\n"


def ask(*words: object) -> tuple[int, str, str]:
    done = CliRunner().invoke(app, [str(word) for word in words])
    return done.exit_code, done.stdout, done.stderr


def bench(folder: Path, names: list[str], conditions: str = "") -> Path:
    """Tables by these names in `raw`, the second value of each its place; the profile's path."""
    (folder / "raw").mkdir()
    for k, name in enumerate(names):
        (folder / "raw" / name).write_text(TABLE % k)
    profile = folder / "bench.yaml"
    profile.write_text(PROFILE % conditions)
    return profile


def test_a_folder_is_imported_whole_with_conditions_by_name(tmp_path: Path) -> None:
    names = ["drop_2.5ms_a.001", "drop_3.0ms_a_b.lvm", "drop_3.5ms_", "drop_4ms_x.csv"]
    profile = bench(tmp_path, names, 'conditions_from: {name: "drop_{initiation.speed}ms_*"}')
    (tmp_path / "raw" / ".hidden").write_text("of a file manager")
    (tmp_path / "raw" / "notes.md").write_text("# notes")
    code, said, faults = ask("import", tmp_path / "raw", "--profile", profile, "--out", tmp_path / "rec", "--json")
    assert (code, faults) == (0, "")
    made = ["drop_2.5ms_a.001", "drop_3.0ms_a_b", "drop_3.5ms_", "drop_4ms_x"]
    assert [Path(f["file"]).name for f in json.loads(said)["files"]] == [f"{name}.csv" for name in made]
    for k, (name, speed) in enumerate(zip(made, (2.5, 3.0, 3.5, 4.0), strict=True)):
        recording = read_recording(tmp_path / "rec" / f"{name}.csv")
        assert recording.conditions == {"vehicle.mass": 132.0, "initiation.speed": speed}
        assert recording["ground/force_normal"].tolist() == [1500.0, 1e3 * k]


def test_a_name_keeps_all_but_its_ending(tmp_path: Path) -> None:
    """Two speeds behind a point used to end in one file."""
    profile = bench(tmp_path, ["Messung_3.0.csv", "Messung_3.5.csv"])
    out = tmp_path / "rec"
    for name in ("Messung_3.0.csv", "Messung_3.5.csv"):
        assert ask("import", tmp_path / "raw" / name, "--profile", profile, "--out", out)[0] == 0
    assert sorted(p.name for p in out.glob("*.csv")) == ["Messung_3.0.csv", "Messung_3.5.csv"]
    assert ask("import", out / "Messung_3.5.csv", "--to", "mme.zip", "--out", out)[0] == 0
    assert name_of(out / "Messung_3.5.mme.zip") == "Messung_3.5"
    assert [name_of(Path(n)) for n in ("a.tar.gz", "b.2024.tdms", "c.001", ".csv", "d")] == [
        *("a", "b.2024", "c.001", ".csv", "d")
    ]
    folder = tmp_path / "run_3.5"
    folder.mkdir()
    assert name_of(folder) == "run_3.5"


@pytest.mark.parametrize("command", ["import", "compare", "calibrate", "diagnose", "identify"])
def test_two_recordings_of_one_name_are_refused_unwritten(tmp_path: Path, command: str) -> None:
    profile = bench(tmp_path, ["a.csv", "a.lvm", "b.csv"])
    words: dict[str, list[Any]] = {
        "compare": ["drop_test"],
        "calibrate": ["drop_test", "--fit", "vehicle.mass"],
        "diagnose": ["drop_test", "--workers", "0"],
    }
    given = [command, *words.get(command, []), tmp_path / "raw", "--profile", profile, "--out", tmp_path / "out"]
    code, said, faults = ask(*given)
    assert (code, said) == (2, "")
    message = f"a second recording by this name, got 'a', first {tmp_path}/raw/a.csv; two recordings share a name"
    assert faults == f"{tmp_path}/raw/a.lvm: {message}\n"
    assert not (tmp_path / "out").exists()


def test_every_command_reads_a_folder_by_a_profile(tmp_path: Path) -> None:
    """Each refuses the one file whose name gives no speed: it has read the folder, by the profile."""
    profile = bench(tmp_path, ["d_3.0.log", "other.log"], 'conditions_from: {name: "d_{initiation.speed}.log"}')
    for words in (
        ["import", "raw"],
        ["check", "raw"],
        ["compare", "drop_test", "raw"],
        ["calibrate", "drop_test", "raw", "--fit", "ground.law.stiffness_scale"],
        ["diagnose", "drop_test", "raw", "--workers", "0"],
        ["identify", "raw"],
    ):
        where = [tmp_path / word if word == "raw" else word for word in words]
        out = [] if words[0] == "check" else ["--out", tmp_path / "out"]
        code, _, faults = ask(*where, "--profile", profile, *out)
        assert code == 2, words
        assert faults.startswith(f"{tmp_path / 'raw' / 'other.log'}: the name does not fit conditions_from.name"), words
        assert faults.count("\n") == 1
        assert not (tmp_path / "out").exists()


def test_conditions_by_a_table(tmp_path: Path) -> None:
    profile = bench(tmp_path, ["a.csv", "b.csv"], "conditions_from: {table: raw/conditions.csv}")
    table = tmp_path / "raw" / "conditions.csv"
    table.write_text("file;initiation.speed;title\nb.csv;2,5;clay, wet\na.csv;3;dry\nc.csv;1;not here\n")
    found = read_named([tmp_path / "raw"], profile)
    assert {name: r.conditions for name, (_, r) in found.items()} == {
        "a": {"vehicle.mass": 132.0, "initiation.speed": 3, "title": "dry"},
        "b": {"vehicle.mass": 132.0, "initiation.speed": 2.5, "title": "clay, wet"},
    }


@pytest.mark.parametrize(
    ("text", "line", "words"),
    [
        ("file,initiation.speed\na.csv,3.0\n", None, "b.csv: no row for this file"),
        ("file,initiation.sped\na.csv,3.0\nb.csv,3.0\n", 1, "no such path, got 'initiation.sped'; below initiation"),
        ("file,initiation.speed\na.csv,\nb.csv,3.0\n", 2, "initiation.speed: an empty cell"),
        ("file,initiation.speed\na.csv,1\nb.csv,2\na.csv,3\n", 4, "file: a second row for 'a.csv'"),
        ("file,initiation.speed\na.csv,1,5\nb.csv,2\n", 2, "got 3 cells for 2 columns"),
        ("name,initiation.speed\na.csv,1\n", 1, "no column 'file'"),
        ("file,vehicle.mass\na.csv,1\nb.csv,2\n", 1, "vehicle.mass is stated in conditions as well"),
        ("file,initiation.speed,initiation.speed\na.csv,1,2\n", 1, "a column twice"),
    ],
)
def test_a_table_is_taken_at_its_word(tmp_path: Path, text: str, line: int | None, words: str) -> None:
    profile = bench(tmp_path, ["a.csv", "b.csv"], "conditions_from: {table: conditions.csv}")
    (tmp_path / "conditions.csv").write_text(text)
    code, _, faults = ask("import", tmp_path / "raw", "--profile", profile, "--out", tmp_path / "rec")
    assert code == 2
    assert words in faults
    assert line is None or f"conditions.csv:{line}: " in faults
    assert faults.count("\n") == 1
    assert not (tmp_path / "rec").exists()


@pytest.mark.parametrize(
    ("pattern", "name", "ways"),
    [
        ("drop_{initiation.speed}_*.csv", "drop_3.0_a_b.csv", [{"initiation.speed": "3.0"}]),
        ("drop_{initiation.speed}_*.csv", "drop_3.0_7_1.csv", [{"initiation.speed": "3.0"}]),
        (
            "{ground.law}_{initiation.speed}.csv",
            "soft_clay_-3.csv",
            [{"ground.law": "soft_clay", "initiation.speed": "-3"}],
        ),
        ("d{initiation.speed}.csv", "d3.5.csv", [{"initiation.speed": "3.5"}]),
        ("d{initiation.speed}.*", "d2.5.csv", [{"initiation.speed": "2"}, {"initiation.speed": "2.5"}]),
        ("d{initiation.speed}.csv", "D3.5.csv", []),
        ("d{initiation.speed}.csv", "d.csv", []),
    ],
)
def test_what_a_pattern_reads(pattern: str, name: str, ways: list[dict[str, str]]) -> None:
    """The one way by which most values are numbers; two ways are told as two, never chosen between."""
    assert sorted(matched(parts_of(pattern), name), key=str) == ways


def test_a_name_that_can_be_read_in_two_ways_is_refused(tmp_path: Path) -> None:
    profile = bench(tmp_path, ["d2.5.csv"], 'conditions_from: {name: "d{initiation.speed}.*"}')
    with pytest.raises(InputError, match=r"in two ways, got initiation.speed = 2(.5)? or initiation.speed = 2"):
        read_recording(tmp_path / "raw" / "d2.5.csv", profile=profile)


@pytest.mark.parametrize(
    ("given", "words"),
    [
        ('{name: "drop_*.csv"}', "conditions_from.name: no value in it"),
        ('{name: "{initiation.speed}*"}', "nothing tells where a value ends"),
        ('{name: "{initiation.speed}{vehicle.mass}.csv"}', "nothing tells where a value ends"),
        ('{name: "{initiation speed}.csv"}', "not a scenario path, got '{initiation speed}'"),
        ('{name: "{}.csv"}', "not a scenario path, got '{}'"),
        ('{name: "a{initiation.speed.csv"}', "got 'a{initiation.speed.csv'; {PATH} for a value"),
        ('{name: "raw/{initiation.speed}.csv"}', "no folders"),
        ('{name: "{initiation.speed}_{initiation.speed}.csv"}', "a path given twice"),
        ('{name: "{vehicle.mass}.csv"}', "vehicle.mass is stated in conditions as well"),
        ("{table: none.csv}", "conditions_from.table: no such file, got 'none.csv'"),
        ("{}", "one of name and table is needed"),
        ('{name: "a{initiation.speed}.csv", table: c.csv}', "one of name and table is needed"),
    ],
)
def test_a_profile_is_refused_at_its_line(tmp_path: Path, given: str, words: str) -> None:
    profile = bench(tmp_path, ["a.csv"], f"conditions_from: {given}")
    with pytest.raises(InputError) as said:
        read_profile(profile)
    (fault,) = said.value.faults
    assert fault.line == 4
    assert words in str(fault)


def test_a_pattern_for_what_no_scenario_has(tmp_path: Path) -> None:
    profile = bench(tmp_path, ["a1.csv"], 'conditions_from: {name: "a{vehicle.weight}.csv"}')
    code, _, faults = ask("import", tmp_path / "raw", "--profile", profile, "--out", tmp_path / "rec")
    assert code == 2
    assert faults.startswith(f"{profile}:4: conditions_from.name: no such path, got 'vehicle.weight'; below vehicle")
    assert not (tmp_path / "rec").exists()


def test_the_longest_pattern_ends_in_time() -> None:
    """The kind of pattern and name on which a search that turns back takes longer than anyone lives."""
    pattern = "{initiation.speed}a" + "*a" * ((MOST_PARTS - 3) // 2) + "b"
    begun = time.perf_counter()
    assert matched(parts_of(pattern), "a" * 250) == []
    assert time.perf_counter() - begun < 20.0
    with pytest.raises(ValueError, match="too long"):
        parts_of("{initiation.speed}" + "a*" * MOST_PARTS)


def test_import_does_not_replace_what_it_reads(tmp_path: Path) -> None:
    profile = bench(tmp_path, ["a.csv", "b.csv"])
    before = (tmp_path / "raw" / "a.csv").read_bytes()
    code, _, faults = ask("import", tmp_path / "raw", "--profile", profile, "--out", tmp_path / "raw", "--force")
    assert code == 2
    assert "would replace the recording that is read; another --out" in faults
    assert (tmp_path / "raw" / "a.csv").read_bytes() == before


def test_import_writes_all_or_nothing(tmp_path: Path) -> None:
    """What stands in the way of one of the last files keeps the first from being written."""
    profile = bench(tmp_path, ["a.csv", "b.csv"])
    out = tmp_path / "rec"
    out.mkdir()
    (out / "b.yaml").write_text("a sidecar of something else\n")
    code, said, faults = ask("import", tmp_path / "raw", "--profile", profile, "--out", out)
    assert (code, said) == (2, "")
    assert faults.startswith(f"{out / 'b.yaml'}: exists")
    assert [p.name for p in out.iterdir()] == ["b.yaml"]


def test_folders_of_folders_hold_their_tests(tmp_path: Path) -> None:
    """A campaign in ISO-MME is one folder a test; what is no recording beside them is not taken for one."""
    profile = bench(tmp_path, ["a.csv", "b.csv"])
    assert ask("import", tmp_path / "raw", "--profile", profile, "--out", tmp_path / "rec")[0] == 0
    for name in ("a", "b"):
        write_recording(read_recording(tmp_path / "rec" / f"{name}.csv"), tmp_path / "mme" / f"{name}_1.5.mme")
    (tmp_path / "mme" / "photos").mkdir()
    assert list(read_named([tmp_path / "mme"])) == ["a_1.5", "b_1.5"]
    code, said, _ = ask("check", tmp_path / "mme", "--json")
    assert (code, len(json.loads(said)["files"])) == (0, 2)


@pytest.mark.parametrize(("name", "text"), [("notes.txt", "Notes of the day:\nwind, rain\n"), ("rig.jpg", "\0\1\n")])
def test_what_is_no_recording_is_left_out_by_select(name: str, text: str, tmp_path: Path) -> None:
    profile = bench(tmp_path, ["d1.csv", "d2.csv"])
    (tmp_path / "raw" / name).write_text(text)
    words = ("import", tmp_path / "raw", "--profile", profile, "--out", tmp_path / "rec")
    code, said, faults = ask(*words)
    assert (code, said, len(faults.splitlines())) == (2, "", 1)
    assert faults.endswith(f"; or leave {name} out: --select with the names of the others\n")
    assert not (tmp_path / "rec").exists()
    assert ask(*words, "--select", "d*")[0] == 0
    code, said, faults = ask("compare", "drop_test", tmp_path / "raw", "--profile", profile, "--out", tmp_path / "out")
    assert (code, said, len(faults.splitlines())) == (2, "", 1)
    assert faults.endswith(f"; or leave {name} out: name the others one by one\n")


def test_a_fault_of_a_file_alone_says_nothing_of_others(tmp_path: Path) -> None:
    profile = bench(tmp_path, ["d1.csv"])
    (tmp_path / "raw" / "d1.csv").write_text("no table\n")
    code, _, faults = ask("import", tmp_path / "raw", "--profile", profile, "--out", tmp_path / "rec")
    assert (code, "--select" in faults) == (2, False)

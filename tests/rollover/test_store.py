"""Results on disk: whole or not at all, never over another run's."""

from __future__ import annotations

import json
import os
import re
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow.parquet as pq
import pytest
from typer.testing import CliRunner

from rollover.assessment import results
from rollover.cli.main import app
from rollover.recording import Clock, Recording, Sensor, read_parquet, write_parquet
from rollover.scenario import load
from rollover.spec.document import content_hash
from rollover.system.errors import InputError
from tests.rollover.example import Peak, run_of

PEAKS: Any = (Peak(),)


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    return tmp_path / "out" / "drop"


def names(folder: Path) -> list[str]:
    return sorted(p.name for p in folder.iterdir())


def test_what_a_run_writes(folder: Path) -> None:
    run = run_of(load("drop_test"))

    def picture(path: Path) -> None:
        path.write_bytes(b"rrd")

    answer = results.write(folder, run, PEAKS, half_step=run, picture=picture)
    assert names(folder) == ["channels.parquet", "events.json", "recording.rrd", "run.json", "scenario.yaml"]
    assert names(folder.parent) == ["drop"]
    assert answer == json.loads((folder / "run.json").read_text()) == results.read_run_json(folder)
    assert answer["files"] == names(folder)
    assert (answer["status"], answer["wall_time"], answer["domain_flags"]) == ("done", 0.5, ["speed"])
    assert answer["scenario_hash"] == content_hash(run.scenario)
    assert set(answer["versions"]) >= {"rollover", "exudyn", "numpy", "python"}
    assert answer["energy_ledger"] == {"kinetic": 1.0, "residual": None}  # not a number: null, as JSON has no NaN
    assert answer["peak_loads"][0]["raw"] == 3552.1
    assert answer["half_step"]["status"] == "done"
    assert load(folder / "scenario.yaml") == run.scenario
    assert (folder / "scenario.yaml").read_text().startswith(f"# {run.scenario.title}\n")
    events = json.loads((folder / "events.json").read_text())
    assert events[0]["kind"] == "first-touch"
    assert events[0]["place"] == [0.0, 0.0, -1e-9]


def test_channels_survive_to_the_last_bit_with_their_units(tmp_path: Path) -> None:
    recording = replace(
        run_of(load("drop_test")).recording, conditions={"initiation.speed": 3.0}, noise={"time": 0.1}, cfc={"time": 60}
    )
    write_parquet(recording, tmp_path / "c.parquet")
    again = read_parquet(tmp_path / "c.parquet")
    assert again.time.tobytes() == recording.time.tobytes()
    for name, values in recording.channels.items():
        assert again[name].tobytes() == values.tobytes()
    assert vars(again).keys() == vars(recording).keys()
    assert (again.title, again.conditions, again.noise, again.cfc) == (
        recording.title,
        recording.conditions,
        recording.noise,
        recording.cfc,
    )
    schema = pq.read_schema(tmp_path / "c.parquet")
    assert schema.names == ["time", *recording.channels]
    assert schema.field("ground/force_normal").metadata[b"unit"] == b"N"


def test_a_channel_outside_the_table_is_not_written(tmp_path: Path) -> None:
    recording = Recording(title="x", time=np.array([0.0]), channels={"rops/forse": np.array([1.0])})
    with pytest.raises(ValueError, match="unknown channel, got 'rops/forse'"):
        write_parquet(recording, tmp_path / "c.parquet")


@pytest.mark.parametrize("content", [b"", b"no parquet"])
def test_what_is_not_a_channels_file(tmp_path: Path, content: bytes) -> None:
    (tmp_path / "c.parquet").write_bytes(content)
    with pytest.raises(InputError, match=r"c\.parquet: cannot be read: "):
        read_parquet(tmp_path / "c.parquet")


@pytest.mark.parametrize("reason", [RuntimeError, KeyboardInterrupt])
def test_nothing_is_left_of_a_write_that_breaks_off(folder: Path, reason: type[BaseException]) -> None:
    def picture(path: Path) -> None:
        path.write_bytes(b"half")
        raise reason

    with pytest.raises(reason):
        results.write(folder, run_of(load("drop_test")), PEAKS, picture=picture)
    assert names(folder.parent) == []


def test_a_write_that_breaks_off_leaves_the_earlier_results(folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    run = run_of(load("drop_test"))
    before = results.write(folder, run, PEAKS)
    rename, calls = os.rename, []

    def breaks_the_second_time(a: Path, b: Path) -> None:
        calls.append(b)
        if len(calls) == 2:
            raise KeyboardInterrupt
        rename(a, b)

    monkeypatch.setattr(os, "rename", breaks_the_second_time)
    with pytest.raises(KeyboardInterrupt):
        results.write(folder, replace(run, sentence="later"), PEAKS)
    assert len(calls) == 3
    assert results.read_run_json(folder) == before
    assert names(folder.parent) == ["drop"]


def test_the_same_run_is_written_again_and_another_only_by_force(folder: Path) -> None:
    run = run_of(load("drop_test"))
    other = run_of(run.scenario.replaced({"initiation.speed": 2.0}))
    results.write(folder, run, PEAKS)
    results.write(folder, replace(run, wall_time=0.7), PEAKS)
    assert results.read_run_json(folder)["wall_time"] == 0.7
    title = run.scenario.title
    got = re.escape(repr(title))
    with pytest.raises(InputError, match=f"holds another run, got {got}; --force replaces it, --out leaves it$"):
        results.write(folder, other, PEAKS)
    assert results.read_run_json(folder)["scenario_hash"] == content_hash(run.scenario)
    results.write(folder, other, PEAKS, force=True)
    assert results.read_run_json(folder)["scenario_hash"] == content_hash(other.scenario)


def test_results_of_other_versions_are_another_run(folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    run = run_of(load("drop_test"))
    results.write(folder, run, PEAKS)
    monkeypatch.setattr(results, "versions", lambda: {"rollover": "next"})
    with pytest.raises(InputError, match="holds this run by other versions"):
        results.claim(folder, content_hash(run.scenario))
    assert results.claim(folder, content_hash(run.scenario), force=True) == folder.resolve()


def test_a_folder_with_anything_else_is_never_touched(folder: Path) -> None:
    run = run_of(load("drop_test"))
    results.write(folder, run, PEAKS)
    (folder / "notes.txt").write_text("mine")
    for force in (False, True):
        with pytest.raises(InputError, match=r"holds files that are not results, got 'notes\.txt'; another --out"):
            results.write(folder, run, PEAKS, force=force)
    assert (folder / "notes.txt").read_text() == "mine"
    (folder.parent / "file").write_text("mine")
    with pytest.raises(InputError, match="not a folder, but a file; another --out is needed"):
        results.claim(folder.parent / "file", "", force=True)


def test_a_link_to_a_folder_stays_a_link(folder: Path, tmp_path: Path) -> None:
    run = run_of(load("drop_test"))
    results.write(folder, run, PEAKS)
    link = tmp_path / "link"
    link.symlink_to(folder, target_is_directory=True)
    results.write(link, replace(run, wall_time=0.7), PEAKS)
    assert link.is_symlink()
    assert results.read_run_json(folder)["wall_time"] == 0.7


def test_a_failed_run_is_written_with_its_sentence(folder: Path) -> None:
    run = run_of(load("drop_test"), "diverged at t = 0.01 s")
    answer = results.write(folder, run, ())
    assert (answer["status"], answer["sentence"]) == ("failed", "diverged at t = 0.01 s")
    assert len(read_parquet(folder / "channels.parquet").time) == 11


@pytest.mark.parametrize(
    ("text", "message"),
    [
        (None, "not a results folder, got no run.json"),
        ("{", "run.json: cannot be read: "),
        ("{}", "run.json: not the run.json of a run; format 'rollover-run/1' is needed"),
        ("[]", "run.json: cannot be read: not a mapping, got a list of 0; "),
    ],
)
def test_reading_what_is_not_a_run(tmp_path: Path, text: str | None, message: str) -> None:
    if text is not None:
        (tmp_path / "run.json").write_text(text)
    with pytest.raises(InputError) as caught:
        results.read_run_json(tmp_path)
    assert message in str(caught.value)


def test_how_a_channel_was_measured_survives_too(tmp_path: Path) -> None:
    sensor = Sensor(body="rops", position=(0.1, 0.2, 1.5), matrix=((0.0, -1.0, 0.0), (1.0, 0.0, 0.0), (0.0, 0.0, 1.0)))
    recording = replace(
        run_of(load("drop_test")).recording,
        clock=Clock(zero="unknown"),
        sensors={"ground/force_normal": sensor},
        notes=("a note",),
    )
    write_parquet(recording, tmp_path / "c.parquet")
    again = read_parquet(tmp_path / "c.parquet")
    assert (again.clock, again.sensors, again.notes) == (recording.clock, recording.sensors, recording.notes)


def test_an_own_older_result_is_replaced_with_a_note(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    Path("mine.yaml").write_text("base: drop_test.yaml\ntitle: Mine\nsimulation: {duration: 0.05}\n")

    def asked(*words: str) -> Any:
        return CliRunner().invoke(app, ["run", "--no-half-step", "--out", "out/mine", *words])

    assert asked("mine.yaml").exit_code == 0
    old = results.read_run_json(Path("out/mine"))["scenario_hash"]
    Path("mine.yaml").write_text(Path("mine.yaml").read_text().replace("0.05", "0.06"))
    assert (set_ := asked("mine.yaml", "--set", "initiation.speed=2")).exit_code == 2, set_.stderr
    done = asked("mine.yaml")
    assert done.exit_code == 0, done.stderr
    assert f"replaces the run of this scenario as it was before it was changed (hash {old[:12]})" in done.stderr
    assert results.read_run_json(Path("out/mine"))["scenario_hash"] != old
    Path("other").mkdir()
    Path("other/mine.yaml").write_text("base: drop_test.yaml\ntitle: Theirs\nsimulation: {duration: 0.05}\n")
    refused = asked("other/mine.yaml")
    assert refused.exit_code == 2
    assert "holds another run, got 'Mine'" in refused.stderr


def test_a_variant_in_the_way_is_told_by_what_was_set(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Two variants of a scenario share their title, so the title alone would not say what stands there."""
    monkeypatch.chdir(tmp_path)

    def asked(speed: str) -> Any:
        given = ["--set", f"initiation.speed={speed}", "--set", "simulation.duration=0.05"]
        return CliRunner().invoke(app, ["run", "drop_test", "--no-half-step", *given])

    assert asked("2.0").exit_code == 0
    assert asked("2.0").exit_code == 0
    refused = asked("2.5")
    assert refused.exit_code == 2
    title = load("drop_test").title
    assert refused.stderr.splitlines()[-1].endswith(
        f"holds another run, got {title!r} with --set initiation.speed=2.0 simulation.duration=0.05; "
        "--force replaces it, --out leaves it"
    )


def test_results_of_an_edited_scenario_are_ones_own(tmp_path: Path) -> None:
    folder = tmp_path / "out"
    said: list[str] = []
    about = {"scenario_hash": "a", "recordings": ["d"], "origin": results.origin(tmp_path / "x.yaml", folder)}
    folder.mkdir()
    results.write_json(folder / "a.json", {"format": "f/1", **about})

    def claimed(**changes: Any) -> Path:
        return results.claim_report(folder, "f/1", {**about, **changes}, ["a.json"], say=said.append)

    assert claimed() == folder.resolve()
    assert said == []
    claimed(scenario_hash="b")
    assert len(said) == 1
    for changes in (
        {"scenario_hash": "b", "recordings": ["e"]},
        {"scenario_hash": "b", "origin": results.origin(tmp_path / "y.yaml", folder)},
        {"scenario_hash": "b", "origin": results.origin(tmp_path / "x.yaml", folder, ["gravity=9"])},
    ):
        with pytest.raises(InputError, match="holds results of something else"):
            claimed(**changes)

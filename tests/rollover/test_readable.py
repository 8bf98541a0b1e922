"""What is written can be read back by every command, or is refused before it is written."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from rollover.recording import Clock, Recording, Sensor
from rollover.recording.importers import read_recording, write_recording
from rollover.recording.importers.importer import Collection, Importer
from rollover.recording.runs import write_parquet
from rollover.system.errors import InputError
from tests.fuzz.oracle import is_whole
from tests.rollover.machines import rollover

TIME = np.linspace(0.0, 0.4, 41)
FORCE = {"ground/force_normal": 1000.0 * np.sin(4.0 * TIME) ** 2}
ODD_VALUES = [
    ({"energy/friction": np.full(41, np.nan)}, "column energy/friction: all gaps"),
    ({"ground/sinkage": np.where(TIME < 0.2, 0.0, np.inf)}, "sample 20: column ground/sinkage: not a finite number"),
    ({"ground/sinkage": np.where(TIME < 0.2, -np.inf, np.nan)}, "sample 0: column ground/sinkage: not a finite number"),
]


def recording(**changes: Any) -> Recording:
    return replace(Recording(title="a", time=TIME, channels=FORCE), **changes)


def refused(*words: object) -> str:
    result = rollover(*words)
    assert (result.exit_code, result.stdout) == (2, ""), result.output
    lines = result.stderr.splitlines()
    assert [is_whole(line) for line in lines] == [""], lines
    return lines[0]


@pytest.mark.parametrize(("channels", "says"), ODD_VALUES)
def test_a_run_whose_values_are_no_numbers_is_not_imported(channels: dict[str, Any], says: str, tmp_path: Path) -> None:
    (tmp_path / "one").mkdir()
    write_parquet(recording(channels={**FORCE, **channels}), tmp_path / "one" / "channels.parquet")
    line = refused("import", tmp_path / "one", "--out", tmp_path / "out")
    assert says in line
    assert "one/channels.parquet: " in line
    assert not (tmp_path / "out").exists()


@pytest.mark.parametrize(("channels", "says"), [*ODD_VALUES, ({}, "nothing but time")])
@pytest.mark.parametrize("name", ["a.csv", "a.parquet", "a.mme.zip", "a.mme"])
def test_no_writer_writes_what_its_reader_refuses(
    name: str, channels: dict[str, Any], says: str, tmp_path: Path
) -> None:
    with pytest.raises(InputError) as caught:
        write_recording(recording(channels={**FORCE, **channels} if channels else {}), tmp_path / name)
    assert says in str(caught.value)
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize(("channels", "says"), ODD_VALUES)
def test_readers_of_other_packages_are_held_to_it(channels: dict[str, Any], says: str, tmp_path: Path) -> None:
    made = recording(channels={**FORCE, **channels})
    importer = Importer(
        name="own",
        meaning="",
        sniff=lambda path: True,
        read=lambda path, profile: made,
        tests=lambda path: ["t"],
        read_test=lambda path, profile, name: made,
    )
    about = {"name": "set", "meaning": "", "citation": "", "licence": "", "where": ""}
    collection = Collection(**about, read=lambda path, select: iter([("toss1", made)]))
    assert importer.read_test is not None
    for read in (
        lambda: importer.read(tmp_path, None),
        lambda: importer.read_test(tmp_path, None, "t"),  # type: ignore[misc]
        lambda: collection.read(tmp_path, ["*"]),
    ):
        with pytest.raises(InputError) as caught:
            read()
        assert says in str(caught.value)
    assert f"{tmp_path / 'toss1'}: " in str(caught.value), "which of a set it is"


@pytest.mark.parametrize(
    ("about", "says"),
    [
        ({"noise": {"ground/force_normal": -1.0}}, "channels.ground/force_normal.noise"),
        ({"uncertainty": {"vehicle.mass": 0.0}}, "uncertainty"),
        ({"conditions": {"vehicle": {"mass": 1.0}}}, "conditions.vehicle: not a value"),
        ({"source": "x" * 300_000}, "too long"),
    ],
)
def test_what_a_sidecar_cannot_say_is_not_written(about: dict[str, Any], says: str, tmp_path: Path) -> None:
    import pyarrow.parquet as pq

    (tmp_path / "one").mkdir()
    path = tmp_path / "one" / "channels.parquet"
    write_parquet(recording(), path)
    table = pq.read_table(path)
    said = json.loads(table.schema.metadata[b"rollover"])
    pq.write_table(table.replace_schema_metadata({"rollover": json.dumps({**said, **about})}), path)
    line = refused("import", tmp_path / "one", "--out", tmp_path / "out")
    assert line.startswith(f"{tmp_path / 'out' / 'one.csv'}: "), "no name of a moment"
    assert says in line
    assert not (tmp_path / "out").exists()


def test_a_class_that_no_filter_has_is_none_of_a_run(tmp_path: Path) -> None:
    write_parquet(recording(cfc={"ground/force_normal": 100}), tmp_path / "channels.parquet")
    for to in ("csv", "mme.zip"):
        line = refused("import", tmp_path / "channels.parquet", "--to", to, "--out", tmp_path / "out")
        assert "not channels of a run" in line


@pytest.mark.parametrize("others", [{}, FORCE])
def test_an_mme_test_has_no_place_for_instruments(others: dict[str, Any], tmp_path: Path) -> None:
    name = "sensor/one/acceleration_x"
    made = recording(channels={**others, name: np.sin(TIME)}, sensors={name: Sensor(body="striker")})
    write_recording(made, tmp_path / "a.csv")
    line = refused("import", tmp_path / "a.csv", "--to", "mme.zip", "--out", tmp_path / "out")
    assert f"where an instrument sits, got {name}; csv or parquet has one" in line
    assert rollover("import", tmp_path / "a.csv", "--to", "parquet", "--out", tmp_path / "out").exit_code == 0
    assert read_recording(tmp_path / "out" / "a.parquet").sensors[name].body == "striker"
    if others:
        words = ("--channel", "ground/*", "--to", "mme.zip", "--out", tmp_path / "mme")
        assert rollover("import", tmp_path / "a.csv", *words).exit_code == 0
        assert read_recording(tmp_path / "mme" / "a.mme.zip")["ground/force_normal"] == pytest.approx(
            FORCE["ground/force_normal"], abs=0.0
        )


@pytest.mark.parametrize("name", ["a.csv", "a.parquet", "a.mme.zip", "a.mme"])
def test_odd_titles_and_slow_clocks_are_read_back(name: str, tmp_path: Path) -> None:
    made = Recording(
        title="a\0b\x85: c\u2028",
        source="NOVALUE\n: \x1b[2J",
        time=np.array([0.0, 2e6, 4e6]),
        channels={"ground/force_normal": np.array([1.0, np.nan, 3.0])},
        clock=Clock(zero="unknown"),
    )
    write_recording(made, tmp_path / name)
    found = read_recording(tmp_path / name)
    time, values = found.samples("ground/force_normal")
    assert time.tolist() == [0.0, 4e6]
    assert values.tolist() == [1.0, 3.0]

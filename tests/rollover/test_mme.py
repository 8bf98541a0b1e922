"""ISO-MME tests as laboratories write them: one column is one channel, what is promised is there or named."""

from __future__ import annotations

import re
import shutil
import tarfile
import zipfile
from pathlib import Path

import numpy as np
import pytest
from typer.testing import CliRunner

from rollover.cli.main import app
from rollover.recording import Recording
from rollover.recording.importers import names_of_tests, read_recording, write_recording
from rollover.system.errors import InputError

CASES = Path(__file__).parent / "cases"
Z, X = "chassis/acceleration_z", "chassis/acceleration_x"
UP = "11VEHCCG0000ACZA"


def channel(
    code: str, values: list[object], unit: str = "m/s2", start: float = 0.0, step: float = 1e-3, **more: str
) -> str:
    head = {
        "Test object number": "1",
        "Name of the channel": "as the laboratory calls it",
        "Channel code": code,
        "Unit": unit,
        "Reference channel": "implicit",
        "Reference channel name": "NOVALUE",
        "Sampling interval": repr(step),
        "Time of first sample": repr(start),
        "Number of samples": str(len(values)),
        **{key.replace("_", " "): value for key, value in more.items()},
    }
    return "".join(f"{key:<28}:{value}\n" for key, value in head.items()) + "\n".join(map(str, values)) + "\n"


def made(folder: Path, *channels: str, listing: str | None = None, name: str = "T1") -> Path:
    """Write a test; its list names every file unless another is given, or none ("")."""
    (folder / name / "Channel").mkdir(parents=True)
    (folder / name / f"{name}.mme").write_text("Title :A test\nLaboratory name :Lab\n")
    codes = [re.search(r"Channel code\s*:(.*)", text)[1] for text in channels]  # type: ignore[index]
    if listing is None:
        rows = "".join(f"Name of channel {i:03d} :{code} / c{i}\n" for i, code in enumerate(codes, start=1))
        listing = f"Number of channels :{len(channels)}\n{rows}"
    if listing:
        (folder / name / "Channel" / f"{name}.chn").write_text(listing)
    for i, text in enumerate(channels, start=1):
        (folder / name / "Channel" / f"{name}.{i:03d}").write_text(text)
    return folder / name


def read(path: Path, profile: str = "") -> Recording:
    if not profile:
        return read_recording(path)
    at = path.parent / "p.yaml"
    at.write_text(f"format: rollover-profile/1\nchannels:\n{profile}")
    return read_recording(path, profile=at)


def import_(*words: str | Path) -> tuple[int, str]:
    done = CliRunner().invoke(app, ["import", *map(str, words)])
    return done.exit_code, done.output


# ---- one column is one channel


def test_two_objects_are_refused_and_the_profile_chooses(tmp_path: Path) -> None:
    shutil.copytree(CASES / "mme_objects", tmp_path / "t")
    with pytest.raises(
        InputError, match=rf"two columns mean {Z}, got '{UP}' and '21VEHCCG0000ACZA'; a profile chooses"
    ):
        read(tmp_path / "t")
    first = read(tmp_path / "t", f"  {UP}: {{channel: {Z}}}\n")
    second = read(tmp_path / "t", f"  21VEHCCG0000ACZA: {{channel: {Z}}}\n")
    assert np.abs(first[Z]).max() == pytest.approx(17.5, abs=0.1)
    assert first[Z] == pytest.approx(10.0 * second[Z], rel=1e-4)
    assert first.notes == ("1 of 2 columns left out, without a description: 21VEHCCG0000ACZA",)


@pytest.mark.parametrize("other", ["12VEHCCG0000ACZA", "11VEHCCG0000ACZ0", "11VEHCCG0000ACZC", "1?VEHCCG0000ACZA"])
def test_positions_and_filter_classes_are_no_choice_of_ours(tmp_path: Path, other: str) -> None:
    path = made(tmp_path, channel(UP, [1, 2, 3]), channel(other, [4, 5, 6]))
    with pytest.raises(InputError, match=rf"got '{UP}' and '{re.escape(other)}'"):
        read(path)


def test_one_code_twice_is_told_apart_by_the_files(tmp_path: Path) -> None:
    path = made(tmp_path, channel(UP, [1, 2, 3]), channel(UP, [4, 5, 6]))
    with pytest.raises(InputError, match=rf"got '{UP} \(T1.001\)' and '{UP} \(T1.002\)'"):
        read(path)
    with pytest.raises(InputError, match=rf"channels.{UP}: no such column in T1, .*it is {UP} \(T1.001\), "):
        read(path, f"  {UP}: {{channel: {Z}}}\n")
    assert read(path, f'  "{UP} (T1.002)": {{channel: {Z}}}\n')[Z].tolist() == [-4.0, -5.0, -6.0]


def test_stretches_of_one_channel_are_joined_at_their_own_times(tmp_path: Path) -> None:
    path = made(
        tmp_path,
        channel(UP, [3, 4], start=0.5, step=0.1),
        channel(UP, [1, 2], start=-0.002),
        channel("11VEHCCG0000ACXA", [9, "NOVALUE", 7], start=0.001, step=0.002),
    )
    found = read(path)
    assert found.samples(Z)[0] == pytest.approx([-0.002, -0.001, 0.5, 0.6])
    assert found.samples(Z)[1].tolist() == [-1.0, -2.0, -3.0, -4.0]
    assert found.samples(X)[0] == pytest.approx([0.001, 0.005])
    assert found.samples(X)[1].tolist() == [9.0, 7.0]
    assert any(note.startswith(f"{Z}: joined from {UP} (T1.002) (-0.002 to -0.001 s)") for note in found.notes)


# ---- what the list promises


def test_three_of_five_promised_channels_are_said_to_be_missing() -> None:
    found = read(CASES / "mme_count")
    assert set(found.channels) == {Z, X}
    assert found.notes == ("3 of 5 channels of mme_count.chn are not there: 3 that it does not name",)


def test_channels_that_the_list_names_are_named(tmp_path: Path) -> None:
    listing = (
        f"Number of channels :4\nName of channel 001 :{UP} / up\nName of channel 002 :11SEAT000000FOZA / seat\n"
        "Name of channel 003 :11BELT000000FOXA / belt\n"
    )
    found = read(made(tmp_path, channel(UP, [1, 2]), listing=listing))
    assert found.notes == (
        "3 of 4 channels of T1.chn are not there: 11SEAT000000FOZA / seat, 11BELT000000FOXA / belt, "
        "1 that it does not name",
    )


def test_files_that_are_not_on_the_list_are_named(tmp_path: Path) -> None:
    listing = f"Number of channels :1\nName of channel 001 :{UP.lower()} / up\n"
    path = made(tmp_path, channel(UP, [1, 2]), channel("11VEHCCG0000ACXA", [3, 4]), listing=listing)
    found = read(path)
    assert found[X].tolist() == [3.0, 4.0]
    assert found.notes == ("1 of 2 files are not in T1.chn: T1.002 (11VEHCCG0000ACXA)",)


@pytest.mark.parametrize("listing", ["", None, "Number of channels :NOVALUE\n"])
def test_a_list_that_is_kept_or_promises_nothing_needs_no_word(tmp_path: Path, listing: str | None) -> None:
    assert read(made(tmp_path, channel(UP, [1, 2]), listing=listing)).notes == ()


def test_the_header_of_the_test_may_promise_as_well(tmp_path: Path) -> None:
    path = made(tmp_path, channel(UP, [1, 2]), listing="")
    with (path / "T1.mme").open("a") as file:
        file.write("Number of channels :3\n")
    assert read(path).notes == ("2 of 3 channels of T1.mme are not there: 2 that it does not name",)


# ---- units, gaps, and channels that cannot be read


def test_metre_per_bracketed_second_squared() -> None:
    found = read(CASES / "mme_u0")
    assert np.abs(found[Z]).max() == pytest.approx(17.5, abs=0.1)
    assert found.notes == ()


def test_a_channel_in_no_unit_is_left_out_and_the_rest_is_read(tmp_path: Path) -> None:
    path = made(tmp_path, channel(UP, [1, 2], unit="V"), channel("11VEHCCG0000ACXA", [3, 4], unit="G'S"))
    found = read(path)
    assert found[X] == pytest.approx([3 * 9.80665, 4 * 9.80665])
    assert found.notes == (f"1 of 2 columns left out, unit 'V' does not fit {Z}: {UP}",)
    with pytest.raises(InputError, match=rf"channels.{UP}: unit: unit does not fit {Z}, got 'V'"):
        read(path, f"  {UP}: {{channel: {Z}}}\n")
    assert read(path, f"  {UP}: {{channel: {Z}, unit: g}}\n")[Z] == pytest.approx([-9.80665, -2 * 9.80665])


def test_a_test_of_such_channels_alone_is_refused(tmp_path: Path) -> None:
    path = made(tmp_path, channel(UP, [1, 2], unit="V"))
    with pytest.raises(InputError, match=rf"no column is a channel, got {UP} \(unit 'V' does not fit {Z}\); --profile"):
        read(path)


BROKEN = {
    "word": (channel("11SEAT000000FOZA", [1, "x"]), r"T1.002: line 11: not a number, got 'x'", "11SEAT000000FOZA"),
    "cut off": (
        channel("11SEAT000000FOZA", [1, 2], Number_of_samples="9"),
        r"Number of samples: says 9, got 2",
        "11SEAT000000FOZA",
    ),
    "no clock": (
        channel("11SEAT000000FOZA", [1, 2], Sampling_interval="NOVALUE"),
        r"Sampling interval: got 'NOVALUE'",
        "11SEAT000000FOZA",
    ),
    "no code": (channel("NOVALUE", [1, 2]), r"Channel code: got 'NOVALUE'", "NOVALUE"),
    "all gaps": (channel("11SEAT000000FOZA", ["NOVALUE", "NoValue"]), r"no value in it", "11SEAT000000FOZA"),
}


@pytest.mark.parametrize("name", BROKEN)
def test_an_unneeded_broken_channel_is_left_out_with_reason(tmp_path: Path, name: str) -> None:
    text, said, key = BROKEN[name]
    path = made(tmp_path, channel(UP, [1, 2]), text)
    found = read(path)
    assert found[Z].tolist() == [-1.0, -2.0]
    assert any(re.search(rf"1 of 2 columns left out, .*{said}.*: {key}", note) or said in note for note in found.notes)
    with pytest.raises(InputError, match=said):
        read(path, f"  {key}: {{channel: rops/force_z, unit: N}}\n")


def test_a_broken_channel_that_is_one_of_ours_is_refused(tmp_path: Path) -> None:
    path = made(tmp_path, channel(UP, [1, "x"]), channel("11VEHCCG0000ACXA", [3, 4]))
    with pytest.raises(InputError, match=r"T1.001: line 11: not a number, got 'x'"):
        read(path)


def test_an_explicit_clock_in_milliseconds(tmp_path: Path) -> None:
    clock = channel("11TIRS000000TIRP", [-5, 0, 10], unit="ms")
    path = made(
        tmp_path, clock, channel(UP, [1, 2, 3], Reference_channel="explicit", Reference_channel_name="11TIRS000000TIRP")
    )
    found = read(path)
    assert found.time == pytest.approx([-0.005, 0.0, 0.01])
    assert found.notes == ()  # the clock is not left out


def test_a_channel_without_a_name_is_not_taken_for_a_clock(tmp_path: Path) -> None:
    nameless = channel("11SEAT000000FOZA", [1, 2], Name_of_the_channel="NOVALUE")
    found = read(made(tmp_path, channel(UP, [1, 2]), nameless))
    assert found.notes == ("1 of 2 columns left out, without a description: 11SEAT000000FOZA",)


# ---- several tests


def test_both_tests_of_a_zip_are_imported_under_their_names(tmp_path: Path) -> None:
    code, said = import_(CASES / "two_tests.zip", "--out", tmp_path / "out")
    assert code == 0, said
    assert sorted(p.name for p in (tmp_path / "out").iterdir()) == [
        *("mme_ang.csv", "mme_ang.yaml", "mme_exp.csv", "mme_exp.yaml"),
    ]
    found = read_recording(tmp_path / "out" / "mme_ang.csv")
    assert set(found.channels) == {"chassis/roll", "chassis/angular_velocity_x", X}
    assert list(read_recording(tmp_path / "out" / "mme_exp.csv").channels) == [Z]


def test_some_of_several_tests(tmp_path: Path) -> None:
    code, said = import_(CASES / "two_tests.zip", "--select", "*exp", "--out", tmp_path / "out")
    assert code == 0, said
    assert sorted(p.name for p in (tmp_path / "out").iterdir()) == ["mme_exp.csv", "mme_exp.yaml"]
    code, said = import_(CASES / "two_tests.zip", "--select", "none", "--out", tmp_path / "no")
    assert code == 2
    assert not (tmp_path / "no").exists()


def test_a_single_reader_refuses_several_with_their_names() -> None:
    with pytest.raises(InputError, match=r"2 tests, got mme_ang, mme_exp; rollover import two_tests.zip makes a rec"):
        read_recording(CASES / "two_tests.zip")
    with pytest.raises(InputError, match=r"no such test, got 'mme_exo'; did you mean 'mme_exp'\?"):
        read_recording(CASES / "two_tests.zip", test="mme_exo")
    one = read_recording(CASES / "two_tests.zip", test="mme_exp")
    assert list(one.channels) == [Z]


def both(tmp_path: Path) -> Path:
    """A folder with two tests."""
    place = tmp_path / "both"
    made(place, channel(UP, [1, 2]), name="A1")
    made(place, channel(UP, [3, 4, 5]), name="B2")
    return place


def test_a_tar_of_two_tests_beside_a_file_managers_entries(tmp_path: Path) -> None:
    place = both(tmp_path)
    for folder in ("A1", "B2"):
        (place / folder / f"._{folder}.mme").write_bytes(b"\0\5\x16\7")
    with tarfile.open(tmp_path / "t.tar.gz", "w:gz") as tar:
        tar.add(place, ".")
    assert names_of_tests(tmp_path / "t.tar.gz", "") == ["A1", "B2"]
    assert read_recording(tmp_path / "t.tar.gz", test="B2")[Z].tolist() == [-3.0, -4.0, -5.0]


def test_tests_of_one_name_are_told_apart_by_their_folders(tmp_path: Path) -> None:
    with zipfile.ZipFile(tmp_path / "t.zip", "w") as archive:
        for folder, value in (("mon", 1), ("tue", 2)):
            archive.writestr(f"{folder}/T.mme", "Title :x\n")
            archive.writestr(f"{folder}/Channel/T.001", channel(UP, [value, value]))
    assert names_of_tests(tmp_path / "t.zip", "") == ["mon-T", "tue-T"]
    assert read_recording(tmp_path / "t.zip", test="tue-T")[Z].tolist() == [-2.0, -2.0]


def test_two_tests_that_share_a_folder_keep_their_own_files(tmp_path: Path) -> None:
    place = made(tmp_path, channel(UP, [1, 2]), name="A1")
    other = made(tmp_path, channel(UP, [3, 4]), channel("11VEHCCG0000ACXA", [5, 6]), name="B2")
    shutil.copy(other / "B2.mme", place)
    for file in (other / "Channel").iterdir():
        shutil.copy(file, place / "Channel")
    with pytest.raises(InputError, match=r"2 tests, got A1, B2"):
        read_recording(place)
    assert list(read_recording(place / "A1.mme").channels) == [Z]
    assert read_recording(place / "B2.mme")[Z].tolist() == [-3.0, -4.0]
    assert read_recording(place, test="B2").notes == ()


# ---- nothing goes unmentioned


@pytest.mark.parametrize("packed", [False, True])
def test_all_that_a_test_holds_is_read_or_named(tmp_path: Path, packed: bool) -> None:
    others = [f"1{i}SEAT{i:02d}0000FOZA" for i in range(1, 6)]
    path = made(tmp_path, channel(UP, [1, 2]), *(channel(code, [i, i]) for i, code in enumerate(others)))
    if packed:
        with zipfile.ZipFile(tmp_path / "t.zip", "w") as archive:
            for file in path.rglob("*.*"):
                archive.write(file, file.relative_to(path).as_posix())
        path = tmp_path / "t.zip"
    found = read(path)
    assert len(found.channels) == 1
    assert found.notes == (f"5 of 6 columns left out, without a description: {', '.join(others)}",)


# ---- clocks


@pytest.mark.parametrize(
    ("step", "more", "words"),
    [
        (100.0, {}, "line 7: Sampling interval: got 100.0, by which 400 samples last 40000 s"),
        (0.1, {}, "SAE J211 asks for 10000 Hz of CFC 1000; seconds are needed"),
        (1e-4, {"Sampling_interval_unit": "ms"}, "with 'sampling interval unit' 'ms'; seconds are needed"),
        (1e-4, {"Sampling_rate": "1000"}, "with 'sampling rate' '1000', which is not 1 over it"),
    ],
)
def test_an_interval_that_cannot_be_seconds_is_refused(
    tmp_path: Path, step: float, more: dict[str, str], words: str
) -> None:
    path = made(tmp_path, channel(UP, list(range(400)), step=step, **more))
    with pytest.raises(InputError, match=re.escape(words)):
        read(path)


def test_intervals_that_are_seconds_are_read(tmp_path: Path) -> None:
    """A static test of 1 h at 10 Hz, unfiltered; a rate that agrees."""
    slow = channel("11ROPS000000FOR0", list(range(36_000)), "N", step=0.1)
    assert read(made(tmp_path, slow)).time[-1] == pytest.approx(3599.9)
    agreed = channel(UP, list(range(400)), step=1e-4, Sampling_rate="10000", Sampling_interval_unit="s")
    assert read(made(tmp_path, agreed, name="T2")).time[-1] == pytest.approx(0.0399)


def test_two_channels_cannot_last_a_thousand_times_as_long(tmp_path: Path) -> None:
    other = channel("11VEHCCG0000ACX0", list(range(400)), step=0.1)
    with pytest.raises(InputError, match=r"got 0.1 in T1.002, line 7 and 0.0001 in T1.001, line 7"):
        read(made(tmp_path, channel(UP, list(range(400)), step=1e-4), other))
    slower = channel("11VEHCCG0000ACX0", list(range(400)), step=2e-3)
    assert read(made(tmp_path, channel(UP, list(range(400)), step=1e-4), slower, name="T2")).time[-1] == 0.798


def test_what_is_sampled_slowly_is_written_with_its_stamps(tmp_path: Path) -> None:
    slow = Recording(title="slow", time=np.arange(50) * 5.0, channels={Z: np.sin(np.arange(50))}, cfc={Z: 60})
    write_recording(slow, tmp_path / "slow.mme")
    assert read(tmp_path / "slow.mme").time.tolist() == slow.time.tolist()


@pytest.mark.parametrize(("code", "head", "taken"), [("0", "180", 180), ("C", "180", 180), ("C", "600", None)])
def test_the_filter_class_of_code_and_head(tmp_path: Path, code: str, head: str, taken: int | None) -> None:
    found = read(made(tmp_path, channel(UP[:15] + code, [1, 2, 3], Channel_frequency_class=head)))
    assert found.cfc.get(Z) == taken
    assert any("neither is taken" in note for note in found.notes) == (taken is None)


def test_files_of_an_archive_that_belong_to_no_test_are_named(tmp_path: Path) -> None:
    folder = made(tmp_path, channel(UP, [1, 2, 3]))
    with zipfile.ZipFile(tmp_path / "a.zip", "w") as archive:
        for file in sorted(folder.rglob("*.*")):
            archive.write(file, file.relative_to(tmp_path))
        archive.writestr("T1/readme.txt", "words")
        archive.writestr("inner.zip", b"another test")
        archive.writestr("T1/Movie/a.avi", b"pictures")
    assert [n for n in read(tmp_path / "a.zip").notes if "no test" in n] == [
        "2 of 6 files in it belong to no test: inner.zip, T1/Movie/a.avi"
    ]

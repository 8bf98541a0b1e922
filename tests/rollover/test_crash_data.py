"""CSV of DTS data acquisition and NHTSA's EV5 folders: made here in their shape, read with what they say themselves."""

from __future__ import annotations

import re
import zipfile
from pathlib import Path

import numpy as np
import pytest

from rollover.recording import Recording
from rollover.recording.importers import names_of_tests, read_recording
from rollover.system.errors import InputError

G = 9.80665
X, Z = "chassis/acceleration_x", "chassis/acceleration_z"
TIME = np.arange(40) * 5e-5 - 5e-4
WAVE = np.sin(np.arange(40))

# ---- DTS


def dts(
    mark: str = ",", decimal: str = ".", codes: str = "10VEHCCG0000ACXA", units: str = "g ", rate: int = 20000
) -> str:
    head = [f"Sample Rate (Hz)|{rate}|", f"ISO Channel Code|{codes}|D0HEADCG0000ACXA", f"Engineering Unit|{units}|g "]
    lines = [*head, "Data Starts Here||", "Time|Chan 5:AC3|Chan 6:AC4"]
    lines += [f"{t:.6f}|{a:.6f}|{2 * a:.6f}".replace(".", decimal) for t, a in zip(TIME, WAVE, strict=True)]
    return "\n".join(lines).replace("|", mark) + "\n"


def read(folder: Path, text: str, profile: str = "") -> Recording:
    (folder / "dts.csv").write_text(text)
    if not profile:
        return read_recording(folder / "dts.csv")
    (folder / "p.yaml").write_text(f"format: rollover-profile/1\n{profile}")
    return read_recording(folder / "dts.csv", profile=folder / "p.yaml")


@pytest.mark.parametrize(("mark", "decimal"), [(",", "."), (";", ","), ("\t", ".")])
def test_dts_by_its_iso_codes(tmp_path: Path, mark: str, decimal: str) -> None:
    found = read(tmp_path, dts(mark, decimal))
    assert found.time == pytest.approx(TIME, abs=1e-9)
    assert found[X] == pytest.approx(G * WAVE, abs=1e-5)
    assert dict(found.cfc) == {X: 1000}
    assert found.notes == ("1 of 3 columns left out, without a description: Chan 6:AC4",)


def test_dts_codes_are_in_sae_axes(tmp_path: Path) -> None:
    found = read(tmp_path, dts(codes="10VEHCCG0000ACZC", units="m/(s*s)"))
    assert found[Z] == pytest.approx(-WAVE, abs=1e-6)
    assert f"turned from SAE J211 axes to ISO 8855, as the ISO codes have it: {Z}" in found.notes


@pytest.mark.parametrize("csv", ["", "csv: {names_row: 5}\n"])
def test_dts_by_a_profile_as_it_stands(tmp_path: Path, csv: str) -> None:
    channels = f'channels:\n  Time: {{channel: time, unit: s}}\n  "Chan 6:AC4": {{channel: {Z}, unit: g}}\n'
    found = read(tmp_path, dts(), csv + channels)
    assert found[Z] == pytest.approx(2.0 * G * WAVE, abs=1e-5)
    if not csv:  # the unit is in the file
        assert read(tmp_path, dts(), channels.replace("}, unit: g", ""))[Z] == pytest.approx(found[Z])


def test_dts_rate_that_is_not_that_of_the_stamps_is_said(tmp_path: Path) -> None:
    found = read(tmp_path, dts(rate=10000))
    assert "Sample Rate says 10000 Hz, the column of time 20000 Hz: read by the column" in found.notes


@pytest.mark.parametrize(
    ("text", "said"),
    [
        (dts(codes="NONE"), r"no column is a channel, got Time, Chan 5:AC3, Chan 6:AC4; --profile FILE"),
        (dts(units="V"), r"no column is a channel, got .*Chan 5:AC3 \(unit 'V' does not fit chassis/acceleration_x\)"),
        (dts().replace("\n-0.000350,", "\n-0.000350,x"), r"dts.csv:9: column Chan 5:AC3: not a number"),
    ],
)
def test_dts_refused(tmp_path: Path, text: str, said: str) -> None:
    with pytest.raises(InputError, match=said):
        read(tmp_path, text)


# ---- NHTSA EV5


def instrument(number: int, kind: str, attached: str, axis: str, unit: str, vehicle: int = 1) -> str:
    fields = [vehicle, number, kind, "NA", attached, axis, "SEC", unit, "1650", "ENDEVCO", "", "20000", "200", "0"]
    return "|".join(map(str, [*fields, "-10", "29", "50", "AM", "P", "made up"]))


def ev5(*instruments: str) -> str:
    test = "V5|Overturn of a tractor|OBJ|12-MAR-1998|The laboratory|" + "|".join(["x"] * 15)
    lines = ["----- EV5 -----", "----- TEST -----", test, "----- VEHICLE -----", "1|A|B", "----- INSTRUMENTATION -----"]
    return "\r\n".join([*lines, *instruments, "----- END -----", ""])


def curve(scale: float) -> str:
    return "".join(f"{t:.6f}\t{scale * a:.6f}\r\n" for t, a in zip(TIME, WAVE, strict=True))


def folder_of(place: Path, about: str | None, **curves: str) -> Path:
    folder = place / "v00001"
    folder.mkdir()
    if about is not None:
        (folder / "v00001.EV5").write_text(about)
    for number, text in curves.items():
        (folder / f"v00001.{number[1:]}").write_text(text)
    return folder


TWO = (instrument(1, "AC", "VECG", "XL", "G'S"), instrument(2, "AC", "HDCG", "ZL", "G'S"))


@pytest.mark.parametrize("packed", [False, True])
def test_nhtsa_by_its_instruments(tmp_path: Path, packed: bool) -> None:
    path = folder_of(tmp_path, ev5(*TWO), n001=curve(1.0), n002=curve(2.0))
    if packed:
        with zipfile.ZipFile(tmp_path / "v00001.zip", "w") as archive:
            for file in path.iterdir():
                archive.write(file, file.name)
        path = tmp_path / "v00001.zip"
    found = read_recording(path)
    assert (found.title, found.source) == ("Overturn of a tractor", "The laboratory")
    assert found.time == pytest.approx(TIME, abs=1e-9)
    assert found[X] == pytest.approx(G * WAVE, abs=1e-5)
    assert found.notes == (
        "1 of 2 columns left out, without a description: 002",
        "instruments: 001 AC NA VECG XL G'S made up; 002 AC NA HDCG ZL G'S made up",
    )


def test_nhtsa_by_a_profile_takes_the_unit_of_the_file(tmp_path: Path) -> None:
    load = instrument(3, "LC", "ROOF", "ZL", "NWT")
    path = folder_of(tmp_path, ev5(*TWO, load), n001=curve(1.0), n002=curve(2.0), n003=curve(5.0))
    (tmp_path / "p.yaml").write_text('format: rollover-profile/1\nchannels:\n  "003": {channel: rops/force_z}\n')
    found = read_recording(path, profile=tmp_path / "p.yaml")
    assert found["rops/force_z"] == pytest.approx(5.0 * WAVE, abs=1e-5)
    assert "2 of 3 columns left out, without a description: 001, 002" in found.notes


def test_nhtsa_without_its_description(tmp_path: Path) -> None:
    path = folder_of(tmp_path, None, n001=curve(1.0), n002=curve(2.0))
    (tmp_path / "p.yaml").write_text(f'format: rollover-profile/1\nchannels:\n  "002": {{channel: {X}, unit: g}}\n')
    assert read_recording(path, profile=tmp_path / "p.yaml")[X] == pytest.approx(2.0 * G * WAVE, abs=1e-5)
    with pytest.raises(InputError, match=r"no column is a channel, got 001, 002; --profile FILE"):
        read_recording(path)


def test_nhtsa_files_and_list_that_differ_are_said(tmp_path: Path) -> None:
    more = instrument(7, "AC", "VECG", "ZL", "G'S")
    found = read_recording(folder_of(tmp_path, ev5(*TWO, more), n001=curve(1.0), n002=curve(2.0), n009=curve(3.0)))
    assert list(found.channels) == [X]
    assert "1 of 4 columns left out, listed in v00001.EV5, and no file: 007" in found.notes
    assert "files that v00001.EV5 does not list: 009" in found.notes


def test_nhtsa_two_vehicles_are_refused_with_both(tmp_path: Path) -> None:
    other = instrument(2, "AC", "VECG", "XL", "G'S", vehicle=2)
    path = folder_of(tmp_path, ev5(TWO[0], other), n001=curve(1.0), n002=curve(2.0))
    with pytest.raises(InputError, match=r"two columns mean chassis/acceleration_x, got '001' and '002'"):
        read_recording(path)


def test_nhtsa_a_broken_curve_is_refused_only_if_needed(tmp_path: Path) -> None:
    broken = curve(1.0).replace("\r\n", "\r\noops\r\n", 1)
    path = folder_of(tmp_path, ev5(*TWO), n001=curve(1.0), n002=broken)
    found = read_recording(path)
    assert found[X].size == 40
    assert any(
        re.search(r"1 of 2 columns left out, v00001.002: line 2: not two numbers.*: 002", n) for n in found.notes
    )
    (path / "v00001.001").write_text(broken)
    (path / "v00001.002").write_text(curve(1.0))
    (path / "v00001.EV5").write_text(ev5(TWO[0], instrument(2, "AC", "VECG", "ZL", "G'S")))
    with pytest.raises(InputError, match=r"v00001.001: line 2: not two numbers, got 'oops'"):
        read_recording(path)


def test_nhtsa_a_curve_over_millimetres_is_no_recording(tmp_path: Path) -> None:
    crush = instrument(2, "LC", "ROOF", "ZL", "NWT").replace("|SEC|", "|MM|")
    found = read_recording(folder_of(tmp_path, ev5(TWO[0], crush), n001=curve(1.0), n002=curve(2.0)))
    assert any("X is no time" in note and note.endswith(": 002") for note in found.notes)


def test_nhtsa_two_tests_in_a_zip(tmp_path: Path) -> None:
    with zipfile.ZipFile(tmp_path / "both.zip", "w") as archive:
        for name, scale in (("v00001", 1.0), ("v00002", 3.0)):
            archive.writestr(f"{name}/{name}.EV5", ev5(TWO[0]))
            archive.writestr(f"{name}/{name}.001", curve(scale))
    path = tmp_path / "both.zip"
    assert names_of_tests(path, "") == ["v00001", "v00002"]
    assert read_recording(path, test="v00002")[X] == pytest.approx(3.0 * G * WAVE, abs=1e-5)
    with pytest.raises(InputError, match=r"2 tests, got v00001, v00002; rollover import both.zip makes a recording of"):
        read_recording(path)


@pytest.mark.parametrize("status", ["CF", "MD", "ND", "channel failed", "Meaningless data"])
def test_nhtsa_data_that_are_said_to_be_lost_are_not_read(tmp_path: Path, status: str) -> None:
    lost = [row.replace("|AM|", f"|{status}|") for row in TWO]
    path = folder_of(tmp_path, ev5(TWO[0], lost[1]), n001=curve(1.0), n002=curve(2.0))
    assert f"1 of 2 columns left out, its data status is '{status.upper()}': 002" in read_recording(path).notes
    (path / "v00001.EV5").write_text(ev5(lost[0], TWO[1]))
    with pytest.raises(InputError, match=f"column 001: its data status is '{status.upper()}'; a profile without it"):
        read_recording(path)


def test_nhtsa_a_status_that_is_no_loss_is_said(tmp_path: Path) -> None:
    path = folder_of(tmp_path, ev5(TWO[0].replace("|AM|", "|QD|"), TWO[1]), n001=curve(1.0), n002=curve(2.0))
    found = read_recording(path)
    assert found[X] == pytest.approx(G * WAVE, abs=1e-5)
    assert "001: its data status is 'QD'" in found.notes

"""ISO-MME: what the head of a channel says of all its values."""

from __future__ import annotations

from pathlib import Path

import pytest

from rollover.system.errors import InputError
from tests.rollover.test_mme import UP, Z, channel, made, read


@pytest.mark.parametrize("status", ["channel failed", "Meaningless data", "no data available", "INVALID"])
def test_data_that_are_said_to_be_lost_are_not_read(tmp_path: Path, status: str) -> None:
    other = "11VEHCCG0000ACXA"
    lost = channel(UP, [1, 2, 3], Data_status=status)
    with pytest.raises(InputError, match=f"column {UP}: its data status is '{status}'; a profile without it reads"):
        read(made(tmp_path, lost, channel(other, [4, 5, 6])))
    found = read(tmp_path / "T1", f"  {other}: {{channel: chassis/acceleration_x}}\n")
    assert f"1 of 2 columns left out, its data status is '{status}': {UP}" in found.notes


@pytest.mark.parametrize(("status", "note"), [("ok", 0), ("NOVALUE", 0), ("as measured", 0), ("questionable data", 1)])
def test_data_of_another_status_are_read_and_said(tmp_path: Path, status: str, note: int) -> None:
    found = read(made(tmp_path, channel(UP, [1, 2, 3], Data_status=status)))
    assert found[Z].tolist() == [-1.0, -2.0, -3.0]
    assert list(found.notes) == [f"{UP}: its data status is {status!r}"] * note


def test_a_scale_in_a_head_is_said(tmp_path: Path) -> None:
    found = read(made(tmp_path, channel(UP, [1, 2, 3], Scale_factor="2.0", Calibration_date="2024")))
    assert found.notes == (
        f"{UP}: scale_factor 2 stands beside its numbers, and is not applied; `scale` of a profile does",
    )

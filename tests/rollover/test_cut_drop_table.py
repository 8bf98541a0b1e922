"""The table of a cut drop, which the published set of the penetrometer holds beside its logs: faults in words."""

from __future__ import annotations

import gzip
from pathlib import Path

import pytest

from rollover.recording.importers import COLLECTIONS
from rollover.recording.importers.bluedrop import COLUMNS
from rollover.recording.importers.soil_penetrometer import LARGEST
from rollover.system.errors import InputError
from tests.fuzz.oracle import is_whole

HEAD = ",".join(COLUMNS)
ROW = ",".join("0.1" for _ in COLUMNS)
TABLES: dict[str, tuple[bytes, str]] = {
    "a word": (f"{HEAD}\n{ROW}\nabc{ROW[3:]}\n".encode(), "row 2: not a number, got 'abc'; 9 numbers in each row"),
    "a short row": (f"{HEAD}\n{ROW}\n1,2\n".encode(), "got 2 cells in row 2; 9 numbers in each row"),
    "no row": (HEAD.encode(), "got no row; 9 numbers in each row"),
    "nothing": (b"", "got columns ''; t_s, a2g"),
    "no text": (f"{HEAD}\n".encode() + b"\xe9", "not a readable penetrometer file: damaged"),
    "too much": (bytes(LARGEST + 1), "unpacks to too much, got more than 67108864 bytes; a table of one cut drop"),
}


@pytest.mark.parametrize("what", TABLES)
def test_a_damaged_table_of_a_drop_is_told_in_words(what: str, tmp_path: Path) -> None:
    data, said = TABLES[what]
    path = tmp_path / "a_main_drop.csv.gz"
    path.write_bytes(gzip.compress(data, 1))
    with pytest.raises(InputError) as caught:
        list(COLLECTIONS["soil-penetrometer"].read(path, ["*"]))
    assert is_whole(str(caught.value)) == ""
    assert said in str(caught.value)

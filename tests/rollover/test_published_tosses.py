"""Published tosses of cubes and elbows: tensors read without running code, flights, and the owners' files."""

from __future__ import annotations

import pickle
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from rollover.recording.importers.tensors import read_tensor
from rollover.recording.importers.tosses import RATE
from tests.rollover import published_files as files
from tests.rollover.published_files import published, read, refused

# tensors


@pytest.mark.parametrize("write", [files.write_new_pt, files.write_old_pt])
def test_a_tensor_is_read_from_both_kinds_of_files(tmp_path: Path, write: Callable[..., None]) -> None:
    rows = np.arange(24.0).reshape(2, 3, 4) / 7.0
    write(tmp_path / "0.pt", rows)
    assert np.array_equal(read_tensor(tmp_path / "0.pt"), rows)


def test_a_view_of_a_storage_is_read_by_its_strides(tmp_path: Path) -> None:
    rows = np.arange(12.0).reshape(3, 4)
    pickled = files.tensor_pickle((4, 3), count=12, strides=(1, 4))
    files.write_new_pt(tmp_path / "0.pt", rows, pickled)
    assert np.array_equal(read_tensor(tmp_path / "0.pt"), rows.T)


class Marks:
    """Pickles as a call that makes a file: what a malicious pickle would do, harmless."""

    def __init__(self, path: Path) -> None:
        self.path = path

    def __reduce__(self) -> tuple[object, tuple[str, str]]:
        return (open, (str(self.path), "w"))


@pytest.mark.parametrize("protocol", [0, 1, 2, 4])
@pytest.mark.parametrize("write", [files.write_new_pt, files.write_old_pt])
def test_code_in_a_pickle_is_refused_and_never_run(tmp_path: Path, write: Callable[..., None], protocol: int) -> None:
    marker = tmp_path / "marker"
    write(tmp_path / "0.pt", np.zeros((2, 2)), pickle.dumps(Marks(marker), protocol))
    line = refused(lambda: read_tensor(tmp_path / "0.pt"))
    assert "no tensor needs" in line
    assert not marker.exists()
    # the test is one only if the same bytes do make the file where they are trusted
    pickle.loads(pickle.dumps(Marks(marker), protocol)).close()
    assert marker.exists()


def test_a_call_of_the_right_name_with_other_things_is_refused(tmp_path: Path) -> None:
    call = files.tensor_pickle((2, 2), call="torch._utils\n_rebuild_parameter")
    files.write_new_pt(tmp_path / "0.pt", np.zeros((2, 2)), call)
    assert "torch._utils._rebuild_parameter" in refused(lambda: read_tensor(tmp_path / "0.pt"))
    built = files.tensor_pickle((2, 2))[:-1] + b"}b."
    files.write_new_pt(tmp_path / "1.pt", np.zeros((2, 2)), built)
    assert "instruction BUILD" in refused(lambda: read_tensor(tmp_path / "1.pt"))


@pytest.mark.parametrize(
    ("pickled", "says"),
    [
        (files.tensor_pickle((1 << 15, 1 << 15), count=1 << 30), "claims"),
        (files.tensor_pickle((1000, 1000), count=4, strides=(0, 0)), "claims a shape"),
        (files.tensor_pickle((2, 2), count=4, strides=(4, 1)), "reaches beyond"),
        (files.tensor_pickle((2, 2), count=4, strides=(-2, 1)), "claims a shape"),
        (files.tensor_pickle((2, 2), storage="HalfStorage"), "no tensor needs"),
    ],
)
@pytest.mark.parametrize("write", [files.write_new_pt, files.write_old_pt])
def test_a_tensor_claiming_more_than_its_file_is_refused(
    tmp_path: Path, pickled: bytes, says: str, write: Callable[..., None]
) -> None:
    if write is files.write_old_pt:
        pickled = pickled.replace(files.text("0"), files.text("60429056")).replace(b"tQ", b"NtQ", 1)
    write(tmp_path / "0.pt", np.zeros((2, 2)), pickled)
    line = refused(lambda: read_tensor(tmp_path / "0.pt"))
    # the old form says twice how many numbers there are
    assert says in line or "are claimed" in line


def test_a_compressed_part_and_a_cut_file_are_refused(tmp_path: Path) -> None:
    files.write_new_pt(tmp_path / "0.pt", np.zeros((500, 2)), compressed=True)
    assert "compressed" in refused(lambda: read_tensor(tmp_path / "0.pt"))
    files.write_old_pt(tmp_path / "1.pt", np.zeros((5, 2)))
    (tmp_path / "1.pt").write_bytes((tmp_path / "1.pt").read_bytes()[:-8])
    assert "claims 10 numbers" in refused(lambda: read_tensor(tmp_path / "1.pt"))
    for size in (0, 1, 20, 150):
        (tmp_path / "2.pt").write_bytes((tmp_path / "1.pt").read_bytes()[:size])
        assert "PyTorch tensor" in refused(lambda: read_tensor(tmp_path / "2.pt"))


# cube


def test_a_published_toss_is_in_metres_from_its_flight(tmp_path: Path) -> None:
    rows = files.cube_rows()
    files.write_old_pt(tmp_path / "7.pt", files.as_tensor(rows))
    files.write_new_pt(tmp_path / "12.pt", files.as_tensor(rows)[0])
    found = read("cube-tosses", tmp_path)
    assert list(found) == ["toss007", "toss012"]
    for toss in found.values():
        # a flat cube whose lower face ends 1.5 mm under the zero of the poses: there is the table
        lands = int(np.argmax(rows[:, 2] - 0.0524 < 0.002))
        assert toss.time.size == lands + round(0.1 * RATE) + 1
        assert toss["chassis/position_z"][0] == pytest.approx(0.13 + 0.0015, abs=1e-9)
        assert toss["chassis/position_x"][0] == pytest.approx(0.2)
        start = toss.conditions
        assert start["initiation.position"] == pytest.approx([0.2, 0.1, 0.1315], abs=1e-6)
        assert start["initiation.velocity"] == pytest.approx([-1.0, 0.4, -0.5], abs=1e-6)
        assert start["initiation.angular_velocity"] == pytest.approx([0.0, 0.0, 2.0], abs=1e-6)
        # recorded rates are no measurements and are left out, which is said
        assert not [name for name in toss.channels if "velocity" in name]
        assert any("velocities are left out" in note for note in toss.notes)
        assert any("-1.5 mm" in note for note in toss.notes)
        assert any("cut off" in note for note in toss.notes)


def test_a_quaternion_begins_as_simulated_without_jumps(tmp_path: Path) -> None:
    rows = files.cube_rows()
    rows[:, 3:7] *= -1.0
    rows[5:9, 3:7] *= -1.0
    files.write_old_pt(tmp_path / "0.pt", files.as_tensor(rows))
    toss = read("cube-tosses", tmp_path)["toss000"]
    q = [toss[f"chassis/quaternion_{axis}"][0] for axis in "wxyz"]
    assert toss.conditions["initiation.quaternion"] == pytest.approx(q, abs=1e-6)
    assert toss["chassis/quaternion_w"] == pytest.approx(files.cube_rows()[: toss.time.size, 3], abs=1e-12)


@pytest.mark.parametrize(
    ("change", "says"),
    [
        (lambda a: a[:, :15], "rows of 19 columns"),
        (lambda a: np.where(np.arange(19) == 3, np.nan, a), "not a finite number"),
        (lambda a: np.where(np.arange(19) == 3, 3.0, a), "not a quaternion"),
    ],
)
def test_what_is_no_toss_of_the_cube_is_refused(tmp_path: Path, change: Callable[..., np.ndarray], says: str) -> None:
    files.write_old_pt(tmp_path / "0.pt", change(files.as_tensor(files.cube_rows())[0]))
    assert says in refused(lambda: read("cube-tosses", tmp_path))


def test_published_tosses_match_an_independent_reading() -> None:
    folder = published("cubes")
    found = read("cube-tosses", folder)
    assert list(found) == [f"toss00{k}" for k in range(10)]
    for k, toss in enumerate(found.values()):
        data = (folder / f"{k}.pt").read_bytes()
        # the numbers stand at the end of the old form: 19 a row
        count = int.from_bytes(data[data.index(b"q\x01a.") + 4 :][:8], "little")
        rows = np.frombuffer(data[-8 * count :], "<f8").reshape(-1, 19)
        assert toss["chassis/position_x"] == pytest.approx(rows[: toss.time.size, 0] * 0.0524, abs=1e-12)
        assert toss.time[1] == pytest.approx(1.0 / 148.0)
        below = rows[0, 2] * 0.0524 - toss["chassis/position_z"][0]
        assert -0.003 < below < -0.001
    assert found["toss000"]["chassis/position_x"][0] == pytest.approx(0.209874, abs=1e-6)


# elbow


def elbow(angle: float, rate: float) -> np.ndarray:
    """Two links that fly without turning while the hinge turns: (n, 15), the pair's centre on a parabola."""
    t = np.arange(30) / 148.0
    a = angle + rate * t
    second = np.stack([-0.035 + 0.035 * np.cos(a), np.full(t.size, 0.06), -0.035 * np.sin(a)], axis=1)
    centre = np.stack([0.5 * t, 0.1 + 0.0 * t, 1.0 + 0.3 * t - 0.5 * 9.81 * t**2], axis=1)
    rows = np.zeros((t.size, 15))
    rows[:, 0], rows[:, 4:7], rows[:, 7] = 1.0, centre - 0.5 * second, a
    return rows


def test_the_place_of_the_elbow_is_that_of_both_links(tmp_path: Path) -> None:
    files.write_new_pt(tmp_path / "3.pt", elbow(0.3, 4.0))
    toss = read("elbow-tosses", tmp_path)["elbow003"]
    assert toss.conditions["initiation.velocity"] == pytest.approx([0.5, 0.0, 0.3], abs=1e-6)
    assert toss.conditions["vehicle.whole.mass"] == pytest.approx(0.74)
    assert toss["chassis/position_x"] == pytest.approx(0.5 * toss.time, abs=1e-9)
    assert toss["rops/hinge/elbow/angle_y"] == pytest.approx(0.3 + 4.0 * toss.time)
    assert any("no list of effects" in note for note in toss.notes)


def test_all_published_elbows_are_read_and_begin_with_a_flight() -> None:
    found = read("elbow-tosses", published("elbow"))
    assert len(found) == 20
    assert found["elbow000"]["rops/hinge/elbow/angle_y"][0] == pytest.approx(0.05960892)
    assert found["elbow000"]["chassis/quaternion_w"][0] == pytest.approx(0.57072043)
    for name, toss in found.items():
        # what is fitted to the flight goes through the first pose
        start = toss.conditions["initiation.position"]
        assert start[2] == pytest.approx(toss["chassis/position_z"][0], abs=0.005), name

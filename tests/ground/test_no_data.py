"""Nodes of a height map without a height are refused, whatever mark stands there, and no ground is taken for one."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from ground.no_data import missing
from ground.relief import STEEPEST
from ground.surface import Heightmap
from rollover.scenario import load
from rollover.system.errors import InputError

SPACING = (0.5, 0.5)


def terrain(seed: int, n: int = 24, roughness: float = 0.3) -> np.ndarray:
    """Ground by random waves, 0.5 m between nodes, some 0.3 m high."""
    random = np.random.default_rng(seed)
    x, y = np.meshgrid(0.5 * np.arange(n), 0.5 * np.arange(n), indexing="ij")
    waves = [
        random.normal() * np.sin(2.0 * np.pi * (random.uniform(0, 0.3) * x + random.uniform(0, 0.3) * y))
        for _ in range(8)
    ]
    return np.asarray(roughness * np.sum(waves, axis=0) / np.sqrt(8.0))


@pytest.mark.parametrize(
    "mark", [-9999.0, -32768.0, -3.4028234663852886e38, 1e20, 9999.0, -99999.0, -99.0, 999.0, -30.0]
)
@pytest.mark.parametrize("at", [[(3, 5)], [(0, 0), (0, 1), (7, 9), (23, 23)]])
def test_a_mark_is_told_with_its_place(mark: float, at: list[tuple[int, int]]) -> None:
    for seed in range(5):
        heights = terrain(seed)
        for i, j in at:
            heights[i, j] = mark
        found = missing(heights, SPACING, STEEPEST)
        assert found is not None
        assert found[:2] == at[0]
        assert f"{mark:.7g}" in found[2]


def test_a_mark_at_most_nodes_is_still_the_mark() -> None:
    """Where little of the map was measured the measured nodes are the fewer."""
    heights = terrain(1)
    heights[np.random.default_rng(0).random(heights.shape) < 0.8] = -40.0
    i, j, _ = missing(heights, SPACING, STEEPEST) or (-1, -1, "")
    assert heights[i, j] == -40.0


def test_a_mark_of_nines_on_a_map_that_is_wider_than_it_is_deep() -> None:
    heights = np.tile(terrain(2), (20, 20))  # 240 m
    assert missing(heights, SPACING, STEEPEST) is None
    heights[100, 200] = -99.0
    assert (missing(heights, SPACING, STEEPEST) or ())[:2] == (100, 200)


def test_no_ground_is_taken_for_a_mark() -> None:
    """Rough ground at any altitude, a trench, a wall, a quarry, a cliff, a step as high as the map is wide."""
    for seed in range(100):
        random = np.random.default_rng(seed)
        heights = terrain(seed, roughness=random.uniform(0.01, 1.0)) + random.uniform(-400.0, 4000.0)
        assert missing(heights, SPACING, STEEPEST) is None, seed
        i, j = random.integers(2, 20, 2)
        for height in (-3.0, 0.15, 2.5, 11.0, -9.9):  # 11.5 m wide
            built = heights.copy()
            built[i : i + 3, j:] = height + heights.min()
            assert missing(built, SPACING, STEEPEST) is None, (seed, height)
    assert missing(np.array([[0.0, 0.0], [9.0, 9.0]]), (0.1, 1.0), STEEPEST) is None
    assert missing(np.zeros((5, 5)), SPACING, STEEPEST) is None


def test_heights_in_python_are_refused_alike() -> None:
    with pytest.raises(ValueError, match=r"heights.1.2: no height at row 2, column 3, got nan"):
        Heightmap(heights=((0.0, 0.0, 0.0), (0.0, 0.0, float("nan"))), spacing=(1.0, 1.0))


@pytest.mark.parametrize(
    ("cell", "words"),
    [
        ("-9999.000", "heights.1.2: no height at row 2, column 3, got -9999"),
        ("-3.4028235e+38", "row 2, column 3, got -3.402823e+38"),
        ("nan", "row 2, column 3, got nan"),
        ("", "row 2, column 3, got an empty cell"),
        ("1e400", "row 2, column 3, got inf"),
    ],
)
def test_a_file_is_refused_at_its_line(tmp_path: Path, cell: str, words: str) -> None:
    rows = [["0.1", "0.2", "0.3", "0.2"] for _ in range(5)]
    rows[1][2] = cell
    (tmp_path / "map.csv").write_text("# heights, m\n\n" + "".join(",".join(row) + "\n" for row in rows))
    surface = "{kind: heightmap, heights: map.csv, spacing: [0.5, 0.5]}"
    (tmp_path / "s.yaml").write_text(f"base: side_overturn.yaml\nground:\n  surface: {surface}\n")
    with pytest.raises(InputError) as said:
        load(tmp_path / "s.yaml")
    (fault,) = said.value.faults
    assert (Path(fault.file or "").name, fault.line) == ("map.csv", 4)
    assert words in str(fault)
    assert "fill" in fault.message


def test_the_header_of_an_esri_grid_is_named(tmp_path: Path) -> None:
    (tmp_path / "map.csv").write_text("ncols 2\nnrows 2\ncellsize 0.5\nNODATA_value -9999\n0 0\n0 -9999\n")
    surface = "{kind: heightmap, heights: map.csv, spacing: [0.5, 0.5]}"
    (tmp_path / "s.yaml").write_text(f"base: side_overturn.yaml\nground: {{surface: {surface}}}\n")
    with pytest.raises(InputError, match="header of an ESRI ASCII grid, got 'ncols 2'"):
        load(tmp_path / "s.yaml")


def test_a_mark_in_an_npy_file(tmp_path: Path) -> None:
    heights = terrain(0)
    heights[6, 4] = -32768.0
    np.save(tmp_path / "map.npy", heights.astype(np.float32))
    surface = "{kind: heightmap, heights: map.npy, spacing: [0.5, 0.5]}"
    (tmp_path / "s.yaml").write_text(f"base: side_overturn.yaml\nground: {{surface: {surface}}}\n")
    with pytest.raises(InputError, match="row 7, column 5, got -32768"):
        load(tmp_path / "s.yaml")


def test_a_list_of_points_is_no_grid(tmp_path: Path) -> None:
    heights = terrain(0, n=6)
    rows = [f"{0.5 * i},{0.5 * j},{heights[i, j]:.3f}" for i in range(6) for j in range(6)]
    (tmp_path / "map.csv").write_text("\n".join(rows))
    surface = "{kind: heightmap, heights: map.csv, spacing: [0.5, 0.5]}"
    (tmp_path / "s.yaml").write_text(f"base: side_overturn.yaml\nground: {{surface: {surface}}}\n")
    with pytest.raises(InputError, match="list of points x, y, z, got 36 rows of three"):
        load(tmp_path / "s.yaml")
    np.savetxt(tmp_path / "map.csv", heights[:, :3], delimiter=",")
    load(tmp_path / "s.yaml")

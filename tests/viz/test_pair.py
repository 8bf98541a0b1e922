"""Two runs in one recording: both scenes moved aside unharmed, the curves exact, the difference theirs."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from rollover.assessment import results
from rollover.comparison.run_pair import Pair, pair, read
from tests.viz import example
from tests.viz.picture import has_software_driver, kept, pictures, pixels
from viz.content.entities import series

log = pytest.importorskip("viz.recordings.log", reason="no rerun wheel for this platform", exc_type=ImportError)

from viz.recordings.pair import BASELINE, CANDIDATE, write_pair  # noqa: E402
from viz.recordings.verify import blueprint_queries, check_rrd, read_column, read_entities  # noqa: E402


@pytest.fixture(scope="module")
def two(tmp_path_factory: pytest.TempPathFactory) -> tuple[Pair, Path]:
    root = tmp_path_factory.mktemp("pair")
    for name, slope in (("was", 0.0), ("now", 10.0)):
        run = example.overturn(slope_deg=slope)
        force = (1.0 + 0.02 * slope) * run.recording["rops/force"]
        run.recording.channels["rops/force"][:] = force
        peaks: tuple[object, ...] = example.peaks(run)
        results.write(root / name, run, peaks, picture=lambda path, run=run: log.write_rrd(run, path))  # type: ignore
    found = pair(read(root / "was"), read(root / "now"))
    write_pair(found, root / "pair.rrd")
    return found, root / "pair.rrd"


def test_it_is_whole_and_holds_what_its_layout_asks_for(two: tuple[Pair, Path]) -> None:
    assert check_rrd(two[1]) == []
    assert [p.name for p in two[1].parent.iterdir() if p.name.startswith(".")] == []


def test_each_side_has_its_whole_scene(two: tuple[Pair, Path]) -> None:
    found, path = two
    entities = read_entities(path)
    for side, result in (("baseline", found.baseline), ("candidate", found.candidate)):
        own = {
            e: parts for e, parts in read_entities(result.folder / "recording.rrd").items() if e.startswith("/world")
        }
        assert own
        for entity, parts in own.items():
            assert entities[f"/{side}{entity}"] == parts
        _, there = read_column(path, f"/{side}/world/chassis", "Transform3D:translation")
        _, was = read_column(result.folder / "recording.rrd", "/world/chassis", "Transform3D:translation")
        assert there == was


def test_curves_and_difference_are_those_of_the_runs(two: tuple[Pair, Path]) -> None:
    found, path = two
    s = series("rops/force")
    drawn = {}
    for source in (f"/{s.path}/baseline", f"/{s.path}/candidate", f"/difference/{s.path}"):
        time, rows = read_column(path, source, "Scalars:scalars")
        drawn[source.rpartition("/")[2]] = np.array([row[0] for row in rows])
        np.testing.assert_array_equal(time, np.round(found.baseline.recording.time * 1e9).astype(np.int64))
    was, now, less = drawn.values()
    np.testing.assert_array_equal(was, found.baseline.recording["rops/force"] * s.factor)
    np.testing.assert_allclose(now, 1.2 * was, rtol=1e-12)
    np.testing.assert_allclose(less, 0.2 * was, atol=1e-9)


def test_the_first_tab_answers_and_both_scenes_are_in_it(two: tuple[Pair, Path]) -> None:
    views = dict(blueprint_queries(two[1]))
    assert {"What changed", "ROPS force, kN", "ROPS force, kN: candidate less baseline"} <= set(views)
    assert sum(name.startswith(("Baseline: arrows", "Candidate: arrows")) for name in views) == 2
    _, (words,) = read_column(two[1], "/answer", "TextDocument:text")
    assert words[0].startswith("# ROPS force: 44.2 kN before, 53.1 kN now: +20 %.")
    assert "| `ground.surface.angle_deg` | 0.0 deg | 10.0 deg |" in words[0]


def test_without_a_recording_there_is_no_picture(two: tuple[Pair, Path], tmp_path: Path) -> None:
    found, _ = two
    results.write(tmp_path / "bare", example.overturn(), ())
    with pytest.raises(FileNotFoundError, match=r"bare: no recording.rrd there"):
        write_pair(pair(found.baseline, read(tmp_path / "bare")), tmp_path / "pair.rrd")
    assert [p.name for p in tmp_path.iterdir()] == ["bare"]


@pytest.mark.skipif(not has_software_driver(), reason="no software Vulkan driver (mesa-vulkan-drivers)")
def test_the_viewer_draws_it_without_complaint(two: tuple[Pair, Path]) -> None:
    (shot,), complaints = pictures(two[1], [1.4])
    kept("compare_two_runs.png", shot)
    assert complaints == []
    image = pixels(shot)
    for shade in (BASELINE, CANDIDATE):  # both curves in the plot, and the difference below
        rgb = [(shade >> k) & 255 for k in (24, 16, 8)]
        assert (np.abs(image - rgb).max(axis=2) < 12).sum() > 100

"""Every shipped scenario in the viewer: its recording is whole, holds what its layout names, and no view complains."""

from __future__ import annotations

import subprocess
from pathlib import Path
from typing import Any

import pytest

from rollover import loads, simulate
from rollover.document import shipped_folder
from rollover.scenario import load
from tests.viz.picture import complaints_of, has_software_driver, headless_viewer, kept, pixels, settled
from tests.viz.picture import load as show
from viz.viewer import viewer_binary

log = pytest.importorskip("viz.log", reason="no rerun wheel for this platform", exc_type=ImportError)

from viz.verify import check_rrd  # noqa: E402

SCENARIOS = sorted(path.stem for path in shipped_folder().glob("*.yaml"))
KEPT = {"side_overturn": 2.4, "drop_test": 0.2, "static_rops_test": 4.0, "rear_overturn": 1.13}  # name -> s


@pytest.fixture(scope="module")
def recordings(tmp_path_factory: pytest.TempPathFactory) -> dict[str, Path]:
    """Each scenario run once, at its own length and step."""
    folder, found = tmp_path_factory.mktemp("shipped"), {}
    for name in SCENARIOS:
        run = simulate.run(load(name))
        assert run.status == "done", (name, run.sentence)
        found[name] = folder / f"{name}.rrd"
        log.write_rrd(run, found[name], peaks=loads.peak_loads(run))
    return found


def test_recordings_are_whole_and_hold_what_their_layouts_name(recordings: dict[str, Path]) -> None:
    assert len(recordings) > 15
    found = {name: check_rrd(path) for name, path in recordings.items()}
    assert {name: problems for name, problems in found.items() if problems} == {}
    done = subprocess.run(
        [viewer_binary(), "rrd", "verify", *recordings.values()], capture_output=True, text=True, check=False
    )
    assert done.returncode == 0, done.stdout + done.stderr


@pytest.mark.skipif(not has_software_driver(), reason="no software Vulkan driver (mesa-vulkan-drivers)")
def test_no_view_of_any_scenario_complains(recordings: dict[str, Path]) -> None:
    complaints: dict[str, list[str]] = {}
    for name, path in recordings.items():
        with headless_viewer() as viewer:
            complaints[name] = shown(viewer, name, path)
    assert {name: said for name, said in complaints.items() if said} == {}


def shown(viewer: Any, name: str, path: Path) -> list[str]:
    """What the viewer complains about once the recording is drawn."""
    show(viewer, path)
    viewer.set_time("sim_time", duration=KEPT.get(name, 0.0), play_state="paused")
    shot = settled(lambda: viewer.take_screenshot(max_size=1600 if name in KEPT else 300))
    assert pixels(shot).std() > 5.0, f"{name}: nothing is drawn"
    if name in KEPT:
        kept(f"{name}.png", shot)
    return complaints_of(viewer)

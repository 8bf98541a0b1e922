"""Every shipped scenario in the viewer: its recording is whole, holds what its layout names, and no view complains."""

from __future__ import annotations

import subprocess
from pathlib import Path
from typing import Any

import pytest

from rollover.assessment import loads
from rollover.dynamics import simulate
from rollover.scenario import load
from rollover.spec.document import shipped_folder
from tests.viz.picture import complaints_of, has_software_driver, headless_viewer, kept, pixels, settled
from tests.viz.picture import load as show
from viz.recordings.viewer import viewer_binary

log = pytest.importorskip("viz.recordings.log", reason="no rerun wheel for this platform", exc_type=ImportError)

from viz.recordings.verify import check_rrd  # noqa: E402

SCENARIOS = sorted(path.stem for path in shipped_folder().glob("*.yaml"))
KEPT = {"side_overturn": 2.4, "drop_test": 0.2, "static_rops_test": 4.0, "rear_overturn": 1.13}  # name -> s


def test_every_recording_is_whole_and_no_view_complains(tmp_path: Path) -> None:
    """One test: the runs are shared, and workers share nothing."""
    recordings = {name: recorded(name, tmp_path) for name in SCENARIOS}
    assert len(recordings) > 15
    found = {name: check_rrd(path) for name, path in recordings.items()}
    assert {name: problems for name, problems in found.items() if problems} == {}
    done = subprocess.run(
        [viewer_binary(), "rrd", "verify", *recordings.values()], capture_output=True, text=True, check=False
    )
    assert done.returncode == 0, done.stdout + done.stderr
    if not has_software_driver():
        pytest.skip("recordings are whole; no software Vulkan driver (mesa-vulkan-drivers) to draw them with")
    complaints: dict[str, list[str]] = {}
    for name, path in recordings.items():
        with headless_viewer() as viewer:
            complaints[name] = shown(viewer, name, path)
    assert {name: said for name, said in complaints.items() if said} == {}


def recorded(name: str, folder: Path) -> Path:
    """A scenario run once, at its own length and step, by the loop where it may: what a recording is made of is alike.

    `regress` runs each by Exudyn, and test_integrators.py holds both integrators' results side by side.
    """
    run = simulate.run(load(name).of_many())
    assert run.status == "done", (name, run.sentence)
    path = folder / f"{name}.rrd"
    log.write_rrd(run, path, peaks=loads.peak_loads(run))
    return path


def shown(viewer: Any, name: str, path: Path) -> list[str]:
    """What the viewer complains about once the recording is drawn."""
    show(viewer, path)
    viewer.set_time("sim_time", duration=KEPT.get(name, 0.0), play_state="paused")
    shot = settled(lambda: viewer.take_screenshot(max_size=1600 if name in KEPT else 300))
    assert pixels(shot).std() > 5.0, f"{name}: nothing is drawn"
    if name in KEPT:
        kept(f"{name}.png", shot)
    return complaints_of(viewer)

"""Pictures of a recording without a window, to be looked at: ``python -m tests.viz.picture RRD OUT TIME ...``.

Needs a Vulkan driver; without a graphics card Debian's mesa-vulkan-drivers (lavapipe) will do.
"""

from __future__ import annotations

import io
import os
import socket
import subprocess
import sys
import time
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from viz.viewer import viewer_binary

KEPT = Path(__file__).resolve().parents[2] / "out" / "pictures"  # for people to look at after the tests
DRIVERS = Path("/usr/share/vulkan/icd.d")
_HARMLESS = ("Software rasterizer", "loss of performance", "not found for screenshot")


def has_software_driver() -> bool:
    """Whether pictures can be made on a machine without a graphics card."""
    return DRIVERS.is_dir() and any("lvp" in p.name for p in DRIVERS.iterdir())


def kept(name: str, picture: bytes) -> Path:
    """Keep a picture for people to look at."""
    KEPT.mkdir(parents=True, exist_ok=True)
    path = KEPT / name
    path.write_bytes(picture)
    return path


def pixels(picture: bytes) -> NDArray[np.int64]:
    """Red, green, blue of a PNG, 0 to 255, (rows, columns, 3)."""
    from PIL import Image

    return np.asarray(Image.open(io.BytesIO(picture)).convert("RGB"), dtype=np.int64)


@contextmanager
def headless_viewer() -> Iterator[Any]:
    """A viewer without a window, listening on this machine only."""
    from rerun.experimental import ViewerClient

    with socket.socket() as s:
        s.bind(("127.0.0.1", 0))
        port = s.getsockname()[1]
    command = [viewer_binary(), "--headless", "--bind", "127.0.0.1", "--port", str(port), "--hide-welcome-screen"]
    child = subprocess.Popen(command, env={"RUST_LOG": "error", **os.environ}, stderr=subprocess.DEVNULL)
    try:
        yield _patiently(lambda: _answering(ViewerClient.connect(f"rerun+http://127.0.0.1:{port}/proxy")))
    finally:
        child.kill()
        child.wait()


def _answering(viewer: Any) -> Any:
    viewer.get_state()
    return viewer


def _patiently(attempt: Any, seconds: float = 30.0) -> Any:
    deadline = time.monotonic() + seconds
    while True:
        try:
            return attempt()
        except Exception:
            if time.monotonic() > deadline:
                raise
            time.sleep(0.2)


def pictures(path: Path, times: Sequence[float]) -> tuple[list[bytes], list[str]]:
    """A PNG for each instant, and what the viewer complained about."""
    with headless_viewer() as viewer:
        viewer.open([str(path.resolve())])
        deadline = time.monotonic() + 30.0
        while not (state := viewer.get_state()).recordings or not state.recordings[0].timelines:
            assert time.monotonic() < deadline, "the recording was not loaded"
            time.sleep(0.1)
        found = []
        for instant in times:
            viewer.set_time("sim_time", duration=instant, play_state="paused")
            before = b""
            while (shot := viewer.take_screenshot(max_size=1600)) != before and time.monotonic() < deadline + 30.0:
                before = shot
            found.append(shot)
        state = viewer.get_state()
        complaints = [f"{view.name}: {r.summary}" for view in state.views for r in view.reports]
        complaints += [
            f"{entry.level}: {entry.message}"
            for entry in viewer.get_logs()
            if entry.level in ("WARN", "ERROR") and not any(h in entry.message for h in _HARMLESS)
        ]
        return found, complaints


if __name__ == "__main__":
    shots, said = pictures(Path(sys.argv[1]), [float(t) for t in sys.argv[3:]])
    for t, png in zip(sys.argv[3:], shots, strict=True):
        Path(f"{sys.argv[2]}_{t}.png").write_bytes(png)
    print("\n".join(said) or "nothing to complain about")

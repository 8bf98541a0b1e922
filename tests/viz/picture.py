"""Pictures of a recording without a window, to be looked at: ``python -m tests.viz.picture RRD OUT TIME ...``.

Each goes to OUT_TIME.png, 1200 pixels wide in 256 colours, small enough for a page.

Needs a Vulkan driver; without a graphics card Debian's mesa-vulkan-drivers (lavapipe) will do.
"""

from __future__ import annotations

import io
import os
import socket
import subprocess
import sys
import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from viz.recordings.viewer import viewer_binary

KEPT = Path(__file__).resolve().parents[2] / "out" / "pictures"  # for people to look at after the tests
DRIVERS = Path("/usr/share/vulkan/icd.d")
PATIENCE = 60.0  # s, until a recording is loaded or a picture stands still
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


def small(picture: bytes, width: int = 1200) -> bytes:
    """The same PNG in fewer pixels and 256 colours."""
    from PIL import Image

    image = Image.open(io.BytesIO(picture)).convert("RGB")
    image = image.resize((width, round(image.height * width / image.width)), Image.Resampling.LANCZOS)
    out = io.BytesIO()
    image.quantize(256, method=Image.Quantize.MAXCOVERAGE, dither=Image.Dither.NONE).save(out, "PNG", optimize=True)
    return out.getvalue()


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


def complaints_of(viewer: Any) -> list[str]:
    """What views report and the viewer logged, but for what every software renderer says."""
    complaints = [f"{view.name}: {r.summary}" for view in viewer.get_state().views for r in view.reports]
    return complaints + [
        f"{entry.level}: {entry.message}"
        for entry in viewer.get_logs()
        if entry.level in ("WARN", "ERROR") and not any(h in entry.message for h in _HARMLESS)
    ]


def pictures(path: Path, times: Sequence[float]) -> tuple[list[bytes], list[str]]:
    """A PNG for each instant, and what the viewer complained about."""
    with headless_viewer() as viewer:
        load(viewer, path)
        found = []
        for instant in times:
            viewer.set_time("sim_time", duration=instant, play_state="paused")
            found.append(settled(lambda: viewer.take_screenshot(max_size=1600)))
        return found, complaints_of(viewer)


def picture_of_view(path: Path, name: str) -> bytes:
    """A PNG of one view at the recording's start."""
    with headless_viewer() as viewer:
        load(viewer, path)
        viewer.set_time("sim_time", duration=0.0, play_state="paused")
        settled(lambda: viewer.take_screenshot(max_size=1600))
        (view,) = [v for v in viewer.get_state().views if v.name == name]
        return settled(lambda: viewer.take_screenshot(view.view_id))


def load(viewer: Any, path: Path) -> None:
    viewer.open([str(path.resolve())])
    deadline = time.monotonic() + PATIENCE
    while not (state := viewer.get_state()).recordings or not state.recordings[0].timelines:
        assert time.monotonic() < deadline, f"{path}: the recording was not loaded"
        time.sleep(0.05)


def settled(shoot: Callable[[], bytes]) -> bytes:
    """A picture that is the same twice."""
    before, deadline = b"", time.monotonic() + PATIENCE
    while (shot := shoot()) != before and time.monotonic() < deadline:
        before = shot
    return shot


if __name__ == "__main__":
    shots, said = pictures(Path(sys.argv[1]), [float(t) for t in sys.argv[3:]])
    for t, png in zip(sys.argv[3:], shots, strict=True):
        Path(f"{sys.argv[2]}_{t}.png").write_bytes(small(png))
    print("\n".join(said) or "nothing to complain about")

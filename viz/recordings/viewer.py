"""The viewer's window: one process, on this machine only, gone when the window closes or this process ends."""

from __future__ import annotations

import contextlib
import os
import signal
import subprocess
import sys
import threading
from collections.abc import Iterator, Mapping
from importlib.util import find_spec
from pathlib import Path
from types import FrameType


def viewer_binary() -> Path:
    """The viewer itself; `rerun` on the path is a wrapper whose end would leave the viewer running.

    Raises ``FileNotFoundError`` where the installed SDK brings no viewer.
    """
    spec = find_spec("rerun_cli")
    folders = [Path(p) for p in (spec.submodule_search_locations or ())] if spec is not None else []
    names = ["Rerun.app/Contents/MacOS/Rerun", "rerun"] if sys.platform == "darwin" else ["rerun", "rerun.exe"]
    for candidate in (folder / name for folder in folders for name in names):
        if candidate.is_file():
            return candidate
    raise FileNotFoundError("viewer: not found beside the installed rerun-sdk; install a rerun-sdk with its viewer")


def has_display() -> bool:
    """Whether a window can be opened; only X11 and Wayland say where."""
    return sys.platform in ("darwin", "win32") or any(os.environ.get(k) for k in ("DISPLAY", "WAYLAND_DISPLAY"))


def open_viewer(path: Path) -> int:
    """Open a recording and wait until its window is closed; returns the viewer's exit status.

    It listens on this machine only, on a free port, so that a window already open is left alone; the viewer's usage
    statistics are switched off first, as its makers provide for. Raises ``FileNotFoundError``.
    """
    if not path.is_file():
        raise FileNotFoundError(f"{path}: no such recording")
    binary = viewer_binary()
    quiet = {**os.environ, "RUST_LOG": "error"}
    nowhere = subprocess.DEVNULL
    subprocess.run([binary, "analytics", "disable"], check=False, stdout=nowhere, stderr=nowhere, env=quiet)
    here = ["--bind", "127.0.0.1", "--port", "auto"]
    return wait_for([str(binary), *here, "--hide-welcome-screen", str(path)], quiet)


def wait_for(command: list[str], environment: Mapping[str, str] | None = None) -> int:
    """Run a child to its end; it does not outlive this call, however this call ends."""
    with _terminated_like_interrupted(), subprocess.Popen(command, env=environment) as child:
        try:
            return child.wait()
        finally:
            if child.poll() is None:
                child.terminate()
                try:
                    child.wait(timeout=5.0)
                except subprocess.TimeoutExpired:
                    child.kill()


@contextlib.contextmanager
def _terminated_like_interrupted() -> Iterator[None]:
    """Let SIGTERM raise, so that what stands in `finally` is done; only the main thread may say so."""
    if threading.current_thread() is not threading.main_thread():
        yield
        return

    def stop(number: int, frame: FrameType | None) -> None:
        raise SystemExit(128 + number)

    before = signal.signal(signal.SIGTERM, stop)
    try:
        yield
    finally:
        signal.signal(signal.SIGTERM, before)

"""The viewer's window leaves nothing behind and listens to nobody else; played by a stand-in."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest

from viz.recordings import viewer

pytestmark = pytest.mark.skipif(sys.platform == "win32", reason="platform: the stand-in is a shell script")


def stand_in(folder: Path, status: int) -> Path:
    script = folder / "viewer"
    script.write_text(
        f'#!/bin/sh\necho "$RUST_LOG" "$@" >> {folder / "calls"}\n[ "$1" = analytics ] || exit {status}\n'
    )
    script.chmod(0o755)
    return script


def test_window_is_local_quiet_and_its_status_returned(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    binary = stand_in(tmp_path, status=7)
    monkeypatch.setattr(viewer, "viewer_binary", lambda: binary)
    monkeypatch.delenv("RUST_LOG", raising=False)
    recording = tmp_path / "run.rrd"
    recording.write_bytes(b"")
    assert viewer.open_viewer(recording) == 7
    calls = (tmp_path / "calls").read_text().splitlines()
    assert calls[0].split() == ["error", "analytics", "disable"]
    arguments = calls[1].split()
    assert arguments[arguments.index("--bind") + 1] == "127.0.0.1"
    assert arguments[arguments.index("--port") + 1] == "auto"
    assert arguments[-1] == str(recording)


def test_a_recording_that_is_not_there_opens_nothing(tmp_path: Path) -> None:
    with pytest.raises(FileNotFoundError, match="no such recording"):
        viewer.open_viewer(tmp_path / "none.rrd")


def test_the_binary_is_the_viewer_itself() -> None:
    pytest.importorskip("rerun", reason="no rerun wheel for this platform")
    assert viewer.viewer_binary().stat().st_size > 1_000_000  # and not the wrapper script on the path


@pytest.mark.parametrize("number", [signal.SIGTERM, signal.SIGINT])
def test_the_window_does_not_outlive_the_command(number: int, tmp_path: Path) -> None:
    note = tmp_path / "child"
    child = f"import os, time; open({str(note)!r}, 'w').write(str(os.getpid())); time.sleep(60)"
    code = f"import sys; from viz.recordings.viewer import wait_for; wait_for([sys.executable, '-c', {child!r}])"
    # whoever starts the tests behind a shell has the interrupt ignored, and children inherit that
    code = f"import signal; signal.signal(signal.SIGINT, signal.default_int_handler); {code}"
    parent = subprocess.Popen([sys.executable, "-c", code], stderr=subprocess.DEVNULL)
    deadline = time.monotonic() + 30.0
    while not (note.exists() and note.read_text()):
        assert time.monotonic() < deadline
        time.sleep(0.05)
    parent.send_signal(number)
    assert parent.wait(timeout=30.0) != 0
    with pytest.raises(ProcessLookupError):
        os.kill(int(note.read_text()), 0)

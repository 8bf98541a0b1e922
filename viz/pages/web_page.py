"""One HTML file with a recording and the viewer itself, for a reader who has only a browser.

The viewer's script and its WebAssembly are asked from the installed viewer, which serves them for its own web page;
they stand in the file as they came, so that viewer and recording are of one version. A content security policy in the
page forbids every connection: nothing is loaded from elsewhere and nobody is told.
"""

from __future__ import annotations

import base64
import contextlib
import functools
import gzip
import html
import http.client
import os
import re
import socket
import subprocess
import time
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path

from rollover.system.writing import put
from viz.content.embedded import embedded, in_script, policy
from viz.recordings.viewer import viewer_binary

TEMPLATE = Path(__file__).parent / "templates" / "viewer.html"
SCRIPT, PROGRAM = "/re_viewer.js", "/re_viewer_bg.wasm"
SCRIPTS = re.compile(r"<script>(.*?)</script>", re.DOTALL)  # those of the template, which run
OWN_POLICY = ("script-src 'wasm-unsafe-eval'", "img-src data: blob:", "media-src data: blob:", "font-src data:")
PATIENCE = 30.0  # s, until the viewer serves its page


@dataclass(frozen=True, kw_only=True)
class Viewer:
    """What a browser needs of the viewer: its script, and its program packed by gzip."""

    script: str
    program: bytes


def write_page(recording: Path, path: Path, *, title: str, footer: str = "") -> None:
    """Write the page of a recording, whole or not at all; `footer` says where the recording is from.

    Raises ``FileNotFoundError`` where there is no recording or the installed SDK brings no viewer, and ``OSError``
    for a viewer that does not serve its web page.
    """
    if not recording.is_file():
        raise FileNotFoundError(f"{recording}: no such recording")
    text = page(recording.read_bytes(), installed(), title=title, footer=footer)
    put(path, lambda at: at.write_text(text, encoding="utf-8"))


def page(recording: bytes, viewer: Viewer, *, title: str, footer: str = "") -> str:
    """HTML text with everything in it."""
    parts = {
        "title": html.escape(title),
        "footer": html.escape(footer),
        "name": embedded(title),
        "script": in_script(viewer.script),
        "program": base64.b64encode(viewer.program).decode("ascii"),
        "recording": base64.b64encode(gzip.compress(recording, 6, mtime=0)).decode("ascii"),
    }
    template = TEMPLATE.read_text(encoding="utf-8")
    parts["policy"] = policy((_filled(text, parts) for text in SCRIPTS.findall(template)), *OWN_POLICY)
    return _filled(template, parts)


def _filled(template: str, parts: Mapping[str, str]) -> str:
    pieces = template.split("@@")  # every second one is a part's name
    return "".join(parts[piece] if k % 2 else piece for k, piece in enumerate(pieces))


@functools.cache
def installed() -> Viewer:
    """The installed viewer. Raises ``FileNotFoundError``, or ``OSError`` if it does not serve its page."""
    with _serving(viewer_binary()) as port:
        script, program = _fetched(port, SCRIPT).decode("utf-8"), _fetched(port, PROGRAM)
    if not program.startswith(b"\0asm") or "WebHandle" not in script:
        raise OSError("viewer: what it serves is not its web viewer; another version of rerun-sdk may help")
    return Viewer(script=script, program=gzip.compress(program, 6, mtime=0))


@contextlib.contextmanager
def _serving(binary: Path) -> Iterator[int]:
    """Port of this machine at which the viewer serves its page, for as long as that is needed."""
    port, other = _free_ports()
    command = [str(binary), "--serve-web", "--bind", "127.0.0.1", "--web-viewer-port", str(port), "--port", str(other)]
    nowhere = subprocess.DEVNULL
    quiet = {**os.environ, "RUST_LOG": "error"}
    subprocess.run([binary, "analytics", "disable"], check=False, stdout=nowhere, stderr=nowhere, env=quiet)
    child = subprocess.Popen(command, stdout=nowhere, stderr=nowhere, env=quiet)
    try:
        deadline = time.monotonic() + PATIENCE
        while not _answers(port):
            if child.poll() is not None or time.monotonic() > deadline:
                raise OSError("viewer: it did not serve its web page on this machine")
            time.sleep(0.05)
        yield port
    finally:
        child.kill()
        child.wait()


def _free_ports() -> tuple[int, int]:
    with socket.socket() as one, socket.socket() as other:
        one.bind(("127.0.0.1", 0))
        other.bind(("127.0.0.1", 0))
        return one.getsockname()[1], other.getsockname()[1]


def _answers(port: int) -> bool:
    with socket.socket() as s:
        return s.connect_ex(("127.0.0.1", port)) == 0


def _fetched(port: int, path: str) -> bytes:
    connection = http.client.HTTPConnection("127.0.0.1", port, timeout=PATIENCE)
    try:
        connection.request("GET", path)
        answer = connection.getresponse()
        if answer.status != 200:
            raise OSError(f"viewer: {path} was answered by {answer.status}")
        return answer.read()
    finally:
        connection.close()

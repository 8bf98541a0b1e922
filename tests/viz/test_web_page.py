"""The HTML file with viewer and recording: complete, and shown by a browser that has no network."""

from __future__ import annotations

import base64
import gzip
import re
import time
from pathlib import Path

import pytest

from tests.viz.browser import has_browser, opened
from tests.viz.picture import kept, pixels
from viz.pages import web_page
from viz.pages.web_page import Viewer, page, write_page

HOSTILE = 'a "b" </script> <!-- & @@script@@'
STAND_IN = Viewer(script='say("</script>"); // WebHandle <!-- @@title@@', program=gzip.compress(b"\0asm..."))


def held(text: str, name: str) -> bytes:
    """What the page holds under a name, unpacked as the browser does it."""
    found = re.search(rf'<script type="text/plain" id="{name}">([^<]*)</script>', text)
    assert found is not None
    return gzip.decompress(base64.b64decode(found[1], validate=True))


def test_the_page_holds_recording_and_viewer() -> None:
    recording = bytes(range(256)) * 10
    text = page(recording, STAND_IN, title="Side overturn", footer="rollover 1")
    assert held(text, "recording") == recording
    assert held(text, "program") == b"\0asm..."
    assert "<title>Side overturn</title>" in text
    assert "rollover 1" in text
    assert page(recording, STAND_IN, title="Side overturn", footer="rollover 1") == text


def test_no_text_can_break_out_of_its_place() -> None:
    text = page(b"", STAND_IN, title=HOSTILE, footer=HOSTILE)
    assert len(re.findall(r"<script[ >]", text)) == len(re.findall(r"</script>", text)) == 5
    assert text.count("<!--") == 1, "the page's own comment"
    assert text.count("</html>") == 1
    assert 'handle.open_channel("recording", "a \\"b\\" \\u003c/script\\u003e \\u003c!-- \\u0026 @@script@@")' in text
    assert 'say("<\\/script>"); // WebHandle <\\!-- @@title@@' in text, "put in as it is, not read as a template"


def test_the_policy_allows_no_connection() -> None:
    text = page(b"", STAND_IN, title="x")
    policy = re.search(r'http-equiv="Content-Security-Policy" content="([^"]*)"', text)
    assert policy is not None
    rules = dict(rule.strip().split(" ", 1) for rule in policy[1].split(";"))
    assert rules["default-src"] == rules["connect-src"] == "'none'"
    assert not re.search(r"https?:|ws:|\*", policy[1])
    assert not re.search(r"<(script|link|img|iframe)[^>]* (src|href)=", text)


def test_the_installed_viewer_is_taken_and_leaves_no_server(drop_rrd: Path) -> None:
    viewer = web_page.installed()
    assert gzip.decompress(viewer.program).startswith(b"\0asm")
    for method in ("open_channel", "send_rrd_to_channel", "close_channel", "has_panicked"):
        assert f"{method}(" in viewer.script, "what the page calls"


def test_a_viewer_that_does_not_serve_is_told(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    silent = tmp_path / "viewer"
    silent.write_text("#!/bin/sh\nexit 1\n")
    silent.chmod(0o755)
    monkeypatch.setattr(web_page, "viewer_binary", lambda: silent)
    recording = tmp_path / "a.rrd"
    recording.write_bytes(b"rrd")
    web_page.installed.cache_clear()
    with pytest.raises(OSError, match="did not serve its web page"):
        write_page(recording, tmp_path / "a.html", title="x")
    web_page.installed.cache_clear()
    with pytest.raises(FileNotFoundError, match="no such recording"):
        write_page(tmp_path / "b.rrd", tmp_path / "b.html", title="x")
    assert sorted(p.name for p in tmp_path.iterdir()) == ["a.rrd", "viewer"]


@pytest.mark.skipif(not has_browser(), reason="no chromium with playwright")
def test_a_browser_without_a_network_shows_it(overturn_rrd: Path, tmp_path: Path) -> None:
    path = tmp_path / "viewer.html"
    write_page(overturn_rrd, path, title="Side overturn", footer="rollover")
    with opened(path, width=900, height=600) as shown:
        shown.wait_for_selector("html[data-state]", state="attached", timeout=120_000)
        assert shown.get_attribute("html", "data-state") == "shown", shown.inner_text("#said")
        deadline, picture = time.monotonic() + 120.0, b""
        while time.monotonic() < deadline and not drawn(picture):
            time.sleep(2.0)
            picture = shown.screenshot(timeout=60_000)
        assert drawn(picture), "soil, tractor and a plotted curve are not all in the picture"
        time.sleep(5.0)  # plots come to their range
        kept("viewer_html.png", shown.screenshot(timeout=60_000))
        assert shown.asked == [path.resolve().as_uri()], "it asked for something else than itself"
        assert shown.said == []


def drawn(picture: bytes) -> bool:
    """Whether soil, the chassis's green and the curve's blue are all there."""
    if not picture:
        return False
    image = pixels(picture)
    red, green, blue = image[..., 0], image[..., 1], image[..., 2]
    soil = (red > green + 15) & (green > blue + 10) & (red > 60)
    paint = (green > red + 20) & (green > blue + 20)
    curve = (blue > 200) & (red < 130) & (green < 190)
    return bool(soil.sum() > 5000 and paint.sum() > 500 and curve.sum() > 50)

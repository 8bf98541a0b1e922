"""A real browser without a window and without a network, for pages to be opened in."""

from __future__ import annotations

import shutil
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

CHROMIUM = shutil.which("chromium")
ARGUMENTS = ["--no-sandbox", "--use-angle=swiftshader", "--enable-unsafe-swiftshader"]


def has_browser() -> bool:
    """Whether Debian's chromium and the library that drives it are there."""
    try:
        import playwright.sync_api  # noqa: F401
    except ImportError:
        return False
    return CHROMIUM is not None


@contextmanager
def opened(path: Path, *, width: int = 1100, height: int = 800, script: bool = True, **options: Any) -> Iterator[Any]:
    """A page opened from its file, offline; `page.asked` lists all that it asked for, `page.said` its complaints."""
    from playwright.sync_api import sync_playwright

    with sync_playwright() as play:
        browser = play.chromium.launch(executable_path=CHROMIUM, args=ARGUMENTS)
        context = browser.new_context(
            viewport={"width": width, "height": height}, java_script_enabled=script, offline=True, **options
        )
        page = context.new_page()
        page.asked, page.said = [], []
        page.on("request", lambda request: page.asked.append(request.url))
        page.on("console", lambda m: page.said.append(m.text) if m.type == "error" else None)
        page.on("pageerror", lambda error: page.said.append(str(error)))
        try:
            page.goto(path.resolve().as_uri())
            yield page
        finally:
            browser.close()

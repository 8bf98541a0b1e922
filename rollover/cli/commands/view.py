"""`rollover view`: the recorded visualisation."""

from __future__ import annotations

import shlex
from pathlib import Path
from typing import Annotated

import typer

from rollover.cli.commands.common import Force, answering, app, manual
from rollover.system.errors import Fault, InputError, absent
from rollover.system.own_json import read_json


@app.command(
    epilog=manual(
        "view out/demo", "view out/demo --html side_overturn.html", writes="nothing, or with --html the one page."
    )
)
@answering
def view(
    results: Annotated[Path, typer.Argument(help="A results folder or an .rrd file.", metavar="DIR_OR_RRD")],
    html: Annotated[
        Path | None, typer.Option(help="Write one HTML file with viewer and recording in it, and open nothing.")
    ] = None,
    force: Force = False,
) -> None:
    """Open the recorded visualisation in the native viewer, or put it into one HTML file.

    The HTML file holds the viewer and the recording, about 20 MB: it opens in a browser by a double click, without a
    network and without this program, and asks nobody for anything.
    """
    path = _recording(results)
    try:
        if html is not None:
            _page(path, html, force)
            return
        from viz.recordings.viewer import has_display, open_viewer

        if not has_display():
            raise InputError(Fault(file=str(path), message=_no_display(results)))
        status = open_viewer(path)
    except FileNotFoundError as e:
        raise InputError(Fault(message=str(e))) from None
    if status != 0:
        raise InputError(Fault(file=str(path), message=f"the viewer could not show it, it ended with status {status}"))


def _no_display(results: Path) -> str:
    """What to do where no window can be opened."""
    asked = shlex.quote(str(results))
    return (
        "no display to open a window on, got neither DISPLAY nor WAYLAND_DISPLAY; "
        f"`rollover view {asked} --html viewer.html` writes a page to open elsewhere, and in a checkout "
        "`python -m tests.viz.picture RRD FOLDER/NAME TIME` a picture of an .rrd"
    )


def _recording(results: Path) -> Path:
    """The .rrd of a results folder, or the file itself. Raises `InputError`."""
    from rollover.assessment.results import PICTURE

    if results.is_dir():
        found = [results / PICTURE] if (results / PICTURE).is_file() else sorted(results.glob("*.rrd"))
        if not found:
            raise InputError(Fault(file=str(results), message=f"no {PICTURE} there; `rollover run` writes one"))
        if len(found) > 1:
            names = ", ".join(p.name for p in found)
            raise InputError(Fault(file=str(results), message=f"several recordings, got {names}; name one of them"))
        return found[0]
    if not results.is_file():
        message, _, cure = absent(results).partition("; ")
        raise InputError(Fault(file=str(results), message=f"{message}; {cure or '`rollover run` writes results'}"))
    if results.suffix != ".rrd":
        raise InputError(Fault(file=str(results), message="not a recording for the viewer; an .rrd file is needed"))
    return results


def _page(path: Path, html: Path, force: bool) -> None:
    """Write the page beside the native viewer. Raises `InputError`."""
    from rollover.assessment.results import RUN, VIEWER
    from rollover.cli import console
    from rollover.system.names import inside
    from rollover.system.writing import hold
    from viz.pages.web_page import write_page

    if html.is_dir() or html.suffix.lower() not in (".html", ".htm"):
        raise InputError(
            Fault(file="--html", message=f"not the name of a page, got {str(html)!r}; NAME.html is needed")
        )
    if html.exists() and not force:
        raise InputError(Fault(file=str(html), message="exists; --force replaces it"))
    if (html.parent / RUN).exists() and html.name != VIEWER:
        raise InputError(Fault(file=str(html), message=f"a page in a results folder is {VIEWER}, got {html.name!r}"))
    inside(html.parent, html.name, file="--html")
    hold(html)
    title, footer = _about(path)
    try:
        write_page(path, html, title=title, footer=footer)
    except OSError as e:
        if e.errno is not None:  # the machine's, no answer of the viewer
            raise
        raise InputError(Fault(file=str(html), message=str(e))) from None
    console.tell(f"Written: {html}, {html.stat().st_size / 1e6:.0f} MB. A double click opens it.")


def _about(path: Path) -> tuple[str, str]:
    """Title of a recording and what it rests on, as far as the folder says."""
    from rollover.assessment.results import RUN, versions

    try:
        found = read_json(path.parent / RUN)
        own, scenario, title = found["versions"]["rollover"], found["scenario_hash"], found["title"]
    except (OSError, ValueError, KeyError, TypeError):  # no run's folder
        return path.stem, f"rollover {versions()['rollover']}."
    return str(title), f"rollover {own}, scenario {scenario}."

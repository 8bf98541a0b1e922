"""What a frame alone answers, on standard output."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from rollover.cli.console import terminal
from rollover.system.errors import excerpt


def rops(answer: Mapping[str, Any], folder: str) -> None:
    """Loads, hinges in their order and verdicts of a frame alone."""
    from rollover.assessment.stand_results import findings
    from viz.pages.rops import headline

    out = terminal.out()
    out.print(
        f"{excerpt(answer['vehicle'])}, {answer['mass']:g} kg; frame of {answer['frame_mass']:.1f} kg", style="bold"
    )
    out.print(headline(answer), style="bold")
    for c in answer["criteria"]:
        style = {"met": "green", "not met": "bold red"}.get(c["verdict"], "yellow")
        out.print(
            f"{c['requirement']['standard']}, {c['requirement']['name']}: {c['verdict']} ({c['note']})", style=style
        )
    out.print(f"{answer['elements']} elements, {answer['segments']} to a member; feet: {answer['base']}.")
    found = findings(answer["tests"])
    if found is not None:
        out.print(terminal.table(found.headings, found.rows, words=found.words))
    for e in answer["tests"]:
        for h in e.get("hinges", []):
            out.print(
                f"{e['name']}: hinge in {h['member']}, {h['place']:.2f} of {h['of']:.2f} m, at "
                f"{1e3 * h['deflection']:.0f} mm and {1e-3 * h['force']:.1f} kN"
            )
        if e.get("mechanism_force") is not None:
            out.print(f"{e['name']}: mechanism at {1e-3 * e['mechanism_force']:.1f} kN")
        for c in e.get("connections", []):
            at = c["failed"]
            more = (
                "" if at is None else f": gives way at {1e3 * at['deflection']:.0f} mm and {1e-3 * at['force']:.1f} kN"
            )
            out.print(f"{e['name']}: use of {c['name']} {c['use']:.2f}{more}", style=None if at is None else "bold red")
    for said in answer["warnings"]:
        out.print(said, style="yellow")
    out.print(f"Results: {folder}")

"""The page of an identified ground law: stiffness over depth as measured and by the law, coefficients, what is open."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from ground.law import REFERENCE_AREA, REFERENCE_MASS, GroundLaw, along
from rollover.system.numbers import percent
from viz.content.blocks import Block, Cell, Figure, Footer, Headline, Note, Section, Table, as_sentence
from viz.figures import plots
from viz.figures.plots import Curve
from viz.pages.page import render

SURE = 0.2  # of the stiffness: what is known less surely takes no part in the regression, and is not drawn


def headline(numbers: Mapping[str, Any]) -> str:
    """How much of the law the drops determine; of forms that compete, which one predicts best."""
    count = len(numbers["recordings"])
    drops = f"{count} drop{'s' * (count != 1)}"
    if "forms" in numbers:
        best = _best(numbers)
        errors = [best["held_out_deceleration_error"], best["held_out_depth_error"]]
        missed = " and ".join(f"{percent(e)} of {of}" for e, of in zip(errors, ("deceleration", "depth"), strict=True))
        return f"Law {numbers['law']} from {drops}: the form {best['name']} misses {missed} of drops left out"
    found = [c["origin"] == "data" for c in numbers["coefficients"]]
    return f"Law {numbers['law']} from {drops}: {sum(found)} of {len(found)} coefficients are determined"


def _best(numbers: Mapping[str, Any]) -> Mapping[str, Any]:
    """The form that was chosen."""
    return next(f for f in numbers["forms"] if f["name"] == numbers["chosen"])


def page(
    law: GroundLaw,
    numbers: Mapping[str, Any],
    *,
    refused: Sequence[str] = (),
    remarks: Sequence[str] = (),
    command: str,
    versions: Mapping[str, str],
) -> str:
    """HTML of a law; `numbers` is what identify.json says, `refused` and `remarks` are sentences."""
    given = _best(numbers)["numbers"] if "forms" in numbers else numbers["coefficients"]
    rows = [[c["name"], f"{c['value']:.5g}", _end(c["low"]), _end(c["high"]), _origin(c)] for c in given]
    columns = ["coefficient", "value", "95 % from", "to", ""]
    open_ = any(c.get("origin", "data") != "data" for c in given)
    blocks: list[Block] = [Note(text=f"{as_sentence(text)}.", warning=True) for text in refused]
    blocks += _curves(law, numbers)
    blocks.append(Section(title="Coefficients", blocks=[Table(columns=columns, rows=rows, numeric=(1, 2, 3))]))
    blocks += _forms(numbers)
    names = tuple(f"{c['name']}:" for c in given)  # what is said of them stands in the table
    blocks += [Note(text=f"{as_sentence(text)}.") for text in remarks if not text.startswith(names)]
    return render(
        title="Ground law from recorded drops",
        subtitle="Rollover load study: identification",
        headline=Headline(
            sentence=f"{headline(numbers)}.",
            detail="A scenario names the soil file beside this page: ground.law.",
            state="warn" if open_ or refused else "pass",
        ),
        blocks=blocks,
        footer=Footer(command=command, versions=versions),
    )


def _end(value: float | None) -> str:
    return "not bounded" if value is None else f"{value:.5g}"


def _origin(c: Mapping[str, Any]) -> Cell:
    if "origin" not in c:  # of a form, whose numbers are what its interval says
        return Cell("")
    if c["origin"] == "data":
        return Cell("determined", "pass")
    return Cell(f"not determined: {c['why']}", "warn")


def _forms(numbers: Mapping[str, Any]) -> list[Block]:
    """Forms that competed: how well each follows the drops it was fitted to, and those that were left out."""
    rows: list[list[str | Cell]] = [
        [
            Cell(f["name"], "pass") if f["name"] == numbers["chosen"] else f["name"],
            f["statement"],
            percent(f["residual"]),
            f"{f['log_scatter']:.2f}",
            percent(f["held_out_deceleration_error"]),
            percent(f["held_out_depth_error"]),
        ]
        for f in numbers.get("forms", ())
    ]
    if not rows:
        return []
    columns = ["form", "", "RMS / largest force", "scatter of ln F", "held-out deceleration", "held-out depth"]
    return [Section(title="Forms that competed", blocks=[Table(columns=columns, rows=rows, numeric=(2, 3, 4, 5))])]


def _curves(law: GroundLaw, numbers: Mapping[str, Any]) -> list[Block]:
    """Secant stiffness F/z of each drop, brought to the reference area, with the law at its speed and mass."""
    curves: list[Curve] = []
    for k, drop in enumerate(d for d in numbers["drops"] if d.get("stiffness")):
        z, stiffness, sd = (np.array(drop["stiffness"][name]) for name in ("depth", "value", "sd"))
        sure = (stiffness > 0.0) & (sd < SURE * stiffness)
        if not np.any(sure):
            continue
        scale, role = 1e-3 * REFERENCE_AREA / drop["area"], plots.CYCLE[k % len(plots.CYCLE)]
        x = 1e3 * z[sure]
        name = f"{drop['name']}, {drop['speed']:.3g} m/s"
        curves.append(Curve(name=name, x=x, y=scale * stiffness[sure], role=role, spread=scale * sd[sure]))
        mass = REFERENCE_MASS if numbers.get("law_mass") == "reference" else drop["mass"]
        force = along(law, z[sure], np.zeros(sure.sum()), speed=drop["speed"], mass=mass)
        curves.append(
            Curve(
                name="_" if k else "law, at the speed of each drop",
                x=x,
                y=1e-3 * force / z[sure],
                role="ink",
                thin=True,
            )
        )
    if not curves:
        return []
    svg = plots.xy(curves, across="sinkage, mm", label="stiffness F/z, kN/m")
    text = "Stiffness of the ground over sinkage, as measured, with one standard deviation, and by the law (thin)."
    return [Section(title="Stiffness", blocks=[Figure(svg=svg, caption=text)])]

"""`rollover plan`: what a test would show, before it is made."""

from __future__ import annotations

import math
import shlex
from collections.abc import Sequence
from pathlib import Path
from typing import Annotated, Any

import typer

from rollover.cli.commands.common import (
    AsJson,
    Force,
    Setting,
    answering,
    app,
    hand_out,
    manual,
    noises,
    scenario_with,
)
from rollover.system.errors import Fault, InputError


@app.command(
    "plan",
    epilog=manual(
        "plan drop_test --between soil-viscous-damping,soil-inertial-drag --tolerance 0.02",
        "plan drop_test --vary initiation.speed=1,2,3.5 --sensor ground/force_normal --noise ground/force_normal=20",
        writes="plan.json, report.html.",
    ),
)
@answering
def plan_(
    scenario: Annotated[str, typer.Argument(help="A scenario file, or the name of a shipped one.")],
    between: Annotated[
        list[str] | None,
        typer.Option(
            metavar="EFFECT,EFFECT",
            help="Effects to be told apart, one of a sensor as ID:CHANNEL; may be repeated",
            show_default="each from each",
        ),
    ] = None,
    sensor: Annotated[
        list[str] | None,
        typer.Option(metavar="CHANNEL", help="A recorded channel; may be repeated", show_default="the usual ones"),
    ] = None,
    noise: Annotated[
        list[str] | None,
        typer.Option(
            metavar="SHARE or CHANNEL=SIGMA",
            help="White noise, 1 sigma: a share of each channel's range, or SI for one; may be repeated",
            show_default="0.005",
        ),
    ] = None,
    rate: Annotated[float, typer.Option(help="Sampling rate, Hz.", min=10.0, max=1e5)] = 1000.0,
    tolerance: Annotated[
        float, typer.Option(help="Share of a channel's range by which a model may miss it.", min=0.0, max=0.5)
    ] = 0.0,
    vary: Annotated[
        str | None,
        typer.Option(
            metavar="PATH=VALUE,VALUE",
            help="A drop for each value is planned",
            show_default="one, as the scenario says",
        ),
    ] = None,
    uncertain: Annotated[
        list[str] | None,
        typer.Option(metavar="PATH=SIGMA", help="1 sigma of a value that is not known exactly; may be repeated."),
    ] = None,
    set_: Setting = None,
    out: Annotated[Path | None, typer.Option(help="Results folder", show_default="out/plan/NAME")] = None,
    force: Force = False,
    as_json: AsJson = False,
) -> None:
    """Say before a drop test which effects it would show, which it would tell apart, and what to measure beside."""
    from rollover.assessment import results
    from rollover.cli import console
    from rollover.comparison.synthesis import DROP
    from rollover.diagnosis.planning.plan import FILES, FORMAT, JSON, PAGE, json_of, plan, usual_noise
    from rollover.diagnosis.planning.planned import Instruments
    from rollover.dynamics.drop_test import unfit
    from rollover.spec import document

    path, chosen = scenario_with(scenario, set_)
    if reason := unfit(chosen):
        raise InputError(Fault(file=str(path), message=f"{reason}; drops of a striker on level ground can be planned"))
    share, sigmas = noises(noise or [])
    if any(sigma == 0.0 for sigma in (share, *sigmas.values())):
        raise InputError(Fault(file="--noise", message="no noise at all, got 0; a value above 0"))
    known = usual_noise(chosen, sensor or [], share, sigmas, DROP)
    instruments = Instruments(noise=known, rate=rate, tolerance=tolerance, uncertain=_sigmas(uncertain or []))
    conditions, pairs = _conditions(vary), _pairs(between or [])
    folder = out or Path("out", "plan", path.stem)
    about: dict[str, Any] = {
        "scenario_hash": document.content_hash(chosen),
        **chosen.own_code,
        "between": [list(pair) for pair in pairs],
        "noise": dict(known),
        "rate": rate,
        "tolerance": tolerance,
        "conditions": conditions,
        "uncertain": dict(instruments.uncertain),
    }
    about["origin"] = results.origin(path, folder, set_ or [])
    results.claim_report(folder, FORMAT, about, FILES, force=force, say=console.say)
    found = plan(chosen, conditions=conditions, instruments=instruments, between=pairs, say=console.say)
    answer = json_of(found, about)
    from viz.pages.plan import page

    given = [("--between", between), ("--sensor", sensor), ("--noise", noise), ("--uncertain", uncertain)]
    options = [word for name, texts in given for text in texts or [] for word in (name, text)]
    options += ["--rate", f"{rate:g}", "--tolerance", f"{tolerance:g}", *(["--vary", vary] if vary else [])]
    options += [word for text in set_ or [] for word in ("--set", text)]
    command = " ".join(map(shlex.quote, ["rollover", "plan", scenario, *options]))
    text = page(
        found,
        title=chosen.title,
        command=command,
        scenario_hash=about["scenario_hash"],
        versions=results.versions(),
    )
    hand_out(answer, text, folder, (JSON, PAGE), as_json=as_json, show=lambda: console.plan(found, str(folder)))


def _pairs(given: Sequence[str]) -> list[tuple[str, str]]:
    """Pairs of effects. Raises `InputError`."""
    found = []
    for text in given:
        names = [name.strip() for name in text.split(",")]
        if len(names) != 2 or not all(names) or names[0] == names[1]:
            message = f"not two effects, got {text!r}; EFFECT,EFFECT of `rollover list effects`"
            raise InputError(Fault(file="--between", message=message))
        found.append((names[0], names[1]))
    return list(dict.fromkeys(found))


def _conditions(vary: str | None) -> list[dict[str, Any]]:
    """Conditions of the drops that are planned: one for each value. Raises `InputError`."""
    if vary is None:
        return [{}]
    path, equals, values = vary.partition("=")
    if not equals or not path.strip() or not values.strip():
        message = f"not a path with values, got {vary!r}; PATH=VALUE,VALUE"
        raise InputError(Fault(file="--vary", message=message))
    each = [{path.strip(): _number(value, "--vary", path)} for value in values.split(",")]
    if any(each.count(one) > 1 for one in each):
        raise InputError(
            Fault(file="--vary", path=path, message=f"a value given twice, got {values!r}; once is allowed")
        )
    return each


def _sigmas(given: Sequence[str]) -> dict[str, float]:
    """Standard deviations by path. Raises `InputError`."""
    found: dict[str, float] = {}
    for text in given:
        path, _, value = text.partition("=")
        sigma = _number(value, "--uncertain", path)
        if sigma <= 0.0 or path in found:
            wrong = "given twice" if path in found else "not a standard deviation"
            message = f"{wrong}, got {text!r}; PATH=SIGMA above 0, once"
            raise InputError(Fault(file="--uncertain", path=path, message=message))
        found[path] = sigma
    return found


def _number(text: str, option: str, path: str) -> float:
    """A finite number. Raises `InputError`."""
    try:
        value = float(text)
    except ValueError:
        value = math.nan
    if not math.isfinite(value):
        raise InputError(Fault(file=option, path=path, message=f"not a number, got {text!r}; PATH=NUMBER"))
    return value

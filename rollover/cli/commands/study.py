"""`rollover study`: many cases of one scenario, resumable, here or on a cluster."""

from __future__ import annotations

import json
import shlex
from collections.abc import Mapping
from enum import StrEnum
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from rollover.cli.commands.common import (
    FAILED,
    AsJson,
    Force,
    Setting,
    answering,
    app,
    manual,
    settings,
)
from rollover.system.arguments import LONGEST, MOST_MEMORY, MOST_WORKERS

if TYPE_CHECKING:
    from rollover.studies.runner import Conducted


class Retry(StrEnum):
    """Which kept cases are run again."""

    failed = "failed"


@app.command(
    epilog=manual(
        "study my_study.yaml --workers 4",
        "study soil_side_overturn --set initiation.excess_deg=6 --out out/pushed",
        writes="study.json, cases and their table with a row for each, failed ones too, report.html, the worst case as "
        "a scenario. Run again, it resumes.",
    )
)
@answering
def study(
    name: Annotated[str, typer.Argument(help="A study file, or the name of a shipped one.", metavar="STUDY")],
    set_: Setting = None,
    out: Annotated[Path | None, typer.Option(help="Results folder", show_default="out/study/NAME")] = None,
    workers: Annotated[
        int | None,
        typer.Option(help="Cases at once; 0 for this process", show_default="number of cores", min=0, max=MOST_WORKERS),
    ] = None,
    scheduler: Annotated[
        str, typer.Option(metavar="ADDRESS", help="Of a dask scheduler: tcp://HOST:PORT, local or slurm.")
    ] = "",
    retry: Annotated[Retry | None, typer.Option(help="Run failed cases again.")] = None,
    time_limit: Annotated[float, typer.Option(help="Wall time for each case, s.", min=0.1, max=LONGEST)] = 600.0,
    memory_limit: Annotated[
        float, typer.Option(help="Memory that each case may take, MB.", min=1.0, max=1e-6 * MOST_MEMORY)
    ] = 4000.0,
    force: Force = False,
    as_json: AsJson = False,
) -> None:
    """Run what a study lacks, then give ranges, quantiles, exceedance probability, sensitivities, worst case."""
    from ground.compiled import is_warm
    from rollover import studies
    from rollover.assessment import results
    from rollover.cli import console
    from rollover.studies.carry_out import prepared
    from rollover.studies.runner import Way

    path = studies.find(name)
    ready = prepared(path, out, changes=settings(set_ or []), given=set_ or [], scheduler=scheduler, force=force)
    chosen = ready.study
    for line in chosen.scenario.idle:
        console.say(f"{path}: scenario: {line}")
    way = Way(
        workers=workers,
        scheduler=scheduler,
        time_limit=time_limit,
        memory_limit=1e6 * memory_limit,
        retry="failed" if retry else "",
    )
    cold = chosen.simulator == "full" and not is_warm(chosen.scenario.of_many().integrator)
    words = ["rollover", "study", name, *(w for s in set_ or [] for w in ("--set", s))]
    command = " ".join(map(shlex.quote, [*words, *(["--out", str(out)] if out else [])]))

    def drawn(done: Conducted, report: Mapping[str, Any]) -> str:
        from viz.pages.study import page

        return page(chosen, done, report, command=command)

    with console.compiling(cold):
        report = ready.carried_out(way, page=drawn, watch=console.counting, say=console.say)
    if as_json:
        print(json.dumps(results.plain(report), indent=2))
    else:
        from viz.pages.study import headline

        console.tell("\n".join([headline(report).sentence, *sentences(report), f"Results: {ready.folder}"]))
    if not report["cases"]["done"]:
        console.say(f"{path}: every case failed; the first: {report['failures'][0]['sentence']}")
        raise typer.Exit(FAILED)


def _made(report: dict[str, Any]) -> list[str]:
    """What was run, of what, by which integrator, and how far Exudyn's cases lie from it."""
    from rollover.studies import reference

    n = report["cases"]
    lines = [report["title"], *([report["differs"]] if report.get("differs") else [])]
    lines += [f"Set: {', '.join(report['set'])}"] if report.get("set") else []
    made_by = report.get("integrator", "drop")
    ran = f"{report['ran']} run now" + ("" if made_by == "drop" else f" by {made_by}")
    lines.append(f"{n['done']} of {n['all']} cases done, {n['failed']} failed; {ran}")
    said = reference.sentence(report.get("reference_check"))
    return [*lines, said] if said else lines


def _limit(e: Mapping[str, Any], unit: str) -> str:
    """The limit of an output, for people."""
    from rollover.cli.console import readable
    from viz.pages.report import series_unit

    return f"{readable(e['limit'], unit)} {series_unit(unit)[0].removeprefix('1')}".rstrip()


def sentences(report: dict[str, Any]) -> list[str]:
    """The report in a few lines."""
    from rollover.assessment.ledger import of_cases
    from rollover.cli.console import readable
    from rollover.studies import failures
    from viz.pages.report import series_unit

    lines = _made(report)
    for each in report["outputs"]:
        unit = series_unit(each["unit"])[0]
        lines.append(f"{each['name']}, {unit}")
        if not each["cases"]:
            lines.append("  no case has it")
        elif not report["drawn"]:
            least, most = (readable(each[key], each["unit"]) for key in ("least", "largest"))
            lines.append(f"  {least} to {most} over {each['cases']} cases")
        for q in each["quantiles"]:
            low, value, high = (readable(q[key], each["unit"]) for key in ("low", "value", "high"))
            lines.append(f"  {100.0 * q['q']:5.4g} %  {value:>9}   ({low} to {high})")
        if (e := each["exceedance"]) is not None:
            span = f"({100.0 * e['low']:.3g} to {100.0 * e['high']:.3g} %)"
            lines.append(
                f"  probability {e['beyond']} {_limit(e, each['unit'])}: {100.0 * e['probability']:.3g} %  {span}"
            )
            if e["failed"]:
                none, every = f"{100.0 * e['least']:.3g} %", f"{100.0 * e['most']:.3g} %"
                span = f"({100.0 * e['low_of_all']:.3g} to {100.0 * e['high_of_all']:.3g} %)"
                low = f"  with {e['failed']} failed cases as not {e['beyond']}: {none}"
                lines.append(f"{low}, as {e['beyond']}: {every}  {span}")
        if (e := each["beyond_limit"]) is not None:
            failed = f", {e['failed']} failed" if e["failed"] else ""
            lines.append(f"  {e['beyond']} {_limit(e, each['unit'])}: {e['hits']} of {e['cases']} cases{failed}")
        for s in each["sobol"]:
            total = f"total {s['total']:.2f} +- {s['total_half_width']:.2f}"
            lines.append(f"  {s['axis']}: first {s['first']:.2f} +- {s['first_half_width']:.2f}, {total}")
        for m in each["morris"]:
            lines.append(f"  {m['axis']}: mean magnitude of effects {readable(m['magnitude'], each['unit'])}")
    if (r := report["reliability"]) and "reason" not in r:
        lines.append(
            f"Beyond the limit by importance sampling {r['probability']:.3g} ({r['low']:.3g} to {r['high']:.3g}), "
            f"FORM {r['form_probability']:.3g}, beta {r['beta']:.3g}"
        )
    if (ledger := report["ledger"])["open"]:
        lines.append(of_cases(ledger))
    if report["from_rest"]:
        lines.append(f"{report['from_rest']} cases had no static balance and began from rest")
    if said := failures.sentence(report["failures_along"]):
        lines.append(said)
    lines += [f"{f['cases']} failed ({f['failure']}): {f['sentence']}" for f in report["failures"][:5]]
    if (w := report["worst"]) is not None:
        lines.append(f"Worst case: point {w['point']}, written to {w['file']}")
    return lines

"""`rollover study`: many cases of one scenario, resumable, here or on a cluster."""

from __future__ import annotations

import json
import shlex
import time
from enum import StrEnum
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from rollover.cli.commands.common import COMPILING, FAILED, AsJson, Force, answering, app, manual

if TYPE_CHECKING:
    from rollover.studies.runner import Builder, Conducted, Progress, Way
    from rollover.studies.study import Study


class Retry(StrEnum):
    """Which kept cases are run again."""

    failed = "failed"


@app.command(
    epilog=manual(
        "study my_study.yaml --workers 4",
        writes="study.json, cases and their table with a row for each, failed ones too, report.html, the worst case as "
        "a scenario. Run again, it resumes.",
    )
)
@answering
def study(
    name: Annotated[str, typer.Argument(help="A study file, or the name of a shipped one.", metavar="STUDY")],
    out: Annotated[Path | None, typer.Option(help="Results folder", show_default="out/study/NAME")] = None,
    workers: Annotated[
        int | None, typer.Option(help="Cases at once; 0 for this process", show_default="number of cores", min=0)
    ] = None,
    scheduler: Annotated[
        str, typer.Option(metavar="ADDRESS", help="Of a dask scheduler: tcp://HOST:PORT, local or slurm.")
    ] = "",
    retry: Annotated[Retry | None, typer.Option(help="Run failed cases again.")] = None,
    time_limit: Annotated[float, typer.Option(help="Wall time for each case, s.", min=0.1)] = 600.0,
    memory_limit: Annotated[float, typer.Option(help="Memory that each case may take, MB.", min=1.0)] = 4000.0,
    force: Force = False,
    as_json: AsJson = False,
) -> None:
    """Run what a study lacks, then give ranges, quantiles, exceedance probability, sensitivities, worst case."""
    from ground.compiled import is_warm
    from rollover import studies
    from rollover.cli import console
    from rollover.studies import case_store, cluster, reliability
    from rollover.studies.design import points
    from rollover.studies.runner import Builder, Way, conduct
    from rollover.studies.summary import answers

    path = studies.find(name)
    chosen = studies.load(path)
    points(chosen)  # reads the plan's table as well, before anything is written
    if chosen.reliability is not None:
        reliability.installed()
    if scheduler:
        cluster.installed(scheduler)
    folder = out or Path("out", "study", path.stem)
    target = case_store.claim(folder, path.stem, force=force)
    way = Way(
        workers=workers,
        scheduler=scheduler,
        time_limit=time_limit,
        memory_limit=1e6 * memory_limit,
        retry="failed" if retry else "",
    )
    if not is_warm() and chosen.simulator == "full":
        console.say(f"Compiling the contact kernels, once per installation: about {COMPILING} s.")
    command = " ".join(map(shlex.quote, ["rollover", "study", name, *(["--out", str(out)] if out else [])]))
    with case_store.locked(target):
        begin(target, path.stem, chosen)
        began = time.perf_counter()
        with console.counting("cases") as show:
            done = conduct(chosen, target, way, lambda p: show(p.done, p.of, _note(p)))
        ran = time.perf_counter() - began
        builder = Builder(chosen)
        account = {**_head(path.stem, chosen, "done"), **answers(chosen, done), "ran": done.ran}
        account["kept"] = len(set(done.keys)) - done.ran
        account["reliability"] = _reliability(chosen, builder, target, way)
        account["worst"] = write_worst(target, chosen, builder, account)
        account["run_time"] = ran
        _finish(target, chosen, done, account, command)
    if as_json:
        print(json.dumps(_plain(account), indent=2))
    else:
        console.tell("\n".join([*sentences(account), f"Results: {folder}"]))
    if not account["cases"]["done"]:
        console.say(f"{path}: every case failed; the first: {account['failures'][0]['sentence']}")
        raise typer.Exit(FAILED)


def begin(target: Path, name: str, chosen: Study) -> None:
    """Mark the folder as this study's, so that it can be gone on with after whatever happens."""
    from rollover.spec import document
    from rollover.studies import case_store
    from rollover.system.writing import sweep

    target.mkdir(parents=True, exist_ok=True)
    sweep(target)  # what a process left that was killed
    head = f"{chosen.title}\nEvery value of the study beside this file."
    case_store.put_text(target / case_store.STUDY, document.dump(chosen, head))
    if not (target / case_store.ACCOUNT).exists() or _name_of(target / case_store.ACCOUNT) != name:
        case_store.put_text(target / case_store.ACCOUNT, json.dumps(_head(name, chosen, "running"), indent=2) + "\n")


def _name_of(account: Path) -> str:
    try:
        return str(json.loads(account.read_text(encoding="utf-8")).get("name", ""))
    except (OSError, ValueError):
        return ""


def _head(name: str, chosen: Study, status: str) -> dict[str, Any]:
    from rollover.assessment import results
    from rollover.assessment.shipped import origin
    from rollover.spec import document
    from rollover.studies import case_store

    made_from = origin(chosen.scenario)
    return {
        "format": case_store.FORMAT,
        "name": name,
        "title": chosen.title,
        "differs": made_from.in_words if made_from else "",
        "status": status,
        "scenario_hash": document.content_hash(chosen.scenario),
        **chosen.scenario.own_code,
        "plan": chosen.plan.kind,
        "versions": results.versions(),
    }


def _note(p: Progress) -> str:
    failed = f"{p.failed} failed, " if p.failed else ""
    return f"{failed}{60.0 * p.rate:.3g} a minute, {_span(p.left)} left" if p.rate > 0.0 else failed.rstrip(", ")


def _span(seconds: float) -> str:
    if seconds < 90.0:
        return f"{seconds:.0f} s"
    return f"{seconds / 60.0:.0f} min" if seconds < 5400.0 else f"{seconds / 3600.0:.1f} h"


def _reliability(chosen: Study, builder: Builder, target: Path, way: Way) -> dict[str, Any] | None:
    """FORM and importance sampling through the same store: what was run once is not run again."""
    if chosen.reliability is None:
        return None
    import numpy as np
    from scipy.special import ndtr

    from rollover.cli import console
    from rollover.studies import reliability
    from rollover.studies.design import from_unit
    from rollover.studies.runner import evaluate
    from rollover.studies.summary import values_of

    output = chosen.outputs[0]
    limit = output.limit
    assert limit is not None

    def limit_state(u: Any) -> Any:
        with console.counting("cases about the design point") as show:
            found = from_unit(chosen, ndtr(u))
            rows = evaluate(builder, target, way, found, lambda p: show(p.done, p.of, _note(p)))
        return output.worst_sign * (values_of(output, rows) - limit) / max(abs(limit), 1e-12)

    names = [axis.name for axis in chosen.axes]
    try:
        found = reliability.form_and_importance_sampling(limit_state, names, chosen.reliability, chosen.confidence)
    except reliability.NoDesignPointError as e:
        console.say(f"No reliability: {e}")
        return {"reason": str(e)}
    point = from_unit(chosen, ndtr(np.array([[found["design_point"][n] for n in names]]))).row(0)
    return {**found, "output": output.name, "limit": limit, "design_values": point}


def write_worst(target: Path, chosen: Study, builder: Builder, account: dict[str, Any]) -> dict[str, Any] | None:
    """Write the worst case of the first output as a scenario, and say what it is."""
    from rollover.spec import document
    from rollover.studies import case_store

    worst = account["outputs"][0]["worst"]
    if worst is None:
        (target / case_store.WORST).unlink(missing_ok=True)
        return None
    output = chosen.outputs[0]
    said = ", ".join(f"{name} = {value}" for name, value in worst["axes"].items())
    scenario = builder.scenario(worst["axes"])
    head = (
        f"Worst case of the study {account['name']}: point {worst['point']}, {said}.\n"
        f"There {output.name} is {worst['value']!r} {output.unit}; run it again: rollover run {case_store.WORST}"
    )
    if chosen.simulator == "drop":
        head += "\nThe study dropped it by itself; the full run differs by the integration error."
    case_store.put_text(target / case_store.WORST, document.dump(scenario, head))
    return {"output": output.name, "file": case_store.WORST, "scenario_hash": document.content_hash(scenario), **worst}


def _finish(target: Path, chosen: Study, done: Conducted, account: dict[str, Any], command: str) -> None:
    from rollover.studies import case_store
    from viz.pages.study import page

    case_store.put_text(target / case_store.PAGE, page(chosen, done, _plain(account), command=command))
    case_store.put_text(target / case_store.ACCOUNT, json.dumps(_plain(account), indent=2, allow_nan=False) + "\n")


def _plain(account: dict[str, Any]) -> Any:
    from rollover.assessment import results

    return results.plain(account)


def sentences(account: dict[str, Any]) -> list[str]:
    """The account in a few lines."""
    from rollover.assessment.ledger import of_cases
    from rollover.cli.console import readable
    from rollover.studies import failures
    from viz.pages.report import series_unit

    n = account["cases"]
    lines = [account["title"], *([account["differs"]] if account.get("differs") else [])]
    lines += [f"{n['done']} of {n['all']} cases done, {n['failed']} failed; {account['ran']} run now"]
    for each in account["outputs"]:
        unit = series_unit(each["unit"])[0]
        lines.append(f"{each['name']}, {unit}")
        if not each["cases"]:
            lines.append("  no case has it")
        elif not account["drawn"]:
            least, most = (readable(each[key], each["unit"]) for key in ("least", "largest"))
            lines.append(f"  {least} to {most} over {each['cases']} cases")
        for q in each["quantiles"]:
            low, value, high = (readable(q[key], each["unit"]) for key in ("low", "value", "high"))
            lines.append(f"  {100.0 * q['q']:5.4g} %  {value:>9}   ({low} to {high})")
        if (e := each["exceedance"]) is not None:
            limit = readable(e["limit"], each["unit"])
            span = f"({100.0 * e['low']:.3g} to {100.0 * e['high']:.3g} %)"
            lines.append(f"  probability {e['beyond']} {limit}: {100.0 * e['probability']:.3g} %  {span}")
            if e["failed"]:
                none, every = f"{100.0 * e['least']:.3g} %", f"{100.0 * e['most']:.3g} %"
                span = f"({100.0 * e['low_of_all']:.3g} to {100.0 * e['high_of_all']:.3g} %)"
                low = f"  with {e['failed']} failed cases as not {e['beyond']}: {none}"
                lines.append(f"{low}, as {e['beyond']}: {every}  {span}")
        if (e := each["beyond_limit"]) is not None:
            limit, failed = readable(e["limit"], each["unit"]), f", {e['failed']} failed" if e["failed"] else ""
            lines.append(f"  {e['beyond']} {limit}: {e['hits']} of {e['cases']} cases{failed}")
        for s in each["sobol"]:
            total = f"total {s['total']:.2f} +- {s['total_half_width']:.2f}"
            lines.append(f"  {s['axis']}: first {s['first']:.2f} +- {s['first_half_width']:.2f}, {total}")
        for m in each["morris"]:
            lines.append(f"  {m['axis']}: mean magnitude of effects {readable(m['magnitude'], each['unit'])}")
    if (r := account["reliability"]) and "reason" not in r:
        lines.append(
            f"Beyond the limit by importance sampling {r['probability']:.3g} ({r['low']:.3g} to {r['high']:.3g}), "
            f"FORM {r['form_probability']:.3g}, beta {r['beta']:.3g}"
        )
    if (ledger := account["ledger"])["open"]:
        lines.append(of_cases(ledger))
    if account["from_rest"]:
        lines.append(f"{account['from_rest']} cases had no static balance and began from rest")
    if said := failures.sentence(account["failures_along"]):
        lines.append(said)
    lines += [f"{f['cases']} failed ({f['failure']}): {f['sentence']}" for f in account["failures"][:5]]
    if (w := account["worst"]) is not None:
        lines.append(f"Worst case: point {w['point']}, written to {w['file']}")
    return lines

"""`rollover prove`: the blind proof of the diagnosis."""

from __future__ import annotations

import json
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from rollover.cli.commands.common import FAILED, AsJson, Force, answering, app, manual
from rollover.cli.commands.sealing import Order, write_sealed_cases
from rollover.system.arguments import LONGEST, MOST_CASES, MOST_SEED, MOST_WORKERS
from rollover.system.errors import Fault, InputError

if TYPE_CHECKING:
    from rollover.proof.commitment import Seal

JSON, SEAL, TRUTH, DIAGNOSES, PAGE = "prove.json", "seal.json", "truth.json", "diagnoses.jsonl", "report.html"
REPORT_FILES = (JSON, SEAL, TRUTH, DIAGNOSES, PAGE)


@app.command(
    epilog=manual(
        "prove --cases 50 --seed 1",
        "prove --cases 20 --export out/cases",
        writes="prove.json, report.html, seal.json, truth.json, diagnoses.jsonl; with --export sealed cases. "
        "Run again after an interrupt, it goes on.",
        status="3 every diagnosis failed",
    )
)
@answering
def prove(
    cases: Annotated[int, typer.Option(help="How many concealed campaigns of tests.", min=1, max=MOST_CASES)] = 50,
    seed: Annotated[
        int | None,
        typer.Option(
            help="Another seed, other cases; the same seed, the same ones.",
            show_default="1; with --export one that nobody knows",
            min=0,
            max=MOST_SEED,
        ),
    ] = None,
    export: Annotated[
        Path | None,
        typer.Option(metavar="DIR", help="Diagnose nothing: write the cases here for others, for `rollover score`."),
    ] = None,
    truth: Annotated[
        Path | None, typer.Option(metavar="FILE", help="Of --export: the truth.", show_default="DIR-truth.json")
    ] = None,
    out: Annotated[Path, typer.Option(help="Folder of the full report.")] = Path("out/prove"),
    workers: Annotated[
        int | None, typer.Option(help="Cases at once", show_default="number of cores", min=0, max=MOST_WORKERS)
    ] = None,
    rig: Annotated[
        str | None,
        typer.Option(
            help="What is tested: drop, or overturn (minutes a case).",
            show_default="drop; overturn with --kinds foreign-engine",
        ),
    ] = None,
    effects: Annotated[
        list[str] | None, typer.Option(metavar="ID", help="Only cases about this effect; may be repeated.")
    ] = None,
    kinds: Annotated[
        list[str] | None,
        typer.Option(
            metavar="KIND",
            help="Only null, decoy, negligible, single, pair, outside, scatter, other-form, foreign-form (an effect by "
            "another law of the literature), background (nothing but a background), foreign-engine (an effect in "
            "overturns by another engine, whose background is that engine alone); may be repeated.",
        ),
    ] = None,
    background: Annotated[
        str | None,
        typer.Option(
            metavar="SHARE",
            help="A smooth discrepancy on every case: rms share of the force's range (0.03), or drawn (0.01 to 0.1); "
            "drawn with --kinds background.",
        ),
    ] = None,
    time_limit: Annotated[float, typer.Option(help="Wall time for each diagnosis, s.", min=1.0, max=LONGEST)] = 600.0,
    force: Force = False,
    as_json: AsJson = False,
) -> None:
    """Make concealed cases (drops by an independent solver), seal the truth, diagnose them, open the seal and score."""
    from rollover.assessment import results
    from rollover.cli import console
    from rollover.proof import kept as kept_cases
    from rollover.proof import runner
    from rollover.proof.kept import Kept
    from rollover.system import own_code
    from rollover.system.writing import CAMPAIGN, notes

    rig = rig or ("overturn" if "foreign-engine" in (kinds or []) else "drop")
    if export is None and truth is not None:
        raise InputError(Fault(file="--truth", message=f"without --export, got {truth}; --export DIR beside it"))
    if export is not None:
        from rollover.proof.sealed_cases import truth_beside

        write_sealed_cases(
            Order(
                cases=cases,
                seed=seed,
                rig=rig,
                kinds=kinds or [],
                effects=effects or [],
                background=None if background is None else _share_of(background),
                workers=workers,
            ),
            export,
            truth or truth_beside(export),
            force=force,
            as_json=as_json,
        )
        return
    seed = 1 if seed is None else seed
    about = {"cases": cases, "seed": seed, "kinds": kinds or [], "effects": effects or []}
    about |= {"rig": rig} if rig != "drop" else {}
    about |= {"background": _share_of(background)} if background is not None else {}
    results.claim_report(out, runner.FORMAT, about, REPORT_FILES, force=force)

    code = {"package": kept_cases.code(), **{kind: own_code.hashes(kind) for kind in own_code.KINDS}}
    asked = {"rig": rig, "background": None, **about, "time_limit": time_limit}
    # beside the results folder, which is written whole or not at all: what came of the cases so far
    kept = Kept(folder=notes(out, CAMPAIGN), asked={**asked, "versions": results.versions(), "code": code})
    kept.claim(out, force=force)

    def tell(seal: Seal) -> None:
        done = kept.answered()
        now = f"{done} of them were diagnosed before an interrupt" if done else "the diagnosis starts now"
        console.say(f"Sealed: the truth of {seal.cases} cases has the hash {seal.digest}; {now}.")

    with console.counting("cases") as show:
        try:
            proof = runner.prove(
                cases,
                seed,
                rig=rig,
                kinds=about["kinds"],  # type: ignore[arg-type]
                effects=about["effects"],  # type: ignore[arg-type]
                background=about.get("background"),  # type: ignore[arg-type]
                workers=workers,
                time_limit=time_limit,
                diagnosis=runner.DIAGNOSIS,
                kept=kept,
                on_seal=tell,
                show=show,
            )
        except ValueError as e:
            raise InputError(Fault(file="rollover prove", message=str(e))) from None
    report = results.plain({**proof.report, "versions": results.versions()})
    with results.whole(out) as part:
        results.write_json(part / JSON, report)
        results.write_json(part / SEAL, proof.seal.public())
        opened = {"format": "rollover-truths/1", "salt": proof.seal.salt, "truths": proof.truths}
        (part / TRUTH).write_text(json.dumps(opened, indent=1), encoding="utf-8")
        lines = (json.dumps(results.plain({"case": name, **found})) for name, found in proof.diagnoses.items())
        (part / DIAGNOSES).write_text("".join(f"{line}\n" for line in lines), encoding="utf-8")
        from viz.pages.proof import page

        text = page(report, command=_command(cases, seed, about), versions=report["versions"])
        (part / PAGE).write_text(text, encoding="utf-8")
    kept.clear()
    if as_json:
        print(json.dumps(report, indent=2))
    else:
        console.tell("\n".join([*sentences(report["summary"]), f"Written to {out}"]))
    if not proof.diagnoses:
        console.say(f"Every diagnosis failed; the first: {report['rows'][0]['failure']}")
        raise typer.Exit(FAILED)


def _share_of(text: str) -> float | str:
    """A number where it is one."""
    try:
        return float(text)
    except ValueError:
        return text


def _command(cases: int, seed: int, about: dict[str, Any]) -> str:
    words = ["rollover", "prove", "--cases", str(cases), "--seed", str(seed)]
    words += [word for name in ("effects", "kinds") for value in about[name] for word in (f"--{name}", value)]
    words += ["--background", str(about["background"])] if "background" in about else []
    words += ["--rig", about["rig"]] if "rig" in about else []
    return " ".join(words)


def sentences(summary: dict[str, Any]) -> list[str]:
    """The report in a few lines."""
    said = {
        "False alarms where nothing was": summary["false_alarms"],
        "One effect: detected": summary["detected"],
        "  of those, named first": summary["named_first"],
        "  in the set offered": summary["in_set"],
        "  alone and right": summary["alone_and_right"],
        "Two effects: both named": summary["two_effects"]["both"],
        "Unlisted: called unexplained": summary["outside"]["unexplained"],
        "  named a listed effect that is not even close": summary["outside"]["wrong"],
        "Intervals that hold the true value": summary["coverage"],
    }
    if (real := summary["real"]) is not None:
        said |= {
            "Foreign forms and backgrounds: in the set, of all": real["of_all"]["in_set"],
            "  first, of all": real["of_all"]["first"],
            "  in the set, of those larger than the background": real["stronger_than_background"]["in_set"],
            "  called by another name": real["called"]["another_name"],
            "  a background alone named as an effect": real["background_alone"]["false_name"],
            "  a background alone named unexplained": real["background_alone"]["unexplained"],
        }
    lines = [f"{what:<50} {_share(found)}" for what, found in said.items() if found["of"]]
    if (given := summary["probabilities"]) is not None and given["cases"]:
        scores = f"Brier score {given['brier']:.3f}, log score {given['log']:.3f}"
        slope = "" if given["slope"] is None else f", slope {given['slope']:.2f}"
        lines.append(f"{'Probabilities, of ' + str(given['cases']) + ' cases':<50} {scores}{slope}")
    if summary["failed"]:
        lines.append(f"{'Diagnoses that failed':<50} {len(summary['failed'])}")
    return lines


def _share(found: dict[str, Any]) -> str:
    low, high = 100.0 * found["low"], 100.0 * found["high"]
    return f"{found['hits']:4d} of {found['of']:4d}   ({low:.0f} to {high:.0f} % at 95 %)"

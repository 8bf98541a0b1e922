"""`rollover score`: anyone's answers to sealed cases."""

from __future__ import annotations

import shlex
from pathlib import Path
from typing import Annotated

import typer

from rollover.cli.commands.common import AsJson, Force, answering, app, hand_out, manual
from rollover.cli.commands.prove import sentences

JSON, PAGE = "score.json", "report.html"


@app.command(
    epilog=manual(
        "score out/cases answers.json --truth out/cases-truth.json",
        writes=f"{JSON}, {PAGE}.",
    )
)
@answering
def score(
    cases: Annotated[Path, typer.Argument(help="Folder of sealed cases, by `rollover prove --export`.", metavar="DIR")],
    answers: Annotated[Path, typer.Argument(help="Answers to them, as README.md there says.", metavar="ANSWERS")],
    truth: Annotated[
        Path | None, typer.Option(metavar="FILE", help="The truth of the cases.", show_default="DIR-truth.json")
    ] = None,
    out: Annotated[Path | None, typer.Option(help="Results folder", show_default="out/score/NAME")] = None,
    force: Force = False,
    as_json: AsJson = False,
) -> None:
    """Score answers to sealed cases, whoever gave them, by the rules of the blind proof."""
    from rollover.assessment import results
    from rollover.cli import console
    from rollover.proof.answers import SCORE_FORMAT, read_answers, scored
    from rollover.proof.sealed_cases import read_sealed, truth_beside
    from viz.pages.proof import page

    given = read_sealed(cases)
    found = read_answers(answers, given)
    answer = results.plain({**scored(found, given, truth or truth_beside(cases)), "versions": results.versions()})
    folder = out or Path("out", "score", answers.stem)
    about = {"by": found.by, "seal": answer["seal"]}
    results.claim_report(folder, SCORE_FORMAT, about, (JSON, PAGE), force=force)
    words = ["rollover", "score", str(cases), str(answers), *(["--truth", str(truth)] if truth else [])]
    text = page(answer, command=" ".join(map(shlex.quote, words)), versions=answer["versions"])
    said = "\n".join([*sentences(answer["summary"]), f"Written to {folder}"])
    hand_out(answer, text, folder, (JSON, PAGE), as_json=as_json, show=lambda: console.tell(said))

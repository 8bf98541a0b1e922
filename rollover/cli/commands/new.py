"""`rollover new`: an annotated file to begin with."""

from __future__ import annotations

import json
import re
from pathlib import Path
from typing import Annotated

import typer

from rollover.cli.commands.common import AsJson, answering, app, manual
from rollover.system.errors import Fault, InputError, hint

KINDS = ("scenario", "vehicle", "rops", "study", "recording", "profile", "law", "effect")
NAME = re.compile(r"[A-Za-z][A-Za-z0-9_-]*")


@app.command(
    epilog=manual(
        "new vehicle my_tractor",
        writes="NAME.yaml here (recording: NAME.csv too; profile: NAME-sample.csv too; law, effect: NAME.py).",
    )
)
@answering
def new(
    kind: Annotated[str, typer.Argument(help=f"What to write: {', '.join(KINDS)}.", metavar="KIND")],
    name: Annotated[str, typer.Argument(help="Of the file, without ending.", show_default="my-KIND")] = "",
    as_json: AsJson = False,
) -> None:
    """Write an annotated file that is valid and runs, to be changed into your own; nothing is overwritten."""
    if kind not in KINDS:
        raise InputError(Fault(file="rollover new", message=f"no such kind, got {kind!r}; {hint(kind, KINDS)}"))
    place = Path(name or f"my-{kind}")
    stem = place.name.removesuffix(".py" if kind in ("law", "effect") else ".yaml")
    if not NAME.fullmatch(stem):
        message = f"not a plain name, got {stem!r}; letters, digits, '_' and '-' with a letter first are allowed"
        raise InputError(Fault(file="rollover new", path="NAME", message=message))
    from rollover.cli import templates
    from rollover.cli.console import tell
    from rollover.system.writing import hold, together

    texts = {place.with_name(file): text for file, text in templates.written(kind, stem).items()}
    there = [path for path in texts if path.exists() or path.is_symlink()]
    if there:
        raise InputError(
            *(Fault(file=str(p), message="exists, and is not replaced; another NAME is needed") for p in there)
        )
    hold(next(iter(texts)))
    with together(next(iter(texts))) as part:
        for path, text in texts.items():
            (part / path.name).write_text(text, encoding="utf-8")
    if as_json:
        print(json.dumps({"kind": kind, "files": [str(path) for path in texts]}, indent=2))
        return
    for path in texts:
        tell(f"{path}: written; its first lines say how it is checked and used")

"""Reference pages from the tables that `rollover schema`, `rollover list` and `--help` are made of."""

from __future__ import annotations

import inspect
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import MISSING, fields
from typing import Any, cast

import api
import typer

from ground.law import laws
from rollover import scenario as scenarios
from rollover.cli import catalogue
from rollover.cli.main import app
from rollover.effects import effects
from rollover.effects.effect import units_of
from rollover.recording.importers.sidecar import Column, Profile, Sidecar
from rollover.spec.channels import CHANNELS
from rollover.spec.document import slot_of
from rollover.spec.document.slot import Slot, slots
from rollover.spec.rops import Rops
from rollover.spec.standards.codes import STANDARDS, Tractor
from rollover.spec.standards.iso_3471 import MACHINES, iso_3471_requirements
from rollover.spec.standards.machine_codes import SCOPES
from rollover.spec.steel import Steel
from rollover.studies.study import Study

EXAMPLE = Tractor(
    mass=3000.0, wheelbase=2.25, rear_share=0.6, pitch_inertia=5493.0, width=1.9, rops_width=1.1, folding=False
)
MACHINE = Tractor(mass=10_000.0)
ROOTS: dict[str, tuple[str, str, Sequence[type]]] = {  # page -> its title, what it is, the classes that it begins with
    "scenario": ("Keys of a scenario", "A scenario file, and what stands below it.", [scenarios.Scenario]),
    "vehicle": (
        "Keys of a vehicle",
        "A file in `vehicles/`, or `vehicle:` of a scenario.",
        list(slot_of(scenarios.AnyVehicle).kinds.values()),
    ),
    "rops": ("Keys of a ROPS", "A file in `vehicles/rops/`, or `rops:` of a vehicle.", [Rops]),
    "steel": ("Keys of a steel", "A file in `steels/`, or `material:` of a ROPS member.", [Steel]),
    "soil": ("Keys of a soil", "A file in `soils/`, or `ground.law:` of a scenario.", list(laws().values())),
    "study": ("Keys of a study", "A study file; its `scenario:` is a scenario.", [Study]),
    "recording": ("Keys of a recording", "The sidecar `NAME.yaml` of a recording.", [Sidecar, Column]),
    "profile": ("Keys of a profile", "One file for all files that an instrument writes.", [Profile, Column]),
}


def pages() -> dict[str, str]:
    """Markdown of every reference page by its name."""
    found = {"commands": commands(), "python": api.page(plain, code, table), "channels": channels()}
    found |= {"effects": effects_(), "standards": standards()}
    ours: dict[str, set[type]] = {name: set(classes) for name, (_, _, classes) in ROOTS.items()}
    for name, (title, meaning, classes) in ROOTS.items():
        others = {k: c for k, c in ours.items() if k != name and name not in ("recording", "profile")}
        found[name] = keys(title, meaning, classes, others)
    return found


def table(heads: Sequence[str], rows: Iterable[Sequence[str]]) -> str:
    """A Markdown table; what would end a cell is escaped."""
    lines = ["| " + " | ".join(heads) + " |", "|" + "---|" * len(heads)]
    lines += ["| " + " | ".join(cell.replace("|", "\\|").replace("\n", " ") for cell in row) + " |" for row in rows]
    return "\n".join(lines) + "\n"


def code(text: str) -> str:
    """Text as it is typed; nothing of nothing."""
    return f"`{text}`" if text else ""


def plain(text: str) -> str:
    """Words of a docstring or an annotation, in which nothing is markup but what stands in backticks."""
    parts = text.replace("``", "`").split("`")
    kept = [part if i % 2 else _escaped(part) for i, part in enumerate(parts)]
    return "`".join(kept)


def _escaped(text: str) -> str:
    return "".join("\\" + c if c in "*_[]<>{}$#" else c for c in text)


def keys(title: str, meaning: str, classes: Sequence[type], others: dict[str, set[type]]) -> str:
    """A page of all keys: a table for each parameter class that is met from some on, but for those of other pages."""
    elsewhere = {kind: page for page, kinds in others.items() for kind in kinds}
    text = [f"# {title}\n", f"{plain(meaning)} Numbers are in SI units; a key without a default is needed.\n"]
    for kind in _reached(classes, frozenset(elsewhere)):
        text.append(f"## {kind.__name__}\n\n{plain(_first(kind))}\n")
        text.append(table(("key", "unit", "allowed", "default", "meaning"), _rows(kind, elsewhere)))
    return "\n".join(text)


def _rows(kind: type, elsewhere: dict[type, str]) -> Iterator[tuple[str, str, str, str, str]]:
    defaults = {f.name: _default(f) for f in fields(kind)}
    for name, slot in slots(kind).items():
        below = [(element or slot) for element in [slot.element(0) if slot.is_list else slot]]
        kinds = [kind for one in below for kind in (() if one.by_key else one.kinds.values())]
        # one page for all files of a kind: {name}.md beside this one
        links = {elsewhere[k] for k in kinds if k in elsewhere}
        see = "".join(f" See [{page}]({page}.md)." for page in sorted(links))
        yield code(name), plain(slot.unit), plain(_allowed(slot)), code(defaults[name]), plain(slot.meaning) + see


def _allowed(slot: Slot) -> str:
    words = slot.allowed().removesuffix(",")
    return words.replace(",,", ",").replace(", or null", " or null") if len(words) < 300 else words[:297] + "..."


def _default(field: Any) -> str:
    if field.default == "":
        return "''"
    if field.default is not MISSING:
        return catalogue.text(list(field.default) if isinstance(field.default, tuple) else field.default)
    return "" if field.default_factory is MISSING else "its defaults"


def _reached(classes: Sequence[type], stop: frozenset[type]) -> list[type]:
    """Parameter classes that can stand below some, in the order in which they are met."""
    found: list[type] = []
    wanted = list(classes)
    while wanted:
        kind = wanted.pop(0)
        if kind in found or kind in stop:
            continue
        found.append(kind)
        for slot in slots(kind).values():
            below = slot
            while below.is_list and (inner := below.element(0)) is not None:
                below = inner
            if not below.by_key:  # effects have a page of their own
                wanted += list(below.kinds.values())
                wanted += below.written.forms if below.written else ()
    return found


def commands() -> str:
    """Every command with its arguments, options, examples, what it writes and what its exit status says."""
    group: Any = typer.main.get_command(app)
    text = ["# Commands\n", "What `rollover COMMAND --help` prints.\n"]
    for name, command in group.commands.items():
        text.append(f"## rollover {name}\n\n{plain(inspect.cleandoc(command.help or ''))}\n")
        rows = [
            (
                code(
                    str(parameter.metavar or parameter.name).strip("[]")
                    if parameter.param_type_name == "argument"
                    else _spelt(parameter)
                ),
                plain(str(getattr(parameter, "help", "") or "")),
                code("" if _silent(parameter.default) else str(parameter.default)),
            )
            for parameter in command.params
        ]
        text.append(table(("argument or option", "meaning", "default"), rows))
        text.append("```text\n" + "\n".join(filter(None, str(command.epilog or "").split("\n"))) + "\n```\n")
    return "\n".join(text)


def _spelt(parameter: Any) -> str:
    return ", ".join([*parameter.opts, *parameter.secondary_opts])


def _silent(default: object) -> bool:
    return default is None or default is False or callable(default) or default in ((), [], "") or "nset" in str(default)


def channels() -> str:
    """Every channel with its unit."""
    rows = [(code(c.name), plain(c.unit), plain(str(c.meaning))) for c in CHANNELS.values()]
    head = "# Channels\n\nNamed alike in simulations and recordings; `rollover list channels` prints them.\n\n"
    return head + table(("channel", "unit", "meaning"), rows)


def effects_() -> str:
    """Every effect: equation, numbers, source, look-alikes and the test that tells them apart."""
    text = [
        "# Effects\n",
        "Switched on by `--set effects.ID.PARAMETER=VALUE`; at its null an effect changes no bit.",
        "`recalled` in a source: from memory, not held against the print; where a search starts, not a truth.\n",
    ]
    for name, kind in effects().items():
        about = {
            "equation": code(kind.equation),
            "kind": kind.kind,
            "family": plain(kind.family),
            "felt first by": ", ".join(map(code, kind.channels)),
            "source": plain(kind.source),
        }
        text.append(f"## {name}\n\n{plain(_first(kind))}\n")
        text.append(table(("", ""), [(k, v) for k, v in about.items() if v]))
        units = units_of(kind, None)
        numbers = [
            (
                code(key),
                plain(str(units.get(key, ""))),
                plain(_allowed(slot)),
                code({f.name: _default(f) for f in fields(cast(Any, kind))}[key]),
                plain(slot.meaning),
            )
            for key, slot in slots(kind).items()
        ]
        text.append(table(("parameter", "unit", "allowed", "default", "meaning"), numbers))
        if kind.rivals:
            text.append(table(("look-alike", "test"), [(code(k), plain(v)) for k, v in kind.rivals.items()]))
    return "\n".join(text)


def standards() -> str:
    """Every requirement with clause, formula and how surely it is known, and its value for one tractor."""
    sure = {
        "source checked": "the text was read",
        "recalled, high confidence": "recalled, high confidence",
        "recalled": "recalled",
        "recalled, low confidence": "recalled, low confidence",
    }
    text = ["# Standards\n", "This is a simulation study, not type approval. " + _example() + "\n"]
    machines = {f"ISO 3471, {name}": iso_3471_requirements(name, 10000.0) for name in MACHINES}
    of = {name: rule(MACHINE if name in SCOPES else EXAMPLE) for name, rule in STANDARDS.items()}
    for name, asked in {**of, **machines}.items():
        rows = [
            (
                plain(r.name),
                plain(r.clause),
                code(r.formula),
                f"{r.value:.5g}{f' to {r.upper:.5g}' if r.upper is not None else ''} {plain(r.unit)}",
                f"{sure[r.confidence]}: {plain(r.source)}",
            )
            for r in asked
        ]
        text.append(f"## {name}\n")
        text.append(table(("requirement", "clause", "formula", "value", "how it is known"), rows))
    return "\n".join(text)


def _example() -> str:
    return (
        f"Values are those of a tractor of {EXAMPLE.mass:g} kg with a wheelbase of {EXAMPLE.wheelbase:g} m, "
        "for ISO 3471 and the codes of other machines of one of 10,000 kg."
    )


def _first(kind: type) -> str:
    return (inspect.getdoc(kind) or "").partition("\n\n")[0].replace("\n", " ")

"""Results on disk: a run's folder is written whole or not at all, and never over another run's."""

from __future__ import annotations

import csv
import json
import math
import os
import platform
from collections.abc import Callable, Mapping, Sequence
from dataclasses import asdict
from importlib import metadata
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from rollover.assessment.ledger import closure
from rollover.assessment.shipped import origin as shipped_origin
from rollover.recording import write_parquet
from rollover.spec.document import content_hash, dump, shipped_folder
from rollover.system import own_code
from rollover.system.boundary import worded
from rollover.system.errors import Fault, InputError
from rollover.system.own_json import read_json
from rollover.system.writing import hold, own
from rollover.system.writing import whole as whole

if TYPE_CHECKING:
    from rollover.assessment.loads import PeakLoad
    from rollover.dynamics.result import Run

FORMAT = "rollover-run/1"
AGAIN = "`rollover run` writes it anew"
RUN, SCENARIO, CHANNELS, EVENTS, PICTURE, PAGE = (
    "run.json",
    "scenario.yaml",
    "channels.parquet",
    "events.json",
    "recording.rrd",
    "report.html",
)
FILES = (RUN, SCENARIO, CHANNELS, EVENTS, PICTURE, PAGE)
VIEWER = "viewer.html"  # the only other file that may stand there; a new run's folder begins without it


def versions() -> dict[str, str]:
    """Versions of all that a result depends on."""
    packages = ("rollover", "exudyn", "numba", "numpy", "scipy")
    return {
        **{name: metadata.version(name) for name in packages},
        "python": platform.python_version(),
        "platform": f"{platform.system()} {platform.machine()}".lower(),
    }


def origin(path: Path, folder: Path, given: Sequence[str] = ()) -> dict[str, Any]:
    """What a result in `folder` was made from: the scenario's file as seen from there, and what was set besides."""
    file, shipped = path.resolve(), shipped_folder().resolve()
    if file.is_relative_to(shipped):
        return {"shipped": file.relative_to(shipped).as_posix(), "set": list(given)}
    try:
        seen = Path(os.path.relpath(file, folder.resolve()))
    except ValueError:  # another drive
        seen = file
    return {"file": seen.as_posix(), "set": list(given)}


def claim(
    folder: Path,
    scenario_hash: str,
    *,
    force: bool = False,
    made_from: Mapping[str, Any] | None = None,
    say: Callable[[str], None] | None = None,
) -> Path:
    """Resolve a results folder after making sure that it may be written. Raises `InputError`, changes nothing.

    Results of the same scenario and versions may be written again, and so may older ones that were made from the same
    file with the same settings (`made_from`, an `origin`), which is said; others only with `force`. A folder that holds
    anything but results is never touched. A command holds it from here to its end, so that no other writes there.
    """
    target, names = _own_files(folder, (*FILES, VIEWER), RUN)
    if not names or force:
        return target
    found = read_run_json(target)
    is_own = made_from is not None and found.get("origin") == made_from
    if found.get("scenario_hash") != scenario_hash:
        if not is_own:
            got = f"{found.get('title', '')!r}{_as_set(found.get('origin'))}"
            raise _refused(folder, f"holds another run, got {got}; --force replaces it, --out leaves it")
        _say_replaced(say, folder, "run", found)
    elif found.get("versions") != versions() or _is_by_other_code(found):
        if not is_own:
            raise _refused(folder, "holds this run by other versions; --force replaces it, --out leaves it")
        if say is not None:
            say(f"{folder}: replaces the run of this scenario by other versions")
    return target


def _is_by_other_code(found: Mapping[str, Any]) -> bool:
    """Whether files of one's own effects or laws that a result was made with say something else now."""
    stated = found.get("own_code", {})
    return isinstance(stated, Mapping) and any(own_code.hashes(k) != stated[k] for k in own_code.KINDS if k in stated)


def _as_set(made_from: object) -> str:
    """What a result's scenario was set to besides its file: two variants of one scenario share their title."""
    given = made_from.get("set") if isinstance(made_from, Mapping) else None
    return f" with --set {' '.join(map(str, given))}" if isinstance(given, Sequence) and given else ""


def _say_replaced(say: Callable[[str], None] | None, folder: Path, what: str, found: Mapping[str, Any]) -> None:
    if say is not None:
        old = str(found.get("scenario_hash", ""))[:12]
        say(f"{folder}: replaces the {what} of this scenario as it was before it was changed (hash {old})")


def claim_report(
    folder: Path,
    form: str,
    about: Mapping[str, Any],
    files: Sequence[str],
    *,
    force: bool = False,
    own_report: Callable[[Mapping[str, Any]], str] | None = None,
    say: Callable[[str], None] | None = None,
) -> Path:
    """Like `claim`, for what other commands write: `files`, the first of them JSON of the format `form`.

    The same command's report of the same things, those that `about` names, is written again without `force`; so is
    one that differs in the scenario's hash alone, its `origin` being the same, and one of which `own_report` says in a
    sentence why it may be replaced. Both are said.
    """
    target, names = _own_files(folder, files, files[0])
    if not names or force:
        return target
    try:
        found = read_json(target / files[0])
    except (OSError, ValueError):
        found = {}
    others = {key for key, value in about.items() if found.get(key) != value}
    if others <= {"origin"} and found.get("format") == form:
        return target
    if others == {"scenario_hash"} and "origin" in about and found.get("format") == form:
        _say_replaced(say, folder, "report", found)
        return target
    if found.get("format") == form and own_report is not None and (why := own_report(found)):
        if say is not None:
            say(f"{folder}: {why}")
        return target
    raise _refused(folder, f"holds results of something else; --force replaces {files[0]}, --out leaves it")


def _own_files(folder: Path, files: Sequence[str], first: str) -> tuple[Path, list[str]]:
    """The resolved folder and the names in it, none of which is foreign to `files`."""
    if folder.exists() and not folder.is_dir():
        raise _refused(folder, "not a folder, but a file; another --out is needed")
    hold(folder)
    target = folder.resolve()
    if not target.exists():
        return target, []
    names = sorted(p.name for p in target.iterdir() if not own(target, p.name))
    foreign = [name for name in names if name not in files]
    if foreign or (names and first not in names):
        what = foreign[0] if foreign else names[0]
        raise _refused(folder, f"holds files that are not results, got {what!r}; another --out is needed")
    return target, names


def write(
    folder: Path,
    run: Run,
    peaks: Sequence[PeakLoad],
    *,
    criteria: Sequence[Mapping[str, Any]] = (),
    half_step: Run | None = None,
    picture: Callable[[Path], None] | None = None,
    page: Callable[[Mapping[str, Any]], str] | None = None,
    force: bool = False,
    made_from: Mapping[str, Any] | None = None,
) -> dict[str, Any]:
    """Write a run's folder and return what its run.json says.

    `criteria` are what the run was held against, as bare values. Everything goes to a temporary folder beside it,
    which takes its place at the very end; `picture` writes the .rrd there, `page` gives the text of the report from
    what run.json says. Whatever happens before that, an interrupt too, leaves nothing behind.
    """
    scenario_hash = content_hash(run.scenario)
    target = claim(folder, scenario_hash, force=force, made_from=made_from)
    with whole(target) as part:
        head = f"{run.scenario.title}\nEvery value of the run beside this file; run it again: rollover run {SCENARIO}"
        (part / SCENARIO).write_text(dump(run.scenario, head), encoding="utf-8")
        write_parquet(run.recording, part / CHANNELS)
        write_json(part / EVENTS, [asdict(event) for event in run.events])
        if picture is not None:
            picture(part / PICTURE)
        names = sorted([*(p.name for p in part.iterdir()), RUN, *([PAGE] if page is not None else [])])
        answer = json_of(run, peaks, criteria, half_step, names)
        if made_from is not None:
            answer["origin"] = plain(made_from)
        write_json(part / RUN, answer)
        if page is not None:
            (part / PAGE).write_text(page(answer), encoding="utf-8")
    return answer


def read_run_json(folder: Path) -> dict[str, Any]:
    """What the run.json of a results folder says. Raises `InputError`."""
    path = folder / RUN
    try:
        found = read_json(path)
    except FileNotFoundError:
        raise _refused(folder, f"not a results folder, got no {RUN}; {AGAIN}") from None
    except (OSError, ValueError) as e:
        raise _refused(path, f"cannot be read: {worded(e)}; {AGAIN}") from None
    if found.get("format") != FORMAT:
        raise _refused(path, f"not the {RUN} of a run; format {FORMAT!r} is needed")
    return found


def json_of(
    run: Run,
    peaks: Sequence[PeakLoad],
    criteria: Sequence[Mapping[str, Any]] = (),
    half_step: Run | None = None,
    files: Sequence[str] = (),
) -> dict[str, Any]:
    """What run.json says, bare JSON values; `files` are those of the results folder."""
    closed = closure(run)
    answer: dict[str, Any] = plain(
        {
            "format": FORMAT,
            "title": run.scenario.title,
            "shipped": None if (shipped := shipped_origin(run.scenario)) is None else asdict(shipped),
            "status": run.status,
            "sentence": run.sentence,
            "versions": versions(),
            **run.scenario.own_code,
            "scenario_hash": content_hash(run.scenario),
            "integrator": run.scenario.integrator,
            "wall_time": run.wall_time,
            "stop_time": run.stop_time,
            "domain_flags": run.domain_flags,
            "estimates": [e.plain for e in run.scenario.estimates],
            "phases": [{"start": start, "name": name} for start, name in run.phases],
            "energy_ledger": run.ledger,
            "energy_released": run.released,
            "ledger": {"largest_residual": closed.largest, "at": closed.at, "residual_at_end": closed.end},
            "tests": run.tests,
            "peak_loads": [asdict(peak) for peak in peaks],
            "criteria": criteria,
            "half_step": None
            if half_step is None
            else {
                "step": half_step.scenario.simulation.step,
                "status": half_step.status,
                "sentence": half_step.sentence,
                "wall_time": half_step.wall_time,
            },
            "files": list(files),
        }
    )
    return answer


def _refused(path: Path, message: str) -> InputError:
    return InputError(Fault(file=str(path), message=message))


def write_json(path: Path, value: Any) -> None:
    """Write bare values as JSON."""
    path.write_text(json.dumps(plain(value), indent=2, allow_nan=False) + "\n", encoding="utf-8")


def write_csv(path: Path, rows: Sequence[Mapping[str, Any]]) -> None:
    """Write rows with the keys of the first as the header; what is None or no number stays empty."""
    with path.open("w", encoding="utf-8", newline="") as file:
        writer = csv.writer(file)
        if rows:
            writer.writerow(rows[0])
        writer.writerows([plain(v) for v in row.values()] for row in rows)


def plain(value: Any) -> Any:
    """Bare JSON values; what is not a number becomes null."""
    if isinstance(value, Mapping):
        return {str(k): plain(v) for k, v in value.items()}
    if isinstance(value, (list, tuple)):
        return [plain(v) for v in value]
    if isinstance(value, (np.generic, np.ndarray)):
        return plain(value.tolist())
    if isinstance(value, float) and not math.isfinite(value):
        return None
    return value

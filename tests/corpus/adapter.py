"""All that the corpus knows of the program: the words of its command line and the keys of the files it writes.

The command is found by the name of its entry point, so that modules may move. Where an option or a key is renamed,
this file follows, and the entries of the corpus stay what they are.
"""

from __future__ import annotations

import hashlib
import json
import sys
import time
from collections.abc import Iterator, Mapping, Sequence
from importlib.metadata import entry_points
from pathlib import Path
from typing import Any

from tests.corpus.plan import Job

Entry = dict[str, Any]
FAILED = 3  # exit status of a simulation or a diagnosis that failed: the files say so
ANSWERS = (0, 1, FAILED)
NO_LIMIT = "1e6"  # s: a limit of wall time would make answers depend on what else the machine does
SHIPPED_CFC = "CFC 60"
# what is hashed of a diagnosis: by contract there, and neither prose nor times
NUMBERS = (
    "significance", "remaining", "where", "dependencies", "effects", "fit", "candidates", "smallest_detectable",
    "simulations",
)  # fmt: skip


class RefusedError(RuntimeError):
    """The command ended with a status that is no answer."""


def made(job: Job, folder: Path) -> Entry:
    """Entry of one job, worked off in this process; `folder` is empty and may be written to. Raises `RefusedError`."""
    return {"prove": _case, "run": _run, "regress": _peaks}[job.task](job, folder)


def _command(words: Sequence[str]) -> float:
    """Run `rollover WORDS` in this process; the CPU time it took, s."""
    (found,) = entry_points(group="console_scripts", name="rollover")
    began, given, status = time.process_time(), sys.argv, None
    sys.argv = ["rollover", *words]
    try:
        found.load()()
    except SystemExit as e:
        status = e.code
    finally:
        sys.argv = given
    if (status or 0) not in ANSWERS:
        raise RefusedError(f"rollover {' '.join(words)}: exit status {status}")
    return time.process_time() - began


def _read(path: Path) -> Any:
    return json.loads(path.read_text(encoding="utf-8"))


def _run(job: Job, folder: Path) -> Entry:
    out = folder / "run"
    cpu = _command(["run", job.scenario, "--no-half-step", "--out", str(out)])
    peaks = []
    run = _read(out / "run.json")
    for p in run["peak_loads"]:
        peaks.append([p["channel"], "raw", p["unit"], p["raw"], p["raw_time"]])
        peaks.append([p["channel"], SHIPPED_CFC, p["unit"], p["filtered"], p["filtered_time"]])
        peaks.append([p["channel"], "impulse", None, p["impulse"], None])
    channels = hashlib.sha256((out / "channels.parquet").read_bytes()).hexdigest()
    return {"status": run["status"], "channels": channels, "peaks": peaks, "cpu": cpu, "wall": run["wall_time"]}


def _peaks(job: Job, folder: Path) -> Entry:
    out = folder / "regress"
    words = ["regress", job.scenario, "--workers", "0", "--time-limit", NO_LIMIT, "--out", str(out)]
    cpu = _command(words)
    (answer,) = _read(out / "regress.json")["answers"]
    peaks = [[d["load"], d["filter"], d["unit"], d["now"], d["time_now"]] for d in answer["differences"]]
    return {"status": answer["verdict"], "peaks": peaks, "cpu": cpu, "wall": answer["wall_time"]}


def _case(job: Job, folder: Path) -> Entry:
    out = folder / "prove"
    words = ["prove", "--rig", job.rig, "--cases", "1", "--seed", str(job.seed), "--kinds", job.kind]
    words += [word for id in job.effects for word in ("--effects", id)]
    cpu = _command([*words, "--workers", "0", "--time-limit", NO_LIMIT, "--out", str(out)])
    (row,) = _read(out / "prove.json")["rows"]
    (truth,) = _read(out / "truth.json")["truths"]
    lines = (out / "diagnoses.jsonl").read_text(encoding="utf-8").splitlines()
    found = json.loads(lines[0]) if lines else {}
    return {**_truth(job, truth), **_answer(found, truth), **_score(row), "cpu": cpu, "wall": row["seconds"]}


def _truth(job: Job, truth: Mapping[str, Any]) -> Entry:
    effects = [
        {"id": e["id"], "channel": e["channel"] or None, "parameters": e["parameters"], "over_noise": e["over_noise"]}
        for e in truth["effects"]
    ]
    return {"seed": job.seed, "rig": job.rig, "kind": job.kind, "recordings": truth["handed_over"], "truth": effects}


def _answer(found: Mapping[str, Any], truth: Mapping[str, Any]) -> Entry:
    """What a diagnosis says: verdict, names in order, their sets, values with intervals, misfit, a hash of the rest."""
    named = found.get("effects") or []
    held = ((found.get("fit") or {}).get("held_out")) or {}
    names = [
        {
            "id": n["id"],
            "channel": _channel(n),
            "set": sorted({n["id"], *(n.get("indistinguishable_from") or [])}),
            "values": {
                name: [p["value"], p.get("low"), p.get("high")]
                for name, p in (n.get("parameters") or {}).items()
                if isinstance(p, Mapping) and _is_number(p.get("value"))
            },
        }
        for n in named
    ]
    return {
        "verdict": found.get("verdict"),
        "names": names,
        "false_names": [n["id"] for n in names if not _is_there(n, truth)],
        "depends_on": found.get("depends_on"),
        "p_value": (found.get("significance") or {}).get("p_value"),
        "remaining": (found.get("remaining") or {}).get("p_value"),
        "held_out": [(held.get(when) or {}).get("nrmse") for when in ("before", "after")],
        "simulations": found.get("simulations"),
        "numbers": digest([found.get(key) for key in NUMBERS]),
    }


def _score(row: Mapping[str, Any]) -> Entry:
    said = ("detected", "false_alarm", "first", "in_set", "alone", "both", "both_in_sets")
    score: Entry = {key: row[key] for key in said if row[key] is not None}
    if row["claim"]:
        score["claim"] = row["claim"]
    covers = [[f"{p['effect']}.{p['name']}", p["covers"]] for p in row["parameters"] if p["covers"] is not None]
    return {"score": score, "covers": covers, "failure": row["failure"]}


def _channel(effect: Mapping[str, Any]) -> str | None:
    value = effect.get("channel") or (effect.get("parameters") or {}).get("channel")
    return value.get("value") if isinstance(value, Mapping) else value


def _is_there(name: Mapping[str, Any], truth: Mapping[str, Any]) -> bool:
    """Whether a name is a true effect's (a sensor's in its channel), one not told from it, or near an unlisted one."""
    if truth["kind"] == "negligible":
        return False
    return any(
        (
            e["id"] in name["set"]
            and (not e["channel"] or not name["channel"] or e["id"] != name["id"] or e["channel"] == name["channel"])
        )
        or name["id"] in e["near"]
        for e in truth["effects"]
    )


def _is_number(value: Any) -> bool:
    return isinstance(value, (int, float)) and not isinstance(value, bool)


def digest(tree: Any) -> str:
    """SHA-256 over all numbers of a JSON tree to the last bit, in their own order: keys and prose may be renamed."""
    return hashlib.sha256("\n".join(sorted(map(repr, _numbers(tree)))).encode()).hexdigest()[:16]


def _numbers(tree: Any) -> Iterator[int | float]:
    if isinstance(tree, Mapping):
        tree = list(tree.values())
    if isinstance(tree, list):
        for branch in tree:
            yield from _numbers(branch)
    elif _is_number(tree):
        yield tree

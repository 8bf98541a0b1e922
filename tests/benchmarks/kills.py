"""Runs ended by SIGKILL at random moments: nothing is lost, and nothing is left after the next start.

By hand: ``python -m tests.benchmarks.kills [KILLS] [SEED]``. A few of them are among the tests.
"""

from __future__ import annotations

import json
import os
import random
import signal
import subprocess
import sys
import tempfile
import time
from pathlib import Path

from rollover.system import writing
from rollover.system.transaction import JOURNAL, finish, update

ROOT = Path(__file__).resolve().parents[2]


def line(*words: object) -> list[str]:
    return [sys.executable, "-m", "tests.rollover.command", *map(str, words)]


def kill_runs(folder: Path, kills: int, seed: int = 1) -> list[str]:
    """What was found wrong in `kills` ends of a run that replaces an earlier one's results."""
    pick, wrong = random.Random(seed), []
    out = folder / "out" / "a"
    command = line("run", "drop_test", "--no-half-step", "--out", out, "--json")
    began = time.perf_counter()
    first = subprocess.run(command, capture_output=True, text=True, check=True, cwd=ROOT)
    lasts = time.perf_counter() - began
    for k in range(kills):
        child = subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True, cwd=ROOT)
        # most of a run's time passes before it writes; half of the kills fall into the end, where it does
        after = lasts * (pick.uniform(0.0, 1.1) if k % 2 else pick.uniform(0.75, 1.1))
        try:
            said, _ = child.communicate(timeout=after)
        except subprocess.TimeoutExpired:
            child.send_signal(signal.SIGKILL)
            said, _ = child.communicate()
        settled = out if out.is_dir() else next((p for p in (folder / "out").glob(".a.*.old")), None)
        if settled is None:
            wrong.append(f"kill {k} after {after:.2f} s: the earlier results are gone")
        elif out.is_dir():
            wrong += [f"kill {k} after {after:.2f} s: {what}" for what in unlike(out, first.stdout)]
        if said and json.loads(said)["scenario_hash"] != json.loads(first.stdout)["scenario_hash"]:
            wrong.append(f"kill {k}: another answer")
    subprocess.run(command, capture_output=True, text=True, check=True, cwd=ROOT)
    left = sorted(p.name for p in (folder / "out").iterdir())
    if left != ["a"]:
        wrong.append(f"left after the next start: {left}")
    return [*wrong, *unlike(out, first.stdout)]


def kill_writers(folder: Path, kills: int, seed: int = 1) -> list[str]:
    """What was found wrong in `kills` ends of a process that does nothing but write, in each of the three ways.

    It writes one generation of files after the other; after its end the next start must find whole ones only.
    """
    pick, wrong = random.Random(seed), []
    began = time.perf_counter()
    write_on(folder, 0, 1)
    scale = time.perf_counter() - began
    ran = latest = 1
    for k in range(kills):
        child = os.fork()
        if child == 0:
            try:
                write_on(folder, ran)
            finally:
                os._exit(1)
        time.sleep(pick.uniform(0.0, 2.0 * scale))
        os.kill(child, signal.SIGKILL)
        os.waitpid(child, 0)
        with writing.working():
            begin(folder)
            found = generations(folder)
            if any(len(of) > 1 for of in found.values()):
                wrong.append(f"kill {k}: half the one and half the other: {found}")
            latest = max((max(of) for of in found.values() if of), default=0)
            if any(min(of, default=0) < ran for of in found.values()):
                wrong.append(f"kill {k}: what was whole before is gone: {found}, {ran} stood there")
            last, ran = ran, min(min(of, default=0) for of in found.values())
            # half of the kills shall fall into the first generation, whatever else the machine does meanwhile
            scale *= 0.9 if ran > last else 1.1
        left = [p.name for p in folder.rglob("*") if p.name.startswith(".")]
        wrong += [f"kill {k}: left: {left}"] if left else []
    return wrong if latest > kills // 4 else [*wrong, f"only {latest} generations: it was killed before it wrote"]


def begin(folder: Path) -> None:
    """Hold what is written, as commands do at their start."""
    (folder / "baselines").mkdir(exist_ok=True)
    writing.hold(folder / "baselines")
    finish(folder / "baselines" / JOURNAL)
    writing.sweep(folder / "baselines")
    for name in ("run", "d.csv", "account"):
        writing.hold(folder / name)


def write_on(folder: Path, from_: int, count: int = 10**9) -> None:
    """Write generation after generation until the end."""
    with writing.working():
        begin(folder)
        for n in range(from_ + 1, from_ + 1 + count):
            text = f"{n}\n" * 2000
            with writing.whole(folder / "run") as part:
                for name in ("run.json", "channels", "report"):
                    (part / name).write_text(text)
            with writing.together(folder / "d.csv") as part:
                (part / "d.yaml").write_text(text)
                (part / "d.csv").write_text(text)
            with update(folder / "account", {folder / "baselines" / f"{x}.yaml": text for x in "ab"}) as part:
                (part / "regress.json").write_text(text)


def generations(folder: Path) -> dict[str, set[int]]:
    """Which generations stand in each group of files that belong together; -1 for half a file."""
    groups = {"run": "run/*", "pair": "d.*", "update": "baselines/*.yaml account/*"}
    found: dict[str, set[int]] = {}
    for group, patterns in groups.items():
        texts = [p.read_text() for pattern in patterns.split() for p in folder.glob(pattern)]
        found[group] = {int(t.split()[0]) if len(set(t.split())) == 1 and t.count("\n") == 2000 else -1 for t in texts}
    return found


def unlike(out: Path, first: str) -> list[str]:
    """How a results folder is not that of a whole run."""
    try:
        found = json.loads((out / "run.json").read_text(encoding="utf-8"))
    except (OSError, ValueError) as e:
        return [f"run.json: {e}"]
    expected = json.loads(first)
    wrong = [f"no {name}" for name in found["files"] if not (out / name).is_file()]
    wrong += [f"{key} differs" for key in ("scenario_hash", "peak_loads", "files") if found[key] != expected[key]]
    if not (out / "recording.rrd").read_bytes().endswith(b"RRF2FOOT\x01\x00\x00\x00"):
        wrong.append("recording.rrd is cut off")
    return wrong


def main() -> None:
    kills = int(sys.argv[1]) if len(sys.argv) > 1 else 100
    seed = int(sys.argv[2]) if len(sys.argv) > 2 else 1
    with tempfile.TemporaryDirectory() as name:
        wrong = kill_runs(Path(name, "runs"), kills, seed) + kill_writers(Path(name), 10 * kills, seed)
    print("\n".join([*wrong, f"{kills} kills of runs, {10 * kills} of writers, {len(wrong)} faults"]))
    sys.exit(bool(wrong))


if __name__ == "__main__":
    main()

"""Runs ended by SIGKILL at random moments: nothing is lost, and nothing is left after the next start.

By hand: ``python -m tests.benchmarks.kills [KILLS] [SEED]``. A few of them are among the tests.
"""

from __future__ import annotations

import json
import random
import signal
import subprocess
import sys
import tempfile
import time
from pathlib import Path

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
        wrong = kill_runs(Path(name), kills, seed)
    print("\n".join([*wrong, f"{kills} kills, {len(wrong)} faults"]))
    sys.exit(bool(wrong))


if __name__ == "__main__":
    main()

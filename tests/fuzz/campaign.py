"""A campaign: inputs drawn over the entry points, each judged, finds counted by entry point, class and kind."""

from __future__ import annotations

import random
import shutil
from collections import Counter, defaultdict
from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path
from time import perf_counter
from typing import TextIO

from tests.fuzz.all_entry_points import entry_points
from tests.fuzz.entry_points import EntryPoint, Seed, an_input
from tests.fuzz.oracle import CLASSES, Verdict, judge


@dataclass(kw_only=True)
class Done:
    """What came of it. `finds`: entry point -> class -> how often; `kinds`: (class, kind) -> count, the first."""

    inputs: Counter[str] = field(default_factory=Counter)
    statuses: dict[str, Counter[int | None]] = field(default_factory=lambda: defaultdict(Counter))
    finds: dict[str, Counter[str]] = field(default_factory=lambda: defaultdict(Counter))
    kinds: dict[tuple[str, str], tuple[int, str, str]] = field(default_factory=dict)
    seconds: Counter[str] = field(default_factory=Counter)
    longest: float = 0.0
    largest: int = 0


class Place:
    """The folder of one seed: its files stand there between inputs, and are put back after each."""

    def __init__(self, folder: Path, seed: Seed) -> None:
        self.folder, self.seed = folder, seed
        self._make()

    def _make(self) -> None:
        shutil.rmtree(self.folder, ignore_errors=True)
        self.folder.mkdir(parents=True)
        for name, data in self.seed.files.items():
            self._put(name, data)

    def _put(self, name: str, data: bytes) -> None:
        path = self.folder / name
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_bytes(data)

    def unchanged(self) -> None:
        """The seed as it is, unjudged: what is imported or compiled at its first use is of no input's making."""
        judge(self.folder, list(self.seed.words), longest=600.0)
        self._make()

    def judged(self, rng: random.Random) -> tuple[Verdict, dict[str, bytes], list[str]]:
        """One input of this seed."""
        files, words = an_input(self.seed, rng)
        own = {n: d for n, d in self.seed.files.items() if n.startswith("out/") and n not in files}
        for name, data in {**own, **files}.items():
            self._put(name, data)
        out = "out" if "cases" not in words else "cases"
        verdict = judge(
            self.folder, words, out, whole="out" in {n.partition("/")[0] for n in self.seed.files} or out == "cases"
        )
        if any(c == "outside" for c, _ in verdict.finds) or out == "cases":
            self._make()
        for name in files:
            if name in self.seed.files:
                self._put(name, self.seed.files[name])
            else:
                (self.folder / name).unlink(missing_ok=True)
        return verdict, files, words


def campaign(
    folder: Path,
    inputs: int,
    seed: int,
    *,
    only: Sequence[str] = (),
    keep: Path | None = None,
    seconds: float = float("inf"),
    say: TextIO | None = None,
) -> Done:
    """Judge so many inputs; the same seed draws the same ones. `keep` gets one input of each kind of find."""
    (folder / "made").mkdir()
    chosen = [d for d in entry_points(folder / "made") if not only or any(o in d.name for o in only)]
    rng = random.Random(seed)
    done, began = Done(), perf_counter()
    places: dict[tuple[str, int], Place] = {}
    for k in range(inputs):
        if perf_counter() - began > seconds:
            break
        # every entry point once before the draw, so that none is left out of a short campaign
        entry_point: EntryPoint = chosen[k] if k < len(chosen) else rng.choices(chosen, [d.weight for d in chosen])[0]
        at = rng.choices(range(len(entry_point.seeds)), [s.weight for s in entry_point.seeds])[0]
        key = (entry_point.name, at)
        if key not in places:
            places[key] = Place(folder / f"seed{len(places)}", entry_point.seeds[at])
            places[key].unchanged()
        verdict, files, words = places[key].judged(rng)
        _count(done, entry_point, entry_point.seeds[at], verdict, words, keep, files)
        if say is not None and (k + 1) % 500 == 0:
            total = sum(sum(c.values()) for c in done.finds.values())
            print(
                f"{k + 1} inputs, {perf_counter() - began:.0f} s, {total} finds of {len(done.kinds)} kinds",
                file=say,
                flush=True,
            )
    return done


def _count(
    done: Done,
    entry_point: EntryPoint,
    seed: Seed,
    verdict: Verdict,
    words: list[str],
    keep: Path | None,
    files: dict[str, bytes],
) -> None:
    done.inputs[entry_point.name] += 1
    done.statuses[entry_point.name][verdict.status] += 1
    done.seconds[entry_point.name] += verdict.seconds  # type: ignore[assignment]
    done.longest = max(done.longest, verdict.seconds)
    done.largest = max(done.largest, verdict.memory)
    for kind, what in verdict.finds:
        done.finds[entry_point.name][kind] += 1
        times, first, said = done.kinds.get((kind, what), (0, f"{entry_point.name}, {seed.name}", verdict.said[-400:]))
        done.kinds[kind, what] = (times + 1, first, said)
        if times == 0 and keep is not None:
            place = keep / f"{len(done.kinds):03d}-{kind}"
            for name, data in {**seed.files, **files}.items():
                (place / name).parent.mkdir(parents=True, exist_ok=True)
                (place / name).write_bytes(data)
            (place / "COMMAND").write_text(repr(words) + f"\n{kind}: {what}\n{verdict.said}", errors="backslashreplace")


def report(done: Done) -> str:
    """Figures by entry point and class, and every kind of find."""
    lines = [
        f"{'entry point':<24}{'inputs':>8}{'s':>8}{'read':>8}{'refused':>8}" + "".join(f"{c:>11}" for c in CLASSES)
    ]
    for name, count in done.inputs.items():
        status = done.statuses[name]
        lines.append(
            f"{name:<24}{count:>8}{done.seconds[name]:>8.0f}{status[0]:>8}{status[2]:>8}"
            + "".join(f"{done.finds[name][c]:>11}" for c in CLASSES)
        )
    total: Counter[str] = sum(done.finds.values(), Counter())
    lines.append(
        f"{'all':<24}{done.inputs.total():>8}{sum(done.seconds.values()):>8.0f}{'':>16}"
        + "".join(f"{total[c]:>11}" for c in CLASSES)
    )
    lines.append(f"longest {done.longest:.2f} s, largest {done.largest >> 20} MB")
    for (kind, what), (times, first, said) in sorted(done.kinds.items(), key=lambda item: -item[1][0]):
        last = said.strip().splitlines()[-1:] or [""]
        lines.append(f"{times:>6} {kind}: {what}   [{first}] {last[0][:160]!r}")
    return "\n".join(lines)

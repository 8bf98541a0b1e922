"""The entry points of results, made once by the commands themselves, of the command line, and all of them."""

from __future__ import annotations

import contextlib
import io
import json
import os
from pathlib import Path

from rollover.cli.commands.exporting import FORMATS
from tests.fuzz import seeds
from tests.fuzz.answers import answers, own_code, signals
from tests.fuzz.entry_points import OUT, EntryPoint, Seed, documents, recordings
from tests.fuzz.oracle import command
from tests.fuzz.seeds import Files


def results(folder: Path) -> list[EntryPoint]:
    """Results folders, made once in `folder` by the commands themselves."""
    here = Path.cwd()
    os.chdir(folder)
    (folder / "study.yaml").write_bytes(seeds.TABLE)
    (folder / "drop_test.yaml").write_bytes(seeds.scenarios("drop_test")["drop_test.yaml"])
    for k, v in seeds.scenarios("drop_test").items():
        (folder / k).parent.mkdir(parents=True, exist_ok=True)
        (folder / k).write_bytes(v)
    (folder / "points.csv").write_text("speed\n1.0\n2.0\n")
    try:
        for words in (
            ["run", "drop_test", "--no-half-step", "--out", "one"],
            ["run", "drop_test", "--no-half-step", "--set", "initiation.speed=2.0", "--out", "two"],
            ["study", "study.yaml", "--workers", "0", "--out", "cases"],
            ["synthesize", "drop_test", "--out", "rec"],
            ["compare", "drop_test", "rec", "--out", "compared"],
            ["regress", "drop_test", "--workers", "0", "--out", "account"],
            ["prove", "--cases", "1", "--kinds", "null", "--workers", "0", "--seed", "1", "--export", "sealed"],
        ):
            with (
                contextlib.redirect_stdout(io.StringIO()),
                contextlib.redirect_stderr(io.StringIO()),
                contextlib.suppress(SystemExit),
            ):
                command().main(words, prog_name="rollover")
    finally:
        os.chdir(here)

    def taken(*names: str, but: tuple[str, ...] = (".rrd", ".html")) -> Files:
        return {
            p.relative_to(folder).as_posix(): p.read_bytes()
            for name in names
            for p in (folder / name).rglob("*")
            if p.is_file() and p.suffix not in but
        }

    both = taken("one", "two")
    own = tuple(k for k in both if k.startswith("one/"))
    runs = [
        Seed(
            name="compare",
            files=both,
            words=["compare", "one", "two", *OUT],
            touched=("one/run.json", *own),
            weight=0.25,
        ),
        Seed(
            name="compare candidate",
            files=both,
            words=["compare", "two", "one", *OUT],
            touched=("one/run.json", *own),
            weight=0.08,
        ),
        Seed(name="import", files=both, words=["import", "one", *OUT], touched=("one/channels.parquet",), weight=1.5),
        Seed(name="check", files=both, words=["check", "one"], touched=("one/channels.parquet",), weight=0.7),
        Seed(
            name="scenario",
            files=both,
            words=["check", "one/scenario.yaml"],
            touched=("one/scenario.yaml",),
            weight=0.5,
        ),
    ]
    exported = [
        Seed(
            name=f"export {to}",
            files=both,
            words=["export", "one", "--to", to, *OUT],
            touched=("one/channels.parquet", "one/channels.parquet", "one/run.json"),
            options=(("--channel", "?ground/*"),),
        )
        for to in FORMATS
    ]
    compared = taken("compared")
    exported.append(
        Seed(
            name="export comparison",
            files=compared,
            words=["export", "compared", *OUT],
            touched=tuple(n for n in compared if n.endswith((".json", ".parquet"))),
        )
    )
    plain = {"drop_1.csv": seeds.csv(seeds.drop_columns()), "drop_1.yaml": seeds.SIDE.encode()}
    exported.append(Seed(name="export recording", files=plain, words=["export", "drop_1.csv", "--to", "xlsx", *OUT]))
    seen = taken("one", but=(".html",))
    view = [
        Seed(
            name="view",
            files=seen,
            words=["view", "one", "--html", "out/v.html"],
            touched=("one/run.json", "one/recording.rrd"),
            weight=1.0,
        )
    ]
    shelf = {
        **taken("cases"),
        **seeds.scenarios("drop_test"),
        "study.yaml": seeds.TABLE,
        "points.csv": b"speed\n1.0\n2.0\n",
    }
    again = tuple(k for k in shelf if k.startswith("cases/"))
    study = [
        Seed(
            name="study", files=shelf, words=["study", "study.yaml", "--workers", "0", "--out", "cases"], touched=again
        )
    ]
    rec = taken("rec")
    side = tuple(k for k in rec if k.endswith(".yaml"))
    diagnosis = [
        Seed(
            name="diagnose",
            files=rec,
            words=["diagnose", "drop_test", "rec", "--workers", "0", *OUT],
            touched=(*side, *rec),
            weight=1.0,
            options=(("--tolerance", "?0.1"), ("--hold-out", "?drop_test")),
        ),
        Seed(
            name="calibrate",
            files=rec,
            words=["calibrate", "drop_test", "rec", "--fit", "vehicle.mass", "--starts", "0", *OUT],
            touched=(*side, *rec),
        ),
    ]
    report = [
        Seed(
            name="regress",
            files={f"out/{k.partition('/')[2]}": v for k, v in taken("account", but=()).items()},
            words=["regress", "drop_test", "--workers", "0", *OUT],
            touched=("out/regress.json",),
        )
    ]
    sealed = taken("sealed", but=(".py", ".md")) | {"truth.json": (folder / "sealed-truth.json").read_bytes()}
    shown = json.loads(sealed["sealed/seal.json"])["digest"]
    said = {"case": "case-0001", "verdict": "parameter", "effects": [{"id": "mass", "parameters": {}}]}
    said |= {"probabilities": {"mass": 0.9, "nothing": 0.1}, "seconds": 1.0}
    said["effects"][0]["parameters"] = {"added": {"value": 1.0, "low": 0.5, "high": 1.5}}
    answers_ = {"format": "rollover-answers/1", "by": "me", "seal": shown, "answers": [said]}
    sealed["a.json"] = json.dumps(answers_, indent=1).encode()
    words = ["score", "sealed", "a.json", "--truth", "truth.json", *OUT]
    entries = [
        Seed(name="answers", files=sealed, words=words, touched=("a.json",), weight=3.0),
        Seed(
            name="sealed cases",
            files=sealed,
            words=words,
            touched=("sealed/seal.json", "sealed/benchmark.json", "sealed/candidates.json", "truth.json"),
        ),
    ]
    return [
        EntryPoint(name="answers to sealed cases", seeds=entries, weight=0.6),
        EntryPoint(name="results", seeds=runs, weight=1.5),
        EntryPoint(name="export", seeds=exported, weight=0.8),
        EntryPoint(name="view", seeds=view, weight=0.02),
        EntryPoint(name="study results", seeds=study, weight=0.1),
        EntryPoint(name="diagnosis", seeds=diagnosis, weight=0.12),
        EntryPoint(name="account", seeds=report, weight=0.03),
    ]


def options() -> list[EntryPoint]:
    """Words of the command line."""
    rec = {"drop_1.csv": seeds.csv(seeds.drop_columns()), "drop_1.yaml": seeds.SIDE.encode()}
    run = ["run", "drop_test", "--no-half-step", *OUT, "--set", "initiation.speed=2.0"]
    lines = [
        (run, (len(run) - 1,), 0.6),
        (["synthesize", "drop_test", *OUT, "--hide", "ground.law.stiffness_scale=1.1"], (5,), 0.7),
        (["synthesize", "drop_test", *OUT, "--noise", "ground/force_normal=1.0"], (5,), 0.3),
        (
            [
                "synthesize",
                "side_overturn",
                "--set",
                "vehicle.rops.mounts.left.yield_force=[1,2,3]",
                "--rate",
                "x",
                *OUT,
            ],
            (3,),
            1.0,
        ),
        (["synthesize", "drop_test", *OUT, "--rate", "1000"], (5,), 0.3),
        (["synthesize", "drop_test", *OUT, "--cfc", "60"], (5,), 0.3),
        (["synthesize", "drop_test", *OUT, "--late", "0.1"], (5,), 0.3),
        (["synthesize", "drop_test", *OUT, "--seed", "1"], (5,), 0.3),
        (["synthesize", "drop_test", *OUT, "--name", "a"], (5,), 0.3),
        (["synthesize", "drop_test", *OUT, "--channel", "ground/force_normal"], (5,), 0.3),
        (["diagnose", "drop_test", "drop_1.csv", *OUT, "--tolerance", "x"], (6,), 0.3),
        (["diagnose", "drop_test", "drop_1.csv", *OUT, "--hold-out", "x"], (6,), 0.3),
        (["calibrate", "drop_test", "drop_1.csv", *OUT, "--fit", "vehicle.mass=1:2"], (6,), 0.3),
        (["compare", "drop_test", "drop_1.csv", *OUT, "--cfc", "x"], (6,), 0.3),
        (["identify", "drop_1.csv", *OUT, "--buoyancy", "1"], (5,), 0.5),
        (["identify", "drop_1.csv", *OUT, "--scenario", "x"], (5,), 0.5),
        (["import", "drop_1.csv", *OUT, "--to", "csv"], (5,), 1.0),
        (["export", "drop_1.csv", *OUT, "--to", "csv"], (5,), 0.5),
        (["export", "drop_1.csv", *OUT, "--channel", "*"], (5,), 0.5),
        (["export", "nothing", *OUT], (1,), 0.5),
        (["diagnose", "drop_1.csv", "--model", "duffing", *OUT], (3,), 0.5),
        (["--laws", "nothing.py", "check", "drop_test"], (1,), 0.3),
        (["--effects", "nothing.py", "list", "effects"], (1,), 0.3),
        (["import", "drop_1.csv", *OUT, "--as", "csv"], (5,), 1.0),
        (["import", "drop_1.csv", *OUT, "--channel", "*"], (5,), 1.0),
        (["check", "drop_test"], (1,), 1.0),
        (["check", "drop_1.csv", "--scenario", "drop_test"], (3,), 0.5),
        (["list", "paths", "drop_test"], (1,), 0.5),
        (["list", "paths", "drop_test"], (2,), 0.5),
        (["schema", "scenario"], (1,), 0.5),
        (["stability", "side_overturn", "--headings", "x", *OUT], (1,), 0.5),
        (["regress", "nothing", *OUT], (1,), 0.5),
        (["prove", "--kinds", "nothing", "--cases", "1", *OUT], (2,), 0.3),
        (["prove", "--kinds", "nothing", "--cases", "1", "--export", "out/cases", "--truth", "out/t.json"], (8,), 0.3),
        (["score", "drop_1.csv", "drop_1.yaml", *OUT], (1,), 0.5),
        (["study", "nothing", *OUT], (1,), 0.5),
        (["view", "nothing", "--html", "out/a.html"], (1,), 0.5),
        (["compare", "drop_test", "drop_1.csv", *OUT], (2,), 0.5),
        (["import", "drop_1.csv", "--profile", "nothing", *OUT], (3,), 0.5),
        (["nothing", "drop_test"], (0,), 0.3),
    ]
    made = [
        Seed(name=" ".join(words[:1]) + f" {words[vary[0] - 1]}", files=rec, words=words, vary=vary, weight=weight)
        for words, vary, weight in lines
    ]
    return [EntryPoint(name="command line", seeds=made, weight=1.5)]


def entry_points(folder: Path) -> list[EntryPoint]:
    """All entry points; results are made in `folder`."""
    return [*documents(), *recordings(), *results(folder), *options(), signals(), own_code(), answers()]

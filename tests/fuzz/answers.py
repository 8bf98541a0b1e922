"""Entry points of commands that answer from a scenario or code of one's own, and of signals that drive a run."""

from __future__ import annotations

import random

from tests.fuzz import code, seeds
from tests.fuzz.entry_points import OUT, EntryPoint, Seed
from tests.fuzz.seeds import Files

DRIVEN = ("tilt_table_recorded", "shaken_platform", "cornering_overturn")
FOREIGN = b"""\
base: tilt_table_recorded.yaml
inputs:
  table:
    angle_deg: {file: a.mat, channel: input/table/angle, profile: p.yaml, offset: 0.1}
"""
PROFILE = b"""\
format: rollover-profile/1
channels: {t: {channel: time, unit: s}, F: {channel: input/table/angle, unit: deg}}
"""


def signals() -> EntryPoint:
    """Scenarios that recorded signals drive, and the files of those signals."""
    root = seeds.shipped_folder()
    whole = seeds.scenarios(*DRIVEN)
    whole |= {p.relative_to(root).as_posix(): p.read_bytes() for p in (root / "signals").iterdir()}
    beside = tuple(n for n in whole if n.startswith("signals/"))
    made = [
        Seed(name=n, files=whole, words=["check", f"{n}.yaml"], touched=(f"{n}.yaml", *beside), weight=1.0)
        for n in DRIVEN
    ]
    foreign = {**whole, "foreign.yaml": FOREIGN, "p.yaml": PROFILE, "a.mat": seeds.mat()}

    def odd(rng: random.Random) -> Files:
        return {"a.mat": seeds.mat(rng)}

    made.append(
        Seed(
            name="foreign",
            files=foreign,
            words=["check", "foreign.yaml"],
            touched=("foreign.yaml", "p.yaml", "a.mat"),
            odd=odd,
        )
    )
    return EntryPoint(name="signals", seeds=made, weight=1.0)


def own_code() -> EntryPoint:
    """Models in Python files of one's own, and what drives them; laws and effects would stay with this process."""
    words = ["diagnose", "--model", "own.py", "r1.csv", "r2.csv", "--workers", "0", *OUT]
    made = [
        Seed(name="model", files=code.model(), words=words, odd=code.model),
        Seed(name="recording", files=code.model(), words=words, touched=("r1.csv", "r1.yaml"), weight=0.5),
    ]
    return EntryPoint(name="own code", seeds=made, weight=0.6)


def answers() -> EntryPoint:
    """Plans, rolling, frames and templates, by words and by files."""
    whole = seeds.scenarios("drop_test", "side_overturn")
    # no such effect: a plan ends where its words are read, before it is worked out
    plan = ["plan", "drop_test.yaml", "--between", "mass,nothing", *OUT]
    rolling = ["rolling", "vehicles/vineyard_tractor.yaml", *OUT]
    frames = {"frame.yaml": whole["vehicles/rops/two_post_rear_tubes_3t.yaml"]}
    rops = ["rops", "frame.yaml", "--mass", "3000", "--segments", "2", *OUT]
    options = {
        "--sensor": "ground/sinkage",
        "--noise": "0.01",
        "--rate": "500",
        "--tolerance": "0.1",
        "--vary": "initiation.speed=1,2",
        "--uncertain": "vehicle.mass=1.0",
        "--set": "initiation.speed=2.0",
    }
    made = [
        Seed(name=f"plan {name}", files=whole, words=[*plan, name, value], vary=(7,), weight=0.4)
        for name, value in options.items()
    ]
    made += [
        Seed(name="plan between", files=whole, words=plan, vary=(3,), weight=0.4),
        Seed(name="plan", files=whole, words=plan, touched=("drop_test.yaml",)),
        Seed(name="rolling", files=whole, words=rolling, touched=("vehicles/vineyard_tractor.yaml",), weight=3.0),
        Seed(name="rolling by name", files=whole, words=rolling, vary=(1,), weight=0.5),
        Seed(name="rolling input", files=whole, words=[*rolling, "--input", "H6=1.6"], vary=(5,)),
        Seed(name="rolling set", files=whole, words=[*rolling, "--set", "vehicle.whole.mass=1600"], vary=(5,)),
        Seed(name="rops", files=frames, words=rops, touched=("frame.yaml",), weight=2.0),
        Seed(
            name="rops set", files=frames, words=[*rops, "--set", "vehicle.rops.feet.0.name=x"], vary=(9,), weight=0.5
        ),
        Seed(name="rops numbers", files=frames, words=rops, vary=(3, 5), weight=0.5),
        Seed(name="rops speed", files=frames, words=[*rops, "--speed", "1.0"], vary=(9,), weight=0.5),
        Seed(name="new", files={}, words=["new", "scenario", "out/mine"], vary=(1,), weight=0.5),
    ]
    return EntryPoint(name="plan, rolling, rops, new", seeds=made, weight=1.5)

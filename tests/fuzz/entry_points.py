"""Every entry point of the program: valid inputs, what of them may be changed, the command that reads them."""

from __future__ import annotations

import contextlib
import random
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field

from tests.fuzz import seeds, sets, texts
from tests.fuzz.changes import NUMBERS, RAW, changed
from tests.fuzz.seeds import Files

Rng = random.Random


@dataclass(frozen=True, kw_only=True)
class Seed:
    """Valid files and a command that reads them; `odd` builds them anew with odd values, `fixed` are not changed.

    `options` are words of which some may be put behind the command; `weight` says how often it is taken.
    """

    name: str
    files: Files
    words: Sequence[str]
    odd: Callable[[Rng], Files] | None = None
    touched: tuple[str, ...] = ()  # files that are changed; none named: all
    options: tuple[tuple[str, ...], ...] = ()
    weight: float = 1.0
    vary: tuple[int, ...] = ()  # words that are replaced by odd ones


@dataclass(frozen=True, kw_only=True)
class EntryPoint:
    """One entry point: its seeds, and its share of all inputs."""

    name: str
    seeds: list[Seed] = field(default_factory=list)
    weight: float = 1.0


def an_input(seed: Seed, rng: Rng) -> tuple[Files, list[str]]:
    """Files of an input that differ from the seed's, all of them for those built anew, and its command line."""
    words = list(seed.words)
    files: Files = {}
    if seed.odd is not None and rng.random() < 0.5:
        with contextlib.suppress(Exception):  # its writer may refuse what a reader must
            files = seed.odd(rng)
    if not seed.vary and (not files or rng.random() < 0.3):
        whole = {**seed.files, **files}
        name = rng.choice(seed.touched or tuple(whole))
        if name in whole:
            files[name] = changed(name, whole[name], rng)
    for at in seed.vary if not files else ():
        words[at] = _odd_word(words[at], rng)
    for option in seed.options:
        if rng.random() < 0.15:
            words += [w if not w.startswith("?") else _odd_word(w[1:], rng) for w in option]
    return files, words


def _odd_word(word: str, rng: Rng) -> str:
    """A word of the command line as somebody may get it wrong."""
    path, equals, value = word.partition("=")
    pool = (*RAW, *NUMBERS, "-1", "--", "", " ", "n" * 300, "../x", "\x1b[31m", "é", "a=b=c", "/", ".", "..", "\ud800")
    match rng.randrange(6) if equals else 5:
        case 0:
            steps = path.split(".")
            steps[rng.randrange(len(steps))] = rng.choice(("x", "", "*", "0", "-1", "9" * 400, "kind", "n" * 300, "é"))
            return f"{'.'.join(steps)}={value}"
        case 1:
            return path
        case 2:
            return f"{path}.{rng.choice(('kind', '0', '*', 'x'))}={value}"
        case 3 | 4:
            return f"{path}={rng.choice(pool)}"
        case _:
            return rng.choice(pool)


OUT = ("--out", "out")


def documents() -> list[EntryPoint]:
    """Scenarios, vehicles, ROPS, soils, studies, baselines."""
    root = seeds.shipped_folder()
    shipped = ("drop_test", "side_overturn", "cube_toss", "kerb_trip", "tilt_table", "pendulum", "static_rops_test")
    shipped += ("bank_overturn", "vibrating_plate", "rops_drop", "driven_pile", "cone_drop")
    whole = seeds.scenarios(*shipped)
    whole |= {"based.yaml": seeds.BASED}
    scenario = [
        Seed(name=n, files=whole, words=["check", f"{n}.yaml"], touched=(f"{n}.yaml",), weight=1.0) for n in shipped
    ]
    scenario += [
        Seed(
            name="base", files=whole, words=["check", "based.yaml"], touched=("based.yaml", "drop_test.yaml"), weight=5
        ),
        Seed(
            name="include",
            files=whole,
            words=["check", "drop_test.yaml"],
            touched=("soils/natural_clay.yaml",),
            weight=2,
        ),
        Seed(
            name="run",
            files=whole,
            words=["run", "drop_test.yaml", "--no-half-step", *OUT],
            touched=("drop_test.yaml",),
            weight=0.1,
        ),
        Seed(
            name="synthesize",
            files=whole,
            words=["synthesize", "based.yaml", *OUT],
            touched=("based.yaml",),
            weight=1.0,
        ),
        Seed(
            name="stability",
            files=whole,
            words=["stability", "side_overturn.yaml", "--headings", "1", *OUT],
            touched=("side_overturn.yaml",),
            weight=0.04,
        ),
    ]
    vehicles = [
        Seed(name=n, files=whole, words=["check", n], touched=(n,))
        for n in sorted(whole)
        if n.startswith(("vehicles/", "soils/"))
    ]
    study = {**seeds.scenarios("drop_test", "side_overturn"), "study.yaml": seeds.STUDY, "table.yaml": seeds.TABLE}
    study |= {
        "points.csv": b"speed\n1.0\n2.0\n",
        "studies/rops_stiffness.yaml": (root / "studies/rops_stiffness.yaml").read_bytes(),
    }
    studies = [
        Seed(name="check", files=study, words=["check", "study.yaml"], touched=("study.yaml",)),
        Seed(name="table", files=study, words=["check", "table.yaml"], touched=("table.yaml", "points.csv")),
        Seed(
            name="shipped",
            files=study,
            words=["check", "studies/rops_stiffness.yaml"],
            touched=("studies/rops_stiffness.yaml",),
            weight=0.3,
        ),
        Seed(
            name="run",
            files=study,
            words=["study", "table.yaml", "--workers", "0", *OUT],
            touched=("table.yaml", "points.csv"),
            weight=0.1,
        ),
    ]
    base = {
        **seeds.scenarios("drop_test"),
        "baselines/drop_test.yaml": (root / "baselines/drop_test.yaml").read_bytes(),
    }
    baselines = [
        Seed(
            name="check", files=base, words=["check", "baselines/drop_test.yaml"], touched=("baselines/drop_test.yaml",)
        ),
        Seed(
            name="regress",
            files=base,
            words=["regress", "drop_test.yaml", "--workers", "0", *OUT],
            touched=("baselines/drop_test.yaml",),
            weight=0.15,
        ),
    ]
    return [
        EntryPoint(name="scenario", seeds=scenario, weight=3.0),
        EntryPoint(name="vehicle, ROPS, soil", seeds=vehicles, weight=2.0),
        EntryPoint(name="study", seeds=studies, weight=1.5),
        EntryPoint(name="baseline", seeds=baselines, weight=1.0),
    ]


TO = (("--to", "parquet"), ("--to", "mme.zip"), ("--channel", "?*"), ("--select", "?*"), ("--as", "?csv"))


def recordings() -> list[EntryPoint]:
    """Our own recordings, profiles, and one entry point for each importer and each published set of the tables."""
    from rollover.recording.importers import COLLECTIONS, importers

    own = {"drop_1.csv": seeds.csv(seeds.drop_columns()), "drop_1.yaml": seeds.SIDE.encode()}
    packed = {"a.parquet": seeds.parquet(), "a.yaml": seeds.SIDE.encode()}
    imported = ["import", "drop_1.csv", *OUT]
    plain = [
        Seed(name="import csv", files=own, words=imported, options=TO),
        Seed(name="check csv", files=own, words=["check", "drop_1.csv"]),
        Seed(name="import parquet", files=packed, words=["import", "a.parquet", *OUT], options=TO),
        Seed(name="compare", files=own, words=["compare", "drop_test", "drop_1.csv", *OUT], weight=0.1),
        Seed(name="identify", files=own, words=["identify", "drop_1.csv", *OUT], weight=0.5),
    ]
    raw = {
        "drop_2.txt": seeds.csv({k: v for k, v in seeds.drop_columns().items() if k != "a"}),
        "p.yaml": seeds.PROFILE.encode(),
    }
    by_name = {**raw, "p.yaml": seeds.BY_NAME.encode()}
    profile = ["import", "drop_2.txt", "--profile", "p.yaml", *OUT]
    profiles = [
        Seed(name="profile", files=raw, words=profile, options=TO),
        Seed(name="conditions by name", files=by_name, words=profile, touched=("p.yaml",)),
    ]
    entry_points = [
        EntryPoint(name="recording", seeds=plain, weight=2.0),
        EntryPoint(name="profile", seeds=profiles, weight=1.5),
    ]
    makers: dict[str, tuple[str, Callable[..., bytes]]] = {
        "mat": ("a.mat", seeds.mat),
        "tdms": ("a.tdms", seeds.tdms),
        "mdf": ("a.mf4", seeds.mdf),
        "hdf5": ("a.h5", seeds.hdf5),
        "netcdf": ("a.nc", seeds.netcdf),
        "mcap": ("a.mcap", seeds.mcap),
        "ide": ("a.ide", seeds.ide),
        "xlsx": ("a.xlsx", seeds.xlsx),
    }
    columns = {
        "mat": "{t: {channel: time, unit: s}, F: {channel: ground/force_normal, unit: N}}",
        "mcap": "{/cell.force: {channel: ground/force_normal, unit: N}, "
        "/cell.effort.0: {channel: ground/sinkage, unit: m}}",
        "hdf5": "{t: {channel: time}, ground/force_normal: {channel: ground/force_normal}}",
        "netcdf": "{time: {channel: time}, F: {channel: ground/force_normal}}",
        "ide": "{a/b: {channel: ground/force_normal, unit: N}}",
        "mdf": "{ground/force_normal: {channel: ground/force_normal}}",
        "tdms": "{ground/force_normal: {channel: ground/force_normal}}",
        "xlsx": "{data/t: {channel: time}, data/F: {channel: ground/force_normal}}",
    }
    members = texts.mme_members()
    of_text: dict[str, list[Seed]] = {
        "iso-mme": [
            Seed(name="zip", files={"a.zip": texts.zipped(members)}, words=["import", "a.zip", *OUT], options=TO),
            Seed(name="tar", files={"a.tar.gz": texts.tarred(members)}, words=["import", "a.tar.gz", *OUT]),
            Seed(name="folder", files={f"a.mme/{k}": v for k, v in members.items()}, words=["import", "a.mme", *OUT]),
        ],
        "lvm": [Seed(name="lvm", files={"a.lvm": texts.lvm()}, words=["import", "a.lvm", *OUT])],
        "dts": [Seed(name="dts", files={"a.csv": texts.dts()}, words=["import", "a.csv", *OUT])],
        "nhtsa": [
            Seed(
                name="folder",
                files={f"v00001/{k}": v for k, v in texts.nhtsa().items()},
                words=["import", "v00001", *OUT],
            ),
            Seed(name="zip", files={"v00001.zip": texts.zipped(texts.nhtsa())}, words=["import", "v00001.zip", *OUT]),
        ],
    }
    for name in importers():
        if name in makers:
            file, make = makers[name]
            described = f"format: rollover-profile/1\nchannels: {columns[name]}\n".encode()
            files = {file: make(), "p.yaml": described}

            def odd(rng: Rng, file: str = file, make: Callable[..., bytes] = make) -> Files:
                return {file: make(rng)}

            found = [
                Seed(name="alone", files={file: files[file]}, words=["import", file, *OUT], odd=odd),
                Seed(
                    name="profile",
                    files=files,
                    words=["import", file, "--profile", "p.yaml", *OUT],
                    odd=odd,
                    touched=(file, file, "p.yaml"),
                ),
            ]
            entry_points.append(EntryPoint(name=f"importer {name}", seeds=found))
        elif name not in ("plain", "csv"):  # which the first two are
            entry_points.append(EntryPoint(name=f"importer {name}", seeds=of_text[name]))
    made: dict[str, Callable[..., Files]] = {
        "cube-tosses": sets.cube,
        "elbow-tosses": sets.elbow,
        "cone-drops": sets.cones,
        "falling-balls": sets.balls,
        "soil-penetrometer": sets.penetrometer,
        "impack": lambda rng=None: {"2mps_sphere_1.ide": seeds.ide(rng)},
    }
    for name in COLLECTIONS:
        make_set = made[name]
        slow = name in ("soil-penetrometer",)
        entry_points.append(
            EntryPoint(
                name=f"set {name}",
                seeds=[
                    Seed(
                        name=name,
                        files={f"set/{k}": v for k, v in make_set().items()},
                        words=["import", "set", "--as", name, *OUT],
                        odd=lambda rng, m=make_set: {f"set/{k}": v for k, v in m(rng).items()},
                    )
                ],
                weight=0.1 if slow else 0.6,
            )
        )
    return entry_points

"""Concealed cases: the same for the same seed, silent about their truth, and what they say they are."""

from __future__ import annotations

import json
import re
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from rollover import scenario
from rollover.proof import library, outside
from rollover.proof.campaign import ACCELERATION, DEPTH, FORCE, PLACE, SPEED
from rollover.proof.effect_size import strength
from rollover.proof.generator import KINDS, NULLS_SAY_NOTHING, Case, Order, make, plan
from rollover.proof.handover import fingerprint, write_case
from rollover.proof.instruments import Fault, Instruments, Noise, channel_filter
from rollover.proof.library import Setting
from rollover.proof.reference_solver import descend
from rollover.proof.rig import Rig
from rollover.recording import filters
from rollover.recording.importers import read_recording
from rollover.recording.noise_floor import noise_floor

IDS = (*library.EFFECTS, *outside.OUTSIDE)
SETTING = Setting(
    depths=(0.3, 0.2, 0.1),
    spans={FORCE: 3500.0, DEPTH: 0.3, PLACE: 0.4, SPEED: 3.0, ACCELERATION: 30.0},
    peaks={FORCE: 3500.0, DEPTH: 0.3, PLACE: 0.3, SPEED: 3.0, ACCELERATION: 20.0},
    channels=(FORCE, DEPTH, PLACE, SPEED, ACCELERATION),
)


@pytest.fixture(scope="module")
def some() -> list[Case]:
    orders = [Order(index=i, seed=5, kind="single", ids=(id,)) for i, id in enumerate(("soil-crust", "sensor-bias"))]
    return [make(o) for o in (*orders, Order(index=2, seed=5, kind="null"), Order(index=3, seed=5, kind="decoy"))]


def test_the_same_seed_the_same_case(some: list[Case], tmp_path: Path) -> None:
    again = make(Order(index=0, seed=5, kind="single", ids=("soil-crust",)))
    assert json.dumps(again.truth) == json.dumps(some[0].truth)
    write_case(again, tmp_path / "a")
    write_case(some[0], tmp_path / "b")
    assert fingerprint(tmp_path / "a") == fingerprint(tmp_path / "b")
    other = make(Order(index=0, seed=6, kind="single", ids=("soil-crust",)))
    assert other.truth["effects"][0]["parameters"] != some[0].truth["effects"][0]["parameters"]


def test_a_plan_keeps_its_shares_and_gives_each_effect_its_turn() -> None:
    orders = plan(200, 3)
    for kind, share in KINDS.items():
        assert sum(o.kind == kind for o in orders) == pytest.approx(200 * share, abs=1)
    singles = [o.ids[0] for o in orders if o.kind == "single"]
    counts = [singles.count(id) for id in library.EFFECTS if id not in library.NEGLIGIBLE]
    assert max(counts) - min(counts) <= 1
    assert min(counts) >= 3
    assert [o.kind for o in orders[:20]] != sorted(o.kind for o in orders[:20])
    assert {o.ids for o in plan(7, 1, effects=["soil-layer"])} == {("soil-layer",)}
    for wrong in ({"effects": ["soil-lair"]}, {"kinds": ["none"]}):
        with pytest.raises(ValueError, match="no such"):
            plan(3, 1, **wrong)  # type: ignore[arg-type]


def test_the_folder_says_nothing(some: list[Case], tmp_path: Path) -> None:
    words = set(NULLS_SAY_NOTHING)
    for id in IDS:
        words |= {id, *(w for w in re.split("[-:]", id) if w not in ("soil", "sensor", "mass", "speed", "impact"))}
    for case in some:
        folder = tmp_path / case.name
        write_case(case, folder)
        files = sorted(folder.iterdir())
        assert {p.name for p in files} == {"scenario.yaml"} | {
            f"r{n}.{end}" for n in range(1, len(case.recordings) + 1) for end in ("parquet", "yaml")
        }
        assert len({p.stat().st_mtime for p in (*files, folder)}) == 1
        assert (case.scenario == some[2].scenario) == (case.truth["rebounds"] == some[2].truth["rebounds"])
        for path in (p for p in files if p.name.startswith("r") and p.suffix == ".yaml"):
            text = path.read_text().lower()
            found = [w for w in words if re.search(rf"(?<![a-z]){re.escape(w)}(?![a-z])", text)]
            assert not found, f"{path.name}: {found}"
        # nothing but what was drawn alike for all: no number of the truth stands in a sidecar
        numbers = [v for e in case.truth["effects"] for v in e["parameters"].values()]
        said = " ".join(p.read_text() for p in files if p.suffix == ".yaml")
        assert not any(f"{v:.4g}" in said for v in numbers if v not in (1.0, 0.1))


def test_a_folder_is_what_a_diagnosis_reads(some: list[Case], tmp_path: Path) -> None:
    for case in some:
        write_case(case, tmp_path / case.name)
        found = scenario.load(tmp_path / case.name / "scenario.yaml")
        for number, made in enumerate(case.recordings, start=1):
            recording = read_recording(tmp_path / case.name / f"r{number}.parquet")
            assert found.replaced(dict(recording.conditions)).initiation.speed == made.conditions["initiation.speed"]
            for channel in made.channels:
                np.testing.assert_array_equal(recording[channel], made[channel])


# what older kinds drew and made before foreign forms and backgrounds came: sums of the samples, each channel over its
# largest, of the parameters, and the strength
BEFORE: dict[tuple[int, str, tuple[str, ...]], tuple[float, float, float]] = {
    (0, "null", ()): (9935.793924, 0.0, 0.0),
    (1, "single", ("soil-elastic-rebound",)): (2179.805824, 0.6026052204, 1045.4039),
    (2, "pair", ("soil-added-mass-growth", "sensor-lag")): (10321.21683, 2.439317723, 19.194219),
    (3, "outside", ("outside:memory",)): (6193.255207, 26711.41994, 3561.6297),
    (4, "other-form", ("soil-crust",)): (28963.18912, 1.033347508, 161.33466),
    (5, "single", ("structural-compliance",)): (25555.89155, 646019.3814, 5704.0847),
    (6, "single", ("soil-adhesion",)): (11759.99184, 6271.5704, 147.23316),
    (8, "scatter", ()): (20184.40003, 0.0, 0.0),
}


@pytest.mark.parametrize("which", BEFORE, ids=lambda which: f"{which[1]} {'+'.join(which[2])}".strip())
def test_a_seed_makes_the_same_case_after_newer_kinds(which: tuple[int, str, tuple[str, ...]]) -> None:
    index, kind, ids = which
    case = make(Order(index=index, seed=51, kind=kind, ids=ids))
    samples = [values for r in case.recordings for values in r.channels.values()]
    found = sum(float(np.nansum(np.abs(v)) / np.nanmax(np.abs(v))) for v in samples)
    parameters = sum(v for e in case.truth["effects"] for v in e["parameters"].values())
    *drawn, strength = BEFORE[which]
    assert (found, parameters) == pytest.approx(tuple(drawn), rel=1e-7)
    # a difference of two solutions: their events lie where the rounding of a processor puts them (2.8e-7 between two)
    assert case.truth["signal_to_noise"] == pytest.approx(strength, rel=1e-6)
    assert not {"background", "explains"} & set(case.truth)
    assert all("form" not in e and "over_background" not in e for e in case.truth["effects"])


def test_a_null_is_the_paper_with_noise() -> None:
    drawn = (make(Order(index=i, seed=2, kind="null")) for i in range(40))
    case = next(
        c for c in drawn if abs(c.truth["recordings"][0]["late"]) > 1e-3 and max(c.truth["noise_share"].values()) < 0.02
    )
    truth = case.truth
    assert truth["verdict"] == "no-mismatch"
    for recording, about in zip(case.recordings, truth["recordings"], strict=True):
        assert recording.conditions == {"initiation.speed": about["speed"]}
        exact = descend(Rig(speed=about["speed"]), -0.2, 1.0).channels(recording.time - about["late"])
        for channel, values in recording.channels.items():
            if channel in truth["cfc"]:
                continue
            off = (values - exact[channel])[np.isfinite(values)]
            assert np.std(off) == pytest.approx(truth["noise"][channel], rel=0.35)
            assert np.mean(np.abs(off) < 6.0 * truth["noise"][channel]) == 1.0


@pytest.mark.parametrize("id", IDS)
def test_every_effect_can_be_drawn_and_shows(id: str) -> None:
    drawn = {**library.EFFECTS, **outside.OUTSIDE}[id]
    for seed in range(8):
        change = drawn(np.random.default_rng(seed), SETTING)
        assert change.id == id
        assert change.parameters or change.fault
        assert bool(change.channel) == bool(change.fault)
        assert change.rig or change.fault or change.factors or change.speed_power


@pytest.mark.parametrize("id", ["soil-inertial-drag", "sensor-lag", "outside:bands", "mass"])
def test_strength_is_what_the_recordings_can_show(id: str) -> None:
    case = make(Order(index=1, seed=11, kind="outside" if ":" in id else "single", ids=(id,)))
    effect = case.truth["effects"][0]
    assert 0.05 < effect["over_noise"] < 500.0
    assert effect["signal_to_noise"] > effect["over_noise"]
    assert sum(cell["share"] for cell in effect["where"]) == pytest.approx(1.0)
    assert effect["over_noise"] == pytest.approx(case.truth["over_noise"])


def test_a_shift_of_the_clock_alone_is_no_strength() -> None:
    t = np.linspace(0.0, 1.0, 2001)
    a, b = {"x": np.sin(9.0 * t)}, {"x": np.sin(9.0 * (t - 1e-4))}
    found = strength([t], [b], [a], {"x": 1e-3}, [{"x": 1.0}])
    assert found["over_noise"] < 0.01
    bent = strength([t], [{"x": a["x"] + 1e-3 * t}], [a], {"x": 1e-3}, [{"x": 1.0}])
    assert bent["over_noise"] == pytest.approx(np.sqrt(1.0 / 3.0), rel=0.05)
    assert bent["where"][0]["start"] == pytest.approx(0.05 ** (1.0 / 3.0), abs=0.05)


def test_noise_has_its_level_and_colour() -> None:
    random = np.random.default_rng(0)
    for noise in (Noise(sigma=2.0), Noise(sigma=2.0, colour=0.8), Noise(sigma=2.0, cfc=180)):
        drawn = noise.drawn(60_000, 1e-4, random)
        assert np.std(drawn) == pytest.approx(2.0, rel=0.06)
    drawn = Noise(sigma=1.0, colour=0.8).drawn(60_000, 1e-4, random)
    assert np.corrcoef(drawn[1:], drawn[:-1])[0, 1] == pytest.approx(0.8, abs=0.01)
    assert noise_floor(drawn).independence == pytest.approx(Noise(sigma=1.0, colour=0.8).independence(1e-4), rel=0.25)


def test_the_channel_filter_is_that_of_the_standard() -> None:
    x = np.cumsum(np.random.default_rng(1).standard_normal(4000))
    ours, theirs = channel_filter(x, 1e-4, 180), filters.filtered(x, 1e-4, 180)
    np.testing.assert_allclose(ours[400:-400], theirs[400:-400], atol=1e-6)


def reading(channel: str, **fault: Any) -> tuple[Any, Any, Any]:
    t = np.linspace(-0.04, 0.5, 541)
    drop = descend(Rig(), -0.2, 0.7)
    instruments = Instruments(faults={channel: Fault(**fault)})
    read = instruments.limited(instruments.read(drop, t, channel), t, channel, np.random.default_rng(0))
    return t, drop.channels(t)[channel], read


def test_what_each_fault_of_a_sensor_leaves() -> None:
    _, x, y = reading(FORCE, gain=1.03)
    np.testing.assert_allclose(y, 1.03 * x, rtol=1e-12)
    _, x, y = reading(FORCE, bias=40.0)
    np.testing.assert_allclose(y[:30], 40.0, rtol=1e-12)  # before contact
    _, x, y = reading(FORCE, limit=3000.0)
    assert y.max() == 3000.0
    np.testing.assert_array_equal(y[x < 3000.0], x[x < 3000.0])
    t, x, y = reading(DEPTH, offset=0.004)
    np.testing.assert_allclose(y[4:], x[:-4], atol=1e-12)
    t, x, y = reading(DEPTH, drift=0.02)
    np.testing.assert_allclose(y, np.interp(0.98 * t, t, x), atol=2e-5)
    t, x, y = reading(PLACE, lag=0.005)
    slope = np.gradient(y, t)
    np.testing.assert_allclose((y + 0.005 * slope)[60:-1], x[60:-1], atol=2e-4)  # x = y + tau dy/dt
    _, x, y = reading(DEPTH, quantum=0.02)
    assert len(np.unique(y)) <= 18
    _, x, y = reading(FORCE, dropouts=30.0, lasting=0.005)
    assert 3 < np.sum((y == 0.0) & (x > 100.0)) < 200
    t, x, y = reading(FORCE, hum=10.0, frequency=50.0)
    assert np.max(np.abs(y - x)) == pytest.approx(10.0, rel=0.01)
    np.testing.assert_allclose((y - x)[:500], (y - x)[20:520], atol=1e-6)
    t, x, y = reading(FORCE, warming=0.1, middle=0.1, width=0.01)
    assert y[-1] == pytest.approx(1.1 * x[-1])
    assert y[45] == pytest.approx(x[45], rel=1e-3)
    _, x, y = reading(FORCE, curved=1e-5)
    np.testing.assert_allclose(y, x * (1.0 + 1e-5 * x), rtol=1e-12)


def test_a_fault_of_nothing_reads_what_is() -> None:
    _, x, y = reading(FORCE)
    np.testing.assert_array_equal(x, y)

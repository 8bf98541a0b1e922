"""A drop that reaches a harder layer is none of the law's: told by a rise of K', left out, and cut off above it."""

from __future__ import annotations

import functools
import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

import rollover as ro
from ground.branches import fit_branches
from ground.drops import UnusableDrop, loading
from ground.identify import identify
from ground.rise import rise
from rollover.calibration.ground_law import drop_of
from rollover.recording.importers.plain import write
from tests.ground.recorded_drops import TRUTH, recorded
from tests.rollover.test_identify_command import call


@functools.cache
def layered(depth: float, speed: float, **more: float) -> ro.Recording:
    hidden = {"effects.soil-layer.depth": depth, **{f"effects.soil-layer.{k}": v for k, v in more.items()}}
    return ro.synthesize("drop_test", {"initiation.speed": speed}, hidden=hidden, seed=1)


@pytest.mark.parametrize("noise", [0.0, 0.005, 0.02])
@pytest.mark.parametrize("rate", [500.0, 2000.0])
def test_a_drop_of_the_law_has_no_rise(noise: float, rate: float) -> None:
    for seed in range(10):
        for drop in recorded(seed, noise=noise, rate=rate):
            assert rise(loading(drop, 0.1)) is None


@pytest.mark.parametrize(("depth", "speed"), [(0.05, 1.3), (0.05, 2.0), (0.1, 2.0), (0.2, 3.0)])
@pytest.mark.parametrize("ratio", [1.8, 3.0])
def test_a_harder_layer_is_found_at_its_depth(depth: float, speed: float, ratio: float) -> None:
    drop = drop_of("d", layered(depth, speed, stiffness_ratio=ratio), ro.load("drop_test"))
    found = rise(loading(drop, 0.1))
    assert found is not None
    # noise of K' over the few bins beside the layer: it falls by less than 10 % along 10 % of the depth
    assert 0.9 * depth < found.cut <= found.above < depth
    assert found.below > depth
    assert found.hard / found.soft == pytest.approx(ratio, rel=0.2)
    with pytest.raises(UnusableDrop, match=f"a harder layer; to-depth {found.cut:.3g} takes the rows above it alone"):
        identify([drop])


def test_rows_above_the_layer_give_the_law_of_the_soil_there() -> None:
    found = ro.identify({f"d{v}": layered(0.05, v) for v in (1.0, 1.3, 1.6)}, to_depth=0.046)
    for c in found.numbers["coefficients"][2:]:
        assert c["low"] <= TRUTH[c["name"]] <= c["high"]
    assert found.law.first_stiffness == pytest.approx(TRUTH["first_stiffness"], rel=0.02)
    assert found.law.domain.sinkage_most < 0.046


def test_drops_that_end_above_the_layer_are_taken(tmp_path: Path) -> None:
    names = []
    for speed in (1.0, 1.3, 1.6):
        path = tmp_path / f"d{speed}.csv"
        write(layered(0.1, speed), path)
        names.append(str(path))
    done = call(*names, "--out", str(tmp_path / "soil"), "--json")
    assert done.exit_code == 0, done.output
    answer = json.loads(done.stdout)
    assert [d["name"] for d in answer["drops"]] == ["d1.0", "d1.3"]
    assert [r.split(":")[0] for r in answer["refused"]] == ["d1.6"]
    assert "left out: d1.6: K' rises from" in done.stderr
    done = call(*names, "--to-depth", "0.05", "--law", "bearing", "--out", str(tmp_path / "other"))
    assert (done.exit_code, done.stderr.strip()) == (2, "to_depth: of law ye-2006 alone, got law bearing; without it")


def test_branches_of_layered_drops_are_finite_or_unknown() -> None:
    drops = [drop_of(f"d{v}", layered(d, v), ro.load("drop_test")) for d in (0.05, 0.1) for v in (1.5, 2.0, 3.0)]
    for some in (drops[:3], drops[3:]):
        found = fit_branches([loading(drop, 0.1) for drop in some])
        assert np.all(np.isfinite(found.covariance))
        assert np.all(np.isfinite(found.x))


def test_drops_within_the_first_branch_are_refused_with_a_cure() -> None:
    # K_b1 = 75 kN/m on 132 kg: v/omega is 8 mm at 0.2 m/s, and the branches meet at 33 mm
    with pytest.raises(UnusableDrop, match=r"0.2 m/s, 0.3 m/s: not of this law, sinkage_exponent: .*; faster drops"):
        identify(recorded(0, speeds=(0.2, 0.3)))


def test_noise_of_a_cut_drop_is_that_of_all_its_rows() -> None:
    drop = recorded(0, noise=0.01)[1]
    whole, cut = loading(drop, 0.1), loading(replace(drop, to_depth=0.03), 0.1)
    assert cut.noise == whole.noise
    assert cut.deepest == whole.deepest
    assert cut.depth.max() <= 0.03 < whole.depth.max()

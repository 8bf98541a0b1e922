"""The test stand in the picture: a beam at the loaded point, a block on chains, and plots that show its force."""

from __future__ import annotations

import functools

import numpy as np
import pytest

from rollover.run import Run
from rollover.scenario import load
from rollover.simulate import run
from viz.log import write_rrd
from viz.scene import Block, extent, parts, rotation


@functools.cache
def made(name: str) -> Run:
    return run(load(name).replaced({"simulation.duration": 0.5}))


def test_beam_stands_at_the_rops_and_faces_it() -> None:
    result = made("static_rops_test")
    beam = result.motion["beam"]
    # the rear load's point, 0.4 m to the left at the crossbar's height; pushed forward
    assert beam.origin[-1] == pytest.approx([-0.12, 0.40, 2.46], abs=0.05)
    assert rotation(beam.quaternion[-1])[:, 0] == pytest.approx([1.0, 0.0, 0.0], abs=0.01)
    (face,) = [p for p in parts(result) if isinstance(p, Block) and p.path == "world/beam/beam"]
    assert face.centre[0] < 0.0
    assert face.size[1:] == (0.5, 0.15)
    assert result.contact["device"].force[-1, 0] > 1e3


def test_block_hangs_in_the_picture_and_moves() -> None:
    result = made("pendulum")
    (block,) = [p for p in parts(result) if isinstance(p, Block) and p.path == "world/pendulum/block"]
    assert block.size == (0.68, 0.60, 0.68)
    assert result.motion["pendulum"].origin[0, 2] > result.motion["pendulum"].origin[-1, 2] > 2.0
    assert {"world/lashings", "world/pendulum/chain_one"} <= {p.path for p in parts(result)}
    assert extent(result)[1] < 5.0


def test_weight_turns_on_a_tilt_table() -> None:
    result = made("tilt_table")
    weight = result.contact["weight"].force[-1]
    assert np.linalg.norm(weight) == pytest.approx(3000 * 9.81, rel=1e-6)
    assert np.degrees(np.arctan2(weight[1], -weight[2])) == pytest.approx(20.5, abs=0.02)


@pytest.mark.parametrize("name", ["static_rops_test", "pendulum", "tilt_table", "vibrating_plate", "driven_pile"])
def test_recordings_are_written(name: str, tmp_path) -> None:  # type: ignore[no-untyped-def]
    write_rrd(made(name), tmp_path / "a.rrd")
    assert (tmp_path / "a.rrd").stat().st_size > 10_000

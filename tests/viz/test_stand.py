"""The test stand in the picture: a beam at the loaded point, a block on chains, and plots that show its force."""

from __future__ import annotations

import functools

import numpy as np
import pytest

from rollover.assessment.criteria import criteria
from rollover.assessment.loads import peak_loads
from rollover.dynamics.result import Run
from rollover.dynamics.simulate import run
from rollover.scenario import load
from tests.viz.html import Parts
from tests.viz.test_report import ANSWER
from viz.content.blocks import Figure
from viz.content.verdict import verdict
from viz.figures.stand_view import stand_section
from viz.pages.report import headline, page
from viz.recordings.log import write_rrd
from viz.recordings.scene import extent, parts, rotation
from viz.recordings.solids import Block


@functools.cache
def made(name: str) -> Run:
    duration = {"driven_pile": 1.7, "pendulum": 1.4}.get(name, 0.5)
    return run(load(name).replaced({"simulation.duration": duration}))


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


STANDS = {
    "static_rops_test": ("Test stand, force: at most 9.23 kN at 0.500 s", "0 of 1 loads that began"),
    "pendulum": ("Test stand, force: at most 57.0 kN at 1.01", "The block struck at 3.35 m/s with 11.27 kJ"),
    "tilt_table": ("Stood up to 20.50 deg", "Stood up to 20.50 deg"),
    "vibrating_plate": ("Test stand, force: at most 12.0 kN at 0.2", "21 turns at 70 Hz with 11.99 kN"),
    "driven_pile": ("Ground force: at most ", "3 blows drive it "),
}


REQUIRED = {  # what a page answers first where a standard asks for something
    "static_rops_test": "1 of 6 requirements are met; least clearance ",
    "pendulum": "All 3 requirements are met; least clearance ",
}


@pytest.mark.parametrize("name", STANDS)
def test_a_stand_is_told_by_what_it_found(name: str) -> None:
    """On the page and in the picture: its own load first, its sentence and table, nothing of loads that never were."""
    result, (first, sentence) = made(name), STANDS[name]
    peaks, rows = peak_loads(result), criteria(result)
    head = headline(result, peaks, rows)
    assert head.sentence.startswith(REQUIRED.get(name, first))
    assert first in f"{head.sentence} {head.detail}"
    text = page(result, peaks, ANSWER, rows=rows)
    said = Parts(text).said
    assert sentence in said
    assert "Test stand" in said
    assert "ROPS force" not in said
    assert "Histories" in said
    picture = verdict(result, peaks)
    assert picture.startswith("# " + first.replace("at most ", ""))
    assert sentence in picture
    assert "none" not in picture
    for row in rows:
        assert f"{row.requirement.standard}: {row.requirement.name}" in said


def test_energy_of_a_static_test_stands_beside_what_is_asked() -> None:
    result = made("static_rops_test")
    figures = [b for b in stand_section(result, criteria(result))[0].blocks if isinstance(b, Figure)]
    assert len(figures) == 2
    assert "OECD Code 4 / ISO 5700: longitudinal load, rear" in figures[1].svg
    assert "rear" in figures[0].svg
    assert "dashed" in figures[1].caption


def test_what_drives_a_striker_is_a_phase() -> None:
    assert made("driven_pile").phases[-1] == (0.8, "driven")
    assert made("vibrating_plate").phases[-1] == (0.2, "driven")
    assert "rest" in {name for _, name in made("driven_pile").phases[:-1]}, "before the first blow it rests"
    assert made("tilt_table").phases == ((0.0, "support"),)


@pytest.mark.parametrize("name", STANDS)
def test_recordings_are_written(name: str, tmp_path) -> None:  # type: ignore[no-untyped-def]
    write_rrd(made(name), tmp_path / "a.rrd")
    assert (tmp_path / "a.rrd").stat().st_size > 10_000

"""Sections and steels: closed forms against tables and sums over points, buckling classes, what is refused."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np
import pytest

from rollover.spec import document
from rollover.spec.beam import Beam
from rollover.spec.rops import Rops
from rollover.spec.sections import Section
from rollover.spec.steel import Steel
from rollover.system.errors import InputError

S355 = document.load(document.shipped_folder() / "steels" / "S355.yaml", Steel)


# A cm2, I cm4 along depth and width, W_pl cm3 likewise, J cm4, kg/m as the tables of the two standards print them
@pytest.mark.parametrize(
    ("tube", "corners", "table"),
    [
        ((60.0, 60.0, 4.0), "cold-formed", (8.55, 43.6, 43.6, 17.6, 17.6, 72.6, 6.71)),
        ((60.0, 60.0, 4.0), "hot-finished", (8.79, 45.4, 45.4, 18.3, 18.3, 72.5, 6.90)),
        ((60.0, 100.0, 4.0), "hot-finished", (12.0, 158.0, 70.5, 39.1, 27.3, 156.0, 9.41)),
    ],
)
def test_hollow_sections_are_those_of_the_tables(tube, corners, table) -> None:
    p = Section(tube=tube, corners=corners).properties
    found = (
        p.area * 1e4,
        p.second_h * 1e8,
        p.second_b * 1e8,
        p.plastic_h * 1e6,
        p.plastic_b * 1e6,
        p.torsion * 1e8,
        p.area * 7850.0,
    )
    assert found == pytest.approx(table, rel=5e-3)  # three digits are printed


def _summed(inside, b: float, h: float) -> tuple[float, ...]:
    """A, both I, both W_pl from a grid of 1000 x 1000 points, mm; each within 1 % for walls of 3 mm and more."""
    x, y = ((np.arange(1000) + 0.5) / 1000 * side - 0.5 * side for side in (b, h))
    X, Y = np.meshgrid(x, y)
    cell = b * h / 1e6
    on = inside(X, Y)
    return tuple(cell * float(np.sum(f[on])) for f in (np.ones_like(X), Y**2, X**2, np.abs(Y), np.abs(X)))


@pytest.mark.parametrize(
    ("section", "inside"),
    [
        (Section(round_tube=(48.3, 3.2)), lambda x, y: np.abs(np.hypot(x, y) - 22.55) <= 1.6),
        (Section(round_bar=40.0), lambda x, y: np.hypot(x, y) <= 20.0),
        (Section(solid=(30.0, 50.0)), lambda x, y: np.abs(x) <= 15.0),
        (Section(plate=(100.0, 8.0)), lambda x, y: np.abs(x) <= 50.0),
        (
            Section(tube=(60.0, 120.0, 5.0), corners="sharp"),
            lambda x, y: (np.abs(x) > 25.0) | (np.abs(y) > 55.0),
        ),
    ],
)
def test_closed_forms_are_sums_over_the_section(section, inside) -> None:
    p, (A, I_h, I_b, W_h, W_b) = section.properties, _summed(inside, section.width * 1e3, section.depth * 1e3)
    found = (p.area * 1e6, p.second_h * 1e12, p.second_b * 1e12, p.plastic_h * 1e9, p.plastic_b * 1e9)
    assert found == pytest.approx((A, I_h, I_b, W_h, W_b), rel=0.01)
    assert p.elastic_h == pytest.approx(p.second_h / (0.5 * section.depth))
    assert p.elastic_b == pytest.approx(p.second_b / (0.5 * section.width))


def test_torsion_of_thin_tubes_and_bars() -> None:
    thin = Section(tube=(80.0, 80.0, 1.0), corners="sharp").properties
    assert thin.torsion == pytest.approx(0.079**3 * 0.001, rel=0.005)  # Bredt: t a^3 for a square
    square = Section(solid=(40.0, 40.0)).properties
    assert square.torsion == pytest.approx(0.1406 * 0.04**4, rel=0.005)  # Saint-Venant's number for a square
    assert Section(plate=(200.0, 4.0)).properties.torsion == pytest.approx(0.2 * 0.004**3 / 3.0, rel=0.02)


@pytest.mark.parametrize(
    ("section", "strength", "classes"),
    [
        # c/t = (100 - 9)/3 = 30.3 against 33, 38, 42 times epsilon
        (Section(tube=(100.0, 100.0, 3.0)), 235e6, (1, 1, 1)),
        (Section(tube=(100.0, 100.0, 3.0)), 355e6, (2, 2, 2)),  # 26.8, 30.9
        (Section(tube=(120.0, 120.0, 3.0)), 355e6, (4, 4, 4)),  # 37 > 34.2
        (Section(tube=(60.0, 150.0, 3.0)), 235e6, (1, 4, 4)),  # 47: a web of class 1, a flange of class 4
        (Section(round_tube=(100.0, 2.0)), 355e6, (3, 3, 3)),  # 50 against 33.1, 46.3, 59.6
        (Section(solid=(10.0, 90.0)), 460e6, (1, 1, 1)),
    ],
)
def test_walls_that_buckle_are_told_by_their_class(section, strength, classes) -> None:
    found = section.wall_class(strength)
    assert (found["h"], found["b"], found["compression"]) == classes


@pytest.mark.parametrize("n", [0.0, 0.2, 0.4, 0.6, 0.8])
def test_an_axial_force_takes_its_part(n) -> None:
    bar = Section(solid=(30.0, 50.0))
    assert bar.utilisation(n, 1.0 - n * n, 0.0) == pytest.approx(1.0)  # the stress blocks of a rectangle, exactly
    # a hollow section: the middle carries N, the rest M. The clause is a straight line beside that curve: for this tube
    # up to 5.4 % above it, where the webs are just used up, and 7.3 % below it near n = 1
    tube = Section(tube=(60.0, 60.0, 4.0), corners="sharp")
    y = (np.arange(3000) + 0.5) / 100.0
    wide = np.where(y > 26.0, 60.0, 8.0)
    rest = np.cumsum(wide) > n * wide.sum()
    left = float(np.sum((wide * y)[rest]) / np.sum(wide * y))
    assert tube.utilisation(n, left, 0.0) == pytest.approx(1.0, abs=0.074)
    line = min((1.0 - n) / (1.0 - 0.5 * 416.0 / 896.0), 1.0)
    assert tube.utilisation(n, line, 0.0) == tube.utilisation(n, 0.0, line) == pytest.approx(1.0)


def test_two_moments_share_a_section() -> None:
    ring = Section(round_tube=(60.0, 4.0))
    assert ring.utilisation(0.0, 0.6, 0.8) == pytest.approx(1.0)  # the resultant of a round section
    square = Section(tube=(60.0, 60.0, 4.0))
    assert square.utilisation(0.0, 0.5, 0.5) == pytest.approx(2.0 ** (1.0 / 1.66) / 2.0)


def test_a_beam_weighs_what_its_steel_does() -> None:
    beam = Beam(
        name="post", start=(0.0, 0.3, 0.0), end=(0.0, 0.5, 1.5), section=Section(solid=(30.0, 50.0)), material=S355
    )
    body = beam.body
    # summed over points of the bar
    n = 400
    along, depth, width = beam.axes
    s = (np.arange(n) + 0.5) / n * beam.length
    p, r = (((np.arange(20) + 0.5) / 20 - 0.5) * side for side in (0.05, 0.03))
    points = (
        np.array(beam.start)
        + s[:, None, None, None] * along
        + p[None, :, None, None] * depth
        + r[None, None, :, None] * width
    ).reshape(-1, 3)
    mass = 7850.0 * 0.03 * 0.05 * beam.length
    off = points - points.mean(axis=0)
    J = mass * (np.mean(np.sum(off**2, axis=1)) * np.eye(3) - off.T @ off / len(off))
    assert body.mass == pytest.approx(mass)
    assert body.centre_of_mass == pytest.approx(points.mean(axis=0))
    assert body.inertia == pytest.approx(np.diag(J), rel=5e-3)
    assert body.products == pytest.approx((J[0, 1], J[0, 2], J[1, 2]), rel=5e-3, abs=1e-9)
    assert depth == pytest.approx((1.0, 0.0, 0.0))  # along the vehicle unless told otherwise


def test_shipped_steels_are_those_of_the_standard() -> None:
    shelf = document.shipped_folder() / "steels"
    found = {p.stem: document.load(p, Steel) for p in sorted(shelf.glob("*.yaml"))}
    strengths = {name: (s.yield_strength / 1e6, s.tensile_strength / 1e6) for name, s in found.items()}
    assert strengths == {
        "S235": (235, 360),
        "S275": (275, 430),
        "S355": (355, 490),
        "S420": (420, 520),
        "S460": (460, 540),
    }
    for steel in found.values():
        assert {path for p in steel.provenance for path in p.of} == {
            "yield_strength",
            "tensile_strength",
            "youngs_modulus",
            "poisson_ratio",
            "density",
            "uniform_strain",
            "rate_factor",
        }
        assert steel.tangent == pytest.approx(
            (steel.tensile_strength - steel.yield_strength) / (steel.uniform_strain - steel.yield_strength / 210e9)
        )


FRAME = """\
base: vehicles/rops/two_post_rear_3t.yaml
members:
  - {name: left, start: [-0.1, 0.5, 0.85], end: [-0.1, 0.5, 2.4], section: {tube: [80, 80, 5]}, material: S355}
  - {kind: beam, name: right, start: [-0.1, -0.5, 0.85], end: [-0.1, -0.5, 2.4], section: SECTION, material: MATERIAL}
"""


def _rops(folder: Path, section: str = "{tube: [80, 80, 5]}", material: str = "S355") -> Rops:
    file = folder / "frame.yaml"
    file.write_text(FRAME.replace("SECTION", section).replace("MATERIAL", material))
    return document.load(file, Rops)


def test_a_file_gives_sections_and_steels_by_name(tmp_path) -> None:
    found = _rops(tmp_path, material="{base: S420, yield_strength: 450.0e6}")
    left, right = found.beams
    assert (left.material.name, right.material.yield_strength) == ("S355", 450e6)
    assert right.material.tensile_strength == 520e6
    (_, shapes) = found.parts["rops"]
    assert [shape.diameter for shape in shapes] == [0.08, 0.08]  # what the ground meets


@pytest.mark.parametrize(
    ("section", "material", "said"),
    [
        (
            "{tube: [80, 80, 42]}",
            "S355",
            "section.tube: no room for its walls and cold-formed corners, got [80.0, 80.0, 42.0]",
        ),
        ("{tube: [80, 80, 40], corners: sharp}", "S355", "section.tube: no room for its walls, got"),
        ("{round_tube: [60, 30]}", "S355", "section.round_tube: no hollow, got [60.0, 30.0] mm; t below 30 mm"),
        ("{tube: [80, 80, 4], plate: [10, 4]}", "S355", "got tube and plate; one"),
        ("{}", "S355", "section.tube: one of tube, round_tube, solid, plate, round_bar is needed, got none; one"),
        ("{tube: [80, 80]}", "S355", "section.tube: too short, got a list of 2"),
        ("{tube: [80, 80, -4]}", "S355", "out of bounds, got -4"),
        ("{tube: [80, 80, 4]}", "S356", "material: no such file, got 'S356'; did you mean 'S355'?"),
        (
            "{tube: [80, 80, 4]}",
            "{base: S355, yield_strength: 600.0e6}",
            "yield_strength: above the tensile strength (4.9e+08 Pa), got 6e+08",
        ),
        (
            "{tube: [80, 80, 4]}",
            "{base: S355, uniform_strain: 0.001}",
            "uniform_strain: reached before the steel yields",
        ),
    ],
)
def test_what_no_mill_rolls_is_refused_where_it_stands(tmp_path, section, material, said) -> None:
    with pytest.raises(InputError) as e:
        _rops(tmp_path, section, material)
    line = str(e.value).splitlines()[0]
    assert said in line
    # by its place where the name of a file is wrong: what the member is called is not read yet
    assert line.startswith(tuple(f"{tmp_path / 'frame.yaml'}:4: members.{at}." for at in ("right", "1")))


def test_a_depth_along_the_member_is_no_depth(tmp_path) -> None:
    with pytest.raises(ValueError, match="depth_towards: no direction across the member"):
        Beam(
            name="post",
            start=(0.0, 0.0, 0.0),
            end=(0.0, 0.0, 1.0),
            section=Section(solid=(30.0, 50.0)),
            material=S355,
            depth_towards=(0.0, 0.0, 2.0),
        )
    turned = Beam(
        name="post",
        start=(0.0, 0.0, 0.0),
        end=(0.0, 0.0, 1.0),
        section=Section(solid=(30.0, 50.0)),
        material=S355,
        depth_towards=(1.0, 1.0, 0.5),
    )
    assert turned.axes[1] == pytest.approx((math.sqrt(0.5), math.sqrt(0.5), 0.0))

"""A structure that its joints, or a vehicle that its tyres leave a motion: which one, and what is missing."""

from __future__ import annotations

import re
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import pytest
from typer.testing import CliRunner

from rollover.cli.main import app
from rollover.scenario import Scenario, load
from rollover.spec import document
from rollover.spec.connector import Connector
from rollover.spec.inertia import MassProperties
from rollover.spec.mechanism import STANDARD_GRAVITY, FreeMotion, Joint, free_motions
from rollover.spec.rops import Rops
from rollover.system.errors import InputError

SHELF = document.shipped_folder() / "vehicles"
# 80 kg half a metre above the middle of its mounts
FRAME = MassProperties(mass=80.0, centre_of_mass=(0.0, 0.0, 1.5), inertia=(20.0, 10.0, 15.0))


def mount(name: str, position: tuple[float, float, float], turn: float = 0.0) -> Joint:
    rates = {"stiffness": (1e6, 1e6, 1e6), "damping": (0.0, 0.0, 0.0), "rotational_stiffness": (turn, turn, turn)}
    connector = Connector(name=name, position=position, **rates)
    return Joint(path=f"mounts.{name}", below="chassis", above="rops", connector=connector)


def free(*joints: Joint) -> tuple[FreeMotion, ...]:
    return free_motions({"rops": FRAME}, joints)


def test_one_mount_without_torsion_leaves_three_turns() -> None:
    found = free(mount("only", (0.2, 0.1, 1.0)))
    assert [m.axis for m in found] == [(1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0)]
    assert all(m.turns and m.point == (0.2, 0.1, 1.0) and m.stiffness < 1e-6 for m in found)


@pytest.mark.parametrize(
    ("ends", "axis"),
    [
        (((0.0, 0.4, 1.0), (0.0, -0.4, 1.0)), (0.0, 1.0, 0.0)),
        (((-0.3, 0.0, 1.0), (0.5, 0.0, 1.0)), (1.0, 0.0, 0.0)),
        (((-0.3, 0.3, 1.0), (0.3, -0.3, 1.0)), (0.707, -0.707, 0.0)),
        (((0.0, 0.4, 0.9), (0.0, -0.2, 1.7)), (0.0, -0.6, 0.8)),
    ],
)
def test_two_mounts_leave_the_turn_about_the_line_through_them(
    ends: tuple[tuple[float, float, float], tuple[float, float, float]], axis: tuple[float, float, float]
) -> None:
    (found,) = free(mount("a", ends[0]), mount("b", ends[1]))
    assert found.turns
    assert found.axis == pytest.approx(axis, abs=5e-4)
    assert found.point == pytest.approx([0.5 * (a + b) for a, b in zip(*ends, strict=True)], abs=5e-4)
    assert {j.connector.name for j in found.joints} == {"a", "b"}


def test_a_third_mount_off_the_line_holds_without_torsion() -> None:
    two = mount("left", (0.0, 0.4, 1.0)), mount("right", (0.0, -0.4, 1.0))
    assert len(free(*two, mount("middle", (0.0, 0.0, 1.0)))) == 1
    assert free(*two, mount("front", (0.3, 0.0, 1.0))) == ()


def test_a_turn_is_free_until_stiffness_outdoes_weight() -> None:
    two = (0.0, 0.4, 1.0), (0.0, -0.4, 1.0)
    (found,) = free(*(mount(f"m{y}", at, turn=1.0) for y, at in enumerate(two)))
    # 80 kg at 0.5 m would topple below m g h; the bound is its radius of gyration about the mounts instead of h
    radius = (0.25 + 0.5 * 45.0 / 80.0) ** 0.5
    assert found.stiffness == pytest.approx(2.0, rel=1e-2)
    assert found.needed == pytest.approx(80.0 * STANDARD_GRAVITY * radius, rel=2e-2)
    assert found.needed > 80.0 * STANDARD_GRAVITY * 0.5
    assert free(*(mount(f"m{y}", at, turn=0.5 * 1.1 * found.needed) for y, at in enumerate(two))) == ()
    assert len(free(*(mount(f"m{y}", at, turn=0.5 * 0.9 * found.needed) for y, at in enumerate(two)))) == 1


def refused(changes: Mapping[str, Any], file: str = "two_post_folding_2t") -> str:
    with pytest.raises(InputError) as found:
        document.replaced(document.load(SHELF / "rops" / f"{file}.yaml", Rops), changes)
    (fault,) = found.value.faults
    return f"{fault.path}: {fault.message}"


def test_hinges_without_torsion_leave_the_upper_part_its_turn() -> None:
    told = refused({"upper.hinges.*.rotational_stiffness": [6e5, 0.0, 4e5]})
    assert told.startswith("upper.hinges: rops_upper turns freely about y through [-0.08, 0, 1.45] m, got ")
    assert "got rotational_stiffness 0 N m/rad about y at left and right; more than" in told


def test_one_hinge_is_named_with_the_value_that_it_lacks() -> None:
    hinge = {"name": "fold", "position": [-0.08, 0.0, 1.45], "stiffness": [2e7] * 3, "damping": [0.0] * 3}
    told = refused({"upper.hinges": [{**hinge, "rotational_stiffness": [6e5, 0.0, 4e5]}]})
    assert told.startswith("upper.hinges.fold.rotational_stiffness: rops_upper turns freely about y through")
    told = refused({"upper.hinges": [hinge]})
    assert "rops_upper turns freely about x, y and z through [-0.08, 0, 1.45] m, got 0 N m/rad about x, y and z" in told


def test_mounts_are_told_before_the_hinges_above_them() -> None:
    still = {"mounts.*.rotational_stiffness": [0.0] * 3, "upper.hinges.*.rotational_stiffness": [0.0] * 3}
    told = refused(still)
    assert told.startswith("mounts: rops with rops_upper turns freely about y through [-0.08, 0, 0.75] m")
    assert "at left and right;" in told


def test_mounts_too_soft_along_an_axis_leave_a_shift() -> None:
    told = refused({"mounts.*.stiffness": [1.0, 1e5, 7e6]}, "two_post_rear_2t")
    assert told.startswith("mounts: rops shifts freely along x, got stiffness 1 N/m along x at left and right; more")


@pytest.mark.parametrize("path", sorted(SHELF.glob("rops/*.yaml")), ids=lambda p: p.stem)
def test_shipped_structures_are_held(path: Path) -> None:
    rops = document.load(path, Rops)
    assert free_motions({name: body for name, (body, _) in rops.parts.items()}, rops.joints) == ()


def test_check_and_run_name_the_user_s_file_and_the_motion(tmp_path: Path) -> None:
    text = (SHELF / "rops" / "two_post_rear_3t.yaml").read_text(encoding="utf-8")
    own = tmp_path / "own.yaml"
    own.write_text(
        re.sub(r"rotational_stiffness: \S+ \[.*\]", r"rotational_stiffness: &rotational_stiffness [0, 0, 0]", text)
    )
    line = 1 + own.read_text(encoding="utf-8").splitlines().index("mounts:")
    scenario = tmp_path / "scenario.yaml"
    scenario.write_text("base: " + str(document.find("kerb_trip").resolve()) + "\nvehicle: {rops: own.yaml}\n")
    for command in (
        ["check", str(own)],
        ["check", str(scenario)],
        ["run", str(scenario), "--out", str(tmp_path / "o")],
    ):
        done = CliRunner().invoke(app, command)
        assert done.exit_code == 2, command
        (told,) = done.stderr.splitlines()
        assert told.startswith(f"{own}:{line + 1}: ")  # the first of the mounts
        assert "mounts: rops turns freely about y through [-0.1, 0, 0.85] m" in told
    assert not (tmp_path / "o").exists()


def test_the_line_is_that_of_the_one_joint_s_value(tmp_path: Path) -> None:
    folded = (SHELF / "rops" / "two_post_folding_2t.yaml").read_text(encoding="utf-8").partition("  hinges:\n")
    hinge = "    - {name: fold, position: [0, 0, 1.45], stiffness: [1e7, 1e7, 1e7], damping: [0, 0, 0],\n"
    hinge += "       rotational_stiffness: [1e5, 0, 1e5]}\n"
    own = tmp_path / "own.yaml"
    own.write_text(folded[0] + folded[1] + hinge + "  members:" + folded[2].partition("  members:")[2])
    line = 1 + own.read_text(encoding="utf-8").splitlines().index(hinge.splitlines()[1])
    done = CliRunner().invoke(app, ["check", str(own)])
    assert done.stderr.startswith(
        f"{own}:{line}: upper.hinges.fold.rotational_stiffness: rops_upper turns freely about y"
    )


def standing(changes: Mapping[str, Any]) -> Scenario:
    return load("tilt_table").replaced(changes)


@pytest.mark.parametrize(
    ("changes", "told"),
    [
        (
            {"vehicle.wheels.front_left.centre.0": 0.0, "vehicle.wheels.front_right.centre.0": 0.0},
            "chassis with front_axle turns freely about y through [0, 0, 0] m",
        ),
        (
            {"vehicle.wheels.front_left.carrier": "chassis", "vehicle.wheels.front_right.carrier": "chassis"},
            "front_axle turns freely about x through [2.25, 0, 0.55] m on its tyres, got no wheel",
        ),
        (
            {"vehicle.wheels.rear_left.carrier": "front_axle", "vehicle.wheels.rear_right.carrier": "front_axle"},
            "chassis turns freely about x through [2.25, 0, 0.55] m on its tyres, got no wheel",
        ),
    ],
)
def test_what_the_tyres_do_not_hold_is_named(changes: Mapping[str, Any], told: str) -> None:
    with pytest.raises(InputError, match=re.escape(f"vehicle.wheels: {told}")):
        standing(changes)


def test_wheels_that_roll_and_the_axle_s_swing_are_meant() -> None:
    assert standing({"vehicle.wheels.*.rolls": True}).vehicle.name

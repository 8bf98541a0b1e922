"""Feet of a frame of beams: what a frame in one piece on them carries is what the frame of beams alone does."""

from __future__ import annotations

from dataclasses import replace

import pytest

from rollover.assessment.frame_test import frame_test
from rollover.dynamics.simulate import run
from rollover.scenario import Scenario, load
from rollover.spec import document
from rollover.spec.feet import STIFF, STIFF_TURN
from rollover.spec.rops import Rops
from rollover.system.errors import InputError

FILE = document.shipped_folder() / "vehicles" / "rops" / "two_post_rear_tubes_3t.yaml"
FRAME = document.load(FILE, Rops)
H, WIDE = 1.61, 1.0


def test_feet_are_a_portal_and_cantilevers() -> None:
    left, right = FRAME.standing
    assert (left.stiffness, left.yield_moment) == (right.stiffness, right.yield_moment)
    post = FRAME.beams[0]
    EI, m = 210e9 * post.section.properties.second_h, post.plastic_resistance[1]
    r = H / WIDE  # the same tube all round
    # sideways: half of the portal's sway stiffness, hinges at foot and knee
    assert left.stiffness[1] == pytest.approx(12.0 * EI / H**3 * (1.0 + 6.0 * r) / (4.0 + 6.0 * r))
    assert left.yield_force == (None, pytest.approx(2.0 * m / H), None)
    # lengthways: a cantilever that turns about its foot
    assert left.rotational_stiffness[1] == pytest.approx(3.0 * EI / H)
    assert left.yield_moment == (None, pytest.approx(m), None)
    assert (left.stiffness[0], left.stiffness[2]) == (STIFF, STIFF)
    assert (left.rotational_stiffness[0], left.rotational_stiffness[2]) == (STIFF_TURN, STIFF_TURN)
    assert left.rate_factor is not None
    assert (left.rate_factor.rate, left.rate_factor.exponent) == (3200.0, 5.0)


def test_a_weaker_rail_is_where_the_knee_gives_way() -> None:
    posts, rail = FRAME.beams[:2], FRAME.beams[2]
    weak = replace(rail, section=replace(rail.section, tube=(50.0, 50.0, 4.0)))
    frame = replace(FRAME, members=(*posts, weak))
    m, k = posts[0].plastic_resistance[1], weak.plastic_resistance[2]
    assert k < m
    assert frame.standing[0].yield_force[1] == pytest.approx((m + k) / H)
    assert frame.standing[0].stiffness[1] < FRAME.standing[0].stiffness[1]
    alone = replace(FRAME, members=posts)  # nothing across: cantilevers both ways
    assert alone.standing[0].yield_force == (None, None, None)
    assert alone.standing[0].rotational_stiffness[0] == pytest.approx(alone.standing[0].rotational_stiffness[1])


def test_a_run_on_feet_is_the_frame_of_beams() -> None:
    """The side load as a run and as beams alone, without the rate of strain: force, deflection and set."""
    base = load("static_rops_test")
    quiet = {f"vehicle.rops.members.{b.name}.material.rate_factor": None for b in FRAME.beams}
    side = {"initiation.loads": [{"name": "side", "asks": "side", "come_from": "left"}], "initiation.rate": 0.4}
    scenario: Scenario = base.replaced({"vehicle.rops": str(FILE)}).replaced(quiet | side)
    (beams,) = frame_test(scenario).tests
    (found,) = run(scenario).tests
    assert found["energy"] == pytest.approx(beams["energy"], rel=0.01)
    # a bent line for the beams' knee and for the zone that grows: 5 % in force, 10 % in the way, 15 % in the set
    assert found["force"] == pytest.approx(beams["force"], rel=0.05)
    assert found["deflection"] == pytest.approx(beams["deflection"], rel=0.10)
    assert found["permanent_set"] == pytest.approx(beams["permanent_set"], rel=0.15)


def with_effects(rops: Rops, changes: dict[str, float]) -> Rops:
    """The frame that a tractor in an overturn has under effects, in this order."""
    found = load("side_overturn").replaced({"vehicle.rops": rops} | changes).applied().vehicle.rops  # type: ignore[union-attr]
    assert found is not None
    return found


STRENGTH = {
    "effects.rops-elasticity.stiffness": 2e5,
    "effects.rops-plasticity.yield_force": 9e3,
    "effects.mount-play.gap": 0.01,
}


def test_effects_of_the_rops_reach_its_feet() -> None:
    found = with_effects(FRAME, STRENGTH)
    assert found == with_effects(FRAME, dict(reversed(STRENGTH.items())))
    (before, _), (left, right) = FRAME.standing, found.standing
    assert left.stiffness[1] + right.stiffness[1] == pytest.approx(2e5)
    assert sum(found.side_stiffness.values()) == pytest.approx(2e5)
    ratio = left.stiffness[1] / before.stiffness[1]
    assert ratio < 0.5
    # lengthways in proportion, dashpots by the root; what a post does not decide stays
    assert left.rotational_stiffness[1] == pytest.approx(ratio * before.rotational_stiffness[1])
    assert left.damping[1] == pytest.approx(ratio**0.5 * before.damping[1])
    assert left.rotational_damping[1] == pytest.approx(ratio**0.5 * before.rotational_damping[1])
    assert (left.stiffness[0], left.stiffness[2]) == (STIFF, STIFF)
    assert (left.rotational_stiffness[0], left.rotational_stiffness[2]) == (STIFF_TURN, STIFF_TURN)
    assert left.yield_force == (None, pytest.approx(4.5e3), None)
    assert left.yield_moment == before.yield_moment
    assert left.play == right.play == (0.01, 0.01, 0.01)


def test_effects_reach_feet_that_turn_and_mounts_beside_them() -> None:
    """Without a rail a post is k_turn/H^2 at its top and yields at M/H there; a mount beside it has its own share."""
    alone = replace(FRAME, members=FRAME.beams[:2])
    left = with_effects(alone, STRENGTH).standing[0]
    assert left.rotational_stiffness[0] == pytest.approx(1e5 * H**2)
    assert left.yield_moment[0] == pytest.approx(4.5e3 * H)
    assert left.yield_force == (None, None, None)
    assert left.stiffness == (STIFF, STIFF, STIFF)
    foot = replace(FRAME, feet=FRAME.feet[:1], members=FRAME.beams[:2])
    own = foot.side_stiffness["feet.left"]
    mount = load("side_overturn").vehicle.rops.mounts[1]  # type: ignore[union-attr]
    mount = replace(mount, position=(-0.10, -0.50, 0.85))
    both = with_effects(replace(foot, mounts=(mount,)), STRENGTH)
    whole = own + mount.stiffness[1]
    assert both.side_stiffness == pytest.approx(
        {"mounts.right": 2e5 * mount.stiffness[1] / whole, "feet.left": 2e5 * own / whole}
    )
    assert both.mounts[0].yield_force[1] == pytest.approx(9e3 * mount.stiffness[1] / whole)
    assert both.standing[1].yield_moment[0] == pytest.approx(9e3 * own / whole * H)


@pytest.mark.parametrize("effect", ["rops-elasticity.stiffness", "rops-plasticity.yield_force", "mount-play.gap"])
def test_an_effect_at_its_null_leaves_feet_as_they_are(effect) -> None:
    base = load("field_upset_tubes")
    null = base.replaced({f"effects.{effect}": 0.0 if effect.endswith("gap") else None})
    assert null.effects
    assert null.applied().vehicle == base.vehicle


def test_a_foot_s_stated_values_go_before_its_section(tmp_path) -> None:
    file = tmp_path / "frame.yaml"
    text = FILE.read_text()
    file.write_text(text.replace(RIGHT, RIGHT[:-1] + ", side_stiffness: 2.0e5, side_yield: 15.0e3, play: 0.002}"))
    left, right = document.load(file, Rops).standing
    assert left == FRAME.standing[0]
    assert right.stiffness[1] == pytest.approx(2.0e5)
    assert (right.yield_force[1], right.play) == (15.0e3, (0.002, 0.002, 0.002))


RIGHT = "{name: right, position: [-0.10, -0.50, 0.85]}"


@pytest.mark.parametrize(
    ("new", "said"),
    [
        (RIGHT.replace("-0.50", "-0.90"), "feet.right.position: no member with a section ends there"),
        (RIGHT.replace("right", "left"), "two share a name"),
    ],
)
def test_a_foot_without_a_post_is_refused(tmp_path, new, said) -> None:
    file = tmp_path / "frame.yaml"
    text = FILE.read_text()
    assert RIGHT in text
    file.write_text(text.replace(RIGHT, new))
    with pytest.raises(InputError, match=said):
        document.load(file, Rops)


def test_a_frame_without_mounts_and_feet_is_refused(tmp_path) -> None:
    file = tmp_path / "frame.yaml"
    text = FILE.read_text()
    file.write_text(text.split("feet:")[0] + "members:" + text.split("members:", 1)[1])
    with pytest.raises(InputError, match="mounts: none given; at least one, or feet of members with a section"):
        document.load(file, Rops)

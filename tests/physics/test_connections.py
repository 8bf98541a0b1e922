"""Welds, bolts and cast pieces at ends of members: elastic lines, published bolts, cantilevers that give way there."""

from __future__ import annotations

import json
import math
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from rollover.assessment.frame_json import json_of, scenario_of
from rollover.assessment.frame_test import frame_test
from rollover.dynamics.frame.connected import connected, forces_at
from rollover.spec import document
from rollover.spec.connections import Bolts, Cast, Connection, Forces, Weld
from rollover.spec.rops import Rops
from rollover.spec.sections import Section
from tests.physics.frames import MILD, TUBE, bar, pushed

STRENGTH = 360e6 / (math.sqrt(3.0) * 0.8)  # Pa, of a fillet in mild steel: f_u/(sqrt(3) beta_w)
FLANGE = Bolts(size=16, places=((-60.0, -50.0), (60.0, -50.0), (60.0, 50.0), (-60.0, 50.0)))
LENGTH = 1.2
POST = bar("post", (0.0, 0.0, 0.0), (0.0, 0.0, LENGTH), TUBE, MILD)


def alone(**parts: float) -> Forces:
    n, v_h, v_b, m_h, m_b, t = (parts.get(k, 0.0) for k in ("n", "v_h", "v_b", "m_h", "m_b", "t"))
    return n, v_h, v_b, m_h, m_b, t


@pytest.mark.parametrize("section", [Section(tube=(60.0, 100.0, 4.0)), Section(round_tube=(76.1, 4.0))])
def test_a_weld_is_an_elastic_line(section: Section) -> None:
    """Stress at the worst place of a line of width a around the outline, its moduli summed place by place."""
    a, count = 4e-3, 20000
    s = (np.arange(count) + 0.5) / count
    b, h = section.width, section.depth
    if section.is_round:
        p, r, ds = 0.5 * b * np.cos(2.0 * np.pi * s), 0.5 * b * np.sin(2.0 * np.pi * s), math.pi * b / count
    else:
        way, around = 2.0 * (b + h) * s, 2.0 * (b + h)
        p = np.interp(way, [0.0, h, h + b, 2.0 * h + b, around], np.array([-1, 1, 1, -1, -1]) * 0.5 * h)
        r = np.interp(way, [0.0, h, h + b, 2.0 * h + b, around], np.array([1, 1, -1, -1, 1]) * 0.5 * b)
        ds = around / count
    area, second = a * ds * count, [a * ds * float(np.sum(x * x)) for x in (p, r)]
    given = alone(n=30e3, m_h=2.0e3, m_b=-0.7e3)
    stress = np.abs(given[0] / area - given[3] * p / second[0] - given[4] * r / second[1]).max()
    assert Weld(throat=4.0).use(given, section, MILD) == pytest.approx(stress / STRENGTH, rel=1e-4)
    enclosed = 0.25 * math.pi * b * b if section.is_round else b * h
    twisted = 1e3 / (2.0 * enclosed * a)  # Bredt
    assert Weld(throat=4.0).use(alone(t=1e3), section, MILD) == pytest.approx(twisted / STRENGTH, rel=1e-4)


def test_a_thicker_fillet_carries_more_than_its_tube() -> None:
    """f_vw = 262 MPa of 360 MPa steel: of a tube of 60 x 60 x 4 a throat of 4 mm carries less, of 5 mm more."""
    thin, thick = (Connection(name="foot", member="post", end="start", weld=Weld(throat=a)) for a in (4.0, 5.0))
    assert Weld.strength(MILD) == pytest.approx(259.8e6, rel=1e-3)
    share = [
        min(x / y for x, y in zip(c.resistances(POST), POST.plastic_resistance, strict=False)) for c in (thin, thick)
    ]
    # M_w/M_pl = a h (b + h/3) f_vw/(W_pl f_y), 19.2 cm3 over 17.6 cm3 at 4 mm
    assert share[1] / share[0] == pytest.approx(1.25)
    moment = 4e-3 * 60e-3 * 80e-3 * STRENGTH
    assert share[0] == pytest.approx(
        min(moment / POST.plastic_resistance[1], 2 * 0.12 * 4e-3 * STRENGTH / POST.plastic_resistance[0])
    )


def test_bolts_have_their_published_resistances() -> None:
    """M16 of 8.8: 90.4 and 60.3 kN, M20 of 10.9: 176 and 98 kN, with the factor 1.25 of design (many tables)."""
    for size, grade, tension, shear in ((16, "8.8", 90.4e3, 60.3e3), (20, "10.9", 176.4e3, 98.0e3)):
        found = replace(FLANGE, size=size, grade=grade).resistances
        # tables round A_s to 157 and 245 mm2, by 0.2 %, and resistances to three digits
        assert found == pytest.approx((1.25 * tension, 1.25 * shear), rel=3e-3)


def test_bolts_share_what_they_hold() -> None:
    tension, shear = FLANGE.resistances
    # four alike: N/4; a moment about their middle by p/S_p, S_p = 4 x 60^2; pressed together nothing pulls
    assert FLANGE.use(alone(n=4e4), TUBE, MILD) == pytest.approx(1e4 / tension)
    assert FLANGE.use(alone(n=-4e4), TUBE, MILD) == 0.0
    pulled = 3e3 * 0.06 / (4.0 * 0.06**2)
    assert FLANGE.use(alone(m_h=3e3), TUBE, MILD) == pytest.approx(pulled / tension)
    assert FLANGE.use(alone(m_h=3e3, n=-4e4), TUBE, MILD) == pytest.approx((pulled - 1e4) / tension)
    assert FLANGE.use(alone(v_h=3e4, v_b=4e4), TUBE, MILD) == pytest.approx(1.25e4 / shear)
    # a torque on the bolts' polar way: T rho/(S_p + S_r), rho = hypot(60, 50)
    rho = math.hypot(0.06, 0.05)
    assert FLANGE.use(alone(t=2e3), TUBE, MILD) == pytest.approx(2e3 * rho / (4.0 * rho**2) / shear)
    # pull and shear together, beyond F_t/F_t,R: F_v/F_v,R + F_t/(1.4 F_t,R)
    both = FLANGE.use(alone(n=4e4, v_h=8e4), TUBE, MILD)
    assert both == pytest.approx(2e4 / shear + 1e4 / (1.4 * tension))


def test_a_cast_piece_carries_elastically() -> None:
    cast = Cast(section=Section(solid=(50.0, 80.0)), strength=240e6)
    assert cast.use(alone(m_h=240e6 * 50e-3 * 80e-3**2 / 6.0), TUBE, MILD) == pytest.approx(1.0)
    assert cast.use(alone(m_b=240e6 * 80e-3 * 50e-3**2 / 6.0), TUBE, MILD) == pytest.approx(1.0)
    assert cast.use(alone(n=-240e6 * 50e-3 * 80e-3), TUBE, MILD) == pytest.approx(1.0)
    assert cast.use(alone(v_h=240e6 / math.sqrt(3.0) * 50e-3 * 80e-3), TUBE, MILD) == pytest.approx(1.0)


@pytest.mark.parametrize("way", [(1.0, 0.0, 0.0), (0.0, 1.0, 0.0)])
@pytest.mark.parametrize("what", ["weld", "bolts", "cast"])
def test_a_cantilever_gives_way_at_its_foot(way: tuple[float, float, float], what: str) -> None:
    """A load F at L: M = F L, V = F at the foot; where the use is 1, with the lean of some mm left out."""
    holds = {"weld": Weld(throat=2.0), "bolts": FLANGE, "cast": Cast(section=Section(solid=(40.0, 30.0)), strength=2e8)}
    foot = Connection(name="foot", member="post", end="start", **{what: holds[what]})  # type: ignore[arg-type]
    frame, _, curve = pushed([POST], {POST.end: way}, feet=[POST.start], most=0.06, step=0.001, segments=12)
    n, v_h, v_b, m_h, m_b, _ = forces_at(frame, 0, "start", curve[5])
    moment, shear = (m_h, v_h) if way[0] else (m_b, v_b)
    assert abs(moment) == pytest.approx(curve[5].force * LENGTH, rel=2e-3)
    assert abs(shear) == pytest.approx(curve[5].force, rel=1e-2)
    assert abs(n) < 0.01 * curve[5].force
    tension, sheared = FLANGE.resistances
    arm, stiff = (0.06, 4.0 * 0.06**2) if way[0] else (0.05, 4.0 * 0.05**2)
    depth, width = (30e-3, 40e-3) if way[0] else (40e-3, 30e-3)
    of = {
        "weld": math.hypot(LENGTH / (2e-3 * 0.06 * 0.08), 1.0 / (4.0 * 0.06 * 2e-3)) / STRENGTH,
        "bolts": max(LENGTH * arm / stiff / tension, LENGTH * arm / stiff / (1.4 * tension) + 0.25 / sheared),
        "cast": math.hypot(LENGTH * 6.0 / (width * depth**2), math.sqrt(3.0) / (width * depth)) / 2e8,
    }
    (row,) = connected(frame, [foot], curve)["connections"]
    if what == "bolts":  # beyond what the tube itself carries
        assert row["failed"] is None
        assert row["use"] == pytest.approx(max(p.force for p in curve) * of[what], rel=0.02)
        return
    assert row["failed"]["force"] == pytest.approx(1.0 / of[what], rel=5e-3)
    before = [p for p in curve if p.deflection <= row["failed"]["deflection"]]
    assert row["failed"]["energy"] >= before[-1].energy


def welded(throat: float) -> Rops:
    """The shipped frame of tubes with both feet welded all around."""
    rops = document.load(document.shipped_folder() / "vehicles/rops/two_post_rear_tubes_3t.yaml", Rops)
    feet = [
        Connection(name=f"foot_{s}", member=f"post_{s}", end="start", weld=Weld(throat=throat))
        for s in ("left", "right")
    ]
    return replace(rops, connections=tuple(feet))


def answer_of(rops: Rops | None) -> dict:
    scenario = scenario_of("two_post_rear_tubes_3t", 3000.0)
    scenario = scenario if rops is None else scenario.replaced({"vehicle": replace(scenario.vehicle, rops=rops)})
    return json_of(frame_test(scenario, segments=4))


def test_a_weak_weld_ends_a_test_a_strong_one_changes_nothing() -> None:
    without, weak, strong = answer_of(None), answer_of(welded(4.0)), answer_of(welded(10.0))
    assert (without["verdict"], weak["verdict"], strong["verdict"]) == ("met", "not met", "met")
    for old, new in zip(without["tests"], strong["tests"], strict=True):
        rows = {k: v for k, v in new.items() if k not in ("connections", "broken")}
        assert rows == old
        assert max(c["use"] for c in new["connections"]) < 1.0
    rear, crush = weak["criteria"][0], next(c for c in weak["criteria"] if c["requirement"]["name"] == "crush, rear")
    at = weak["tests"][0]["connections"][0]["failed"]
    # what was absorbed until then is what counts; a broken foot is none in the loads after it
    assert rear["simulated"] == pytest.approx(at["energy"])
    assert "foot_left gives way at" in rear["note"]
    assert crush["simulated"] == 0.0
    assert "foot_left gave way in load 'rear'" in crush["note"]
    assert any(s.startswith("foot_left, fillet weld, throat 4 mm, carries") for s in weak["warnings"])
    assert "give way as their welds" in weak["method"]
    json.dumps(weak, allow_nan=False)


@pytest.mark.parametrize(
    ("line", "said"),
    [
        ("{name: a, member: post_left, end: start}", "one of weld, bolts and cast, got none"),
        ("{name: a, member: poost, end: start, weld: {throat: 5}}", "no member with a section, got 'poost'; post_left"),
        ("{name: a, member: post_left, end: middle, weld: {throat: 5}}", "'middle'"),
        (
            "{name: a, member: post_left, end: end, bolts: {size: 17, places: [[1, 1], [-1, -1]]}}",
            "no coarse thread, got M17; one of 8, 10",
        ),
        (
            "{name: a, member: post_left, end: end, bolts: {size: 16, places: [[0, 40], [0, -40]]}}",
            "in one line, got [[0.0, 40.0], [0.0, -40.0]]",
        ),
    ],
)
def test_connections_that_hold_nothing_are_refused(tmp_path: Path, line: str, said: str) -> None:
    file = tmp_path / "frame.yaml"
    file.write_text(f"base: vehicles/rops/two_post_rear_tubes_3t.yaml\nconnections:\n  - {line}\n")
    with pytest.raises(Exception, match=r"frame.yaml:\d") as caught:
        document.load(file, Rops)
    assert said in str(caught.value)

"""`rollover rops`: what it writes, answers and refuses."""

from __future__ import annotations

import json
from pathlib import Path

import pytest
from typer.testing import CliRunner

from rollover.assessment.frame_json import scenario_of
from rollover.assessment.frame_test import frame_test
from rollover.cli.main import app

FRAME = """\
# Two posts and a beam of square tube.
frame: two-post-rear
body: {mass: 110.0, centre_of_mass: [-0.10, 0.0, 1.42], inertia: [68.7, 45.0, 24.3]}
mounts:
  - &mount
    name: left
    position: [-0.10, 0.50, 0.85]
    stiffness: [5.0e7, 5.0e7, 5.0e7]
    damping: [400.0, 320.0, 2400.0]
    rotational_stiffness: [1.0e6, 1.0e6, 1.0e6]
  - name: right
    position: [-0.10, -0.50, 0.85]
    stiffness: [5.0e7, 5.0e7, 5.0e7]
    damping: [400.0, 320.0, 2400.0]
    rotational_stiffness: [1.0e6, 1.0e6, 1.0e6]
members:
  - {name: post_left, start: [-0.10, 0.50, 0.85], end: [-0.10, 0.50, 2.46], section: {tube: TUBE}, material: S355}
  - {name: post_right, start: [-0.10, -0.50, 0.85], end: [-0.10, -0.50, 2.46], section: {tube: TUBE}, material: S355}
  - {name: crossbar, start: [-0.10, -0.55, 2.46], end: [-0.10, 0.55, 2.46], section: {tube: TUBE}, material: S355}
corner: [-0.10, 0.55, 2.50]
clearance_zone:
  seat_reference_point: [0.30, 0.0, 1.15]
"""


def written(folder: Path, tube: str = "[80, 80, 6]", **others: str) -> Path:
    text = FRAME.replace("TUBE", tube).replace("- &mount\n    name", "- name")
    for old, new in others.items():
        assert old in text
        text = text.replace(old, new)
    file = folder / "frame.yaml"
    file.write_text(text)
    return file


def call(*words: object):
    return CliRunner().invoke(app, ["rops", *(str(w) for w in words)])


def test_a_frame_is_tested_by_its_vehicles_mass(tmp_path) -> None:
    out = tmp_path / "out"
    done = call(written(tmp_path), "--mass", "3000", "--out", out)
    assert done.exit_code == 0, done.stderr
    answer = json.loads((out / "rops.json").read_text())
    assert answer["format"] == "rollover-rops/1"
    assert (answer["segments"], answer["base"], answer["mass"]) == (12, "mounts", 3000.0)
    loads = {e["name"]: e for e in answer["tests"]}
    assert list(loads) == ["rear", "crush-rear", "side", "crush-front"]
    # energies 1.4 M and 1.75 M, force 20 M: where a load ends
    assert loads["rear"]["energy"] == pytest.approx(4200.0, rel=1e-5)
    assert loads["side"]["energy"] == pytest.approx(5250.0, rel=1e-5)
    for name in ("crush-rear", "crush-front"):
        assert loads[name]["force"] == pytest.approx(60e3, rel=1e-5)
    for e in loads.values():
        x, y = zip(*e["curve"], strict=True)
        assert (x[0], y[0]) == (0.0, 0.0)
        assert e["energy"] == pytest.approx(
            sum(0.5 * (b - a) * (u + v) for a, b, u, v in zip(x, x[1:], y, y[1:], strict=False))
        )
        assert -1e-9 <= e["permanent_set"] < e["deflection"]
    # both feet hinge under the rear load, the nearer post first; a two-post frame is two cantilevers lengthways
    assert [h["member"] for h in loads["rear"]["hinges"]] == ["post_left", "post_right"]
    assert {h["member"] for h in loads["side"]["hinges"]} == {"post_left", "post_right", "crossbar"}
    sway = 4.0 * answer["members"][0]["plastic_moment_width"] / 1.61
    assert loads["side"]["mechanism_force"] == pytest.approx(sway, rel=0.05)  # straight hardening adds to 4 M_p/h
    assert answer["verdict"] == "met"
    assert {c["verdict"] for c in answer["criteria"]} == {"met"}
    assert answer["frame_mass"] == pytest.approx(sum(m["mass"] for m in answer["members"]))
    said = done.stdout
    assert "rear: hinge in post_left, 0.00 of 1.61 m" in said
    assert "side load: met" in said
    text = (out / "report.html").read_text()
    near = min(e["zone_distance"] for e in answer["tests"] if e.get("zone_distance") is not None)
    assert f"All {len(answer['criteria'])} requirements are met; least clearance {1e3 * near:.0f} mm." in text
    assert f"rollover rops {tmp_path / 'frame.yaml'} --mass 3000" in text


def test_the_same_numbers_come_as_json(tmp_path) -> None:
    file = written(tmp_path)
    done = call(file, "--mass", "3000", "--out", tmp_path / "out", "--json", "--segments", "6")
    answer = json.loads(done.stdout)
    assert answer == json.loads((tmp_path / "out" / "rops.json").read_text())
    assert (answer["segments"], answer["elements"]) == (6, 6 + 6 + 4 + 6 + 4 + 4) or answer["segments"] == 6


def test_a_vehicle_or_scenario_brings_its_loads(tmp_path) -> None:
    file = written(tmp_path)
    done = call("utility_tractor", "--set", f"vehicle.rops={file}", "--out", tmp_path / "v", "--json")
    assert done.exit_code == 0, done.stderr
    assert [e["name"] for e in json.loads(done.stdout)["tests"]] == ["rear", "crush-rear", "side", "crush-front"]
    done = call("static_rops_test", "--set", f"vehicle.rops={file}", "--out", tmp_path / "s", "--json")
    tests = {e["name"]: e for e in json.loads(done.stdout)["tests"]}
    assert tests["side"]["given"] == pytest.approx(5437.25, rel=1e-6)  # the scenario's surplus
    assert tests["side"]["required_energy"] == 5250.0
    assert tests["front"]["energy"] == pytest.approx(0.35 * 3000.0 * (1.0 + 107.0 / 3000.0), rel=1e-5)


def test_a_load_pushed_on_shows_the_margin(tmp_path) -> None:
    near = written(tmp_path, "[60, 60, 4]", **{"[0.30, 0.0, 1.15]": "[0.30, 0.0, 1.55]"})
    scenario = scenario_of(near, 1000.0).replaced({"initiation.push_on": "rear"})
    found = frame_test(scenario)
    last = found.tests[-1]
    assert last["name"] == "rear"
    assert last["status"].startswith("pushed on until it failed: deflected by more than 600 mm")
    row = next(r for r in found.criteria if r.requirement.name.startswith("longitudinal"))
    # into the operator's space long before: what was absorbed until then is what counts
    assert row.simulated == pytest.approx(last["entered"]["energy"])
    assert row.margin == pytest.approx(last["entered"]["energy"] / 1400.0 - 1.0)
    assert row.verdict == "met"


def test_a_frame_that_is_too_weak_fails(tmp_path) -> None:
    done = call(written(tmp_path, "[40, 40, 3]"), "--mass", "3000", "--out", tmp_path / "out", "--json")
    assert done.exit_code == 0
    answer = json.loads(done.stdout)
    assert answer["verdict"] == "not met"
    rear = answer["tests"][0]
    assert rear["entered"] is not None or rear["status"].startswith("given up")
    met = sum(c["verdict"] == "met" for c in answer["criteria"])
    assert met < len(answer["criteria"])
    said = f"{met} of {len(answer['criteria'])} requirements are met"
    text = (tmp_path / "out" / "report.html").read_text()
    assert said in text
    deepest = -min(e["zone_distance"] for e in answer["tests"] if e.get("zone_distance") is not None)
    assert (f"a member enters the clearance zone by {1e3 * deepest:.0f} mm" in text) is (deepest >= 0.0)


def test_thin_walls_are_told(tmp_path) -> None:
    done = call(written(tmp_path, "[120, 120, 3]"), "--mass", "2000", "--out", tmp_path / "out", "--json")
    said = json.loads(done.stdout)["warnings"]
    assert any(s.startswith("post_left, tube 120 x 120 x 3 of S355, is of class 4 in bending") for s in said)
    stocky = call(written(tmp_path), "--mass", "2000", "--out", tmp_path / "stocky", "--json")
    assert json.loads(stocky.stdout)["warnings"] == []


@pytest.mark.parametrize("begins_with", ["post", "crossbar"])
def test_a_crushing_beam_lies_on_the_posts(begins_with: str, tmp_path) -> None:
    """60 kN in the middle of the beam would be P L/8 = 7.5 kN m, beyond its 6.3 kN m; on the posts nothing yields."""
    file = written(tmp_path, "[60, 60, 4]")
    if begins_with == "crossbar":  # the beam ends 50 mm outside its posts, whoever of them is named first
        lines = file.read_text().splitlines(keepends=True)
        beam = next(k for k, line in enumerate(lines) if "name: crossbar" in line)
        lines.insert(beam - 2, lines.pop(beam))
        file.write_text("".join(lines))
    scenario = scenario_of(file, 3000.0)
    (crush,) = frame_test(scenario.replaced({"initiation.loads": [{"name": "crush", "asks": "crush"}]})).tests
    assert (crush["status"], crush["hinges"], crush["first_yield"]) == ("reached", [], None)
    assert crush["force"] == pytest.approx(60e3, rel=1e-5)
    # two posts as columns on their mounts: F/(2 (1/k + H/(E A))^-1), the beam's ends turn a little with them
    assert crush["deflection"] == pytest.approx(30e3 * (1.0 / 5e7 + 1.61 / (210e9 * 8.548e-4)), rel=0.02)


def test_an_option_that_changes_nothing_says_so(tmp_path) -> None:
    """A frame on feet has no mounts that could be held still."""
    words = ("--mass", "3000", "--segments", "4", "--clamped")
    feet = call("two_post_rear_tubes_3t", *words, "--out", tmp_path / "feet")
    mounts = call(written(tmp_path), *words, "--out", tmp_path / "mounts")
    assert (feet.exit_code, mounts.exit_code) == (0, 0)
    assert "--clamped changes nothing" in feet.stderr
    assert "--clamped" not in mounts.stderr


def test_soft_mounts_give_and_clamped_feet_do_not(tmp_path) -> None:
    soft = written(tmp_path, **{"[1.0e6, 1.0e6, 1.0e6]": "[1.0e5, 1.0e5, 1.0e5]"})
    found = {
        clamped: frame_test(scenario_of(soft, 3000.0), clamped=clamped, segments=6).tests[0]
        for clamped in (False, True)
    }
    # at the top, two feet in parallel: H^2/(2 k) beside the post's H^3/(6 E I)
    top = 1.61**2 / 2e5
    post = 1.0 / found[True]["stiffness"]
    assert 1.0 / found[False]["stiffness"] == pytest.approx(post + top, rel=0.1)


@pytest.mark.parametrize(
    ("change", "said"),
    [
        ({"upper": None}, "upper: a frame in two parts is not calculated alone"),
        (
            {"position: [-0.10, -0.50, 0.85]": "position: [-0.10, -0.90, 0.85]"},
            "mounts.right: no member with a section is near",
        ),
        ({"kind": None}, "members: no member has a section, got tubes and boxes alone"),
    ],
)
def test_what_it_cannot_calculate_is_refused(tmp_path, change, said) -> None:
    file = written(tmp_path)
    text = file.read_text()
    for old, new in change.items():
        if old == "upper":
            text += (
                "upper:\n  body: {mass: 20.0, centre_of_mass: [-0.1, 0.0, 2.4], inertia: [5.0, 1.0, 5.0]}\n"
                "  hinges:\n    - {name: fold, position: [-0.1, 0.0, 2.0], stiffness: [1.0e7, 1.0e7, 1.0e7], damping: "
                "[1, 1, 1],\n       rotational_stiffness: [1.0e6, 1.0e6, 1.0e6]}\n  members: []\n"
            )
        elif old == "kind":
            text = text.split("members:")[0] + (
                "members:\n  - {kind: tube, name: a, start: [0, 0, 1], end: [0, 0, 2], diameter: 0.1}\n"
                "corner: [0, 0, 2]\n"
            )
        else:
            assert old in text
            text = text.replace(old, new)
    file.write_text(text)
    done = call(file, "--mass", "3000", "--out", tmp_path / "out")
    assert done.exit_code == 2
    assert done.stderr.startswith(f"{file}:"), done.stderr
    assert said in done.stderr
    assert len(done.stderr.strip().splitlines()) == 1
    assert not (tmp_path / "out").exists()


def test_a_frame_by_itself_needs_a_mass(tmp_path) -> None:
    file = written(tmp_path)
    done = call(file, "--out", tmp_path / "out")
    assert (done.exit_code, done.stderr.split(": ")[1]) == (2, "--mass")
    light = call(file, "--mass", "50", "--out", tmp_path / "out")
    assert light.exit_code == 2
    assert "--mass: too little for this ROPS" in light.stderr
    wrong = call("striker_that_is_none", "--mass", "3000")
    assert wrong.exit_code == 2
    assert "no such file" in wrong.stderr


def test_a_load_at_a_speed_is_carried_by_more(tmp_path) -> None:
    """Steel that yields higher the faster it is strained: the same energy takes less way and more force."""
    file = written(tmp_path, "[70, 70, 5]")
    found = {}
    for name, words in {"slow": [], "quick": ["--speed", "3.0"]}.items():
        done = call(file, "--mass", "3000", "--segments", "6", *words, "--out", tmp_path / name, "--json")
        assert done.exit_code == 0, done.stderr
        found[name] = json.loads(done.stdout)
    slow, quick = found["slow"], found["quick"]
    assert ("speed" in slow, quick["speed"]) == (False, 3.0)
    assert "rate of strain are left out" in slow["method"]
    assert "Loads go at 3 m/s" in quick["method"]
    rear = [a["tests"][0] for a in (slow, quick)]
    assert rear[1]["energy"] == pytest.approx(rear[0]["energy"], rel=1e-4)
    # (3200, 5) at some 3/1.6 1/s: 1.2 of the yield
    assert 1.1 < rear[1]["mechanism_force"] / rear[0]["mechanism_force"] < 1.35
    assert rear[1]["deflection"] < rear[0]["deflection"]
    assert rear[1]["permanent_set"] < rear[0]["permanent_set"]
    assert "--speed 3" in (tmp_path / "quick" / "report.html").read_text()


def test_a_speed_without_a_rate_factor_is_refused(tmp_path) -> None:
    file = written(tmp_path)
    file.write_text(file.read_text().replace("material: S355", "material: {base: S355, rate_factor: null}"))
    done = call(file, "--mass", "3000", "--speed", "1.0", "--out", tmp_path / "out")
    assert done.exit_code == 2
    assert "--speed: no steel has a rate factor, got S355; `material: {base: S355, rate_factor:" in done.stderr
    assert len(done.stderr.strip().splitlines()) == 1
    assert not (tmp_path / "out").exists()


def test_what_the_frame_alone_leaves_out_is_told(tmp_path) -> None:
    frame = "vehicle.rops=vehicles/rops/two_post_rear_tubes_3t.yaml"
    words = ["static_rops_test", "--set", frame, "--segments", "2", "--json"]
    effects = ["--set", "effects.rops-elasticity.stiffness=2e5", "--set", "vehicle.rops.feet.left.side_yield=1e4"]
    plain = json.loads(call(*words, "--out", tmp_path / "a").stdout)
    done = json.loads(call(*words, *effects, "--out", tmp_path / "b").stdout)
    assert plain["warnings"] == []
    assert done["warnings"] == [
        "What is stated of feet is left out, sections and steel count: left.",
        "Effects of the scenario are left out: rops-elasticity.",
    ]
    assert done["tests"] == plain["tests"]

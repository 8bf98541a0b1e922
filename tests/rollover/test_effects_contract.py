"""What every effect promises, asked of every effect there is, and of one that stands outside the package."""

from __future__ import annotations

import json
import math
import os
import re
import shutil
import string
import subprocess
import sys
from dataclasses import fields, replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from ground.compiled import KEPT
from ground.quantity import quantities
from rollover.dynamics.drop_test import DropModel, simulate_drop
from rollover.dynamics.simulate import run
from rollover.effects import Effect, Heard, effects, nothing
from rollover.recording import Recording
from rollover.scenario import Scenario
from rollover.spec.channels import is_known
from rollover.system.errors import InputError
from tests.physics.scenes import shipped
from tests.rollover import forked

# ids and parameters that users and recordings rely on
PROMISED: dict[str, set[str]] = {
    "soil-viscous-damping": {"damping", "exponent"},
    "soil-rate-hardening": {"per_decade"},
    "soil-inertial-drag": {"coefficient"},
    "soil-added-mass-growth": {"rate"},
    "soil-elastic-rebound": {"recovery"},
    "soil-adhesion": {"stress"},
    "soil-layer": {"depth", "stiffness_ratio"},
    "soil-crust": {"thickness", "stiffness_ratio"},
    "ground-friction": {"coefficient"},
    "rops-elasticity": {"stiffness"},
    "rops-plasticity": {"yield_force"},
    "structural-compliance": {"stiffness", "damping"},
    "mount-play": {"gap"},
    "tyre-damping": {"damping"},
    "tyre-lateral-stiffness": {"stiffness"},
    "axle-stop": {"angle", "stiffness"},
    "tank-slosh": {"mass", "length", "damping"},
    "payload-shift": {"mass", "friction", "travel"},
    "gyroscopic-rotor": {"angular_momentum"},
    "drive-torque": {"torque"},
    "guide-friction": {"force"},
    "air-drag": {"area"},
    "mass": set(),
    "centre-of-mass": {"height", "lateral"},
    "inertia": set(),
    "slope": set(),
    "impact-speed": set(),
    "soil-stiffness": {"scale"},
    "co-moving-mass": {"fraction"},
    **{
        f"sensor-{fault}": {"channel"}
        for fault in ("scale", "bias", "gain", "clipping", "lag", "clock-offset", "clock-drift", "misalignment")
    },
}
OWN = Path(__file__).with_name("own_effect.py")
TABLE: dict[str, Any] = effects()
each = pytest.mark.parametrize("effect", TABLE.values(), ids=TABLE.keys())


def dropped() -> Scenario:
    """A short drop with a lead."""
    return shipped("drop_test").replaced(
        {"simulation.step": 1e-3, "simulation.output_step": 1e-3, "simulation.duration": 0.3, "loads.cfc": 60}
    )


def rolled() -> Scenario:
    """The first stretch of a side overturn with everything on it."""
    return shipped("side_overturn").replaced(
        {"simulation.step": 1e-3, "simulation.output_step": 1e-3, "simulation.duration": 0.05}
    )


def with_effect(scenario: Scenario, effect: Effect) -> Scenario:
    parameters = {f.name: getattr(effect, f.name) for f in fields(effect)}
    return scenario.replaced({f"effects.{effect.id}": parameters})


def same(a: Recording, b: Recording) -> bool:
    return set(a.channels) == set(b.channels) and all(a[k].tobytes() == b[k].tobytes() for k in a.channels)


BASES: dict[str, Recording] = {}


def base(scenario: Scenario) -> Recording:
    if scenario.title not in BASES:
        BASES[scenario.title] = run(scenario).recording
    return BASES[scenario.title]


def test_every_promised_effect_is_there_with_its_parameters() -> None:
    for name, parameters in PROMISED.items():
        assert name in TABLE, name
        assert parameters <= {f.name for f in fields(TABLE[name])}, name
    assert {name for name, e in TABLE.items() if e.kind == "sensor"} == {n for n in PROMISED if n.startswith("sensor")}


@each
def test_an_effect_at_its_null_changes_no_bit_of_a_drop(effect: type[Effect]) -> None:
    scenario = dropped()
    null = with_effect(scenario, nothing(effect))
    assert effect.id in null.effects
    assert same(run(null).recording, base(scenario))
    assert same(simulate_drop(null), simulate_drop(scenario))


@pytest.mark.parametrize(
    "effect", [e for e in TABLE.values() if e.kind != "sensor" and "rollover" in e.acts], ids=lambda e: e.id
)
def test_an_effect_at_its_null_changes_no_bit_of_a_rollover(effect: type[Effect]) -> None:
    scenario = rolled()
    assert same(run(with_effect(scenario, nothing(effect))).recording, base(scenario))


@each
def test_a_default_effect_changes_what_it_acts_on(effect: type[Effect]) -> None:
    scenario = dropped() if "drop" in effect.acts else rolled()
    changed = run(with_effect(scenario, effect()))
    assert changed.status == "done", changed.sentence
    if effect.id in ("soil-adhesion", "soil-elastic-rebound", "rops-plasticity", "rops-elasticity", "axle-stop"):
        assert changed.scenario.effects  # act later than this short stretch: see their own tests
    elif effect.id not in ("ground-friction", "mount-play"):
        assert not same(changed.recording, base(scenario))


@each
def test_an_effect_tells_what_it_is(effect: type[Effect]) -> None:
    assert effect.kind in ("physics", "parameter", "sensor")
    assert (effect.__doc__ or "").strip()
    assert not (effect.__doc__ or "").startswith(f"{effect.__name__}(")
    for text in (effect.family, effect.equation, effect.source, effect.sentence):
        assert len(text) > 5, text
    assert not re.search(r"[(;,] ?[HML][+-]?\)", effect.source), "how sure a source is stands there in words"
    assert set(effect.acts) <= {"drop", "rollover"}
    assert effect.acts
    assert all(is_known(channel) for channel in effect.channels), effect.channels
    assert effect.channels or effect.kind == "sensor"
    names = {f.name for f in fields(effect)}
    assert {name for _, name, _, _ in string.Formatter().parse(effect.sentence) if name} <= names
    assert effect().statement().endswith(".")
    assert effect.rivals, "no look-alike with a test that tells them apart"
    for rival, test in effect.rivals.items():
        assert rival in TABLE, rival
        assert rival != effect.id
        assert len(test) > 10


@each
def test_effect_numbers_have_units_bounds_and_search_ranges(effect: type[Effect]) -> None:
    kind: Any = effect
    declared = quantities(kind)
    assert effect.null
    assert set(effect.null) <= set(declared)
    searched = {*effect.search, *(name for form in effect.forms for name in form.search)}
    assert searched >= {n for n in effect.null if n != "damping_ratio"} - {"stiffness_ratio"}
    assert {name for form in effect.forms for name in (*form.fixed, *form.search)} <= set(declared)
    for name, (low, high, scale, _) in effect.search.items():
        assert declared[name].unit, name
        assert declared[name].meaning, name
        assert declared[name].admits(low), (name, low)
        assert declared[name].admits(high), (name, high)
        assert low < high
        assert scale in ("log", "linear")
        assert scale == "linear" or low > 0.0
        for value in (low, math.sqrt(low * high) if scale == "log" else 0.5 * (low + high), high):
            effect(**{name: value})
        with pytest.raises(ValueError, match=f"{name}: out of bounds"):
            effect(**{name: math.nan})
    assert effect() != nothing(effect)


@each
def test_fit_traits_are_of_fitted_parameters(effect: type[Effect]) -> None:
    assert set(effect.secondary) < set(effect.search), "a strength is left to fit"
    assert set(effect.local_starts) <= set(effect.search)
    assert all(0.0 <= place <= 1.0 for places in effect.local_starts.values() for place in places)
    assert set(effect.grows) <= set(effect.search)
    if effect.kind == "sensor":
        spans = {"ground/force_normal": 4e3, "ground/force_tangential": 1e3, "ground/sinkage": 0.1}
        on = {c: effect.looked_for_on(Heard(c, spans)) for c in spans}
        assert any(on.values())
        assert all(set(search) == set(effect.search) for search in on.values() if search is not None)


@each
def test_naming_one_parameter_switches_an_effect_on(effect: type[Effect]) -> None:
    for name in effect.search:
        value = float(effect.search[name].high)
        changed = dropped().replaced({f"effects.{effect.id}.{name}": value})
        assert changed.effects == {effect.id: effect(**{name: value})}
        if "slope" not in effect.id:
            assert DropModel(scenario=dropped()).with_({f"effects.{effect.id}.{name}": value}).scenario == changed


def test_a_wrong_effect_is_one_line_with_the_nearest() -> None:
    for change, line in {
        "effects.soil-layr.depth": "effects.soil-layr: unknown effect, got 'soil-layr'; did you mean 'soil-layer'",
        "effects.soil-layer.dept": "effects.soil-layer.dept: unknown key, got 'dept'; did you mean 'depth'",
    }.items():
        with pytest.raises(InputError) as caught:
            dropped().replaced({change: 0.1}, origin="--set")
        assert str(caught.value).startswith(f"--set: {line}"), str(caught.value)
    with pytest.raises(InputError, match=r"effects.soil-layer.depth: out of bounds, got -1"):
        dropped().replaced({"effects.soil-layer.depth": -1})
    with pytest.raises(InputError, match=r"effects.sensor-gain.channel: unknown channel, got 'ground/forc'"):
        dropped().replaced({"effects.sensor-gain.channel": "ground/forc"})


def outside(*arguments: str, **variables: str) -> subprocess.CompletedProcess[str]:
    """A process of its own: an effect once defined stays in the table of its process."""
    root = Path(__file__).parents[2]
    if arguments[:2] == ("-m", forked.COMMAND) and not variables:
        return forked.command(*arguments[2:], cwd=root)
    path = os.pathsep.join([str(root), os.environ.get("PYTHONPATH", "")])
    env = {**os.environ, "PYTHONPATH": path, **variables}
    return subprocess.run([sys.executable, *arguments], capture_output=True, text=True, env=env, cwd=root, check=False)


def test_an_own_effect_is_one_short_file_and_keeps_the_contract() -> None:
    assert len(OWN.read_text(encoding="utf-8").splitlines()) <= 40
    program = (
        "import numpy as np\n"
        "from tests.rollover import test_effects_contract as contract\n"
        "roots = contract.TABLE['soil-roots']\n"
        "contract.test_an_effect_at_its_null_changes_no_bit_of_a_drop(roots)\n"
        "contract.test_effect_numbers_have_units_bounds_and_search_ranges(roots)\n"
        "contract.test_naming_one_parameter_switches_an_effect_on(roots)\n"
        "from rollover.dynamics.drop_test import DropModel\n"
        "model = DropModel(scenario=contract.dropped())\n"
        "t = np.array([0.008])\n"
        "own = model.with_({'effects.soil-roots.stiffness': 3e4, 'effects.soil-roots.depth': 0.3})\n"
        "soft = model.with_({'ground.law.stiffness_scale': 1.0})\n"
        "a, b = own.run(t), soft.run(t)\n"
        "K = lambda r: (r['ground/force_normal'] + 13.2 * r['striker/acceleration_z']) / r['ground/sinkage']\n"
        "print(round(float((K(a) - K(b))[0])))\n"
    )
    done = outside("-c", program, ROLLOVER_EFFECTS=str(OWN))
    assert done.stdout.strip() == "30000", done.stderr


def test_the_command_line_takes_a_file_of_effects(tmp_path: Path) -> None:
    listed = outside("-m", "tests.rollover.command", "--effects", str(OWN), "list", "effects", "--json")
    assert "soil-roots" in {row["id"] for row in json.loads(listed.stdout)}, listed.stderr
    missing = outside("-m", "tests.rollover.command", "--effects", str(tmp_path / "no.py"), "list", "effects")
    assert missing.returncode == 2
    assert "no such file of effects" in missing.stderr
    broken = tmp_path / "broken.py"
    broken.write_text("1/0\n")
    answer = outside("-m", "tests.rollover.command", "--effects", str(broken), "list", "effects")
    assert answer.returncode == 2
    assert "cannot be used: ZeroDivisionError" in answer.stderr
    late = outside("-m", "tests.rollover.command", "list", "effects", f"--effects={OWN}")
    assert late.returncode == 2
    assert "--effects stands before the command: rollover --effects FILE list ..." in " ".join(late.stderr.split())


def test_a_file_of_effects_imports_under_its_own_name(tmp_path: Path) -> None:
    """Its machine code is kept for each name that it is loaded under."""
    (tmp_path / "mine.py").write_text(OWN.read_text(encoding="utf-8"), encoding="utf-8")
    shutil.copytree(KEPT, tmp_path / "kept")  # all but that file's own is compiled already
    kept = {"NUMBA_CACHE_DIR": str(tmp_path / "kept")}
    by_name = ["-c", f"import sys; sys.path.insert(0, {str(tmp_path)!r}); import mine; print(mine.SoilRoots.id)"]
    by_path = ["-c", "from rollover.effects import effects; print(list(effects())[-1])"]
    for _ in range(2):
        for asked, variables in ((by_name, kept), (by_path, {**kept, "ROLLOVER_EFFECTS": str(tmp_path / "mine.py")})):
            done = outside(*asked, **variables)
            assert done.stdout.strip() == "soil-roots", done.stderr


def test_an_id_given_twice_is_an_error() -> None:
    program = (
        "from rollover.effects import Effect\n"
        "try:\n"
        "    type('Again', (Effect,), {'id': 'soil-layer'})\n"
        "except TypeError as error: print(error)\n"
        "try:\n"
        "    type('Nameless', (Effect,), {'id': ''})\n"
        "except TypeError as error: print(error)\n"
        "try:\n"
        "    type('Old', (Effect,), {'id': 'old', 'shapes': ('a',)})\n"
        "except TypeError as error: print(error)\n"
    )
    twice, nameless, old = outside("-c", program).stdout.splitlines()
    assert "'soil-layer' is taken by rollover.effects.ground" in twice
    assert "needs an `id`" in nameless
    assert "`shapes` is named `secondary`" in old


def test_the_listing_shows_what_each_effect_is() -> None:
    from rollover.cli import catalogue

    rows = {row["id"]: row for row in catalogue.effects()}
    assert set(rows) == set(effects())
    others = {id for id, kind in effects().items() if not kind.__module__.startswith("rollover.effects.")}
    assert set(rows) - others == set(TABLE) - others  # another test may have read a user's own
    layer = rows["soil-layer"]
    assert layer["kind"] == "physics"
    assert layer["parameters"] == "depth 0.25 m, stiffness_ratio 3, onset 0, width 0 m, stiffness 0 N/m"
    assert np.all([len(row["is"]) > 10 for row in rows.values()])


@pytest.mark.parametrize(
    ("id", "values", "said"),
    [
        ("centre-of-mass", {"height": -0.04, "lateral": 0.01}, "lies 0.04 m lower and 0.01 m further to the left."),
        ("centre-of-mass", {"height": 0.04, "lateral": -0.01}, "lies 0.04 m higher and 0.01 m further to the right."),
        ("sensor-clock-offset", {"channel": "ground/sinkage", "offset": -0.002}, "comes 0.002 s early."),
        ("sensor-bias", {"channel": "ground/sinkage", "bias": -0.003}, "reads 0.003 m too little throughout."),
        ("mass", {"added": 30.0}, "is 30 kg more than stated."),
        ("soil-viscous-damping", {"damping": 1500.0}, "in proportion to the speed: 1,500 N s/m on 63 cm2."),
        ("soil-viscous-damping", {"damping": 339.0, "exponent": 0.5}, "power 0.5: 339 N s/m on 63 cm2 at 1 m/s."),
        ("soil-viscous-damping", {"damping": 0.0, "proportion": 0.2}, "by 0.2 s/m of what it does at rest."),
    ],
)
def test_a_sentence_says_which_way_and_by_how_much(id: str, values: dict[str, Any], said: str) -> None:
    assert TABLE[id](**values).statement().endswith(said)


@pytest.mark.parametrize("effect", [e for e in TABLE.values() if "rollover" not in e.acts], ids=lambda e: e.id)
def test_an_effect_on_a_missing_part_changes_nothing_and_says(effect: type[Effect]) -> None:
    landed = shipped("rops_drop").replaced({"simulation.duration": 0.03})
    with_it = with_effect(landed, effect())
    assert float(np.max(run(landed).recording["ground/force_normal"])) > 1e4
    assert same(run(with_it).recording, run(landed).recording)
    assert with_it.idle == (f"effects.{effect.id}: made for drop tests; nothing need feel it here",)
    assert not with_effect(landed, nothing(effect)).idle


SWITCHED = (
    "rops-elasticity", "rops-plasticity", "mount-play", "axle-stop", "tyre-damping", "tyre-lateral-stiffness",
)  # fmt: skip


@pytest.mark.parametrize(
    ("name", "without", "effects"),
    [
        ("cube_toss", {}, (*SWITCHED, "impact-speed")),
        ("side_overturn", {"vehicle.rops": None}, ("rops-elasticity", "rops-plasticity", "mount-play")),
        ("bank_overturn", {}, ("slope", "impact-speed")),
        ("side_overturn", {}, ()),
        ("field_upset_tubes", {}, ("slope",)),  # a frame on feet, over a bank
    ],
)
def test_an_effect_that_finds_nothing_says_what_it_needs(
    name: str, without: dict[str, Any], effects: tuple[str, ...]
) -> None:
    tried = {id: TABLE[id]() for id in (*SWITCHED, "slope", "impact-speed", "mass")}
    if name != "bank_overturn" and "impact-speed" not in effects:
        tried.pop("impact-speed")  # these begin with no drop either
    chosen = replace(shipped(name).replaced(without), effects=tried)
    said = dict(line.removeprefix("effects.").split(": ", 1) for line in chosen.idle)
    assert set(said) == set(effects)
    assert all(text.startswith("needs ") for text in said.values())
    assert all("nothing feels it here" in text for text in said.values())


def test_what_may_find_nothing_says_what_it_needs() -> None:
    """Whoever writes an effect that finds nothing to change in some scenario says what it needs."""
    bare = shipped("cube_toss")
    for effect in TABLE.values():
        acts = effect.changes is not Effect.changes and "rollover" in effect.acts and effect().places() == {}
        if acts and effect.kind != "sensor":
            assert bool(effect.needs) or effect().changes(bare), effect.id


def test_a_rate_at_another_speed_is_stiffness_and_usual_rate() -> None:
    """1 + a log(v/v_1) = (1 - a log(v_1/v_0)) (1 + b log(v/v_0)): the very same way down while v > v_1."""
    rate, slow = TABLE["soil-rate-hardening"], 0.3
    factor = 1.0 - 0.2 * math.log10(slow / 0.01)
    assert rate(per_decade=0.2, reference_speed=slow).same_as() == {
        "soil-stiffness": "In drops that is the same as ground that is 0.705 times as stiff, and 0.284 stronger for "
        "each tenfold speed beyond 0.01 m/s."
    }
    assert rate(per_decade=0.2).same_as() == rate(per_decade=0.0, power=0.1, reference_speed=slow).same_as() == {}
    drop = DropModel(scenario=shipped("drop_test"))
    own = "effects.soil-rate-hardening"
    one = drop.with_({f"{own}.per_decade": 0.2, f"{own}.reference_speed": slow})
    two = drop.with_({f"{own}.per_decade": 0.2 / factor, "effects.soil-stiffness.scale": factor})
    times = np.linspace(0.0, 0.2, 401)
    a, b = one.motion(times), two.motion(times)
    fast = -a["striker/velocity_z"] > slow
    assert 20 < fast.sum() < 380
    np.testing.assert_allclose(b["ground/force_normal"][fast], a["ground/force_normal"][fast], rtol=1e-6)
    assert np.abs(b["ground/force_normal"] - a["ground/force_normal"])[~fast].max() > 1.0

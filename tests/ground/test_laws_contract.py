"""What every ground law promises, asked of every law there is.

A new law needs nothing here if all its numbers have defaults; otherwise one line in `EXAMPLES`.
"""

from __future__ import annotations

import ctypes
import math
import subprocess
import sys
from dataclasses import fields, replace
from itertools import product
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from ground.bearing import Bearing
from ground.bekker import BekkerWong
from ground.compaction import Compaction
from ground.fluid import FluidEntry
from ground.hard import Hard
from ground.law import BRANCH, HIDDEN, MASS, SPEED, GroundLaw, along, evaluate, laws, touched
from ground.press import Press
from ground.quantity import quantities
from ground.treated import Treated
from ground.ye import Ye2006

# an instance of every law, with no number at which a term of it vanishes
EXAMPLES: dict[str, GroundLaw] = {
    "bearing": Bearing(
        surface_pressure=3e3, depth_pressure=2e4, depth_exponent=0.8, rate_per_decade=0.15, rate_reference=0.03
    ),
    "bekker-wong": BekkerWong(
        cohesive_modulus=5.27e3,
        frictional_modulus=1.515e6,
        exponent=0.7,
        width=0.15,
        unloading_stiffness=1e7,
        unloading_growth=5.03e8,
    ),
    "compaction": Compaction(elastic_stiffness=9e5, plastic_stiffness=6e4, damping=800.0),
    "fluid-entry": FluidEntry(density=1000.0, drag_coefficient=0.8),
    "hard": Hard(stiffness=8e4, restitution=0.4, slow_speed=0.5),
    "press": Press(stiffness=2e5, damping=900.0, side_damping=600.0, side_mass=12.0),
    "treated": Treated(
        speed_coefficient=2e4,
        speed_exponent=2.0,
        first_stiffness=4e5,
        second_stiffness=6e6,
        sinkage_exponent=-0.5,
        speed_decay=0.1,
    ),
    "ye-2006": Ye2006(),
}
OF_THE_FOLDER = {kind: law for kind, law in laws().items() if law.__module__.startswith("ground.")}
SPEEDS = (0.3, 1.0, 2.0, 3.5, 6.0)  # m/s
DEPTHS = (1e-12, 1e-6, 1e-3, 0.01, 0.05, 0.2, 0.499)  # m
RATES = (0.0, 1e-3, 0.5, 3.0)  # m/s

# an error inside compiled code is only printed: make it heard
pytestmark = pytest.mark.filterwarnings("error::pytest.PytestUnraisableExceptionWarning")
each_law = pytest.mark.parametrize("law", EXAMPLES.values(), ids=EXAMPLES.keys())


def address(array: NDArray[np.float64]) -> Any:
    return array.ctypes.data_as(ctypes.POINTER(ctypes.c_double))


def numbers(law: GroundLaw) -> dict[str, float]:
    """The law's numeric fields in the order in which the class declares them."""
    values = {f.name: getattr(law, f.name) for f in fields(law)}
    return {n: v for n, v in values.items() if isinstance(v, (int, float)) and not isinstance(v, bool)}


def history(law: GroundLaw) -> list[float]:
    """Forces on the way down at several speeds, with the law's own states moved in between."""
    forces = []
    p = law.p
    for speed in SPEEDS:
        s = touched(law, speed=speed)
        for z in DEPTHS:
            forces.append(law.force.ctypes(address(p), address(s), z, 0.5))
            if law.advance is not None:
                law.advance.ctypes(address(p), address(s), z, 0.5, 0.01)
    return forces


@pytest.mark.parametrize("kind", OF_THE_FOLDER)
def test_every_law_has_an_example(kind: str) -> None:
    law = OF_THE_FOLDER[kind]
    assert kind in EXAMPLES, (
        f"law {kind!r} ({law.__module__}.{law.__name__}) is under no test: "
        "add an instance of it to EXAMPLES in tests/ground/test_laws_contract.py"
    )
    assert type(EXAMPLES[kind]) is law


def test_no_example_is_left_over() -> None:
    assert set(EXAMPLES) == set(OF_THE_FOLDER)


@each_law
def test_the_force_pushes_back_while_the_striker_goes_down(law: GroundLaw) -> None:
    for speed in SPEEDS:
        for mass in (10.0, 132.0, 3000.0):
            for z in DEPTHS:
                for v in RATES:
                    force = evaluate(law, z, v, speed=speed, mass=mass)
                    assert math.isfinite(force), (speed, mass, z, v)
                    assert force >= 0.0, (speed, mass, z, v)
            assert evaluate(law, 0.2, speed=speed, mass=132.0) > 0.0


@each_law
def test_many_places_at_once_are_what_each_is_by_itself(law: GroundLaw) -> None:
    places = list(product(DEPTHS, RATES))
    p, s = law.p, touched(law, speed=2.0, mass=50.0)
    one_by_one = [law.force.ctypes(address(p), address(s), z, v) for z, v in places]
    z, v = (np.array(many) for many in zip(*places, strict=True))
    assert along(law, z, v, speed=2.0, mass=50.0).tolist() == one_by_one
    assert evaluate(law, *places[-1], speed=2.0, mass=50.0) == one_by_one[-1]


@each_law
def test_no_force_before_there_is_any_sinkage(law: GroundLaw) -> None:
    for speed in SPEEDS:
        assert evaluate(law, 0.0, 0.0, speed=speed) == 0.0
        assert evaluate(law, 1e-9, 0.0, speed=speed) < 10.0


@each_law
def test_the_force_is_pure(law: GroundLaw) -> None:
    """A solver asks several times within a step: neither parameters nor memory may move, not by one bit."""
    p, s = law.p, touched(law, speed=2.0)
    s[HIDDEN + law.hidden :] = math.nan
    before = p.tobytes(), s.tobytes()
    first = [law.force.ctypes(address(p), address(s), z, v) for z in DEPTHS for v in RATES]
    again = [law.force.ctypes(address(p), address(s), z, v) for z in reversed(DEPTHS) for v in reversed(RATES)]
    assert first == again[::-1]
    assert (p.tobytes(), s.tobytes()) == before


@each_law
def test_the_memory_is_as_long_as_the_law_says(law: GroundLaw) -> None:
    """Places beyond the law's own belong to a neighbour; the latched ones belong to the array."""
    guard = -7.25
    s = np.full(HIDDEN + law.hidden + 4, guard)
    s[SPEED], s[MASS], s[BRANCH] = 2.0, 132.0, math.inf
    p = law.p
    if law.begin is not None:
        law.begin.ctypes(address(p), address(s))
    if law.advance is not None:
        law.advance.ctypes(address(p), address(s), 0.01, 1.0, 1e-3)
    assert list(s[HIDDEN + law.hidden :]) == [guard] * 4
    assert (s[SPEED], s[MASS]) == (2.0, 132.0)
    assert s[BRANCH] > 0.0
    assert np.all(np.isfinite(s[HIDDEN:]))
    # every hidden state is set at the touch or kept from zeros, so that a second touch is a first one
    if law.begin is not None:
        assert guard not in s[HIDDEN : HIDDEN + law.hidden]
    assert (law.hidden > 0) or law.advance is None


@each_law
def test_the_numbers_stand_in_p_in_the_order_of_the_fields(law: GroundLaw) -> None:
    names = list(numbers(law))
    assert names[0] == "recovery"
    assert law.p.dtype == np.float64
    assert list(law.p) == list(numbers(law).values())
    given = [f.name for f in fields(law) if f.init and f.name in names and f.name != "recovery"]
    for name in given:
        other = replace(law, **{name: numbers(law)[name] * 1.01})
        moved = [n for n, a, b in zip(names, law.p, other.p, strict=True) if a != b and n != "recovery"]
        assert moved == [name]


@each_law
def test_every_number_of_a_law_is_read_from_its_place(law: GroundLaw) -> None:
    """A wrong index in compiled code reads another field, or none, without a word."""
    names, before = list(numbers(law)), history(law)
    for f in fields(law):
        if f.init and f.name in names and f.name != "recovery":
            other = replace(law, **{f.name: numbers(law)[f.name] * 1.01})
            moved = history(other) != before or other.unloading_line != law.unloading_line
            assert moved, f"{f.name} moves no force, on the way down or back"


@each_law
def test_every_number_has_a_unit_a_meaning_and_bounds_that_hold(law: GroundLaw) -> None:
    kind: type = type(law)
    declared = quantities(kind)
    for name in numbers(law):
        assert name in declared, f"{kind.__name__}.{name}: no Quantity"
        assert declared[name].unit, f"{kind.__name__}.{name}: no unit; '1' for a pure number"
        assert declared[name].meaning, f"{kind.__name__}.{name}: no meaning"
    for f in fields(law):
        if f.init and f.name in declared:
            for wrong in (math.nan, math.inf, -math.inf):
                with pytest.raises(ValueError, match=f"^{f.name}: out of bounds"):
                    replace(law, **{f.name: wrong})


@each_law
def test_a_law_introduces_itself(law: GroundLaw) -> None:
    text = type(law).__doc__ or ""
    first = text.strip().splitlines()[0] if text.strip() else ""
    # what dataclass writes when there is nothing: the signature
    assert not first.startswith(f"{type(law).__name__}("), "no docstring"
    assert "=" in first or first.endswith("."), f"neither an equation nor a sentence: {first!r}"
    assert len(first) > 15


@each_law
def test_a_law_is_named_by_its_kind_and_cannot_be_changed(law: GroundLaw) -> None:
    assert EXAMPLES[law.kind] is law  # type: ignore[attr-defined]
    assert replace(law) == law
    with pytest.raises(AttributeError):
        law.kind = "other"  # type: ignore[attr-defined]
    with pytest.raises(TypeError):
        type(law)(1.0)  # type: ignore[call-arg]


def elsewhere(program: str) -> str:
    """Run a program in a process of its own: a law once defined stays in the table of its process."""
    program = f"from ground.law import GroundLaw, evaluate, laws\nfrom ground.quantity import parameters\n{program}"
    root = Path(__file__).parents[2]
    done = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True, cwd=root, check=False)
    return (done.stdout + done.stderr).strip()


def test_a_law_is_twenty_lines() -> None:
    assert elsewhere(
        "from tests.ground.peat import Peat\n"
        "assert laws()['peat'] is Peat\n"
        "print(Peat().p.tolist(), evaluate(Peat(stiffness=5e4), 0.02, speed=1.0))\n"
        "try: Peat(stiffness=0)\n"
        "except ValueError as error: print(error)"
    ).splitlines() == ["[0.02, 30000.0] 1000.0", "stiffness: out of bounds, got 0; greater than 0 N/m is allowed"]
    source = Path(__file__).with_name("peat.py").read_text(encoding="utf-8")
    assert len(source.splitlines()) <= 22


@pytest.mark.parametrize("page", ["law.py", "README.md"])
def test_the_law_that_the_pages_show_is_the_one_that_runs(page: str) -> None:
    source = Path(__file__).with_name("peat.py").read_text(encoding="utf-8")
    shown = (Path(__file__).parents[2] / "ground" / page).read_text(encoding="utf-8").replace("'''", '"""')
    body = source[source.index("@parameters") :].replace("  # type: ignore[no-untyped-def]", "")
    lines = [line.strip() for line in body.splitlines() if line.strip()]
    assert "\n".join(lines) in "\n".join(line.strip() for line in shown.splitlines() if line.strip())


def test_a_name_given_twice_is_an_error_that_names_both() -> None:
    said = elsewhere("class Second(GroundLaw): kind = 'ye-2006'\nlaws()")
    assert "law name 'ye-2006' is taken by" in said
    assert "__main__" in said
    assert "ground.ye" in said


def test_a_law_without_a_name_is_an_error() -> None:
    said = elsewhere("class Nameless(GroundLaw): pass\nlaws()")
    assert "TypeError: __main__.Nameless: a law needs a field `kind`" in said


def test_the_laws_come_in_alphabetical_order_and_are_all_final() -> None:
    table = laws()
    assert list(table) == sorted(table)
    for law in OF_THE_FOLDER.values():
        assert law.__mro__[1] is GroundLaw, f"{law.__name__}: nothing concrete is inherited from"

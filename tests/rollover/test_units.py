"""Spellings of units: all that mean one unit are read, none that may mean two."""

from __future__ import annotations

import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

from rollover.spec.channels import UNITS, factor
from rollover.spec.units import key

G = 9.80665
OF = {
    "1": "chassis/quaternion_w",
    "s": "time",
    "N": "rops/force",
    "N s": "ground/impulse_normal",
    "N m": "rops/mount/left/moment_x",
    "N m s": "axle/front/impulse",
    "m": "ground/sinkage",
    "m2": "ground/contact_area",
    "m/s": "striker/velocity_z",
    "m/s2": "striker/acceleration_z",
    "rad": "chassis/roll",
    "rad/s": "chassis/angular_velocity_x",
    "J": "rops/energy",
}
ALL = [(dimension, spelling, value) for dimension, table in UNITS.items() for spelling, value in table.items()]


def test_the_list_above_has_every_dimension() -> None:
    assert set(OF) == set(UNITS)


@pytest.mark.parametrize(("dimension", "spelling", "value"), ALL)
def test_every_listed_spelling_keeps_its_factor(dimension: str, spelling: str, value: float) -> None:
    assert factor(spelling, OF[dimension]) == value
    for around in ("[{}]", "({})", " {} ", "[ {} ]"):
        assert factor(around.format(spelling), OF[dimension]) == value


def test_no_two_units_of_a_dimension_are_spelt_alike() -> None:
    for table in UNITS.values():
        by_key: dict[object, float] = {}
        for spelling, value in table.items():
            if (what := key(spelling)) is not None:
                assert by_key.setdefault(what, value) == pytest.approx(value, rel=1e-15)


@pytest.mark.parametrize(("dimension", "spelling", "value"), [one for one in ALL if set(one[1]) & set("/*·")])
def test_blanks_around_operators_do_not_count(dimension: str, spelling: str, value: float) -> None:
    for operator in "/*·":
        spaced = spelling.replace("**", "^").replace(operator, f" {operator}  ")
        assert factor(spaced, OF[dimension]) == value


@pytest.mark.parametrize(
    ("spelling", "dimension", "si"),
    [
        *[(s, "m/s2", 1.0) for s in ("m/(s*s)", "m / s2", "m/s/s", "m s-2", "m.s-2", "m·s⁻²", "m*s^(-2)", "M/S**2")],
        *[(s, "m/s2", 1.0) for s in ("m/(s^2)", "(m)/(s)^2", "m/sec2", "meter/sec²", "[m/(s*s)]", "m per s per s")],
        *[(s, "m/s2", G) for s in ("G'S", "g's", "[g]")],
        *[(s, "rad/s", math.pi / 180.0) for s in ("deg / s", "Deg/s", "DEG/SEC", "degrees/second", "º/s", "deg s-1")],
        *[(s, "rad/s", math.pi / 30.0) for s in ("RPM", "1 / min", "min-1", "min⁻¹", "Rev/Min")],
        *[(s, "N", 1e3) for s in ("KN", "kn", "kN.", "Kilonewton")],
        *[(s, "N", 1.0) for s in ("newtons", "Newton", "n")],
        *[(s, "m", 1e-3) for s in ("MM", "millimeter", "(mm)")],
        *[(s, "m", 1e-6) for s in ("µm", "μm", "UM")],
        *[(s, "s", 1.0) for s in ("sec", "Seconds", "S", "sec.")],
        *[(s, "s", 1e-6) for s in ("μs", "usec", "US")],
        *[(s, "N m", 1.0) for s in ("N-m", "N.m", "newton metre", "m N", "NM", "N⋅m")],
        *[(s, "N m", 0.3048 * 4.4482216152605) for s in ("ft·lbf", "FT-LBF", "lbf.ft", "foot lbf")],
        *[(s, "m2", 1e-4) for s in ("cm**2", "cm·cm", "CM2", "cm⁺²")],
        *[(s, "m/s", 1.0 / 3.6) for s in ("KM/H", "km / h", "km h-1", "Km/h")],
    ],
)
def test_spellings_of_real_tools(spelling: str, dimension: str, si: float) -> None:
    assert factor(spelling, OF[dimension]) == pytest.approx(si, rel=1e-14)


@pytest.mark.parametrize(
    ("spelling", "dimension"),
    [
        *[(s, "N") for s in ("mn", "Mn", "g", "G", "N/m", "N2", "kN kN")],  # mN or MN?
        *[(s, "m") for s in ("Mm", "m/s", "1/m", "", "-", "m/s*s", "m/s s")],  # (m/s) s or m/(s s)?
        *[(s, "s") for s in ("Ms", "Ns", "Hz", "1/s", "m")],
        *[(s, "J") for s in ("Mj", "mj")],
        *[(s, "N m") for s in ("nm", "N/m", "mN", "J m")],  # nm is a length
        *[(s, "m/s2") for s in ("m/s*s", "m/s s", "Mg", "kg", "m/s2/", "*m/s2", "m/(s*s", "m/s)*s", "m/s2.5", "m//s2")],
        *[(s, "m/s") for s in ("m s", "m/s2", "m*/s")],
        *[(s, "rad") for s in ("Mrad", "grad", "rad rad", "rad-1")],
    ],
)
def test_what_is_not_clear_or_of_another_kind_is_refused(spelling: str, dimension: str) -> None:
    with pytest.raises(ValueError, match="unit does not fit"):
        factor(spelling, OF[dimension])


def test_prefixes_keep_their_case() -> None:
    assert factor("mN", OF["N"]) == 1e-3
    assert factor("MN", OF["N"]) == 1e6
    assert factor("mJ", OF["J"]) == 1e-3
    assert factor("MJ", OF["J"]) == 1e6


@given(st.text("mMsSgGNnkKdegrad/*^()-²· 123.'°", max_size=9))
def test_no_text_is_two_units_or_a_traceback(text: str) -> None:
    for channel in OF.values():
        try:
            once = factor(text, channel)
        except ValueError as e:
            assert "unit does not fit" in str(e)  # noqa: PT017
        else:
            assert factor(f" {text} ", channel) == once
            assert once in {v for table in UNITS.values() for v in table.values()}

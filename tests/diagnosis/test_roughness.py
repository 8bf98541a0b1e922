"""A misfit that is rough: how far a parameter may lie is told by a parabola through many places, not by one dip."""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np
import pytest

from rollover.diagnosis.roughness import over_roughness

DUE = 1.96**2


def misfits(of: Callable[[float], float | None], seen: list[float]) -> Callable[[Sequence[float]], list[float | None]]:
    def met(places: Sequence[float]) -> list[float | None]:
        seen.extend(places)
        return [of(t) for t in places]

    return met


@pytest.mark.parametrize(
    ("of", "down", "up", "places"),
    [
        (lambda t: DUE * t**2, 1.0, 1.0, 8),  # as slopes say
        (
            lambda t: DUE * (t / 4.0) ** 2 + 30.0,
            4.0,
            4.0,
            8,
        ),  # the fit stands in a dip, and is four times flatter beside
        (lambda t: DUE * ((t - 2.0) / 4.0) ** 2, 2.0, 6.0, 8),  # which is to one side of the least
        (lambda t: 9e4 if t > 2.5 else DUE * (t / 4.0) ** 2, 4.0, 4.0, 8),  # from there on runs take another course
        (lambda t: None if t < -0.5 else DUE * (t / 5.0) ** 2, 5.0, 5.0, 12),  # the range ends there: four are too few
        (lambda t: None, 1.0, 1.0, 20),
        (lambda t: -0.1 * t**2, 1.0, 1.0, 20),  # no least
    ],
)
def test_an_interval_reaches_as_far_as_the_parabola_beside_a_dip_says(
    of: Callable[[float], float | None], down: float, up: float, places: int
) -> None:
    seen: list[float] = []
    assert over_roughness(misfits(of, seen), DUE) == pytest.approx((down, up), rel=1e-9)
    assert len(seen) == places


def test_an_interval_is_wider_by_what_roughness_moves_the_least_of_the_parabola_by() -> None:
    """e = r (t^3 - 11.8 t) at t = +-1 ... +-4 is at right angles to 1, t and t^2: c stays due/16, b nought.

    With s^2 = sum e^2/(8 - 3) the standard deviation of b is s/sqrt(sum t^2), of the least -b/2c that over 2c.
    """
    r, c, t = 0.05, DUE / 16.0, np.array([-4.0, -3.0, -2.0, -1.0, 1.0, 2.0, 3.0, 4.0])
    rough = np.sqrt(np.sum((r * (t**3 - 11.8 * t)) ** 2) / 5.0)
    half = np.hypot(4.0, 1.96 * rough / np.sqrt(np.sum(t**2)) / (2.0 * c))
    assert half > 4.02
    found = over_roughness(misfits(lambda t: c * t**2 + r * (t**3 - 11.8 * t), []), DUE)
    assert found == pytest.approx((half, half), rel=1e-9)


def test_intervals_hold_where_a_fit_ends_in_the_lowest_of_many_dips() -> None:
    """What is left at place x is u^2 + e_x with u = (x - m)/w; truth lies N(0, w) from m; a fit ends where it is least.

    Slopes of the dip say that the interval is a tenth as wide. Roughness e is as large as what is due.
    """
    rng, w, slopes, held, alone = np.random.default_rng(7), 1.0, 0.1, 0, 0
    for _ in range(400):
        truth, rough = rng.normal(0.0, w), {}

        def left(x: float, rough: dict[float, float] = rough) -> float:
            return (x / w) ** 2 + rough.setdefault(round(x, 9), float(rng.normal(0.0, DUE)))

        fitted = min((float(x) for x in rng.uniform(-2.0, 2.0, 20)), key=left)
        unit = 1.96 * slopes * w
        down, up = over_roughness(misfits(lambda t: left(fitted + t * unit), []), DUE)  # noqa: B023
        held += fitted - down * unit < truth < fitted + up * unit
        alone += abs(truth - fitted) < unit
    assert alone < 0.25 * 400
    assert 0.9 * 400 <= held <= 0.995 * 400

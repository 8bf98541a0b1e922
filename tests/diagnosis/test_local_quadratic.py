"""Runs that are rough: how far a parameter may lie is told by the mean of runs at many places, not by one dip."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.stats import t as student

from rollover.diagnosis.fit.linearisation import ResidualBlock
from rollover.diagnosis.inference.local_quadratic import local_quadratic_extents
from rollover.diagnosis.noise.ensemble import HeavyTail

Array = NDArray[np.float64]
DUE = 1.96**2
N = 40
HALF = 7.0 / np.sqrt(2.0)  # of what is due, where two recordings rise by it 7 places from their leasts
STAGE = np.array([-4.0, -3.0, -2.0, -1.0, 1.0, 2.0, 3.0, 4.0])
ALONG = np.ones(N) / np.sqrt(N)
ACROSS = np.where(np.arange(N) % 2 == 0, 1.0, -1.0) / np.sqrt(N)
DIP = np.where(np.arange(N) % 4 < 2, 1.0, -1.0) / np.sqrt(N)  # at right angles to both


def block(left: Array, **also: Any) -> ResidualBlock:
    known = {"J": np.zeros((left.size, 0)), "slope": np.zeros(left.size), "shift": 0.0, "prior": 1.0}
    return ResidualBlock(residual=left, **(known | also))


def runs(
    of: Callable[[float], list[Array] | None], seen: list[float]
) -> Callable[[Sequence[float]], list[list[ResidualBlock] | None]]:
    def met(places: Sequence[float]) -> list[list[ResidualBlock] | None]:
        seen.extend(places)
        found = [of(t) for t in places]
        return [None if left is None else [block(w) for w in left] for left in found]

    return met


def reach(of: Callable[[float], list[Array] | None], seen: list[float] | None = None) -> tuple[float, float] | None:
    """By runs beside a fit whose slopes, across all that moves, are those of a dip."""
    seen = [] if seen is None else seen
    number = max([len(left) for left in map(of, (-1.0, 1.0)) if left is not None], default=1)
    return local_quadratic_extents(runs(of, seen), [1.96 * DIP] * number, DUE)


def straight(t: float, flatter: float, least: float = 0.0) -> list[Array]:
    """A recording that rises by what is due `flatter` places from its least; 30 of it are left everywhere."""
    return [1.96 * (t - least) / flatter * ALONG + np.sqrt(30.0) * ACROSS]


@pytest.mark.parametrize(
    ("of", "down", "up", "places"),
    [
        (lambda t: straight(t, 3.5), 3.5, 3.5, 8),  # the fit stands in a dip, and is as much flatter beside
        (lambda t: straight(t, 4.5), 4.5, 4.5, 12),  # nearer places do not reach as far
        (lambda t: straight(t, 3.5, 1.5), 2.0, 5.0, 8),  # which is to one side of the least
        (lambda t: [*straight(t, 7.0, 8.0), *straight(t, 7.0, -4.0)], HALF - 2.0, HALF + 2.0, 12),  # the middle of two
        (lambda t: straight(1e3, 1.0) if t > 2.5 else straight(t, 3.5), 3.5, 3.5, 8),  # runs take another course there
        (lambda t: None if t < -0.5 else straight(t, 5.0), 5.0, 5.0, 12),  # the range ends there: four are too few
    ],
)
def test_an_interval_extends_as_far_as_the_mean_of_runs_says(
    of: Callable[[float], list[Array] | None], down: float, up: float, places: int
) -> None:
    seen: list[float] = []
    assert reach(of, seen) == pytest.approx((down, up), rel=1e-9)
    assert len(seen) == places


@pytest.mark.parametrize("of", [lambda t: straight(t, 1e3), lambda t: None])
def test_what_does_not_rise_within_32_points_has_no_interval(of: Callable[[float], list[Array] | None]) -> None:
    seen: list[float] = []
    assert reach(of, seen) is None
    assert len(seen) == 20


def test_a_run_that_fits_much_better_by_chance_diverged() -> None:
    """At one place the 1e4 that all others leave are met: the others tell the mean."""

    def left(t: float) -> list[Array]:
        return [1.96 * t / 3.5 * ALONG + np.sqrt(0.0 if t == 3.0 else 1e4) * ACROSS]

    assert reach(left) == pytest.approx((3.5, 3.5), rel=1e-9)


@pytest.mark.parametrize(("share", "is_looked_at"), [(0.7, True), (0.9, False)])
def test_slopes_that_the_mean_of_runs_has_too_are_believed(share: float, is_looked_at: bool) -> None:
    """J = 1.96 a along a and beside it; the mean keeps a share of |J|^2."""
    across = np.sqrt(share - share**2)
    v = 1.96 * (share * DIP + across * ALONG)
    found = local_quadratic_extents(runs(lambda t: [-t * v], []), [1.96 * DIP], DUE)
    assert found == pytest.approx((1.0 / np.sqrt(share),) * 2 if is_looked_at else (0.0, 0.0), rel=1e-9)


@pytest.mark.parametrize(("scatter", "is_estimated"), [(0.0, True), (57.0, False)])
def test_chance_slopes_of_the_ensemble_mean_are_not_believed(scatter: float, is_estimated: bool) -> None:
    """The mean keeps all of J, |J|^2 = 1.96^2, but h_11 = 1/4260 of what runs scatter by is a fifth of that.

    They do to one side at half the places, 1, 4, 8, 12, 32 on either side, and to the other at the rest.
    """
    assert 1.0 < 1.96**2 * 4260.0 / 57.0**2 < 10.0

    def left(t: float) -> list[Array]:
        to = 1.0 if abs(t) in (1.0, 4.0, 8.0, 12.0, 32.0) else -1.0
        return [-t * 1.96 * DIP + to * scatter * ACROSS]

    assert reach(left) == ((0.0, 0.0) if is_estimated else None)


def test_samples_count_alike_at_all_points_and_no_clock_does() -> None:
    """Half the samples count 0.6 at five places and 0.3 at three: 0.6 at all. What a clock may do is nobody's.

    Of a slope v the late half counts 0.36: c = 0.68 |v|^2. With the clock at right angles to v, nothing changes.
    """
    late = np.arange(N) >= N // 2
    clock = ACROSS * 1e3

    def met(places: Sequence[float]) -> list[list[ResidualBlock] | None]:
        found: list[list[ResidualBlock] | None] = []
        for t in places:
            counts = np.where(late, 0.3 if t > 1.5 else 0.6, 1.0)
            plain = 1.96 * t / 3.0 * ALONG + t * clock
            heavy_tail = HeavyTail(samples=counts, share=1.0, more=0.0)
            found.append([block(counts * plain, slope=counts * clock, prior=1e6, heavy_tail=heavy_tail)])
        return found

    assert local_quadratic_extents(met, [1.96 * DIP], DUE) == pytest.approx((3.0 / np.sqrt(0.68),) * 2, rel=1e-9)


def test_what_was_measured_moves_as_runs_scatter() -> None:
    """w = 1.96/3 t a + r q(t) a, q = t^3 - 11.8 t: at right angles to 1, t, t^2 at the eight places, so v stays.

    By hand: each e of a place that is left out is r q/(1 - H_ii), v changes by its P_1i = t/sum t^2 of it, and the pull
    e'v at the place counts 1 - H_ii of its square. The least stays at nought, where (R3) has 1 + h_00.
    """
    r, slope = 0.02, 1.96 / 3.0
    q = STAGE**3 - 11.8 * STAGE
    X = np.stack([np.ones(8), STAGE, STAGE**2], axis=1)
    np.testing.assert_allclose(X.T @ q, 0.0, atol=1e-9)
    h = np.linalg.inv(X.T @ X)
    own = 1.0 - np.diag(X @ h @ X.T)
    e = r * q / own
    pulls = e * (slope - STAGE / np.sum(STAGE**2) * e)
    c = slope**2 - np.sum((r * q) ** 2) / 5.0 * h[1, 1]
    scatter = student.ppf(0.975, 5) * np.sqrt((1.0 + h[0, 0]) * np.mean(own * pulls**2)) / c
    half = np.hypot(np.sqrt(DUE / c), scatter)
    assert half > 3.1
    found = reach(lambda t: [(slope * t + r * (t**3 - 11.8 * t)) * ALONG])
    assert found == pytest.approx((half, half), rel=1e-9)


def test_a_slope_that_scatter_makes_is_none() -> None:
    """Runs that scatter by 2 in every direction and move nowhere, a hundred times: hardly ever is one found."""
    rng, wider = np.random.default_rng(3), 0
    for _ in range(100):
        wider += reach(lambda _: [2.0 * rng.standard_normal(N) for _ in range(4)]) is not None
    assert wider <= 5


@pytest.mark.parametrize(("scatter", "widest"), [(1.0, 1.9), (4.0, 2.3)])
def test_intervals_hold_at_the_lowest_of_many_minima(scatter: float, widest: float) -> None:
    """Four recordings y = (x - truth) J + e + noise, e of each run six smooth deviations; slopes say a quarter.

    Both are whitened together, noise as 1 and e as `scatter`. A fit that knew J would tell x to sqrt(J'N J)/J'J, N of
    both: here J scatters too, and it is about twice that.
    """
    rng, held, alone, wide = np.random.default_rng(7), 0, 0, []
    white = np.sqrt(1.0 + scatter**2)
    J = [rng.standard_normal(N) for _ in range(4)]
    shapes = [scatter / white * rng.standard_normal((6, N)) / np.sqrt(6.0) for _ in range(4)]
    size = sum(float(j @ j) for j in J)
    known = np.sqrt(size / white**2 + sum(float(np.sum((s @ j) ** 2)) for s, j in zip(shapes, J, strict=True))) / size
    unit = 0.25 * 1.96 / np.sqrt(size)
    for _ in range(300):
        true = [rng.standard_normal(N) / white + rng.standard_normal(6) @ s for s in shapes]
        seen: dict[float, list[Array]] = {}

        def left(x: float, true: list[Array] = true, seen: dict[float, list[Array]] = seen) -> list[Array]:
            new = [j * x - e + rng.standard_normal(6) @ s for j, e, s in zip(J, true, shapes, strict=True)]
            return seen.setdefault(round(x, 9), new)

        places = (float(x) for x in rng.uniform(-12.0 * unit, 12.0 * unit, 20))
        fitted = min(places, key=lambda x: sum(float(w @ w) for w in left(x)))
        down, up = reach(lambda t: left(fitted + t * unit)) or (0.0, 0.0)  # noqa: B023
        held += fitted - down * unit < 0.0 < fitted + up * unit
        alone += abs(fitted) < unit
        wide.append(0.5 * (down + up) * unit)
    assert alone < 0.3 * 300
    assert held >= 0.92 * 300
    assert float(np.median(wide)) < widest * 1.96 * known

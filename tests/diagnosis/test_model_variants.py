"""Shapes and forms: begun in many places, of which those that lead to one are followed once."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from types import SimpleNamespace
from typing import Any, cast

import numpy as np
import pytest

from rollover.diagnosis.fit import model_variants
from rollover.diagnosis.fit.levenberg_marquardt import Problem
from rollover.diagnosis.fit.linearisation import Fitted
from rollover.diagnosis.fit.parameterisation import Candidate
from rollover.diagnosis.settings import SETTINGS
from rollover.effects import Search
from tests.diagnosis.drops import linear_blocks

DAMPING = Candidate(id="soil-viscous-damping", kind="physics", family="", search={"damping": Search(1, 2)})
VARIANT = replace(DAMPING, search={"damping": Search(1, 2), "exponent": Search(0, 1)})


def fitted(c: Candidate, x: Sequence[float], times: float) -> Fitted:
    """A fit to two recordings that leaves so many times what chance does."""
    blocks = tuple(
        replace(b, residual=b.residual * np.sqrt(times), J=np.zeros((40, len(x))))
        for b in linear_blocks(np.random.default_rng(4), 2, 40, np.zeros(1))
    )
    return Fitted(candidates=(c,), x=tuple(x), blocks=blocks)


@pytest.mark.parametrize(
    ("ends", "followed"),
    [
        ((0.50, 0.52, 0.55), [0.50]),  # three ways to one place: the one that is nearest there
        ((0.50, 0.90, 0.52), [0.50, 0.90]),
        ((0.10, 0.50, 0.90), [0.10, 0.50, 0.90]),
    ],
)
def test_of_fits_that_lead_to_one_place_one_is_followed(ends: tuple[float, ...], followed: list[float]) -> None:
    """Short fits come from 0.2, 0.4 and 0.6; a few rounds more lead to `ends`."""
    begun, whole = (0.2, 0.4, 0.6), []

    def fit(_: Any, x: Sequence[float], *, rounds: int | None = None, **how: Any) -> Fitted:
        if rounds == SETTINGS.fit.model_variants.short_rounds:
            return fitted(VARIANT, x, 10.0 + x[1])
        if rounds == SETTINGS.fit.model_variants.meeting_rounds:
            return fitted(VARIANT, (0.3, ends[begun.index(x[1])]), 9.0 + 0.1 * x[1])
        whole.append(x[1])
        return fitted(VARIANT, x, 8.0)

    problem, start = cast(Problem, SimpleNamespace(fit=fit)), fitted(DAMPING, (0.3,), 30.0)
    best = model_variants._best_from(
        problem, start, VARIANT, [(0.3, v) for v in begun], [b.total for b in start.blocks]
    )
    assert whole == followed
    assert best is not None
    assert best.x == (0.3, followed[0])


@pytest.mark.parametrize(
    ("near", "gone_on_with"),
    [
        ([(0.20, 10.0), (0.25, 10.05), (0.60, 10.1)], [0.20, 0.60]),  # two on their way to one place, as far
        ([(0.20, 10.0), (0.25, 10.3), (0.60, 10.4)], [0.20, 0.25, 0.60]),  # not as far: a valley of many
        ([(0.20, 10.0), (0.35, 10.05), (0.60, 10.1)], [0.20, 0.35, 0.60]),
        # those that are apart, up to three: a fourth does not come instead
        ([(0.20, 10.0), (0.25, 10.05), (0.60, 10.06), (0.90, 10.2)], [0.20, 0.60]),
    ],
)
def test_of_short_fits_to_one_minimum_one_goes_on(near: list[tuple[float, float]], gone_on_with: list[float]) -> None:
    """Begun at places that leave so much after a short fit."""
    begun: list[float] = []

    def fit(_: Any, x: Sequence[float], *, rounds: int | None = None, **how: Any) -> Fitted:
        if rounds == SETTINGS.fit.model_variants.short_rounds:
            return fitted(VARIANT, x, dict(near)[x[1]])
        if rounds == SETTINGS.fit.model_variants.meeting_rounds:
            begun.append(x[1])
        return fitted(VARIANT, x, 9.0)

    problem, start = cast(Problem, SimpleNamespace(fit=fit)), fitted(DAMPING, (0.3,), 30.0)
    model_variants._best_from(problem, start, VARIANT, [(0.3, v) for v, _ in near], [b.total for b in start.blocks])
    assert begun == gone_on_with


@pytest.mark.parametrize(
    ("left", "short_fit", "is_followed"), [(30.0, 29.0, False), (30.0, 28.0, True), (3.0, 2.99, True), (3.0, 2.6, True)]
)
def test_far_from_noise_a_variant_that_gains_is_followed(left: float, short_fit: float, is_followed: bool) -> None:
    """Short fits leave so much of what the usual shape leaves: three in a hundred is nothing, seven is a part of it.

    Near noise, at three times what chance leaves, any little may be all there is.
    """
    whole = []

    def fit(_: Any, x: Sequence[float], *, rounds: int | None = None, **how: Any) -> Fitted:
        whole.extend([] if rounds == SETTINGS.fit.model_variants.short_rounds else [x])
        return fitted(VARIANT, x, short_fit)

    problem, start = cast(Problem, SimpleNamespace(fit=fit)), fitted(DAMPING, (0.3,), left)
    best = model_variants._best_from(problem, start, VARIANT, [(0.3, 0.4)], [b.total for b in start.blocks])
    assert (best is not None) is bool(whole) is is_followed


def test_misled_variants_restart_from_the_usual_one_on_all() -> None:
    """From other places short fits to three recordings leave least, and whole ones from there far more than before."""
    usual = replace(DAMPING, secondary={"exponent": Search(0, 1)})
    start, stands = fitted(usual, (0.3,), 30.0), usual.with_secondary((0.3,))[0]
    least = [60.0]

    def fit(candidates: Sequence[Candidate], x: Sequence[float], **how: Any) -> Fitted:
        if how.get("rounds") == SETTINGS.fit.model_variants.short_rounds:
            return fitted(candidates[-1], x, 20.0 if tuple(x) == stands else 10.0)
        least[:] = [1.0] if tuple(x) == stands else least
        return fitted(candidates[-1], x, 30.0 if len(x) == 1 else least[0])

    found = model_variants.with_fitted_secondary(
        cast(Problem, SimpleNamespace(fit=fit)), start, [b.total for b in start.blocks]
    )
    assert found is not None
    assert len(found.x) == 2
    assert model_variants.is_noise(found)


@pytest.mark.parametrize(
    ("leaves", "short_fit", "then", "whole"),
    [
        (1.0, 1.45, 1.3, 1),  # beside an explanation that leaves noise: what comes near it may be another
        (1.0, 1.45, 1.4, 0),
        (1.0, 1.55, 1.3, 0),
        (3.0, 4.9, 4.9, 1),  # twice as far from the noise as the best is
        (3.0, 4.9, 5.1, 0),
        (3.0, 5.1, 4.9, 0),
    ],
)
def test_a_variant_near_its_rivals_misfit_is_followed(leaves: float, short_fit: float, then: float, whole: int) -> None:
    """Times what chance leaves: after a short fit to few recordings, and after a few rounds of all."""
    made = []

    def fit(_: Any, x: Sequence[float], *, rounds: int | None = None, **how: Any) -> Fitted:
        made.extend([] if rounds else [x])
        return fitted(VARIANT, x, short_fit if rounds == SETTINGS.fit.model_variants.short_rounds else then)

    start, lead = fitted(DAMPING, (0.3,), 6.0), fitted(DAMPING, (0.3,), leaves)
    size = sum(b.residual.size for b in lead.blocks)
    scale = leaves * size / lead.total  # blocks of chance: what they leave is nearly their number
    problem = cast(Problem, SimpleNamespace(fit=lambda *a, **k: _scaled(fit(*a, **k), scale)))
    model_variants._best_from(
        problem, _scaled(start, scale), VARIANT, [(0.3, 0.4)], [scale * b.total for b in lead.blocks]
    )
    assert len(made) == whole


def _scaled(f: Fitted, times: float) -> Fitted:
    """A fit that leaves exactly so many times as much."""
    return replace(f, blocks=tuple(replace(b, residual=b.residual * np.sqrt(times)) for b in f.blocks))

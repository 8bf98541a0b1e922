"""Clocks that are off by far more than they may be, as a finding: which, by how much, and what that explains."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace

import numpy as np

from rollover.diagnosis.fit.cross_validation import held_out
from rollover.diagnosis.fit.levenberg_marquardt import Problem
from rollover.diagnosis.inference.scores import judged
from rollover.diagnosis.result import Diagnosis, Interval, Named
from rollover.diagnosis.selection.explanation import Explanation
from rollover.diagnosis.settings import SETTINGS
from rollover.effects import EFFECTS, spoken

TUNING = SETTINGS.report.late_clocks
ID = "sensor-clock-offset"


def with_clock_finding(found: Diagnosis, late: Mapping[str, float], problem: Problem, tried: Explanation) -> Diagnosis:
    """A diagnosis made with clocks set right that were `late` (s, by recording), with that as its first finding."""
    groups = [[r] for r in range(len(problem.dataset))]
    before, held = judged(problem, tried.base, [], groups), held_out(tried.base, groups).total
    clocks = _named(late, problem, tried.p_value)
    rest = f" Beside that: {found.sentence}" if found.effects else ""
    after = {n: a for n, _, a in found.per_recording}
    end = found.after.get("held_out", found.after["training"]).nrmse
    return replace(
        found,
        verdict=found.verdict if found.effects else "sensor",
        answer=found.answer if found.effects else "whole",
        sentence=f"{clocks[0].statement} With it the misfit falls from {held:.1f} to {end:.2f} times the noise.{rest}",
        p_value=tried.p_value,
        effects=(*clocks, *found.effects),
        before=before.scores,
        per_recording=tuple((n, b, after.get(n, b)) for n, b in before.by_recording),
    )


def _named(late: Mapping[str, float], problem: Problem, p_value: float) -> tuple[Named, ...]:
    """One finding for each channel where all recordings are as late, which a scenario can be told; else one of all."""
    from scipy.special import stdtrit

    values = np.array(list(late.values()))
    is_common = len(late) == len(problem.dataset) and float(np.ptp(values)) < 2.0 * SETTINGS.data.dataset.shift_prior
    value, n = float(np.mean(values)), values.size
    error = max(float(np.std(values, ddof=1)) / np.sqrt(n) if n > 1 else 0.0, 0.1 * SETTINGS.data.dataset.shift_prior)
    wide = float(stdtrit(max(n - 1, 1), SETTINGS.report.grades.one_sided_confidence)) * error
    way = "late" if value > 0.0 else "early"
    each = ", ".join(f"{spoken(abs(s) * 1e3)} ms {'late' if s > 0.0 else 'early'} ({name})" for name, s in late.items())
    statement = (
        f"All channels of all recordings come {spoken(abs(value) * 1e3)} ms {way}: their common clock is off."
        if is_common
        else f"Clocks of recordings are off: {each}."
    )
    channels = list(dict.fromkeys(s.channel for e in problem.dataset for s in e.signals))
    own: list[str | None] = [*channels] if is_common and len(channels) <= TUNING.most_channels else [None]
    return tuple(
        Named(
            id=ID,
            kind="sensor",
            statement=statement,
            parameters={"offset": Interval(value=value, low=value - wide, high=value + wide, unit="s")},
            settings={} if channel is None else {"channel": channel, "offset": value},
            channel=channel,
            p_value=p_value,
            indistinguishable_from=(),
            discriminating_test=next(iter(EFFECTS[ID].rivals.values()), ""),
        )
        for channel in own
    )

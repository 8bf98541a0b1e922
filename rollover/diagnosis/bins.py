"""Recordings with more rows than are needed, as means of neighbouring rows, and simulated as such means too."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from rollover.diagnosis.simulator import Simulator, simulator_of
from rollover.filters import least_rate
from rollover.recording import Recording
from rollover.scenario import Scenario

Array = NDArray[np.float64]

MOST_ROWS = 700  # of a recording that are looked at
LIKE_ALL = 3  # stamps within a mean at which it is simulated


@dataclass(frozen=True, kw_only=True)
class Averaged:
    """A simulator at `many` stamps for each mean; predicts the means."""

    inner: Simulator
    many: int

    def predict(self, changes: Mapping[str, Any], shift: float) -> dict[str, Array] | None:
        """See `Simulator`."""
        found = self.inner.predict(changes, shift)
        return None if found is None else {c: v.reshape(-1, self.many).mean(axis=1) for c, v in found.items()}

    def contact(self, _shift: float) -> float:
        """See `Simulator`."""
        return self.inner.contact(_shift)


def simulated(scenario: Scenario, recording: Recording) -> tuple[Recording, Simulator]:
    """The recording at no more than `MOST_ROWS` rows, and what simulates it. Raises `InputError`."""
    thin, inside = _thinned(recording)
    if inside is None:
        return recording, simulator_of(scenario, recording)
    many = inside.shape[1]
    rows = np.arange(many)
    if many > LIKE_ALL and not recording.cfc:  # a filter needs all of them
        rows = np.unique(np.round((np.arange(LIKE_ALL) + 0.5) * many / LIKE_ALL - 0.5).astype(int))
    at = inside[:, rows].reshape(-1)
    part = replace(recording, time=recording.time[at], channels={c: v[at] for c, v in recording.channels.items()})
    return thin, Averaged(inner=simulator_of(scenario, part), many=rows.size)


def binned(recording: Recording) -> Recording:
    """The recording at no more than `MOST_ROWS` rows: means of neighbouring samples, none across a gap.

    What is averaged keeps its information while noise falls with the root of the number; a rate that a filter class
    needs is kept.
    """
    return _thinned(recording)[0]


def _thinned(recording: Recording) -> tuple[Recording, NDArray[np.int64] | None]:
    """The recording of means, and the rows (bins, many) of each; None where there are few enough as it is."""
    n = recording.time.size
    step = float(np.median(np.diff(recording.time))) if n > 1 else 1.0
    most = int(n // MOST_ROWS)
    for cfc in recording.cfc.values():
        most = min(most, int(1.0 / (step * 1.05 * least_rate(cfc))))
    if most < 2:
        return recording, None
    inside = np.arange(n // most * most).reshape(-1, most)
    time = recording.time[inside]
    inside = inside[time[:, -1] - time[:, 0] < 1.5 * (most - 1) * step]
    channels = {c: values[inside].mean(axis=1) for c, values in recording.channels.items()}  # NaN where any is
    noise = {channel: sigma / np.sqrt(most) for channel, sigma in recording.noise.items()}
    thin = replace(recording, time=recording.time[inside].mean(axis=1), channels=channels, noise=noise)
    return thin, inside

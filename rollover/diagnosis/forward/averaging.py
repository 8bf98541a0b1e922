"""Recordings with more rows than are needed, as means of neighbouring rows, and simulated as such means too."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

from rollover.diagnosis.forward.discontinuities import DISCONTINUITY_IN, within_means
from rollover.diagnosis.forward.forward_model import simulator_of
from rollover.diagnosis.forward.full_run import full_runs
from rollover.diagnosis.forward.interface import Simulator
from rollover.diagnosis.settings import SETTINGS
from rollover.diagnosis.settings.forward import Effort
from rollover.recording import Recording
from rollover.recording.attitude import beside, has_attitude
from rollover.recording.filters import least_rate
from rollover.scenario import Scenario
from rollover.spec.initiation import Drop

Array = NDArray[np.float64]

TUNING = SETTINGS.forward.averaging


@dataclass(frozen=True, kw_only=True)
class Averaged:
    """A simulator at several stamps for each mean, `starts` (bins,) where those of each begin; predicts the means.

    `inner` tells of no jumps from stamp to stamp, see `DropSimulator`: their means would say nothing.
    Where fewer than all that are in a mean are simulated, it also says under `DISCONTINUITY_IN` and the channel's name
    how far that jumps within or beside each mean: of how many of its samples it has jumped already is not known then.
    """

    inner: Simulator
    starts: NDArray[np.int64]
    counts: NDArray[np.int64]
    many: int

    def predict(self, changes: Mapping[str, Any], shift: float) -> dict[str, Array] | None:
        """See `Simulator`."""
        every = self.inner.predict(changes, shift)
        if every is None:
            return None
        return {**self._means(every), **self._discontinuities(every)}

    def _discontinuities(self, found: Mapping[str, Array]) -> dict[str, Array]:
        if np.all(self.counts == self.many):
            return {}
        sizes = {}
        for channel, values in found.items():
            sizes[channel] = np.empty(self.starts.size)
            within_means(values, self._of, sizes[channel])
            sizes[channel][self.counts == self.many] = 0.0
        return {DISCONTINUITY_IN + channel: size for channel, size in sizes.items()}

    @cached_property
    def _of(self) -> NDArray[np.int64]:
        """The mean of each stamp."""
        return np.repeat(np.arange(self.starts.size), self.counts)

    def _means(self, found: Mapping[str, Array]) -> dict[str, Array]:
        return {c: np.add.reduceat(v, self.starts) / self.counts for c, v in found.items()}

    def perturbed(
        self, changes: Mapping[str, Any] | None = None, shift: float = 0.0, parts: int = 1
    ) -> list[dict[str, Array]]:
        """See `Simulator`."""
        return [self._means(d) for d in self.inner.perturbed(changes, shift, parts)]

    def choose_medoid(self) -> None:
        """See `Simulator`."""
        self.inner.choose_medoid()

    def until(self, n: int) -> Averaged:
        """See `Simulator`."""
        last = int(self.starts[n]) if n < self.starts.size else int(self.counts.sum())
        return Averaged(inner=self.inner.until(last), starts=self.starts[:n], counts=self.counts[:n], many=self.many)

    def marks(self) -> tuple[tuple[float, str], ...]:
        """See `Simulator`."""
        return self.inner.marks()

    def state(self, shift: float) -> Mapping[str, Array]:
        """See `Simulator`."""
        return self._means(self.inner.state(shift))

    @property
    def contact(self) -> float:
        """See `Simulator`."""
        return self.inner.contact

    @property
    def effort(self) -> Effort:
        """See `Simulator`."""
        return self.inner.effort


def on_attitude_branch(scenario: Scenario, recording: Recording) -> tuple[Recording, Recording | None]:
    """The recording with its attitude on the branch of its simulation, and the attitude of that; None without any.

    Raises `InputError`.
    """
    if not has_attitude(recording):
        return recording, None
    runs = full_runs(simulator_of(scenario, recording))
    reference = None if runs is None else runs.attitude()
    return beside(recording, reference), reference


def compared(scenario: Scenario, recording: Recording) -> tuple[Recording, Recording, Simulator, int]:
    """The recording `on_attitude_branch`, and it as it is `simulated`. Raises `InputError`."""
    recording, reference = on_attitude_branch(scenario, recording)
    return recording, *simulated(scenario, recording, reference)


def simulated(
    scenario: Scenario, recording: Recording, reference: Recording | None = None
) -> tuple[Recording, Simulator, int]:
    """The recording at no more than `most_rows` rows, what simulates it, and how many samples are in a row.

    `reference` is the attitude beside whose branch those of all runs are put. Raises `InputError`.
    """
    is_drop = isinstance(scenario.initiation, Drop)
    # of a full run it is not the rows that cost
    classes = () if is_drop else tuple(recording.cfc.values())
    thin, inside = block_averaged(recording, max(map(least_rate, classes), default=0.0))
    if inside is None:
        return recording, with_reference_attitude(simulator_of(scenario, recording), reference), 1
    many = inside.shape[1]
    # a filter needs all stamps, and so does the kink of the force at the first contact
    near = TUNING.unknown_zero_error if recording.clock.zero == "unknown" else TUNING.known_zero_error
    whole = np.abs(thin.time) < near + many * float(np.median(np.diff(recording.time)))
    if recording.cfc or many <= TUNING.few_stamps or not is_drop:
        whole[:] = True
    # two times at the standard deviation about the mean have the mean of any cubic
    times = recording.time[inside]
    beside = thin.time[:, None] + times.std(axis=1)[:, None] * np.array([-1.0, 1.0])
    stamps = [t if all_ else b for t, b, all_ in zip(times, beside, whole, strict=True)]
    counts = np.array([t.size for t in stamps])
    at = np.concatenate([rows[:n] for rows, n in zip(inside, counts, strict=True)])
    channels = {c: v[at] for c, v in recording.channels.items()}  # which there are is all that is asked of them
    part = replace(recording, time=np.concatenate(stamps), channels=channels)
    starts = np.concatenate([[0], np.cumsum(counts)[:-1]])
    inner = with_reference_attitude(simulator_of(scenario, part, discontinuities=False), reference)
    return thin, Averaged(inner=inner, starts=starts, counts=counts, many=many), many


def with_reference_attitude(simulator: Simulator, reference: Recording | None) -> Simulator:
    """The simulator itself, its full runs with their attitude beside a `reference`."""
    runs = full_runs(simulator)
    if runs is not None:
        runs.reference = reference
    return simulator


def block_averaged(recording: Recording, slowest: float = 0.0) -> tuple[Recording, NDArray[np.int64] | None]:
    """The recording at no more than `most_rows` rows, means of neighbours, none across a gap, and which these are.

    (rows, many), None where there are few enough as it is, or would be fewer than `slowest` asks for, Hz. What is
    averaged keeps its information while noise falls with the root of the number.
    """
    n = recording.time.size
    step = float(np.median(np.diff(recording.time))) if n > 1 else 1.0
    most = int(n // TUNING.most_rows)
    if slowest:
        most = min(most, int(1.0 / (step * TUNING.rate_margin * slowest)))
    if most < 2:
        return recording, None
    inside = np.arange(n // most * most).reshape(-1, most)
    time = recording.time[inside]
    inside = inside[time[:, -1] - time[:, 0] < 1.5 * (most - 1) * step]
    channels = {c: values[inside].mean(axis=1) for c, values in recording.channels.items()}  # NaN where any is
    noise = {channel: sigma / np.sqrt(most) for channel, sigma in recording.noise.items()}
    thin = replace(recording, time=recording.time[inside].mean(axis=1), channels=channels, noise=noise)
    return thin, inside

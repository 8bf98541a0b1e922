"""Peak loads of a run: raw, filtered with their class, the impulse apart, the domain they lie in, and how sure."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from rollover.dynamics.result import Run
from rollover.dynamics.validity import flag_names
from rollover.recording import Recording
from rollover.recording.filters import filtered
from rollover.spec.channels import describe
from rollover.system.numbers import percent


@dataclass(frozen=True, kw_only=True)
class PeakLoad:
    """The largest magnitude of one load channel.

    `impulse` (N s) is the momentum that collisions at restitution 0 took on this path, which no force history shows;
    `domain_flags` name what lay outside the ground law's calibrated domain within 50 ms of the peak;
    `half_step_change` is the relative change of the filtered peak at half the step, None if not examined; `mean` and
    `scatter` (standard deviation over the mean) are those of the filtered peak over an ensemble of `starts`, if any, of
    which `starts_by` made all but the run itself.
    """

    channel: str
    unit: str
    raw: float
    raw_time: float
    filtered: float
    filtered_time: float
    cfc: int
    impulse: float | None = None
    domain_flags: tuple[str, ...]
    half_step_change: float | None = None
    starts: int | None = None
    mean: float | None = None
    scatter: float | None = None
    starts_by: str | None = None


WINDOW = 0.05  # s, around a peak, whose touches are judged against the calibrated domain


def peak_loads(run: Run, half_step: Run | None = None) -> tuple[PeakLoad, ...]:
    """Peaks of every load channel of a run: on the ground, on the ROPS, through each mount, on each wheel.

    `half_step` is the same scenario at half the step.
    """
    found = []
    for channel, parts, impulse in load_channels(run.recording):
        peak = _peak(run, channel, parts, impulse)
        if half_step is not None:
            other = _peak(half_step, channel, parts, impulse)
            size = abs(peak.filtered)
            change = abs(other.filtered - peak.filtered) / size if size > 0.0 else 0.0
            peak = PeakLoad(**{**peak.__dict__, "half_step_change": change})
        found.append(peak)
    return tuple(found)


def load_channels(recording: Recording) -> list[tuple[str, tuple[str, ...], str | None]]:
    """Load, the channels that it is the magnitude of, and the channel of its impulse."""
    names = list(recording.channels)
    found: list[tuple[str, tuple[str, ...], str | None]] = []
    if "rops/force" in names:
        found.append(("rops/force", ("rops/force",), "rops/impulse"))
    if "device/force" in names:
        found.append(("device/force", ("device/force",), None))
    mounts = sorted({n.rsplit("/", 1)[0] for n in names if n.startswith("rops/mount/")})
    found += [(f"{m}/force", tuple(f"{m}/force_{axis}" for axis in "xyz"), None) for m in mounts]
    hinges = sorted({n.rsplit("/", 1)[0] for n in names if n.startswith("rops/hinge/")})
    found += [
        (f"{m}/{what}", tuple(f"{m}/{what}_{k}" for k in "xyz"), None) for m in hinges for what in ("force", "moment")
    ]
    found.append(("ground/force_normal", ("ground/force_normal",), "ground/impulse_normal"))
    found += [(n, (n,), None) for n in names if n.startswith("wheel/")]
    return found


def magnitude(recording: Recording, parts: tuple[str, ...], cfc: int | None) -> NDArray[np.float64]:
    """Magnitude (n,) of one channel or of the vector of several, each filtered first."""
    if recording.time.size < 2:
        cfc, step = None, 1.0  # nothing to filter
    else:
        step = float(np.median(np.diff(recording.time)))
    columns = [recording[p] if cfc is None else filtered(recording[p], step, cfc) for p in parts]
    return np.abs(columns[0]) if len(columns) == 1 else np.sqrt(sum(v * v for v in columns))


def _peak(run: Run, channel: str, parts: tuple[str, ...], impulse: str | None) -> PeakLoad:
    recording, cfc = run.recording, run.scenario.loads.cfc
    raw, smooth = magnitude(recording, parts, None), magnitude(recording, parts, cfc)
    i, k = int(np.argmax(raw)), int(np.argmax(smooth))
    near = np.abs(recording.time - recording.time[i]) <= WINDOW
    flags = int(np.bitwise_or.reduce(run.flags[near])) if not channel.startswith("wheel/") else 0
    return PeakLoad(
        channel=channel,
        unit=describe(parts[0]).unit,
        raw=float(raw[i]),
        raw_time=float(recording.time[i]),
        filtered=float(smooth[k]),
        filtered_time=float(recording.time[k]),
        cfc=cfc,
        impulse=float(recording[impulse][-1]) if impulse is not None and impulse in recording.channels else None,
        domain_flags=flag_names(flags),
        half_step_change=None,
    )


CONVERGED = 0.02  # relative change of a filtered peak at half the step that passes for converged


def leading(peaks: Sequence[PeakLoad]) -> PeakLoad | None:
    """The load that is asked for first: of a test stand's device, on the ROPS, of the ground; one that there was."""
    order = ("device/force", "rops/force", "ground/force_normal")
    first = [p for name in order for p in peaks if p.channel == name and p.raw != 0.0]
    return next(iter([*first, *(p for p in peaks if p.raw != 0.0)]), None)


def converged(peaks: Sequence[PeakLoad]) -> str:
    """A sentence if the leading load moves by no more than `CONVERGED` at half the step, otherwise nothing."""
    is_converged, said = _at_half_step(peaks)
    return f"converged: {said}, at most 2 % is allowed" if is_converged else ""


def unconverged(peaks: Sequence[PeakLoad]) -> str:
    """A sentence if the leading load moves by more than `CONVERGED` at half the step, otherwise nothing."""
    is_converged, said = _at_half_step(peaks)
    return f"not converged: {said}, more than 2 %" if said and not is_converged else ""


def _at_half_step(peaks: Sequence[PeakLoad]) -> tuple[bool, str]:
    """Whether the leading load moves by no more than `CONVERGED`, and by how much; False and nothing if not known."""
    peak = leading(peaks)
    if peak is None or peak.half_step_change is None:
        return False, ""
    said = f"half the step changes {peak.channel} (CFC {peak.cfc}) by {percent(peak.half_step_change)}"
    return peak.half_step_change <= CONVERGED, said

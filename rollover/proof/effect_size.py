"""How much of an effect the recordings can show: what it moves, over the noise, where and in which channel."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]


def strength(
    times: Sequence[Array],
    shown: Sequence[Mapping[str, Array]],
    without: Sequence[Mapping[str, Array]],
    sigma: Mapping[str, float],
    independence: Sequence[Mapping[str, float]],
) -> dict[str, Any]:
    """Strength of what tells `shown` from `without`, noiseless channels of each recording at its `times`.

    A shift in time of each recording is taken out first, as a diagnosis must. `over_noise` is the largest root mean
    square over noise of any channel (all recordings together), `signal_to_noise` the root of the sum of squares of
    independent samples, `channels` the rms over noise of each, `where` the share of the sum by recording and channel
    with the times (s) between which its middle nine tenths lie.
    """
    squares: dict[str, list[float]] = {}
    cells: list[dict[str, Any]] = []
    total = 0.0
    for r, (t, a, b) in enumerate(zip(times, shown, without, strict=True)):
        moved = {c: (a[c] - b[c]) / sigma[c] for c in a}
        slope = {c: np.gradient(b[c], t) / sigma[c] for c in a}
        there = {c: np.isfinite(moved[c]) & np.isfinite(slope[c]) for c in a}
        weight = sum(float(np.sum(slope[c][there[c]] ** 2)) / independence[r][c] for c in a)
        along = sum(float(slope[c][there[c]] @ moved[c][there[c]]) / independence[r][c] for c in a)
        shift = along / weight if weight > 0.0 else 0.0
        for c in a:
            left = (moved[c] - shift * slope[c])[there[c]] ** 2
            if left.size == 0:
                continue
            squares.setdefault(c, []).extend((float(np.sum(left)), left.size))
            worth = float(np.sum(left)) / independence[r][c]
            total += worth
            ends = [0.0, 0.0]
            if worth > 0.0:
                grown = np.cumsum(left) / np.sum(left)
                ends = [float(t[there[c]][min(np.searchsorted(grown, q), left.size - 1)]) for q in (0.05, 0.95)]
            cells.append({"recording": r, "channel": c, "start": ends[0], "end": ends[1], "worth": worth})
    by_channel = {c: float(np.sqrt(sum(s[0::2]) / max(sum(s[1::2]), 1.0))) for c, s in squares.items()}
    for cell in cells:
        cell["share"] = cell.pop("worth") / total if total > 0.0 else 0.0
    return {
        "over_noise": max(by_channel.values(), default=0.0),
        "signal_to_noise": float(np.sqrt(total)),
        "channels": by_channel,
        "where": cells,
    }


class Concealed(Protocol):
    """What is concealed in a case: an effect at a strength, as a rig's library draws it."""

    @property
    def id(self) -> str:
        """Of the effect, by the contract."""

    @property
    def kind(self) -> str:
        """Physics, parameter, sensor or outside."""

    @property
    def parameters(self) -> Mapping[str, float]:
        """Its parameters."""

    @property
    def channel(self) -> str:
        """The one that is misread; empty for physics."""

    @property
    def depends_on(self) -> str:
        """What it is locked to."""

    @property
    def near(self) -> tuple[str, ...]:
        """Listed effects that an unlisted one resembles."""

    @property
    def form(self) -> str:
        """The law by which it acts, empty for the usual one."""

    @property
    def source(self) -> str:
        """Of that law."""


def entry(change: Concealed, found: Mapping[str, Any]) -> dict[str, Any]:
    """What the sealed truth says of one effect; `found` is its strength."""
    more: dict[str, Any] = {"form": change.form, "source": change.source} if change.form else {}
    if "over_background" in found:
        more["over_background"] = float(found["over_background"])
    return {
        "id": change.id,
        "kind": change.kind,
        "parameters": {name: float(value) for name, value in change.parameters.items()},
        "channel": change.channel,
        "depends_on": change.depends_on,
        "near": list(change.near),
        "over_noise": float(found["over_noise"]),
        "signal_to_noise": float(found["signal_to_noise"]),
        "channels": found["channels"],
        "where": found["where"],
        **more,
    }

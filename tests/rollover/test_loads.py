"""Which load is asked for first, and when a run says that it is not converged."""

from __future__ import annotations

import pytest

from rollover.assessment.loads import PeakLoad, converged, leading, unconverged


def peak(channel: str, raw: float = 1e3, change: float | None = 0.001) -> PeakLoad:
    return PeakLoad(
        channel=channel, unit="N", raw=raw, raw_time=0.1, filtered=raw, filtered_time=0.1, cfc=60, impulse=None,
        domain_flags=(), half_step_change=change,
    )  # fmt: skip


def test_loads_are_of_device_then_rops_then_ground() -> None:
    peaks = [peak("wheel/front_left/force_normal"), peak("ground/force_normal"), peak("rops/force")]
    assert leading(peaks) is peaks[2]
    assert leading([*peaks, device := peak("device/force")]) is device
    assert leading([*peaks, peak("device/force", raw=0.0)]) is peaks[2], "a device that never pushed"
    assert leading(peaks[:1]) is peaks[0]
    assert leading([peak("rops/force", raw=0.0)]) is None


@pytest.mark.parametrize(
    ("change", "said"), [(None, ""), (0.02, ""), (0.031, "half the step changes rops/force (CFC 60) by 3.1 %")]
)
def test_more_than_two_percent_is_not_converged(change: float | None, said: str) -> None:
    sentence = unconverged([peak("ground/force_normal", change=0.5), peak("rops/force", change=change)])
    assert sentence == (f"not converged: {said}, more than 2 %" if said else "")
    assert unconverged(()) == ""
    settled = "converged: half the step changes rops/force (CFC 60) by 2 %, at most 2 % is allowed"
    assert converged([peak("ground/force_normal", change=0.5), peak("rops/force", change=change)]) == (
        settled if change == 0.02 else ""
    )

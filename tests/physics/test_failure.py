"""A run that fails is a value: its sentence, its time, and all that was recorded until then."""

from __future__ import annotations

import numpy as np
import pytest

from rollover.dynamics.simulate import run
from tests.physics.scenes import drop, shipped


def test_run_that_breaks_off_says_when_and_keeps_what_it_had() -> None:
    result = run(shipped("rops_drop").replaced({"ground.law.stiffness_scale": 1e14}))
    assert result.status == "failed"
    assert "at t = 0.03" in result.sentence
    assert 1 < result.recording.time.size < 200
    assert result.stop_time < 0.04
    assert all(np.isfinite(v).all() for v in result.recording.channels.values())


def test_interrupt_goes_through() -> None:
    def stop(_time: float, _wall: float) -> None:
        raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        run(shipped("side_overturn").replaced({"simulation.duration": 20.0}), progress=stop)
    assert run(drop(1.0, duration=0.05)).status == "done"  # and nothing is left behind


def test_progress_tells_simulated_and_wall_time() -> None:
    seen: list[tuple[float, float]] = []
    run(shipped("side_overturn"), progress=lambda t, wall: seen.append((t, wall)))
    assert seen
    assert seen == sorted(seen)
    assert 0.0 < seen[0][0] < 4.0

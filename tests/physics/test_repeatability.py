"""The same run twice is the same bit for bit, in this process and in a fresh one."""

from __future__ import annotations

import hashlib
import subprocess
import sys

from rollover.dynamics.result import Run
from rollover.dynamics.simulate import run
from tests.physics.scenes import shipped


def fingerprint(result: Run) -> str:
    """Hash of all channels, bit for bit."""
    digest = hashlib.sha256(result.recording.time.tobytes())
    for name in sorted(result.recording.channels):
        digest.update(name.encode() + result.recording[name].tobytes())
    return digest.hexdigest()


def overturn() -> str:
    """Fingerprint of the first 2.5 s of the side overturn, with the ROPS on the ground."""
    result = run(shipped("side_overturn").replaced({"simulation.duration": 2.5, "simulation.step": 0.001}))
    assert any(e.kind == "first-touch" and e.subject == "rops" for e in result.events)
    return fingerprint(result)


def test_same_run_twice_is_identical() -> None:
    assert overturn() == overturn()


def test_fresh_process_gives_the_same_bits() -> None:
    code = "from tests.physics.test_repeatability import overturn; print(overturn())"
    fresh = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert fresh.stdout.split()[-1] == overturn()


def test_null_friction_and_null_mass_change_nothing() -> None:
    """A coefficient of zero is the absence of the term, bit for bit."""
    base = shipped("drop_test")
    other = base.replaced({"ground.friction.stick_displacement": 0.01, "ground.friction.stick_relaxation": 0.1})
    assert fingerprint(run(base)) == fingerprint(run(other))

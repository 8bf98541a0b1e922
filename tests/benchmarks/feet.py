"""What a frame by its tubes and steel costs a run, beside one on mounts: `python -m tests.benchmarks.feet [REPEATS]`.

The same overturns with both frames in turn, in one process, by both integrators: CPU seconds of the time loop for each
step. A run has a spring for each foot, whatever number of segments the frame alone is calculated with. In the overturn
down a slope the frames land alike; in the field upset that of tubes yields.
"""

from __future__ import annotations

import sys
from collections.abc import Iterator
from dataclasses import dataclass

from rollover.dynamics.simulate import run
from rollover.scenario import load
from tests.benchmarks.integrators import INTEGRATORS, timed_loops

FRAMES = {"mounts": "vehicles/rops/two_post_rear_3t.yaml", "feet": "vehicles/rops/two_post_rear_tubes_3t.yaml"}
SCENARIOS = ("side_overturn_slope", "field_upset_side")
REPEATS = 3


@dataclass(frozen=True, kw_only=True)
class Cost:
    """Seconds of CPU for a step, least of the repetitions, by frame."""

    scenario: str
    integrator: str
    step: dict[str, float]

    @property
    def ratio(self) -> float:
        """Of feet over mounts."""
        return self.step["feet"] / self.step["mounts"]


def costs(repeats: int = REPEATS) -> Iterator[Cost]:
    """Of each scenario by each integrator; the first run of each is not timed."""
    for name in SCENARIOS:
        for integrator in INTEGRATORS:
            base = load(name).replaced({"simulation.integrator": integrator})
            steps = base.simulation.duration / base.simulation.step
            found: dict[str, list[float]] = {frame: [] for frame in FRAMES}
            for k in range(repeats + 1):
                for frame, file in FRAMES.items():
                    with timed_loops() as times:
                        done = run(base.replaced({"vehicle.rops": file}))
                    assert done.status == "done", done.sentence
                    found[frame] += [times[-1] / steps] * (k > 0)
            yield Cost(scenario=name, integrator=integrator, step={f: min(t) for f, t in found.items()})


def main() -> None:
    """Print the table."""
    print(f"{'scenario':22} {'integrator':10} {'mounts, us':>10} {'feet, us':>10} {'ratio':>6}")
    for c in costs(int(sys.argv[1]) if len(sys.argv) > 1 else REPEATS):
        mounts, feet = 1e6 * c.step["mounts"], 1e6 * c.step["feet"]
        print(f"{c.scenario:22} {c.integrator:10} {mounts:10.1f} {feet:10.1f} {c.ratio:6.2f}", flush=True)


if __name__ == "__main__":
    main()

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

TUBES = "vehicles/rops/two_post_rear_tubes_3t.yaml"
FRAMES: dict[str, dict[str, object]] = {
    "mounts": {"vehicle.rops": "vehicles/rops/two_post_rear_3t.yaml"},
    "feet": {"vehicle.rops": TUBES},
    "bent": {"vehicle.rops": TUBES, "vehicle.rops.segments": 8},  # 8 of a post, 4 of half the crossbar
}
SCENARIOS = ("side_overturn_slope", "field_upset_side")
REPEATS = 3


@dataclass(frozen=True, kw_only=True)
class Cost:
    """Seconds of CPU for a step, least of the repetitions, by frame."""

    scenario: str
    integrator: str
    step: dict[str, float]

    @property
    def ratios(self) -> tuple[float, float]:
        """Of feet over mounts, of posts that bend over feet."""
        return self.step["feet"] / self.step["mounts"], self.step["bent"] / self.step["feet"]


def costs(repeats: int = REPEATS) -> Iterator[Cost]:
    """Of each scenario by each integrator; the first run of each is not timed."""
    for name in SCENARIOS:
        for integrator in INTEGRATORS:
            base = load(name).replaced({"simulation.integrator": integrator})
            steps = base.simulation.duration / base.simulation.step
            found: dict[str, list[float]] = {frame: [] for frame in FRAMES}
            for k in range(repeats + 1):
                for frame, changes in FRAMES.items():
                    with timed_loops() as times:
                        done = run(base.replaced(changes))
                    assert done.status == "done", done.sentence
                    found[frame] += [times[-1] / steps] * (k > 0)
            yield Cost(scenario=name, integrator=integrator, step={f: min(t) for f, t in found.items()})


def main() -> None:
    """Print the table."""
    head = "".join(f"{frame + ', us':>12}" for frame in FRAMES)
    print(f"{'scenario':22} {'integrator':10}{head} {'feet/mounts':>12} {'bent/feet':>10}")
    for c in costs(int(sys.argv[1]) if len(sys.argv) > 1 else REPEATS):
        steps = "".join(f"{1e6 * c.step[frame]:12.1f}" for frame in FRAMES)
        print(f"{c.scenario:22} {c.integrator:10}{steps} {c.ratios[0]:12.2f} {c.ratios[1]:10.2f}", flush=True)


if __name__ == "__main__":
    main()

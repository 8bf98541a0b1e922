"""The time loop without an engine: generalised alpha with the same contact forces, in one compiled call after another.

The loop comes back for what only Python can do: to name an event, to make room, to keep a frame of the ground.
"""

from __future__ import annotations

import numpy as np

from rollover.dynamics.recorder import Recorder
from rollover.kernels import generalised_alpha as scheme
from rollover.kernels import time_loop as loop
from rollover.kernels.applied_forces import coefficients


def course_of(recorder: Recorder, steps: int) -> scheme.Course:
    """State of the integrator at the start of a run."""
    rig, settings = recorder.rig, recorder.scenario.simulation
    t, start = rig.tables, rig.start
    n = len(t.spin_mass)
    alpha_m, alpha_f, gamma = coefficients(settings.spectral_radius)
    q = np.zeros(n)
    q[: len(t.mass)] = start.q[: len(t.mass)]
    real = np.zeros(scheme.REALS)
    real[scheme.STEP] = real[scheme.LONGEST] = settings.step
    real[scheme.END], real[scheme.GRAVITY] = steps * settings.step, recorder.scenario.gravity
    return scheme.Course(
        q=q,
        qd=start.qd.copy(),
        qdd=np.zeros(n),
        filtered=np.zeros(n),
        added=t.spin_mass.copy(),
        anchor=np.array([start.q[6 * a : 6 * a + 3] for a in t.joint_i[:, 1]]).reshape(-1, 3),
        scheme=np.array([alpha_m, alpha_f, 0.25 * (gamma + 0.5) ** 2, gamma]),
        real=real,
        whole=np.zeros(scheme.WHOLES, dtype=np.int64),
    )


def solve(recorder: Recorder, steps: int) -> str:
    """Run the time loop; returns "" or why it gave up. Raises ``DivergedError``."""
    course, watch, live = course_of(recorder, steps), recorder.watch, recorder.live
    reason = loop.begin(live.handle, course, watch, recorder.past.watch.drive, recorder.past.start)
    while True:
        time = float(course.real[scheme.TIME])
        recorder.see_to(reason, time, course.qd)
        if not recorder.goes_on(reason, time, course.q) or reason & loop.DONE:
            return ""
        if reason & loop.GAVE_UP:
            return "Newton's iteration does not converge, even at a shorter step"
        reason = loop.advance(live.handle, course, watch)

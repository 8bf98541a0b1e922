"""One case: a resolved scenario to the numbers that a study keeps of it. The same function here and on a cluster."""

from __future__ import annotations

import functools
import gc
import hashlib
import math
import os
import pickle
import platform
import sys
import time
from collections.abc import Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass
from typing import Any, Literal

import numpy as np

from rollover.assessment.ledger import closure
from rollover.assessment.loads import leading as leading_load
from rollover.assessment.loads import load_channels, magnitude, peak_loads
from rollover.assessment.results import versions
from rollover.dynamics.drop_test import DropFailedError, DropModel
from rollover.dynamics.result import Run
from rollover.effects import effects
from rollover.recording import Recording
from rollover.scenario import Scenario, load
from rollover.spec import document
from rollover.spec.initiation import TipOver
from rollover.spec.laws import laws
from rollover.system import own_code

ALSO = ("rops/deflection", "rops/energy", "ground/sinkage", "chassis/roll")
CLEARANCE = ("clearance/structure", "clearance/ground")
Simulator = Literal["full", "drop"]


@dataclass(frozen=True, kw_only=True)
class Case:
    """What a worker is given: the scenario, pickled, and what its result depends on besides.

    `key` names the result: equal keys, equal results. `clearance` adds distances from the operator's zone.
    """

    key: str
    scenario: bytes
    simulator: Simulator
    clearance: bool
    versions: str
    own_code: Mapping[str, str]  # files of one's own effects and laws, which a worker elsewhere has to read first


@dataclass(frozen=True, kw_only=True)
class Result:
    """What a case gave: `measures` by name in SI, domain flags of the run and at the peak, and its provenance.

    `sentence` is empty for a case that is done; a simulation that failed says why and has no measures.
    """

    measures: Mapping[str, float]
    domain_flags: tuple[str, ...]
    peak_flags: tuple[str, ...]
    sentence: str
    provenance: Mapping[str, Any]


def case_of(key: str, scenario: Scenario, *, simulator: Simulator, clearance: bool) -> Case:
    """The case of a scenario, whose `key` is that of `key_of`."""
    return Case(
        key=key,
        scenario=pickle.dumps(scenario),
        simulator=simulator,
        clearance=clearance,
        versions=stated_versions(),
        own_code={name: os.environ.get(name, "") for name in own_code.KINDS.values()},
    )


def key_of(scenario: Scenario, *, simulator: Simulator, clearance: bool) -> str:
    """SHA-256 over the resolved scenario, the versions, and how it is simulated: 40 hexadecimal digits of it."""
    own = own_files("effects") if scenario.effects else ""
    if any(own_code.is_own("laws", law) for law in scenario.ground.every_law):
        own += own_files("laws")
    text = f"{document.content_hash(scenario)} {stated_versions()} {simulator} {clearance} {own}"
    return hashlib.sha256(text.encode()).hexdigest()[:40]


def made_by(scenario: Scenario, simulator: Simulator) -> str:
    """Which integrator makes the run of a scenario; "drop" is that of a drop by itself."""
    return "drop" if simulator == "drop" else scenario.integrator


@functools.cache
def stated_versions() -> str:
    """Versions of all that a result depends on, in one line; asked once."""
    return ", ".join(f"{name} {version}" for name, version in versions().items())


def own_files(kind: Literal["effects", "laws"]) -> str:
    """Hash of the files of one's own effects or laws: what they say decides a result as a version does."""
    return " ".join(own_code.hashes(kind).values())


def warm_up(simulator: Simulator = "full", integrator: str = "exudyn") -> None:
    """Load what a case needs, kernels too, by a drop of its own, so that the first case is not charged for it."""
    effects()
    drop = load("drop_test")
    if simulator == "drop":
        _dropped(drop)
    else:
        _simulated(drop.replaced({"simulation.duration": 0.005, "simulation.integrator": integrator}), clearance=False)


def warm_up_before_fork(simulator: Simulator = "full", integrator: str = "exudyn") -> None:
    """`warm_up` in the process that children are forked from, without any file of one's own, which may change."""
    with suppress(Exception), own_code.none_named():  # the first case will say what is wrong
        warm_up(simulator, integrator)
    gc.collect()
    gc.freeze()  # what stays for good is not searched again and again by each child


class WrongVersionsError(Exception):
    """A worker would compute by other versions than the key says."""


def work(case: Case) -> Result:
    """Simulate a case. Raises what the simulation raises; one that fails is a result with a sentence."""
    if case.versions != stated_versions():
        raise WrongVersionsError(f"this worker has {stated_versions()}; the study was begun with {case.versions}")
    for name, files in case.own_code.items():
        if files:
            os.environ[name] = files
    effects()  # before the scenario, which may hold some of one's own
    began, cpu = time.time(), time.process_time()
    laws()
    scenario: Scenario = pickle.loads(case.scenario)
    found = _dropped(scenario) if case.simulator == "drop" else _simulated(scenario, case.clearance)
    measures, run_flags, peak_flags, sentence = found
    provenance = {
        "finished": time.strftime("%Y-%m-%dT%H:%M:%SZ", time.gmtime()),
        "wall_time": time.time() - began,
        "cpu_time": time.process_time() - cpu,
        "peak_memory": _peak_memory(),
        "host": platform.node(),
        "process": os.getpid(),
        "integrator": made_by(scenario, case.simulator),
    }
    return Result(
        measures=measures, domain_flags=run_flags, peak_flags=peak_flags, sentence=sentence, provenance=provenance
    )


Found = tuple[dict[str, float], tuple[str, ...], tuple[str, ...], str]


def _simulated(scenario: Scenario, clearance: bool) -> Found:
    from rollover.dynamics import simulate

    run = simulate.run(scenario)
    if run.status == "failed":
        return {}, run.domain_flags, (), run.sentence
    peaks = peak_loads(run)
    measures: dict[str, float] = {}
    for peak in peaks:
        measures[peak.channel] = peak.filtered
        measures[f"{peak.channel}/raw"] = peak.raw
        if peak.impulse is not None:
            measures[f"{peak.channel}/impulse"] = abs(peak.impulse)
    measures |= _largest(run.recording, ALSO)
    measures |= _of_run(run)
    if isinstance(run.scenario.initiation, TipOver):
        measures["start/from_rest"] = float(bool(run.sentence))
    if clearance:
        from rollover.assessment.clearance import approaches

        measures |= {f"clearance/{a.what}": a.least for a in approaches(run)}
    first = leading_load(peaks)
    return _finite(measures), run.domain_flags, first.domain_flags if first is not None else (), ""


def _of_run(run: Run) -> dict[str, float]:
    from rollover.assessment.criteria import rops_share

    share = rops_share(run)
    found = {} if share is None else {"rops/share": share}
    if math.isfinite(closed := closure(run).largest):
        found["ledger/residual"] = closed
    return {**found, "time/stop": run.stop_time}


def _dropped(scenario: Scenario) -> Found:
    """A drop test by itself; its domain is not judged."""
    try:
        recording = DropModel(scenario=scenario).run()
    except DropFailedError as e:
        return {}, (), (), str(e)
    measures: dict[str, float] = {}
    for channel, parts, impulse in load_channels(recording):
        measures[channel] = float(magnitude(recording, parts, scenario.loads.cfc).max())
        measures[f"{channel}/raw"] = float(magnitude(recording, parts, None).max())
        if impulse is not None and impulse in recording.channels:
            measures[f"{channel}/impulse"] = abs(float(recording[impulse][-1]))
    measures |= _largest(recording, ALSO)
    return _finite({**measures, "time/stop": float(recording.time[-1])}), (), (), ""


def _largest(recording: Recording, channels: Sequence[str]) -> dict[str, float]:
    return {c: float(np.abs(recording[c]).max()) for c in channels if c in recording.channels}


def _finite(measures: dict[str, float]) -> dict[str, float]:
    wrong = next((name for name, value in measures.items() if not np.isfinite(value)), None)
    if wrong is not None:
        raise ArithmeticError(f"{wrong} is not finite, got {measures[wrong]}")
    return measures


def _peak_memory() -> int:
    """Most bytes that this process ever held, over all of its cases; 0 where that is not told."""
    try:
        # what getrusage tells on Linux begins with what the parent held when it made this process
        with open("/proc/self/status", encoding="ascii") as file:
            return next((1024 * int(line.split()[1]) for line in file if line.startswith("VmHWM")), 0)
    except OSError:
        pass
    if sys.platform == "win32":
        return 0
    import resource

    return int(resource.getrusage(resource.RUSAGE_SELF).ru_maxrss) * (1 if sys.platform == "darwin" else 1024)

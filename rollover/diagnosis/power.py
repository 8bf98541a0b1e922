"""Recordings that are too few or too weak to tell anything."""

from __future__ import annotations

import time as clock
from collections.abc import Mapping, Sequence

from rollover.diagnosis.data.dataset import Dataset
from rollover.diagnosis.fit.parameterisation import strength_parameter
from rollover.diagnosis.result import Diagnosis
from rollover.diagnosis.settings import SETTINGS
from rollover.diagnosis.statements import noise
from rollover.effects import EFFECTS

TUNING = SETTINGS.report.power


def is_underpowered(detectable: Mapping[str, float]) -> bool:
    """Whether even typical strengths of most effects would have stayed below what shows; of all, where no ground acts.

    How many others there are is a matter of the vehicle, not of what its recordings tell.
    """
    typical = {
        name: value
        for name, value in detectable.items()
        if name in EFFECTS and EFFECTS[name].kind == "physics" and None not in EFFECTS[name].null.values()
    }  # of a limit, and of what the scenario has already, nothing is usual
    blind = 0
    for name, value in typical.items():
        parameter, null = strength_parameter(name, EFFECTS[name].search)
        usual = getattr(EFFECTS[name](), parameter, None)
        blind += usual is None or value > abs(usual - null)
    acts = any(channel.startswith("ground/") for name in typical for channel in EFFECTS[name].channels)
    return blind > TUNING.blind_share * len(typical) if acts else blind == len(typical)


def cannot_tell(
    dataset: Sequence[Dataset], names: Sequence[str], notes: Sequence[str], began: float, why: str = ""
) -> Diagnosis:
    """The answer where there is too little to judge."""
    return Diagnosis(
        verdict="cannot-tell",
        sentence=f"There is too little in these recordings to be compared with the simulation.{why}",
        p_value=1.0,
        noise=noise(dataset),
        where=(),
        effects=(),
        remaining_significant=False,
        remaining_p_value=1.0,
        remaining_where=(),
        depends_on=None,
        dependencies=(),
        smallest_detectable={},
        training=tuple(names),
        held_out=(),
        before={},
        after={},
        per_recording=(),
        candidates=(),
        simulations=0,
        seconds=clock.perf_counter() - began,
        notes=tuple(notes),
    )

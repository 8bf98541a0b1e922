"""What a diagnosis says in words: units of the channel itself, phases without a depth gauge, small but sure."""

from __future__ import annotations

import numpy as np
import pytest

from rollover.diagnosis.evidence import evidence_of
from rollover.diagnosis.holdout import Held
from rollover.diagnosis.phases import drop_phases
from rollover.diagnosis.simulator import simulator_of
from rollover.diagnosis.statements import sentence
from rollover.effects import EFFECTS, units_of
from rollover.effects.sensor import SensorBias, SensorClipping
from tests.diagnosis.drops import ACCELERATION, DEPTH, FORCE, recorded, scenario


def test_a_limit_and_an_offset_are_in_the_unit_of_their_channel() -> None:
    assert "2.84e+03 N:" in SensorClipping(channel=FORCE, limit=2840.0).says()
    assert "0.01 m" in SensorBias(channel=DEPTH, bias=0.01).says()
    assert units_of(EFFECTS["sensor-bias"], ACCELERATION)["bias"] == "m/s2"
    assert units_of(EFFECTS["soil-layer"])["depth"] == "m"


def test_phases_need_no_depth_gauge() -> None:
    """The deepest point is that of the scenario where no channel tells it, and near that of the depth gauge."""
    speeds = {"speeds": (2.0,), "channels": (FORCE, ACCELERATION, DEPTH), "rate": 1000.0}
    (name, r), *_ = recorded({}, 4, **speeds)  # type: ignore[arg-type]
    blind = recorded({}, 4, **{**speeds, "channels": (FORCE, ACCELERATION)})[0][1]  # type: ignore[arg-type]
    found = [evidence_of(name, one, simulator_of(scenario(), one)) for one in (r, blind)]
    with_depth, without = ({n: at for at, n in drop_phases(e)} for e in found if e is not None)
    assert list(without) == ["free-fall", "first-contact", "loading", "peak", "unloading", "rest"]
    assert without["peak"] == pytest.approx(with_depth["peak"], rel=0.05)


@pytest.mark.parametrize(("p", "said"), [(0.3, "agree within the noise (p = 0.3)"), (1e-9, "less than 0.1%")])
def test_what_is_sure_and_too_small_to_matter_is_not_called_noise(p: float, said: str) -> None:
    nothing = Held(left=np.ones(1), count=np.ones(1))
    assert said in sentence("no-mismatch", (), p, nothing, nothing, [])

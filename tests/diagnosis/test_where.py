"""Candidates, phases, and what a residual force depends on."""

from __future__ import annotations

import numpy as np
import pytest

from rollover.diagnosis.data.dataset import dataset_of
from rollover.diagnosis.data.phases import drop_phases
from rollover.diagnosis.fit.parameterisation import coordinate, physical
from rollover.diagnosis.forward.forward_model import simulator_of
from rollover.diagnosis.selection.candidates import candidates_of
from rollover.effects import Search
from tests.diagnosis import drops
from tests.diagnosis.drops import recorded, scenario


@pytest.mark.parametrize("search", [Search(0.2, 8.0, "log"), Search(-0.3, 0.5)])
def test_coordinates_go_from_low_to_high_and_back(search: Search) -> None:
    assert physical(0.0, search) == pytest.approx(search.low)
    assert physical(1.0, search) == pytest.approx(search.high)
    assert coordinate(physical(0.37, search), search) == pytest.approx(0.37)


def test_sensor_effects_compete_only_in_channels_they_fit() -> None:
    own = scenario()
    name, recording = recorded({}, speeds=(2.0,))[0]
    e = dataset_of(name, recording, simulator_of(own, recording))
    assert e is not None
    keys = {c.key for c in candidates_of([e], ("soil-crust",), "drop")}
    assert {"sensor-scale:ground/sinkage", "sensor-gain:ground/force_normal", "soil-layer"} <= keys
    assert not keys & {
        "sensor-gain:ground/sinkage",
        "sensor-scale:ground/force_normal",
        "soil-crust",
        "rops-plasticity",
    }


def test_every_start_of_every_candidate_is_inside_its_range() -> None:
    own = scenario()
    name, recording = recorded({}, speeds=(2.0,))[0]
    e = dataset_of(name, recording, simulator_of(own, recording))
    assert e is not None
    for c in candidates_of([e], (), "drop"):
        assert len(c.starts()) >= 4, c.key
        for start in c.starts():
            for v, (parameter, search) in zip(c.values(start).values(), c.search.items(), strict=True):
                assert search.low < v < search.high, (c.key, parameter)


def test_phases_are_in_order_and_the_peak_is_the_deepest_point() -> None:
    own = scenario()
    name, recording = recorded({}, speeds=(2.0,), noise=1e-4, rate=2000.0)[0]
    e = dataset_of(name, recording, simulator_of(own, recording))
    assert e is not None
    phases = drop_phases(e)
    assert [n for _, n in phases] == ["free-fall", "first-contact", "loading", "peak", "unloading", "rest"]
    assert [t for t, _ in phases] == sorted(t for t, _ in phases)
    z, t = recording.channels[drops.DEPTH], recording.time
    begin, end = (next(at for at, n in phases if n == wanted) for wanted in ("peak", "unloading"))
    assert begin < t[np.argmax(z)] < end

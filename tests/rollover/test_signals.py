"""Columns of a file to channels: one column is one channel, each has its own time, and nothing goes unmentioned."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from rollover.recording import Recording
from rollover.recording.importers.sidecar import Column, Described, Profile
from rollover.recording.importers.signals import Signal, assemble, left_out
from rollover.system.errors import InputError

FORCE, SINKAGE = "ground/force_normal", "ground/sinkage"
FIRST, LATER = np.array([0.0, 0.1, 0.2]), np.array([0.5, 0.6])


def signal(values: object, time: object = None, channel: str = "", unit: str = "N") -> Signal:
    stamps = None if time is None else np.asarray(time, dtype=float)
    return Signal(values=np.asarray(values, dtype=float), time=stamps, channel=channel, unit=unit)


def read(signals: dict[str, Signal], **columns: Column) -> Recording:
    about = Profile(format="rollover-profile/1", channels={key: {} for key in columns})
    by = Described(file="p.yaml", about=about, columns=columns, lines={}) if columns else None
    return assemble(Path("test.bin"), signals, by)


def test_two_columns_of_one_channel_are_refused_by_both_names() -> None:
    both = {"raw": signal([1, 2, 3], FIRST, FORCE), "filtered": signal([1, 2, 2], FIRST, FORCE)}
    with pytest.raises(InputError, match=r"two columns mean ground/force_normal, got 'raw' and 'filtered'; a profile"):
        read(both)
    chosen = read(both, filtered=Column(channel=FORCE))
    assert chosen[FORCE] == pytest.approx([1, 2, 2])
    assert chosen.notes == ("1 of 2 columns left out, without a description: raw",)


def test_overlap_by_one_stamp_is_no_continuation() -> None:
    parts = {"a/F": signal([1, 2, 3], FIRST, FORCE), "b/F": signal([4, 5], [0.2, 0.3], FORCE)}
    with pytest.raises(InputError, match=r"'a/F' and 'b/F'"):
        read(parts)


def test_groups_of_disjoint_times_are_joined_and_said_so() -> None:
    # the later group stands first in the file; each number keeps its own stamp
    found = read({"b/F": signal([4, 5], LATER, FORCE), "a/F": signal([1, 2, 3], FIRST, FORCE)})
    assert found.time == pytest.approx([0.0, 0.1, 0.2, 0.5, 0.6])
    assert found[FORCE] == pytest.approx([1, 2, 3, 4, 5])
    assert found.notes == ("ground/force_normal: joined from a/F (0 to 0.2 s), b/F (0.5 to 0.6 s)",)


def test_stretches_in_different_units_are_joined_in_newtons() -> None:
    parts = {"a/F": signal([1000, 2000, 3000], FIRST, FORCE), "b/F": signal([4, 5], LATER, FORCE, unit="kN")}
    assert read(parts)[FORCE] == pytest.approx([1000, 2000, 3000, 4000, 5000])


def test_stretches_with_other_noise_are_no_one_channel() -> None:
    columns = {"a": Column(channel=FORCE, unit="N", noise=1.0), "b": Column(channel=FORCE, unit="N", noise=5.0)}
    with pytest.raises(InputError, match="'a' and 'b'"):
        read({"a": signal([1, 2, 3], FIRST), "b": signal([4, 5], LATER)}, **columns)


def test_each_group_has_its_own_column_of_time() -> None:
    signals = {
        "run1.t": signal(FIRST, unit="s"),
        "run1.F": signal([1, 2, 3]),
        "run2.t": signal(LATER, unit="s"),
        "run2.z": signal([7, 8], unit="mm"),
    }
    clock, force, depth = Column(channel="time"), Column(channel=FORCE), Column(channel=SINKAGE)
    found = read(signals, **{"run1.t": clock, "run1.F": force, "run2.t": clock, "run2.z": depth})
    assert found.samples(FORCE)[0] == pytest.approx(FIRST)
    assert found.samples(SINKAGE)[0] == pytest.approx(LATER)
    assert found.samples(SINKAGE)[1] == pytest.approx([0.007, 0.008])


def test_two_columns_of_time_for_the_same_channels_are_refused() -> None:
    signals = {"t": signal(FIRST, unit="s"), "t2": signal(FIRST + 1, unit="s"), "F": signal([1, 2, 3])}
    clock = Column(channel="time")
    with pytest.raises(InputError, match="two columns mean time, got 't' and 't2'"):
        read(signals, t=clock, t2=clock, F=Column(channel=FORCE))


def test_what_is_no_column_of_numbers_is_named_with_its_reason() -> None:
    signals = {
        "F": signal([1, 2, 3], FIRST, FORCE),
        "state": left_out("text"),
        "note": left_out("text"),
        "x": signal([0, 0, 0], FIRST),
    }
    assert read(signals).notes == (
        "2 of 4 columns left out, text: state, note",
        "1 of 4 columns left out, without a description: x",
    )
    with pytest.raises(InputError, match=r"channels.state: not a column of numbers over time: text; another column"):
        read(signals, state=Column(channel=FORCE))
    with pytest.raises(InputError, match=r"no column is a channel, got state \(text\), x; --profile FILE"):
        read({"state": signals["state"], "x": signals["x"]})

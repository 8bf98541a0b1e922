"""The first page says how high the loads were, and when."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest

from ground.ye import Ye2006
from rollover.dynamics.result import Run
from tests.viz import example
from viz.content.verdict import amount, in_words, joules, ranked, verdict


def test_the_load_that_matters_comes_first(overturn: Run) -> None:
    lines = verdict(overturn, example.peaks(overturn)).splitlines()
    assert lines[0] == "# ROPS force: 63.2 kN at 1.362 s"
    assert "CFC 60: **44.2 kN at 1.370 s**" in lines[2]
    assert "outside the calibrated domain in 2 ways" in lines[2]


def test_table_has_every_peak_in_order(overturn: Run) -> None:
    text = verdict(overturn, example.peaks(overturn))
    assert "| load | raw peak | CFC 60 | collision impulse | change at half step |" in text
    assert "| ROPS force | 63.2 kN at 1.362 s | 44.2 kN at 1.370 s | 5600 N s | 1.2 % |" in text
    rows = [line for line in text.splitlines() if line.startswith("| ")]
    assert [row.split("|")[1].strip() for row in rows[1:7]] == [
        "ROPS force",
        "Ground force",
        "Mount left",
        "ROPS deflection",
        "Deepest sinkage",
        "Wheel rear left",
    ]


def test_domain_flags_are_sentences_with_the_bound(overturn: Run) -> None:
    text = verdict(overturn, example.peaks(overturn))
    lines = text.splitlines()
    assert "- impact more than 10 deg off the ground's normal" in lines  # of all loads that have any
    assert "- momentum of the striking mass above 462 N s" in lines
    first, *others = example.peaks(overturn)
    mixed = (dataclasses.replace(first, domain_flags=("second-hit",)), *others)
    assert "- a second hit on the same rut; virgin soil was tested (Wheel rear left)" in verdict(overturn, mixed)
    domain = Ye2006().domain
    assert in_words("impact-speed", domain) == "impact speed outside 1 to 3.5 m/s"
    assert in_words("contact-area", domain) == "contact area unlike the tested face of 63 cm²"
    assert in_words("never-heard-of", domain) == "never heard of"


def test_ledger_is_judged_against_the_released_energy(overturn: Run) -> None:
    assert "**Energy:** 2.10 J unaccounted for, 0.023 % of the 9.00 kJ released." in verdict(overturn, ())


def test_without_peaks_they_are_read_off_the_channels(overturn: Run) -> None:
    found = {p.channel: p for p in ranked(overturn, ())}
    assert found["rops/force"].raw == example.SPIKE
    assert found["rops/force"].raw_time == 1.362
    assert found["rops/mount/right/force_z"].raw < 0.0  # the sign of the larger side stays
    assert "rear_right" not in " ".join(found)  # carried nothing


def test_a_rops_that_was_not_loaded_is_said(overturn: Run) -> None:
    channels = {**overturn.recording.channels, "rops/force": np.zeros_like(overturn.recording.time)}
    recording = dataclasses.replace(overturn.recording, channels=channels)
    text = verdict(dataclasses.replace(overturn, recording=recording), ())
    assert text.startswith("# ROPS force: none\n")


def test_gaps_do_not_hide_a_peak(drop: Run) -> None:
    force = drop.recording["ground/force_normal"].copy()
    highest = float(force.max())
    force[:5] = np.nan
    recording = dataclasses.replace(drop.recording, channels={"ground/force_normal": force})
    assert ranked(dataclasses.replace(drop, recording=recording), ())[0].raw == highest


def test_a_failed_run_says_so_first() -> None:
    text = verdict(example.overturn(failed=True), ())
    assert text.startswith("# Run failed at 1.500 s\n\n**the time step did not converge at 1.500 s")
    assert "# ROPS force: 63.2 kN at 1.362 s" in text


@pytest.mark.parametrize(
    ("value", "text"), [(63210.123, "63.2 kN"), (-4410.0, "-4.41 kN"), (5600123.0, "5600 kN"), (0.0, "0 kN")]
)
def test_three_figures_and_a_unit(value: float, text: str) -> None:
    assert amount(value, "kN", 1e-3) == text


def test_small_energies_do_not_read_as_zero() -> None:
    assert joules(2.1) == "2.10 J"
    assert joules(-12_345.0) == "-12.3 kJ"

"""A ground law from recorded drops: what `rollover identify` does between reading and writing."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Literal

from ground.identify import LawMass
from ground.law import GroundLaw
from rollover.calibration import ground_law
from rollover.comparison.recordings import Recordings, digest, gathered
from rollover.recording import Recording
from rollover.recording.time_stamps import Zero
from rollover.scenario import Scenario, given
from rollover.spec.document import dump
from rollover.spec.vehicle import Striker
from rollover.system.arguments import LEAST_DEPTH, MOST_DEPTH, MOST_FORCE, one_of, within
from rollover.system.errors import Fault, InputError


@dataclass(frozen=True, kw_only=True)
class Identification:
    """A ground law with what stands behind it.

    `soil` is the text of a soil file, `numbers` what was found (SI) with intervals, `table` its rows as text, `refused`
    a sentence for each drop that was left out, `zeros` where clocks in doubt were set to.
    """

    law: GroundLaw
    soil: str
    numbers: Mapping[str, Any]
    table: tuple[tuple[str, ...], ...]
    remarks: tuple[str, ...]
    refused: tuple[str, ...]
    zeros: Mapping[str, Zero]


def identify(
    recordings: Recordings,
    scenario: str | Path | Scenario = "drop_test",
    *,
    law: Literal["ye-2006", "bearing"] | None = None,
    fraction: float | None = None,
    striker_mass: LawMass = "reference",
    buoyancy: float = 0.0,
    terminal_speed: bool = False,
    keep: bool = False,
    to_depth: float | None = None,
    profile: str | Path | None = None,
) -> Identification:
    """Identify a ground law from recorded drops: stiffness over depth, coefficients with intervals, a soil file.

    Parameters
    ----------
    recordings, profile
        As in `rollover.compare`.
    scenario
        Whose striker fell, unless a recording says otherwise.
    law
        Which law; None: "bearing" for a cone, else "ye-2006".
    fraction
        Share m_b1/m_s of the co-moving mass, 0 to 10; None: the scenario's.
    striker_mass
        Which mass stands in eq (5) of the law, as `ground.striker_mass` of a scenario.
    buoyancy
        Of the striker in what it falls through, N.
    terminal_speed
        Whether it fell at terminal speed, which tells its drag.
    keep
        Whether published values stand for what the drops cannot determine.
    to_depth
        Of a law "ye-2006": down to which depth the drops are of one soil, m, above a harder layer; None: all.

    Returns
    -------
    Identification
        The law, the text of its soil file, numbers with intervals, and which drops were left out.

    Raises
    ------
    InputError
        For wrong input, and where no drop is usable.
    """
    within("fraction", 0.0 if fraction is None else fraction, 0.0, 10.0)
    within("buoyancy", buoyancy, 0.0, MOST_FORCE)
    within("to_depth", 1.0 if to_depth is None else to_depth, LEAST_DEPTH, MOST_DEPTH)
    one_of("law", law, ("ye-2006", "bearing"))
    one_of("striker_mass", striker_mass, ("reference", "effective"))
    return identified(
        gathered(recordings, profile),
        given(scenario)[0],
        form=law,
        fraction=fraction,
        law_mass=striker_mass,
        buoyancy=buoyancy,
        terminal=terminal_speed,
        keep=keep,
        to_depth=to_depth,
    )


def identified(
    recordings: Mapping[str, tuple[Path | None, Recording]],
    scenario: Scenario,
    *,
    form: Literal["ye-2006", "bearing"] | None = None,
    fraction: float | None = None,
    law_mass: LawMass = "reference",
    buoyancy: float = 0.0,
    terminal: bool = False,
    keep: bool = False,
    to_depth: float | None = None,
) -> Identification:
    """Identify a law from drops of a scenario's striker, given as (path, recording) by name.

    `form` None: what fits the striker's nose. `fraction` m_b1/m_s, None: the scenario's co-moving mass. `buoyancy` N.
    `to_depth` m, of rows that are of one soil.
    Raises `InputError`.
    """
    is_cone = isinstance(scenario.vehicle, Striker) and scenario.vehicle.nose == "cone"
    form = form or ("bearing" if is_cone else "ye-2006")
    if to_depth is not None and form != "ye-2006":
        message = f"to_depth: of law ye-2006 alone, got law {form}; without it"
        raise InputError(Fault(message=message))
    known = {name: recording for name, (_, recording) in recordings.items()}
    usable = ground_law.usable(known, scenario)
    drops, unusable = ground_law.drops_of(
        usable.recordings, scenario, buoyancy=buoyancy, terminal=terminal, to_depth=to_depth
    )
    share = scenario.ground.co_moving_mass.share if fraction is None else fraction
    if form == "ye-2006" and not is_cone:  # which that law refuses
        drops, other = ground_law.of_one_soil(drops, share)
        unusable += other
    zeros = {**usable.zeros, **ground_law.zeros_of(drops, known)}
    sources = sorted({recording.source for recording in known.values() if recording.source})
    found = ground_law.identified(
        drops,
        {name: digest(path, recording) for name, (path, recording) in recordings.items()},
        form=form,
        fraction=share,
        law_mass=law_mass,
        keep=keep,
        source="; ".join(sources) or "recorded drops",
    )
    return Identification(
        law=found.law,
        soil=dump(found.law, ground_law.head(found)),
        numbers=found.answer,
        table=found.table,
        remarks=(*(f"{name}: {zero.sentence}" for name, zero in zeros.items()), *found.remarks),
        refused=(*usable.refused, *unusable),
        zeros=zeros,
    )


def json_of(found: Identification) -> dict[str, Any]:
    """What identify.json says."""
    return {
        **found.numbers,
        "clocks": {name: zero.answer for name, zero in found.zeros.items()},
        "refused": list(found.refused),
        "remarks": list(found.remarks),
    }

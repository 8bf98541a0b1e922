"""TDMS of LabVIEW and DIAdem: channels as `group/channel`, with their own units, scales and clocks."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from contextlib import ExitStack
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from rollover.recording import Recording
from rollover.recording.importers import cf, stamps
from rollover.recording.importers.apart import apart
from rollover.recording.importers.columns import is_wanted, no_numbers
from rollover.recording.importers.importer import Importer, check_claim, check_library, library, reading, starts_with
from rollover.recording.importers.sidecar import Described
from rollover.recording.importers.signals import Signal, assemble, left_out
from rollover.recording.importers.tdms_pieces import continued, opened
from rollover.spec.channels import UNITS
from rollover.system.boundary import worded
from rollover.system.errors import Fault, InputError

# what nptdms scales; of any other type it logs a warning and hands over the numbers without a scale
_SCALES: tuple[str, ...] = (
    "Linear",
    "Polynomial",
    "RTD",
    "Strain",
    "Table",
    "Thermistor",
    "Thermocouple",
    "Add",
    "Subtract",
)
_SCALES += ("AdvancedAPI",)
_FROM_1904 = 2_082_844_800  # s from the zero of TDMS stamps to 1970
Properties = Mapping[str, Any]


def _read(path: Path, profile: Described | None) -> Recording:
    check_library("nptdms", "tdms", path)
    return assemble(path, apart(_signals, path, profile, what="TDMS", modules=("nptdms",)), profile)


def _signals(path: Path, profile: Described | None) -> dict[str, Signal]:
    nptdms = library("nptdms", "tdms", path)
    signals: dict[str, Signal] = {}
    with reading(path, "TDMS"), ExitStack() as held:
        file, pieces = opened(nptdms, path)
        held.enter_context(file)
        if file.file_status.incomplete_final_segment:
            message = "cut off, got less than its last segment claims; a whole file is needed"
            raise InputError(Fault(file=str(path), message=message))
        channels = [(group, channel) for group in file.groups() for channel in group.channels()]
        check_claim(path, sum(len(channel) for _, channel in channels), most_per_byte=1.0)
        for group, channel in channels:
            name = f"{channel.group_name}/{channel.name}"
            about = str(channel.properties.get("rollover_channel", channel.name))
            if is_wanted(profile, name, channel=about, shared=channel.name):
                levels = (channel.properties, group.properties, file.properties)
                changed = next((c for p in (channel.path, group.path, "/") if (c := pieces.changed.get(p))), "")
                starts = [(at, int(_nanoseconds(start))) for at, start in pieces.starts.get(channel.path, ())]
                found = Signal(values=np.empty(0), unreadable=changed) if changed else _signal(channel, levels, starts)
                states_scale = profile is not None and bool({name, channel.name} & profile.scaled)
                if not found.left_out and not found.unreadable and not states_scale:
                    found = _beside_scale(found, channel, levels)
                signals[name] = replace(found, channel=about, shared=channel.name)
            else:
                is_text = channel.data_type.__name__ == "String"
                reason = "empty" if len(channel) == 0 else "text" if is_text else ""
                signals[name] = Signal(values=np.empty(0), channel=about, shared=channel.name, left_out=reason)
    return signals


def _beside_scale(found: Signal, channel: Any, levels: Sequence[Properties]) -> Signal:
    """A column beside a property that looks like a scale: whole numbers are counts, others may be scaled already.

    The property is its own, its group's or the file's.
    """
    scales = (cf.stated_scale({k: v for k, v in level.items() if not k.startswith(("NI_", "wf_"))}) for level in levels)
    said = next(
        (f"{one}{whose}" for one, whose in zip(scales, ("", " of its group", " of the file"), strict=True) if one), ""
    )
    is_scaled = any(key.endswith("]_Scale_Type") for key in channel.properties)
    is_clock = found.began is not None and found.time is None
    if not said or is_clock:
        return found
    if np.dtype(channel.dtype).kind in "iu" and not is_scaled:
        return replace(found, unreadable=cf.undefined(said, "TDMS does not define"))
    return replace(found, notes=(*found.notes, cf.not_applied(said)))


def _signal(channel: Any, levels: tuple[Properties, ...], starts: Sequence[tuple[int, int]]) -> Signal:
    if len(channel) == 0:
        return left_out("empty")
    scale, is_scaled = _scale_of(levels)
    if scale:
        return Signal(values=np.empty(0), unreadable=scale)
    try:
        values = channel.read_data(scaled=False) if is_scaled else channel[:]
    except KeyError as e:
        return Signal(values=np.empty(0), unreadable=f"its scale cannot be applied: it lacks {str(e)[:80]}")
    except Exception as e:  # of its scale: a sensor type or a property that the reader misses
        return Signal(values=np.empty(0), unreadable=f"its scale cannot be applied: {worded(e)}")
    if hasattr(values, "seconds"):  # stamps, of which a float would keep 240 ns
        seconds, first = stamps.seconds_from_first(_nanoseconds(values), 1)
        return Signal(values=seconds, unit="s", began=first)
    values = np.asarray(values)
    if reason := no_numbers(values.dtype):
        return left_out(reason)
    properties = levels[0]
    notes = []
    try:
        time = _stamps(properties, values.size)
        if time is not None and time.size > 1 and len(starts) > 1:
            time, note = continued(time, float(time[1] - time[0]), starts)
            notes += [note] * bool(note)
    except (ArithmeticError, AttributeError, TypeError) as e:  # of a property of another type
        return Signal(values=np.empty(0), unreadable=f"its times cannot be worked out: {worded(e)}")
    except ValueError as e:
        return Signal(values=np.empty(0), unreadable=worded(e))
    began: int | None = None if time is None or not starts else starts[0][1]
    is_set = began is not None and began != -_FROM_1904 * stamps.NANO  # LabVIEW writes 1904 where none was set
    unit = str(properties.get("unit_string", "")) or cf.unit_of(properties)
    began = began if is_set else None
    values, gaps = cf.with_gaps(values.astype(np.float64), properties)
    return Signal(values=values, unit=unit, time=time, began=began, notes=(*notes, *gaps))


def _stamps(properties: Properties, count: int) -> NDArray[np.float64] | None:
    """Stamps of a waveform in s from its start; None of a channel that is none. Raises ``ValueError``."""
    step = properties.get("wf_increment")
    if step is None or float(step) == 0.0:
        return None
    unit = str(properties.get("wf_xunit_string", "")).strip() or "s"
    if unit not in UNITS["s"]:
        raise ValueError(f"its waveform runs over {properties.get('wf_xname', 'x')} in {unit!r}, not over time")
    offset = float(properties.get("wf_start_offset") or 0.0)
    return np.asarray((offset + float(step) * np.arange(count)) * UNITS["s"][unit])


def _scale_of(levels: tuple[Properties, ...]) -> tuple[str, bool]:
    """Why the scale of a channel cannot be applied, and whether its numbers are scaled already.

    A channel has its own scale, or that of its group, or that of the file.
    """
    for properties in levels:
        count = properties.get("NI_Number_Of_Scales")
        kinds = {key: str(value) for key, value in properties.items() if key.endswith("]_Scale_Type")}
        if count == 0 or (not kinds and not count):
            continue
        if properties.get("NI_Scaling_Status") == "scaled":
            return "", True
        unknown = sorted({kind for kind in kinds.values() if kind not in _SCALES})
        if unknown:
            return f"its scale is of a type that cannot be applied, got {', '.join(unknown)}", False
        sizes = [value for key, value in properties.items() if key.endswith("_Polynomial_Coefficients_Size")]
        return ("its scale is a polynomial without coefficients" if 0 in sizes else ""), False
    return "", False


def _nanoseconds(moments: Any) -> Any:
    """Whole nanoseconds since 1970 of TDMS stamps, seconds since 1904 and fractions of 2^-64 s."""
    seconds, fractions = moments.seconds, moments.second_fractions
    if isinstance(seconds, np.ndarray):
        rest = np.rint(np.asarray(fractions, dtype=np.float64) * (stamps.NANO / 2.0**64)).astype(np.int64)
        return (np.asarray(seconds, dtype=np.int64) - _FROM_1904) * stamps.NANO + rest
    return (int(seconds) - _FROM_1904) * stamps.NANO + round(int(fractions) * stamps.NANO / 2**64)


TDMS = Importer(name="tdms", meaning="TDMS of LabVIEW and DIAdem", sniff=lambda p: starts_with(p, b"TDSm"), read=_read)

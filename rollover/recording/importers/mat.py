"""MATLAB files up to version 7: `name`, `name[1]` of a matrix, `structure.field`, `structure[2].field` of an array.

What is written is one structure `recording`: `time` and `channels` (columns, SI), `names` and `units` of the channels
under the same fields, `about`, the sidecar's text, by which it is read back without a profile.
"""

from __future__ import annotations

import re
from collections.abc import Iterable, Iterator, Mapping
from pathlib import Path
from typing import Any

import numpy as np

from rollover.recording import Recording
from rollover.recording.importers.apart import apart
from rollover.recording.importers.columns import is_wanted, matrix, no_numbers
from rollover.recording.importers.importer import Importer, reading, starts_with
from rollover.recording.importers.mat_claims import check_claims
from rollover.recording.importers.plain import FORMAT, sidecar_of
from rollover.recording.importers.sidecar import Described, described_inside
from rollover.recording.importers.signals import Signal, assemble, left_out
from rollover.spec.channels import describe
from rollover.system.writing import check_free, put

LONGEST_NAME = 63  # characters of a name in MATLAB
_OWN, _ABOUT = "recording", "about"
_OPAQUE = "function_workspace"  # under this name MATLAB keeps what its tables and objects hold


def write(recording: Recording, path: Path, *, force: bool = False) -> None:
    """Write a recording as one structure, to the last bit. Raises `InputError`."""
    check_free(path, force=force)
    fields = legal_names(recording.channels)
    about = sidecar_of(recording, {"time": "time", **{channel: f"channels.{fields[channel]}" for channel in fields}})
    structure = {
        "title": recording.title,
        "source": recording.source,
        "time": recording.time,
        "channels": {fields[channel]: values for channel, values in recording.channels.items()},
        "names": {field: channel for channel, field in fields.items()},
        "units": {"time": "s", **{field: describe(channel).unit for channel, field in fields.items()}},
        _ABOUT: about,
    }

    def save(at: Path) -> None:
        from scipy.io import savemat

        savemat(at, {_OWN: structure}, appendmat=False, long_field_names=True, do_compression=True, oned_as="column")

    put(path, save)


def legal_names(channels: Iterable[str]) -> dict[str, str]:
    """Each channel with a name that MATLAB allows: letters, digits and _, at most 63, no two the same."""
    found: dict[str, str] = {}
    for channel in channels:
        bare = re.sub(r"[^A-Za-z0-9_]", "_", channel)
        made, n = bare[:LONGEST_NAME], 1
        while made in found.values():
            n += 1
            made = f"{bare[: LONGEST_NAME - 1 - len(str(n))]}_{n}"
        found[channel] = made
    return found


def _read(path: Path, profile: Described | None) -> Recording:
    about, signals = apart(_held, path, profile, what="MATLAB 5", modules=("scipy.io",))
    return assemble(path, signals, described_inside(path, about) if about and profile is None else profile)


def _held(path: Path, profile: Described | None) -> tuple[str, dict[str, Signal]]:
    """The sidecar in a file that was written here, else nothing; and its columns."""
    if profile is None and (own := _own(path)):
        return own
    return "", _signals(path, profile)


def _own(path: Path) -> tuple[str, dict[str, Signal]] | None:
    """What `write` wrote, if that is all there is."""
    from scipy.io import loadmat, whosmat

    with reading(path, "MATLAB 5"):
        check_claims(path)
        if [(name, kind) for name, _, kind in whosmat(str(path))] != [(_OWN, "struct")]:
            return None
        found = loadmat(str(path), squeeze_me=False, struct_as_record=True)[_OWN]
        names = set(found.dtype.names or ())
        if found.size != 1 or not {_ABOUT, "time", "channels"} <= names:
            return None
        one = found.ravel()[0]
        about = "".join(map(str, one[_ABOUT].ravel()))
        channels = one["channels"].ravel()
        if f"format: {FORMAT}" not in about or channels.size != 1 or channels.dtype.names is None:
            return None
        columns = {"time": one["time"], **{f"channels.{n}": channels[0][n] for n in channels.dtype.names}}
        return about, {n: Signal(values=np.asarray(v, dtype=np.float64).ravel()) for n, v in columns.items()}


def _signals(path: Path, profile: Described | None) -> dict[str, Signal]:
    from scipy.io import loadmat, whosmat

    with reading(path, "MATLAB 5"):
        kinds = {}
        check_claims(path)
        for name, _, kind in whosmat(str(path)):
            kinds[str(name)] = kind
        found = loadmat(str(path), mat_dtype=False, squeeze_me=False, struct_as_record=True)
        signals: dict[str, Signal] = {}
        numbers = _numbers(found)
        for name, value in found.items():
            if name in ("__header__", "__version__", "__globals__"):
                continue
            if kinds.get(name) == "logical":  # its numbers are read as 0 and 1
                signals[name] = left_out("true or false")
            elif name.strip("_") == _OPAQUE:
                signals[name] = left_out("contents of MATLAB tables and objects")
            else:
                columns = _columns(name, value)
                signals |= {column: _signal(v, column, profile, numbers.get(column, "")) for column, v in columns}
    return signals


def _numbers(found: Mapping[str, Any]) -> dict[str, str]:
    """Columns of a file that holds one matrix and nothing else are 1, 2, ... too, as in a text file without names.

    A profile then serves files whose matrix bears the name of the test.
    """
    held = [(name, value) for name, value in found.items() if not name.startswith("__")]
    if len(held) != 1 or not isinstance(held[0][1], np.ndarray) or held[0][1].dtype.kind not in "fiu":
        return {}
    columns = matrix(held[0][0], held[0][1].shape)
    return {column: str(k) for k, column in enumerate(columns, 1)} if len(columns) > 1 else {}


def _signal(values: Any, name: str, profile: Described | None, number: str) -> Signal:
    if isinstance(values, str):
        return left_out(values)
    if not is_wanted(profile, name, shared=number):
        return Signal(values=np.empty(0), shared=number)
    column = None if profile is None else profile.columns.get(name) or profile.columns[number]
    is_time = column is not None and column.channel == "time"
    return Signal(values=values.copy() if is_time else values.astype(np.float64), shared=number)


def _columns(name: str, value: Any) -> Iterator[tuple[str, Any]]:
    """Columns of numbers by name, and for all else why it is none."""
    if not isinstance(value, np.ndarray):
        yield name, "a sparse matrix" if hasattr(value, "tocsc") else f"a MATLAB {type(value).__name__}"
    elif type(value).__name__ in ("MatlabOpaque", "MatlabObject", "MatlabFunction"):
        yield name, "a MATLAB table or object" if type(value).__name__ != "MatlabFunction" else "a MATLAB function"
    elif value.dtype.names is not None:
        yield from _of_structs(name, value)
    elif value.dtype.kind == "O":
        yield name, "a MATLAB cell"
    elif reason := no_numbers(value.dtype):
        yield name, reason
    elif value.size < 2:
        yield name, "a single number" if value.size else "empty"
    else:
        columns = matrix(name, value.shape)
        if not columns:
            yield name, f"an array {value.shape}"
        for column, index in columns.items():
            yield column, value[index]


def _of_structs(name: str, value: Any) -> Iterator[tuple[str, Any]]:
    """Fields of a structure, or of an array of them: one column where each element holds a single number."""
    elements = value.ravel()
    if not elements.size:
        yield name, "an empty MATLAB structure"
    for key in value.dtype.names:
        each = [element[key] for element in elements]
        if len(each) > 1 and all(isinstance(v, np.ndarray) and v.dtype.kind in "fiu" and v.size == 1 for v in each):
            yield f"{name}.{key}", np.array([v.ravel()[0] for v in each])
            continue
        for k, inner in enumerate(each):
            yield from _columns(f"{name}[{k}].{key}" if len(each) > 1 else f"{name}.{key}", inner)


MAT = Importer(
    name="mat",
    meaning="MATLAB, version 5 to 7",
    sniff=lambda path: starts_with(path, b"MATLAB 5.0", b"MATLAB 7.0"),
    read=_read,
)

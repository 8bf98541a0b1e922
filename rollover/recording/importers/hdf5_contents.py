"""What an HDF5 file holds, by path: arrays, fields of records, arrays of MATLAB structures; each may be read later."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from rollover.recording.importers import cf
from rollover.recording.importers.arrays import Array
from rollover.recording.importers.columns import Index, no_numbers, text
from rollover.system.budget import Budget

_OBJECT = 500  # bytes of a reference and of what stands for the dataset that it leads to
_MATLAB_INSIDE = {"#refs#": "contents of MATLAB cells and tables", "#subsystem#": "contents of MATLAB objects"}
_MATLAB = {"char": "text", "logical": "true or false", "cell": "a MATLAB cell", "struct": "an empty MATLAB structure"}
_MATLAB_NUMBERS = ("single", "double", *(f"{sign}int{bits}" for sign in ("", "u") for bits in (8, 16, 32, 64)))


def contents(h5py: Any, file: Any, named: Sequence[str]) -> dict[str, Array | str]:
    """All arrays of a file by path, or why one is none. `named` may lead through soft links, which are not walked."""
    found: dict[str, Array | str] = {}
    links: dict[str, str] = {}
    seen: set[int] = set()

    def walk(group: Any, above: str, around: tuple[Mapping[str, Any], ...]) -> None:
        for key in group:
            name, link = f"{above}{key}", group.get(key, getlink=True)
            if not isinstance(link, h5py.HardLink):
                links[name] = f"a link to {link.path}"
                continue
            if key in _MATLAB_INSIDE and not above:
                found[name] = _MATLAB_INSIDE[key]
                continue
            thing = group[key]
            if isinstance(thing, h5py.Dataset):
                found.update(_arrays(h5py, file, name, thing, group, around))
            elif isinstance(thing, h5py.Group):
                address = h5py.h5o.get_info(thing.id).addr
                if address in seen:
                    found[name] = "a group that stands under another name too"
                elif "MATLAB_sparse" in thing.attrs:
                    found[name] = "a sparse matrix"
                else:
                    seen.add(address)
                    walk(thing, f"{name}/", (_attributes(thing), *around))
            else:
                found[name] = "a type of data"

    walk(file, "", (_attributes(file),))
    for name, what in links.items():
        thing = _through_links(h5py, file, name)
        if isinstance(thing, h5py.Dataset):
            found.update(_arrays(h5py, file, name, thing, thing.parent, (_attributes(thing.parent), _attributes(file))))
        else:
            found[name] = what if thing is not None else f"{what}, which is not there"
    for name in named:
        base = name.partition("[")[0].partition(".")[0]
        if name not in found and isinstance(thing := _through_links(h5py, file, base), h5py.Dataset):
            new = _arrays(h5py, file, base, thing, thing.parent, (_attributes(thing.parent), _attributes(file)))
            found |= {n: a for n, a in new.items() if n not in found}
    return found


def _through_links(h5py: Any, file: Any, name: str) -> Any:
    """What a path leads to; None where it leads nowhere. Links out of the file are refused before, by `hdf5_guard`."""
    group, steps = file, [step for step in name.split("/") if step]
    for _ in range(64):  # as many links as a path may pass, so that circles end
        if not steps:
            return group
        try:
            link = group.get(steps[0], getlink=True)
        except (AttributeError, KeyError):  # an array on the way
            return None
        if isinstance(link, h5py.SoftLink):
            group = file if link.path.startswith("/") else group
            steps = [step for step in link.path.split("/") if step not in ("", ".")] + steps[1:]
        elif link is not None:
            group, steps = group[steps[0]], steps[1:]
        else:
            return None
    return None


def _attributes(thing: Any) -> dict[str, Any]:
    found = {}
    for key in thing.attrs:
        try:
            found[key] = thing.attrs[key]
        except (OSError, TypeError, ValueError):  # a type that numpy has no word for says nothing to us either
            continue
    return found


def _arrays(
    h5py: Any, file: Any, name: str, dataset: Any, group: Any, around: tuple[Mapping[str, Any], ...]
) -> dict[str, Array | str]:
    """Columns of a dataset by name: itself, or the fields of its records, or those of MATLAB structures."""
    attributes = _attributes(dataset)
    matlab = text(attributes.get("MATLAB_class", ""))
    if dataset.shape is None or "MATLAB_empty" in attributes:  # there the numbers are the lengths of its axes
        return {name: "empty"}
    if h5py.check_ref_dtype(dataset.dtype) is not None:
        is_struct = not matlab and text(group.attrs.get("MATLAB_class", "")) == "struct"
        return _of_structs(h5py, file, name, dataset) if is_struct else {name: "references, as of a MATLAB cell"}
    if text(attributes.get("NAME", "")).startswith("This is a netCDF dimension but not a netCDF variable"):
        return {name: "a dimension without coordinates"}
    if dataset.dtype.names is not None and set(dataset.dtype.names) != {"real", "imag"}:
        return _of_records(name, dataset, attributes, around)
    if reason := _no_numbers(h5py, dataset, matlab):
        return {name: reason}
    return {name: _array(h5py, dataset, attributes, around)}


def _of_records(
    name: str, dataset: Any, attributes: Mapping[str, Any], around: Sequence[Mapping[str, Any]]
) -> dict[str, Array | str]:
    fields = _fields(dataset.dtype)
    steps = {k: v for k, v in attributes.items() if not cf.stated_scale({k: v})}  # a step of time is that of all fields
    return {
        f"{name}.{key}": Array(
            shape=(*dataset.shape, *kind.shape),
            dtype=kind.base,
            load=_field_of(dataset, way),
            attributes=cf.of_field(attributes, key, at, len(fields)),
            around=(steps, *around),
            part=_part(dataset) * max(1, dataset.dtype.itemsize // 8),
            unclear=cf.of_which_field(attributes, list(fields)),
        )
        for at, (key, (way, kind)) in enumerate(fields.items())
    }


def _no_numbers(h5py: Any, dataset: Any, matlab: str) -> str:
    """Why a dataset is no column of numbers; nothing where it is one."""
    if matlab and matlab not in _MATLAB_NUMBERS:
        return _MATLAB.get(matlab, f"a MATLAB object, {matlab}")
    if h5py.check_string_dtype(dataset.dtype) is not None:
        return "text"
    if dataset.dtype.names is not None:
        return "complex numbers"
    states = h5py.check_enum_dtype(dataset.dtype)
    if states is not None and dataset.dtype.kind != "b":
        return f"names of states: {', '.join(list(states)[:6])}"
    return no_numbers(dataset.dtype) or ("a single number" if dataset.shape == () else "")


def _array(h5py: Any, dataset: Any, attributes: Mapping[str, Any], around: Sequence[Mapping[str, Any]]) -> Array:
    plist = dataset.id.get_create_plist()
    is_stated = plist.fill_value_defined() == h5py.h5d.FILL_VALUE_USER_DEFINED
    coordinates = {axis: dim[0] for axis, dim in enumerate(dataset.dims) if len(dim) and dim[0] != dataset}
    return Array(
        shape=dataset.shape,
        dtype=dataset.dtype,
        load=dataset.__getitem__,
        attributes=attributes,
        around=(attributes, *around),
        scales={axis: _array(h5py, scale, _attributes(scale), ()) for axis, scale in coordinates.items()},
        fill=dataset.fillvalue if is_stated and dataset.fillvalue != 0 else None,  # zeros are measured too
        last_axis_first="MATLAB_class" in attributes,
        part=_part(dataset),
    )


def _part(dataset: Any) -> int:
    """Entries of a chunk, which may be larger than its dataset."""
    return int(np.prod(dataset.chunks, dtype=object)) if dataset.chunks else 0


def _fields(dtype: np.dtype[Any], above: tuple[str, ...] = ()) -> dict[str, tuple[tuple[str, ...], np.dtype[Any]]]:
    """Fields of records by dotted name: the way to each, and its type."""
    found: dict[str, tuple[tuple[str, ...], np.dtype[Any]]] = {}
    for key in dtype.names or ():
        kind = dtype[key]
        if kind.names is not None:
            found |= _fields(kind, (*above, key))
        else:
            found[".".join((*above, key))] = (*above, key), kind
    return found


def _field_of(dataset: Any, way: tuple[str, ...]) -> Callable[[Index], Any]:
    def load(index: Index) -> Any:
        values = dataset.fields(way[0])[()]
        for key in way[1:]:
            values = values[key]
        return values[index]

    return load


def _of_structs(h5py: Any, file: Any, name: str, dataset: Any) -> dict[str, Array | str]:
    """A field of a MATLAB array of structures: a column for each, or one of all where each holds a single number."""
    Budget(Path(file.filename)).claim(_OBJECT * dataset.size, name)
    things = [file[reference] for reference in np.asarray(dataset[()]).ravel()]
    above, _, key = name.rpartition("/")
    if not all(isinstance(t, h5py.Dataset) and not no_numbers(t.dtype) for t in things):
        return {name: "text, cells or structures in an array of structures"}
    if things and all(t.size == 1 for t in things):
        values = np.array([t[()].ravel()[0] for t in things])
        return {name: Array(shape=values.shape, dtype=values.dtype, load=values.__getitem__)}
    found: dict[str, Array | str] = {}
    for k, thing in enumerate(things):
        found |= _arrays(h5py, file, f"{above}[{k}]/{key}", thing, thing.parent, ())
    return found

"""Rows of numbers from a file, each row at its line there: .csv with commas, or .npy."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

import numpy as np

from rollover.spec.document.tree import Node, Place, planted, shown
from rollover.system.boundary import worded
from rollover.system.errors import InputError

MOST_NODES = 500_000
ESRI = ("ncols", "nrows", "xllcorner", "xllcenter", "yllcorner", "yllcenter", "cellsize", "nodata_value")


def read(file: Path, node: Node, path: str) -> Node:
    """The grid in a file that `node` names at `path`, each row at its line. Raises `InputError`."""
    name = shown(file)
    if file.suffix == ".npy":
        try:
            found = np.load(file, mmap_mode="r", allow_pickle=False)  # its header alone
            if found.ndim != 2 or found.size > MOST_NODES:
                what = f"{name} is no grid of numbers, got shape {found.shape}"
                raise node.place.fault(path, f"{what}; two dimensions and at most {MOST_NODES} numbers are allowed")
            grid = np.array(found, dtype=float)
        except InputError:
            raise
        except AttributeError:
            raise node.place.fault(path, f"{name} is no grid of numbers, got several arrays; one .npy array") from None
        except (OSError, ValueError, TypeError, EOFError) as e:
            what = f"{name} is no grid of numbers: {worded(e)}; rows of numbers are needed"
            raise node.place.fault(path, what) from None
        rows: list[tuple[int | None, list[float]]] = [(None, row) for row in grid.tolist()]
    else:
        rows = list(_rows(file, node, path))
    for i, (line, row) in enumerate(rows, 1):
        for j, value in enumerate(row, 1):
            if not np.isfinite(value):
                raise _no_height(Place(file=name, line=line, folder=file.parent), path, i, j, f"got {value!r}")
    if _is_list_of_points([row for _, row in rows]):
        what = f"{name} is a list of points x, y, z, got {len(rows)} rows of three"
        cure = "a row of heights for each x, a height for each y, and their distances in spacing"
        raise node.place.fault(path, f"{what}; {cure}")
    places = [Place(file=name, line=line, folder=file.parent) for line, _ in rows]
    nodes = tuple(planted(row, place) for (_, row), place in zip(rows, places, strict=True))
    return replace(node, value=nodes)


def _is_list_of_points(rows: list[list[float]]) -> bool:
    """Whether rows of three are the nodes of a grid one by one: each of several x once with each of several y."""
    if len(rows) < 4 or {len(row) for row in rows} != {3}:
        return False
    xs, ys = {row[0] for row in rows}, {row[1] for row in rows}
    pairs = {(row[0], row[1]) for row in rows}
    return min(len(xs), len(ys)) > 1 and len(pairs) == len(rows) == len(xs) * len(ys)


def _rows(file: Path, node: Node, path: str) -> Iterator[tuple[int | None, list[float]]]:
    """Line and numbers of each row; blank lines and what follows a # do not count. Raises `InputError`."""
    name, width, count, i = shown(file), 0, 0, 0
    try:
        with file.open(encoding="utf-8-sig") as lines:
            for line, text in enumerate(lines, 1):
                cells = [cell.strip() for cell in text.partition("#")[0].strip().split(",")]
                if cells == [""]:
                    continue
                i += 1
                width = width or len(cells)
                place = Place(file=name, line=line, folder=file.parent)
                row = [_number(cell, (i, j), place, node, path) for j, cell in enumerate(cells, 1)]
                if len(row) != width:
                    what = f"{name} is no grid of numbers: line {line} has {len(row)} columns, the first row {width}"
                    raise node.place.fault(path, f"{what}; as many in each")
                count += width
                if count > MOST_NODES:
                    raise node.place.fault(path, f"{name} is too large; at most {MOST_NODES} numbers are allowed")
                yield line, row
    except (OSError, UnicodeDecodeError) as e:
        what = getattr(e, "strerror", None) or "not UTF-8 text"
        raise node.place.fault(path, f"{name} is no grid of numbers: {what}") from None


def _number(cell: str, at: tuple[int, int], place: Place, node: Node, path: str) -> float:
    try:
        return float(cell)
    except ValueError:
        pass
    if not cell:
        raise _no_height(place, path, *at, "got an empty cell")
    where = f"{place.file}:{place.line}, row {at[0]}, column {at[1]}"
    if cell.split()[0].lower() in ESRI:
        what = f"{where}: the header of an ESRI ASCII grid, got {cell!r}"
        cure = "rows of numbers with commas between them are read, its cell size belongs into spacing"
        raise node.place.fault(path, f"{what}, no grid of numbers; {cure}")
    what = f"{where} is no number, got {cell[:40]!r}, so this is no grid of numbers"
    raise node.place.fault(path, f"{what}; numbers with commas between them are needed")


def _no_height(place: Place, path: str, i: int, j: int, what: str) -> InputError:
    cure = "a number is needed at each node: fill it in from those beside it, or cut the map down to where it has some"
    return place.fault(f"{path}.{i - 1}.{j - 1}", f"no height at row {i}, column {j}, {what}; {cure}")

"""Checks of a written recording that need no window: is it whole, and does it hold what its layout asks for."""

from __future__ import annotations

import re
import warnings
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import rerun as rr
from numpy.typing import NDArray
from rerun.chunk import RrdReader

from viz.content.entities import TIMELINE


def read_entities(path: Path) -> dict[str, set[str]]:
    """Entities of a recording (with a leading slash) and the components that each holds."""
    return _entities(_chunks(path))


def _chunks(path: Path) -> list[tuple[str, Any, Any]]:
    """Entity, chunk and its table of everything but the recording's properties."""
    chunks = RrdReader(path).stream().drop(content="/__properties/**").to_chunks()
    return [(str(c.entity_path), c, c.to_record_batch()) for c in chunks if str(c.entity_path) != "/__properties"]


def _entities(chunks: list[tuple[str, Any, Any]]) -> dict[str, set[str]]:
    found: dict[str, set[str]] = {}
    for entity, _, batch in chunks:
        found.setdefault(entity, set()).update(n for n in batch.schema.names if ":" in n)
    return found


def read_column(path: Path, entity: str, component: str) -> tuple[NDArray[np.int64], list[Any]]:
    """Times (ns) in order and what stands there, one list for each row; static rows come without time."""
    rows: list[tuple[int, Any]] = []
    static: list[Any] = []
    for chunk in RrdReader(path).stream().filter(content=entity, components=component).to_chunks():
        batch = chunk.to_record_batch()
        if component not in batch.schema.names:
            continue
        values = batch[component].to_pylist()
        if chunk.is_static:
            static += values
            continue
        rows += zip(batch[TIMELINE].cast("int64").to_pylist(), values, strict=True)
    rows.sort(key=lambda row: row[0])
    return np.array([t for t, _ in rows], dtype=np.int64), static + [v for _, v in rows]


def blueprint_queries(path: Path) -> Iterator[tuple[str, str]]:
    """Name of each view of the layout and each entity expression it includes, origin filled in."""
    reader = RrdReader(path)
    names: dict[str, str] = {}
    origins: dict[str, str] = {}
    queries: dict[str, list[str]] = {}
    for store in reader.blueprints():
        for chunk in reader.stream(store=store).to_chunks():
            view = re.match(r"/view/[^/]+", str(chunk.entity_path))
            if view is None:
                continue
            batch = chunk.to_record_batch()
            for component, into in (("display_name", names), ("space_origin", origins)):
                if f"ViewBlueprint:{component}" in batch.schema.names:
                    into[view[0]] = batch[f"ViewBlueprint:{component}"].to_pylist()[-1][0]
            if "ViewContents:query" in batch.schema.names:
                queries[view[0]] = batch["ViewContents:query"].to_pylist()[-1]
    for view_id, expressions in queries.items():
        for expression in expressions:
            if not expression.startswith("-"):
                rule = expression.removeprefix("+").strip().replace("$origin", origins.get(view_id, "/"))
                yield names.get(view_id, view_id), rule


def check_rrd(path: Path) -> list[str]:
    """What is wrong with a recording, one sentence each; empty if it is as it should be."""
    try:
        with warnings.catch_warnings(action="ignore"):  # that a footer is missing is said below
            RrdReader(path).store()
        chunks = _chunks(path)
    except Exception as e:
        # the reader raises whatever its decoder does; the sentence is what matters here
        return [f"{path.name}: cannot be read as a whole recording: {e}"]
    return [*_layout(path, _entities(chunks)), *_times(chunks), *_aggregation(chunks), *_overridden(path)]


def _layout(path: Path, entities: dict[str, set[str]]) -> Iterator[str]:
    queries = list(blueprint_queries(path))
    if not queries:
        yield f"{path.name}: no layout in it"
    for view, rule in queries:
        root, wild, _ = rule.partition("/**")
        if not any(e == root or (wild and e.startswith(root + "/")) for e in entities):
            yield f"{path.name}: view {view!r} asks for {rule}, which nothing was logged to"


def _times(chunks: list[tuple[str, Any, Any]]) -> Iterator[str]:
    for entity, chunk, batch in chunks:
        if chunk.is_static:
            continue
        if list(chunk.timeline_names) != [TIMELINE]:
            yield f"{entity}: time lines {list(chunk.timeline_names)}, not {TIMELINE} alone"
            continue
        column = batch[TIMELINE]
        if str(column.type) != "duration[ns]":
            yield f"{entity}: time is {column.type}, not a duration in ns"
        elif column.null_count or np.any(np.diff(column.cast("int64").to_numpy()) < 0):
            yield f"{entity}: time has gaps or runs backwards"


def _aggregation(chunks: list[tuple[str, Any, Any]]) -> Iterator[str]:
    component, most = "SeriesLines:aggregation_policy", [rr.components.AggregationPolicy.MinMax.value]
    safe = {e for e, _, b in chunks if component in b.schema.names and b[component].to_pylist() == [most]}
    for entity, components in _entities(chunks).items():
        if "Scalars:scalars" in components and "SeriesPoints:markers" not in components and entity not in safe:
            yield f"{entity}: drawn without MinMax, a short peak would be drawn lower than it was"


def _overridden(path: Path) -> Iterator[str]:
    """A view of the layout may say how it draws a series, whatever the series itself says."""
    component, most = "SeriesLines:aggregation_policy", [rr.components.AggregationPolicy.MinMax.value]
    reader = RrdReader(path)
    for store in reader.blueprints():
        for chunk in reader.stream(store=store).to_chunks():
            batch = chunk.to_record_batch()
            if component in batch.schema.names and any(v != most for v in batch[component].to_pylist() if v):
                yield f"{path.name}: the layout draws {chunk.entity_path} without MinMax"

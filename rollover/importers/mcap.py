"""MCAP with JSON messages, and ROS bags: every number of a message as `topic.field`, at its logged time."""

from __future__ import annotations

import json
from collections.abc import Callable, Iterator
from dataclasses import fields, is_dataclass
from pathlib import Path
from typing import Any

import numpy as np

from rollover.faults import Fault, InputError
from rollover.importers.importer import MOST_VALUES, Importer, library, reading, starts_with
from rollover.importers.sidecar import Described
from rollover.importers.signals import Signal, assemble
from rollover.recording import Recording

Wanted = Callable[[str], bool]


def _sniff(path: Path) -> bool:
    if path.is_dir():
        return (path / "metadata.yaml").is_file()
    return starts_with(path, b"\x89MCAP0\r\n", b"#ROSBAG V2")


def _read(path: Path, profile: Described | None) -> Recording:
    stamps: dict[str, list[int]] = {}
    values: dict[str, list[float]] = {}
    count = 0
    with reading(path, "MCAP or ROS bag"):
        for stamp, topic, message in _json(path) if starts_with(path, b"\x89MCAP0\r\n") else _ros(path):
            for name, value in _numbers(topic, message):
                if profile is not None and name not in profile.columns:
                    values.setdefault(name, [])
                    continue
                stamps.setdefault(name, []).append(stamp)
                values.setdefault(name, []).append(value)
                count += 1
                if count > MOST_VALUES // 20:  # lists of Python numbers take far more room than an array
                    message = f"too long, got more than {count - 1} values; name the columns with --profile"
                    raise InputError(Fault(file=str(path), message=message))
    zero = min((times[0] for times in stamps.values()), default=0)
    signals = {
        name: Signal(
            values=np.array(column, dtype=np.float64),
            time=np.asarray((np.array(stamps.get(name, []), dtype=np.int64) - zero) * 1e-9, dtype=np.float64),
        )
        for name, column in values.items()
    }
    return assemble(path, signals, profile)


def _json(path: Path) -> Iterator[tuple[int, str, Any]]:
    reader = library("mcap.reader", "mcap", path)
    with path.open("rb") as file:
        for _, channel, message in reader.make_reader(file).iter_messages():
            if channel.message_encoding != "json":
                what = f"topic {channel.topic}: messages in {channel.message_encoding}, json is read from a single file"
                raise InputError(Fault(file=str(path), message=f"{what}; ROS messages from the bag's folder"))
            yield message.log_time, channel.topic, json.loads(message.data)


def _ros(path: Path) -> Iterator[tuple[int, str, Any]]:
    rosbags = library("rosbags.highlevel", "mcap", path)
    with rosbags.AnyReader([path]) as reader:
        for connection, stamp, raw in reader.messages():
            yield stamp, connection.topic, reader.deserialize(raw, connection.msgtype)


def _numbers(name: str, message: Any) -> Iterator[tuple[str, float]]:
    if isinstance(message, (bool, str)):
        return
    if isinstance(message, (int, float)):
        yield name, float(message)
    elif isinstance(message, dict):
        for key, value in message.items():
            yield from _numbers(f"{name}.{key}", value)
    elif is_dataclass(message):
        for field in fields(message):
            if field.name not in ("header", "__msgtype__"):
                yield from _numbers(f"{name}.{field.name}", getattr(message, field.name))


MCAP = Importer(name="mcap", meaning="MCAP with JSON messages, ROS 1 and 2 bags", sniff=_sniff, read=_read)

"""MCAP with JSON messages, and ROS bags: every number of a message as `topic.field`, at its logged time or its own."""

from __future__ import annotations

import json
from collections.abc import Iterator
from pathlib import Path
from typing import Any, BinaryIO

from rollover.recording import Recording
from rollover.recording.importers.apart import apart
from rollover.recording.importers.importer import Importer, check_library, library, reading, starts_with
from rollover.recording.importers.messages import Messages
from rollover.recording.importers.sidecar import Described
from rollover.recording.importers.signals import Signal, assemble, left_out
from rollover.system.budget import Budget
from rollover.system.errors import Fault, InputError

_CHUNK, _CHUNK_INDEX = 0x06, 0x08  # kinds of records
_MCAP = b"\x89MCAP0\r\n"


def _sniff(path: Path) -> bool:
    if path.is_dir():
        return (path / "metadata.yaml").is_file()
    return starts_with(path, _MCAP, b"#ROSBAG V2")


def _read(path: Path, profile: Described | None) -> Recording:
    module = "mcap.reader" if starts_with(path, _MCAP) else "rosbags.highlevel"
    check_library(module, "mcap", path)
    signals, others = apart(_signals, path, profile, what="MCAP or ROS bag", modules=(module,))
    for topic, encoding in others.items():
        if profile is None or any(name.startswith(f"{topic}.") for name in profile.columns):
            what = f"topic {topic}: messages in {encoding}, json is read from a single file"
            raise InputError(Fault(file=str(path), message=f"{what}; ROS messages from the bag's folder"))
        signals[topic] = left_out(f"messages in {encoding}")
    return assemble(path, signals, profile)


def _signals(path: Path, profile: Described | None) -> tuple[dict[str, Signal], dict[str, str]]:
    """Columns of the messages that are read; how those of other topics are written."""
    messages = Messages(path, profile)
    others: dict[str, str] = {}  # topic -> how its messages are written, which is not read
    with reading(path, "MCAP or ROS bag"):
        for logged, topic, source, message in _json(path, others) if starts_with(path, _MCAP) else _ros(path):
            messages.add(topic, logged, message, source)
    return messages.signals(), others


def _json(path: Path, others: dict[str, str]) -> Iterator[tuple[int, str, int, Any]]:
    reader = library("mcap.reader", "mcap", path)
    with path.open("rb") as file:
        claimed = Budget(path)
        for size in _unpacked(file):
            claimed.claim(size)
        file.seek(0)
        for _, channel, message in reader.make_reader(file).iter_messages():
            if channel.message_encoding != "json":
                others[channel.topic] = channel.message_encoding
                continue
            yield message.log_time, channel.topic, channel.id, json.loads(message.data)


def _unpacked(file: BinaryIO) -> Iterator[int]:
    """Bytes that each chunk of an MCAP file says it unpacks to: where it stands, and where the index names it again.

    A record is its kind, its length and its contents; of a chunk these begin with two times and the size, of an entry
    of the index with two times, its place, its length and the places of its channels, and end with the size.
    """
    file.seek(len(_MCAP))
    while len(head := file.read(9)) == 9:
        kind, length = head[0], int.from_bytes(head[1:], "little")
        if kind == _CHUNK:
            part = file.read(min(length, 24))
            yield int.from_bytes(part[16:24], "little")
            length -= len(part)
        elif kind == _CHUNK_INDEX and length >= 8:
            file.seek(length - 8, 1)
            yield int.from_bytes(file.read(8), "little")
            length = 0
        file.seek(length, 1)


def _ros(path: Path) -> Iterator[tuple[int, str, int, Any]]:
    rosbags = library("rosbags.highlevel", "mcap", path)
    with rosbags.AnyReader([path]) as reader:
        for connection, stamp, raw in reader.messages():
            yield stamp, connection.topic, connection.id, reader.deserialize(raw, connection.msgtype)


MCAP = Importer(name="mcap", meaning="MCAP with JSON messages, ROS 1 and 2 bags", sniff=_sniff, read=_read)

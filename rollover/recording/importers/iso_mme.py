"""ISO-MME (ISO/TS 13499): a test as a folder, zip or tar of text files; read and written.

NAME.mme about the test, Channel/NAME.chn the list of channels, Channel/NAME.001 ... one channel each: lines
`Name :value`, then one value a line. Values along and about y and z are in SAE J211 polarity there.
"""

from __future__ import annotations

import re
import zipfile
from collections import Counter
from collections.abc import Mapping
from dataclasses import dataclass, replace
from pathlib import Path, PurePosixPath
from typing import NoReturn

import numpy as np
from numpy.typing import NDArray

from rollover.recording import Recording
from rollover.recording.importers import cf
from rollover.recording.importers import mme_codes as codes
from rollover.recording.importers.data_status import judged
from rollover.recording.importers.importer import Importer
from rollover.recording.importers.mme_archive import content, names_in
from rollover.recording.importers.mme_listing import promised, unlisted
from rollover.recording.importers.mme_time import INTERVAL, contradiction, even_stamps, most_step
from rollover.recording.importers.polarity import sign
from rollover.recording.importers.sidecar import Described
from rollover.recording.importers.signals import Signal, assemble, left_out
from rollover.recording.importers.soundness import check_recording
from rollover.spec.channels import describe, factor, is_known
from rollover.system.errors import Fault, InputError, seen
from rollover.system.writing import check_free, put, whole

NOVALUE = "NOVALUE"
_HEADER = re.compile(r"([^:]*?)\s*:(.*)")
_CHANNEL_FILE = re.compile(r"(.*)\.\d{3,}$")
_NUMBER = re.compile(r"\s*[-+]?(\d|\.\d|nan|inf|novalue)", re.IGNORECASE)


@dataclass(frozen=True, kw_only=True)
class _Channel:
    """A channel file: its head and the lines of that, its values, and what is wrong with it, if anything."""

    file: str
    head: Mapping[str, str]
    values: NDArray[np.float64]
    lines: Mapping[str, int]
    wrong: str = ""

    @property
    def code(self) -> str:
        return self.head.get("channel code", "").strip()

    @property
    def known(self) -> str:
        """Channel that it is, by its name or its code; or nothing."""
        name = _value(self.head, "name of the channel")
        return name if is_known(name) else codes.channel_of(self.code) or ""


def _sniff(path: Path) -> bool:
    if path.is_dir():
        return any(p.suffix.lower() == ".mme" and p.is_file() for p in path.iterdir())
    return path.suffix.lower() in (".mme", ".zip", ".tar", ".tgz", ".gz", ".bz2", ".xz") and path.is_file()


def tests(path: Path) -> list[str]:
    """Names of the tests in a folder or archive. Raises `InputError`."""
    return list(_tests(path)) if path.suffix.lower() != ".mme" or path.is_dir() else [path.stem]


def read_test(path: Path, profile: Described | None, name: str) -> Recording:
    """One of several tests by its name. Raises `InputError`."""
    return _recording(path, path / name, _tests(path)[name], profile)


def _read(path: Path, profile: Described | None) -> Recording:
    if path.suffix.lower() == ".mme" and path.is_file():
        return _recording(path.parent, path, path.name, profile)
    return _recording(path, path, next(iter(_tests(path).values())), profile)


def _tests(place: Path) -> dict[str, str]:
    """Files that describe a test, by its name; tests of one name get that of their folder."""
    found = sorted((n for n in names_in(place) if n.lower().endswith(".mme")), key=lambda n: (n.count("/"), n))
    if not found:
        _refuse(place, "no ISO-MME test, got no .mme file inside")
    stems = [PurePosixPath(n).stem for n in found]
    return {
        stem if stems.count(stem) == 1 else str(PurePosixPath(n).with_suffix("")).replace("/", "-"): n
        for n, stem in zip(found, stems, strict=True)
    }


def _recording(place: Path, path: Path, chosen: str, profile: Described | None) -> Recording:
    """Recording of the test that the file `chosen` in `place` describes; `path` is its name in messages."""
    test = _header(place, chosen, content(place, chosen))[0]
    files = _beside(place, chosen)
    names = sorted(n for n in files if _CHANNEL_FILE.match(n))
    if not names:
        _refuse(path, f"no channels, got no Channel/*.001 beside {chosen}")
    channels = [_channel(place, name) for name in names]
    _check_clocks(place, channels)
    signals = _signals(place, channels, profile)
    title = _value(test, "title") or _value(test, "type of the test") or PurePosixPath(chosen).stem
    laboratory = _value(test, "laboratory name")
    found = assemble(path, signals, profile)
    title = found.title if profile and profile.about.title else title
    source = found.source or laboratory
    listing = next((n for n in sorted(files) if n.lower().endswith(".chn")), "")
    head = _header(place, listing, content(place, listing))[0] if listing else {}
    held = [(channel.file, channel.code) for channel in channels]
    notes = (*found.notes, *promised(PurePosixPath(listing or chosen).name, {**test, **head}, held))
    notes += tuple(unlisted(names_in(place))) if place.is_file() else ()
    flipped = {name: sign(name) * values for name, values in found.channels.items() if sign(name) < 0.0}
    return replace(found, title=title, source=source, channels={**found.channels, **flipped}, notes=notes)


def _beside(place: Path, chosen: str) -> list[str]:
    """Files of a test in the folder Channel beside it; of several tests that share it, those of its name."""
    above = PurePosixPath(chosen).parent
    names = names_in(place)
    files = [n for n in names if PurePosixPath(n).parent.parent == above]
    files = [n for n in files if PurePosixPath(n).parent.name.lower() == "channel"]
    if sum(n.lower().endswith(".mme") and PurePosixPath(n).parent == above for n in names) > 1:
        stem = PurePosixPath(chosen).stem.lower()
        files = [n for n in files if PurePosixPath(n).stem.lower() == stem]
    return files


def _signals(place: Path, channels: list[_Channel], profile: Described | None) -> dict[str, Signal]:
    """Channels by their codes, with their files where a code stands twice.

    A channel that cannot be read is left out, unless it is one of ours, the profile names it, or no other is left.
    """
    count = Counter(channel.code for channel in channels)
    signals: dict[str, Signal] = {}
    wrong: list[str] = []
    clocks = {_reference(channel) for channel in channels} - {""}
    for channel in channels:
        name = f"{channel.code} ({channel.file})" if count[channel.code] > 1 else channel.code or channel.file
        try:
            signal = _signal(place, channel, channels)
        except InputError as e:
            if channel.known if profile is None else name in profile.columns:
                raise
            wrong.append(e.faults[0].message)
            signal = left_out(wrong[-1])
        is_clock = {channel.code, channel.head.get("name of the channel", "")} & clocks and not signal.left_out
        if not is_clock or (profile and name in profile.columns):
            signals[name] = signal
    if profile is None and wrong and not any(signal.channel for signal in signals.values()):
        _refuse(place, wrong[0])
    return signals


def write(recording: Recording, path: Path, *, force: bool = False) -> None:
    """Write a recording as an ISO-MME test: a folder, or one file where `path` ends in .zip. Raises `InputError`.

    The whole test stands there at the end or nothing; numbers keep every bit. What could not be read back is refused:
    the channels of instruments, whose place a test has no word for, among it. The name of our channel goes into
    `Name of the channel`, so that reading the test gives the same channels again.
    """
    check_free(path, force=force)
    check_recording(path, recording)
    if placed := [n for n in recording.channels if n.startswith("sensor/")]:
        what = f"no place in an ISO-MME test for where an instrument sits, got {', '.join(placed)}"
        _refuse(path, f"{what}; csv or parquet has one, or leave such channels out")
    name = path.name.removesuffix(".zip").removesuffix(".mme")
    if path.suffix == ".zip":
        put(path, lambda at: _packed(_files(recording, name), at))
        return
    with whole(path) as folder:
        (folder / "Channel").mkdir()
        for file, text in _files(recording, name).items():
            (folder / file).write_text(text, encoding="utf-8")


def _packed(files: Mapping[str, str], path: Path) -> None:
    with zipfile.ZipFile(path, "w", zipfile.ZIP_DEFLATED) as archive:
        for file, text in sorted(files.items()):
            archive.writestr(file, text)


def _files(recording: Recording, name: str) -> dict[str, str]:
    time = recording.time
    step = (time[-1] - time[0]) / (time.size - 1) if time.size > 1 else 1.0
    even = bool(np.all(np.abs(time - (time[0] + step * np.arange(time.size))) < 1e-12))
    regular = even and step <= min(most_step(cfc) for cfc in (None, *recording.cfc.values()))
    table = {n: sign(n) * values for n, values in recording.channels.items()}
    if not regular:
        table = {"time": time, **table}
    entries = {n: codes.code_of(n, recording.cfc.get(n, 0)) for n in table}
    files = {f"{name}.mme": _text({"Data format edition number": "1.6", **_test(recording)})}
    listing = {"Instrumentation standard": "SAE J211", "Number of channels": str(len(table))}
    for i, (channel, values) in enumerate(table.items(), start=1):
        listing[f"Name of channel {i:03d}"] = f"{entries[channel]} / {channel}"
        head = {
            "Test object number": "1",
            "Name of the channel": channel,
            "Channel code": entries[channel],
            "Unit": describe(channel).unit,
            "Channel frequency class": str(recording.cfc.get(channel, NOVALUE)),
            "Reference channel": "implicit" if regular else "explicit",
            "Reference channel name": NOVALUE if regular else entries["time"],
            "Sampling interval": repr(float(step)) if regular else NOVALUE,
            "Time of first sample": repr(float(time[0])),
            "Number of samples": str(values.size),
        }
        numbers = "\n".join(NOVALUE if v != v else repr(v) for v in values.tolist())
        files[f"Channel/{name}.{i:03d}"] = f"{_text(head)}{numbers}\n"
    return {**files, f"Channel/{name}.chn": _text(listing)}


def _test(recording: Recording) -> dict[str, str]:
    return {
        "Laboratory name": seen(" ".join(recording.source.split())) or NOVALUE,
        "Title": seen(" ".join(recording.title.split())) or NOVALUE,
        "Type of the test": "rollover",
        "Name of test object 1": "vehicle",
    }


def _text(head: Mapping[str, str]) -> str:
    return "".join(f"{key:<28}:{value}\n" for key, value in head.items())


def _header(place: Path, name: str, data: bytes) -> tuple[dict[str, str], list[str], int, dict[str, int]]:
    """Head of a file, its other lines, the number of the first of them, and those of the head."""
    try:
        text = data.decode("utf-8-sig")
    except UnicodeDecodeError:
        text = data.decode("iso-8859-1")
    if "\0" in text:
        _refuse(place, f"{name}: not a text file, got a NUL byte")
    lines = text.splitlines()
    head: dict[str, str] = {}
    at: dict[str, int] = {}
    for i, line in enumerate(lines):
        match = _HEADER.fullmatch(line)
        if match is None and (_NUMBER.match(line) or line.strip().lower() == "start of data"):
            return head, lines[i:], i + 1, at
        if match and (key := match[1].strip().lower()) not in head:
            head[key], at[key] = match[2].strip(), i + 1
    return head, [], len(lines), at


def _channel(place: Path, name: str) -> _Channel:
    head, lines, first, at = _header(place, name, content(place, name))
    wrong, values = "", np.empty(0)
    try:
        values = _numbers(place, name, head, lines, first)
        code = head.get("channel code", "").strip()
        if not re.fullmatch(r"[A-Za-z0-9?]{16}", code):
            _refuse(place, f"{name}: Channel code: got {code!r}; 16 letters and digits are needed")
    except InputError as e:
        wrong = e.faults[0].message
    return _Channel(file=PurePosixPath(name).name, head=head, values=values, lines=at, wrong=wrong)


def _numbers(place: Path, name: str, head: Mapping[str, str], lines: list[str], first: int) -> NDArray[np.float64]:
    """Values of a channel file, gaps NaN, (n,). Raises `InputError`."""
    if lines and lines[0].strip().lower() == "start of data":
        lines, first = lines[1:], first + 1
    words = [line.strip() for line in lines]
    while words and not words[-1]:
        words.pop()
    try:
        values = np.array(["nan" if w.upper() == NOVALUE else w for w in words], dtype=np.float64)
    except ValueError:
        row = next(i for i, w in enumerate(words) if not _is_number(w))
        _refuse(place, f"{name}: line {first + row}: not a number, got {words[row][:40]!r}; one number a line")
    claimed = _value(head, "number of samples")
    if claimed and (not claimed.isdigit() or int(claimed) != values.size):
        _refuse(place, f"{name}: Number of samples: says {claimed[:20]}, got {values.size}; a whole file is needed")
    if not values.size:
        _refuse(place, f"{name}: empty, got no samples")
    return values


def _signal(place: Path, channel: _Channel, channels: list[_Channel]) -> Signal:
    """Samples of a channel on their own clock. Raises `InputError`."""
    if channel.wrong:
        _refuse(place, channel.wrong)
    dimension = codes.dimension_of(channel.code)
    unit = _value(channel.head, "unit") or codes.DEFAULT_UNITS.get(dimension, "")
    if np.isnan(channel.values).all():
        return left_out("no value in it")
    if dimension == "TI" or channel.known == "time":
        return Signal(values=channel.values, unit=unit)
    time = _time(place, channel, channels)
    cfc, note = _cfc(channel)
    lost, status = judged(_value(channel.head, "data status"))
    scale = cf.stated_scale({key.replace(" ", "_"): value for key, value in channel.head.items()})
    notes = (*note, *status, *([cf.not_applied(scale)] if scale else []))
    return Signal(
        values=channel.values, unit=unit, time=time, cfc=cfc, channel=channel.known, notes=notes, unreadable=lost
    )


def _cfc(channel: _Channel) -> tuple[int | None, tuple[str, ...]]:
    """Filter class by the last letter of the code, else by the head; none where they differ, which is noted."""
    by_code, stated = codes.cfc_of(channel.code), _value(channel.head, "channel frequency class")
    by_head = int(stated) if stated.isdigit() and int(stated) in codes.FILTERS.values() else None
    if by_code is not None and by_head is not None and by_code != by_head:
        note = f"its code says CFC {by_code}, its head CFC {by_head}: neither is taken, `cfc` in a profile says which"
        return None, (note,)
    return by_code if by_code is not None else by_head, ()


def _check_clocks(place: Path, channels: list[_Channel]) -> None:
    """Refuse two channels of as many samples of which one has ms or us for s. Raises `InputError`."""
    apart = contradiction((channel.file, channel.head, channel.values.size) for channel in channels)
    if apart is None:
        return
    short, long = (next(c for c in channels if c.file == file) for file in apart)
    steps = [f"{c.head[INTERVAL]} in {c.file}, line {c.lines[INTERVAL]}" for c in (long, short)]
    what = f"got {steps[0]} and {steps[1]}, for {long.values.size} samples each: ms or us for s in one of them"
    _refuse(place, f"{long.file}: Sampling interval: {what}; seconds in both")


def _time(place: Path, channel: _Channel, channels: list[_Channel]) -> NDArray[np.float64]:
    head = channel.head
    if _is_explicit(channel):
        wanted = _reference(channel)
        for other in channels:
            if wanted and wanted.lower() in (other.code.lower(), other.head.get("name of the channel", "").lower()):
                if other.wrong:
                    _refuse(place, other.wrong)
                if other.values.size != channel.values.size:
                    what = f"got {channel.values.size} values for {other.values.size} time stamps in {other.file}"
                    _refuse(place, f"{channel.file}: {what}; one each")
                try:
                    return other.values * factor(_value(other.head, "unit") or "s", "time")
                except ValueError as e:
                    _refuse(place, f"{other.file}: Unit: {e}")
        _refuse(place, f"{channel.file}: Reference channel name: no such channel, got {wanted!r}; the code of another")
    try:
        return even_stamps(head, _cfc(channel)[0], channel.values.size)
    except ValueError as e:
        at = channel.lines.get(INTERVAL)
        _refuse(place, f"{channel.file}: {f'line {at}: ' if at else ''}Sampling interval: {e}")


def _is_explicit(channel: _Channel) -> bool:
    return channel.head.get("reference channel", "implicit").lower() == "explicit"


def _reference(channel: _Channel) -> str:
    """Code or name of the channel that holds the time of this one, or nothing."""
    return _value(channel.head, "reference channel name") if _is_explicit(channel) else ""


def _value(head: Mapping[str, str], key: str) -> str:
    value = head.get(key, "").strip()
    return "" if value.upper() == NOVALUE else value


def _is_number(word: str) -> bool:
    try:
        float("nan" if word.upper() == NOVALUE else word)
    except ValueError:
        return False
    return True


def _refuse(path: Path, message: str) -> NoReturn:
    raise InputError(Fault(file=str(path), message=message))


ISO_MME = Importer(
    name="iso-mme",
    meaning="ISO-MME, ISO/TS 13499: folder, zip or tar",
    sniff=_sniff,
    read=_read,
    tests=tests,
    read_test=read_test,
)

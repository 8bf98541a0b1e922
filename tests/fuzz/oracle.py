"""Judge one command line, called in this process as the command is: its answer, its time, its memory, what it wrote."""

from __future__ import annotations

import contextlib
import gc
import io
import json
import os
import re
import shutil
import signal
import sys
import tempfile
import traceback
import warnings
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from time import process_time
from typing import Any

import typer.main

from rollover.cli.commands import common
from rollover.system import own_code

LONGEST = 5.0  # s of the processor, of one input
MOST_MEMORY = 1 << 30  # bytes, beyond what the process held before
ALLOWED = (0, 1, 2, 3)  # of an input; 74 is the machine's, anything else a bug
TABLES = (".csv", ".parquet")
CLASSES = ("traceback", "hang", "memory", "outside", "unreadable", "line", "status", "warning")

# a cure: what is allowed, needed, meant, or what to do instead, behind what is wrong
_CURE = re.compile(r"; \S|\? |did you mean|\b(is|are) (needed|allowed)\b")
_OWN_CODE = re.compile(r"\S+\.py(:\d+)?: ")  # what Python says of a user's own code is what helps there
_PLACE = re.compile(r"\s*\S.*?: \S")
# how libraries and Python word things that nobody asked about
_BARE = re.compile(
    r"\b[A-Z]\w+(Error|Exception|Warning)\b|NoneType|object has no attribute|Errno|<class |object at 0x|Traceback"
    r"|'(utf-?8|ascii)' codec|can't decode|invalid literal|could not convert|unpack requires|not subscriptable"
    r"|index out of range|setting an array element|inhomogeneous"
)


_OWN_MODULES = tuple(f"rollover_{kind}_" for kind in own_code.KINDS)


class Hang(BaseException):
    """An input took longer than it may."""


@dataclass(frozen=True, kw_only=True)
class Verdict:
    """What came of one input; `finds` are pairs of a class of `CLASSES` and what tells this find from others."""

    status: int | None
    seconds: float
    memory: int
    said: str
    finds: tuple[tuple[str, str], ...]


def command() -> Any:
    """The command `rollover`, built once."""
    global _command
    if _command is None:
        _command = typer.main.get_command(common.app)
    return _command


_command: Any = None
_beside: list[str] = []  # what libraries say past this program


def is_whole(line: str) -> str:
    """What a fault line lacks: a place, a cure, words of its own; nothing where it is whole."""
    if not _PLACE.match(line):
        return "no place"
    if not _CURE.search(line):
        return "no cure"
    if (found := _BARE.search(line)) and not _OWN_CODE.match(line):
        return f"bare text {found[0]}"
    return ""


@contextlib.contextmanager
def _limited(seconds: float) -> Iterator[None]:
    """Raise `Hang` once the processor has worked for so long; where no handler is reached, end with a stack."""
    if not hasattr(signal, "SIGPROF"):
        yield
        return

    def stop(*_: Any) -> None:
        raise Hang

    before = signal.signal(signal.SIGPROF, stop)
    signal.setitimer(signal.ITIMER_PROF, seconds, 0.5)
    try:
        yield
    finally:
        signal.setitimer(signal.ITIMER_PROF, 0.0)
        signal.signal(signal.SIGPROF, before)


@contextlib.contextmanager
def _error_output(found: list[str]) -> Iterator[None]:
    """Collect what is written to the process's own standard error, as handlers of libraries do."""
    sys.stderr.flush()
    own = os.dup(2)
    with tempfile.TemporaryFile() as file:
        os.dup2(file.fileno(), 2)
        try:
            yield
        finally:
            with contextlib.suppress(ValueError):
                (sys.__stderr__ or sys.stderr).flush()
            os.dup2(own, 2)
            os.close(own)
            file.seek(0)
            found += file.read().decode("utf-8", "replace").splitlines()[:3]


def _status(name: str) -> int:
    try:
        text = Path("/proc/self/status").read_text()
    except OSError:
        return 0
    found = re.search(rf"{name}:\s+(\d+)", text)
    return int(found[1]) * 1024 if found else 0


def _reset_peak() -> int:
    with contextlib.suppress(OSError):
        Path("/proc/self/clear_refs").write_text("5")
    return _status("VmRSS")


def judge(
    folder: Path, words: Sequence[str], out: str = "out", *, whole: bool = False, longest: float = LONGEST
) -> Verdict:
    """Call the command in a folder in which only `out` may be written to, and judge it; `out` is gone afterwards.

    With `whole` results stood there before: a refusal leaves them.
    """
    before, environment = _files(folder, out), dict(os.environ)
    here = Path.cwd()
    os.chdir(folder)
    faults: list[str] = []
    finds: list[tuple[str, str]] = []
    stdout, stderr = io.StringIO(), io.StringIO()
    status: int | None = None
    held = _reset_peak()

    def told(*what: Any, file: Any = None) -> None:
        faults.extend(" ".join(map(str, what)).split("\n"))
        print(*what, file=file)

    common.print = told  # type: ignore[attr-defined]
    began = process_time()
    sys.unraisablehook = lambda _: None  # as the command itself does
    try:
        with (
            _error_output(_beside),
            contextlib.redirect_stdout(stdout),
            contextlib.redirect_stderr(stderr),
            warnings.catch_warnings(record=True) as warned,
            _limited(longest),
        ):
            warnings.simplefilter("default")
            warnings.simplefilter("ignore", ResourceWarning)  # nobody is shown them
            warnings.simplefilter("ignore", DeprecationWarning)
            try:
                command().main(list(words), prog_name="rollover")
                status = 0
            except SystemExit as e:
                status = e.code if isinstance(e.code, int) else 1
    except Hang:
        finds.append(("hang", _where(sys.exc_info()[2])))
    except Exception as e:  # what a user would see as a traceback
        finds.append(("traceback", f"{type(e).__name__} {_where(e.__traceback__)}"))
        stderr.write(traceback.format_exc())
    finally:
        del common.print  # type: ignore[attr-defined]
        seconds = process_time() - began
        os.chdir(here)
        _forget_own_code(environment)
    memory = max(0, _status("VmHWM") - held)
    said = stderr.getvalue()
    if memory > MOST_MEMORY:
        finds.append(("memory", f"{memory >> 20} MB"))
        gc.collect()
    if status is not None and status not in ALLOWED:
        finds.append(("status", f"{status}: {_shape(said.strip().splitlines()[-1:])}"))
    if status == 2:
        finds += _lines(faults, said)

    def is_own(w: warnings.WarningMessage) -> bool:
        return Path(w.filename).is_relative_to(folder)

    finds += [("warning", f"{w.category.__name__} {Path(w.filename).name}:{w.lineno}") for w in warned if not is_own(w)]
    finds += [("line", f"said by a library: {_shape([text])}") for text in _beside if text.strip()]
    _beside.clear()
    changed = _changed(before, _files(folder, out))
    if changed:
        finds.append(("outside", changed))
    if status == 0 and (why := _unreadable(folder / out)):
        finds.append(("unreadable", why))
    if status == 2 and not whole and (folder / out).exists() and any(p.is_file() for p in (folder / out).rglob("*")):
        finds.append(("outside", "exit status 2, and something was written"))
    shutil.rmtree(folder / out, ignore_errors=True)
    return Verdict(status=status, seconds=seconds, memory=memory, said=said, finds=tuple(dict.fromkeys(finds)))


def _forget_own_code(environment: dict[str, str]) -> None:
    """Files of one's own are those of a process: the next input is that of another."""
    os.environ.clear()
    os.environ.update(environment)
    for name in [n for n in sys.modules if n.startswith(_OWN_MODULES)]:
        del sys.modules[name]


def _lines(faults: list[str], said: str) -> list[tuple[str, str]]:
    if not faults:
        lines = [line for line in said.splitlines() if line.strip()]
        if len(lines) == 1:
            faults = lines
        else:
            return [("line", f"{len(lines)} lines: {_shape(lines[-2:])}")]
    return [("line", f"{why}: {_shape([line])}") for line in faults if (why := is_whole(line))]


def _shape(lines: list[str]) -> str:
    """A line without what is this input's own: numbers and what is quoted."""
    text = re.sub(r"\"[^\"]*\"|'[^']*'", "'..'", " ".join(lines))
    text = re.sub(r"\d+(\.\d+)?(e[-+]?\d+)?", "0", text)
    parts = text.split(": ")
    return ": ".join(parts[1:])[:110] if len(parts) > 1 else text[:110]


def _where(trace: Any) -> str:
    """The innermost place of the project's own in a stack, and the innermost of all."""
    frames = traceback.extract_tb(trace)
    own = [f for f in frames if "/rollover/" in f.filename.replace(os.sep, "/") and "/tests/" not in f.filename]
    names = [f"{Path(f.filename).name}:{f.name}" for f in (*own[-1:], *frames[-1:])]
    return " < ".join(dict.fromkeys(names))


def _files(folder: Path, out: str) -> dict[str, tuple[int, int]]:
    found = {}
    for path in sorted(folder.rglob("*")):
        name = path.relative_to(folder).as_posix()
        if name.partition("/")[0] != out:
            about = path.lstat()
            found[name] = (0, 0) if path.is_dir() else (about.st_size, about.st_mtime_ns)
    return found


def _changed(before: dict[str, tuple[int, int]], after: dict[str, tuple[int, int]]) -> str:
    for name in sorted({*before, *after}):
        if before.get(name) != after.get(name):
            return ("gone" if name not in after else "new" if name not in before else "changed") + f": {name[:80]}"
    return ""


def _unreadable(out: Path) -> str:
    """Why something that was written cannot be read back, by the project's own readers."""
    from rollover.cli import catalogue
    from rollover.comparison.run_pair import is_result
    from rollover.comparison.run_pair import read as result
    from rollover.recording.importers import read_recording
    from rollover.system.errors import InputError

    for path in sorted(out.rglob("*")) if out.is_dir() else ():
        try:
            if path.is_dir():
                if is_result(path):
                    result(path)
            elif path.suffix == ".json":
                json.loads(path.read_text(encoding="utf-8"))
            elif path.name.endswith(".mme.zip") or (path.suffix in TABLES and path.with_suffix(".yaml").exists()):
                read_recording(path)
            elif path.name == "scenario.yaml" or path.name.startswith("scenario-"):
                catalogue.check(str(path))
        except (InputError, ValueError) as e:
            return f"{path.suffix}: {_shape([str(e)])}"
    return ""

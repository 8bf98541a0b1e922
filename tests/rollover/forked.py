"""A command line in a process of its own that need not import everything again: forked from one that has.

What an interpreter's own start is to show (signals, encodings, memory, imports) still starts one. As a module this is
the process that the others are forked from: a line of JSON for each, answered by the exit code.
"""

from __future__ import annotations

import contextlib
import gc
import importlib
import json
import os
import runpy
import subprocess
import sys
import tempfile
from pathlib import Path
from typing import Any

ROOT = Path(__file__).resolve().parents[2]
COMMAND = "tests.rollover.command"
# what commands import at their first use; none of them starts a thread
IMPORTED = (
    "rollover.cli.main",
    "rollover.cli.catalogue",
    "rollover.cli.console",
    "rollover.dynamics.simulate",
    "rollover.dynamics.drop_test",
    "rollover.assessment.assessed",
    "rollover.studies.regression",
    "rollover.studies.carry_out",
    "rollover.diagnosis",
    "rollover.recording.importers",
)

_server: subprocess.Popen[str] | None = None


def command(*words: object, cwd: Path | None = None) -> subprocess.CompletedProcess[str]:
    """`rollover WORDS` in a process of its own."""
    line, here = [str(w) for w in words], str(cwd or Path.cwd())
    env = {**os.environ, "PYTHONPATH": os.pathsep.join([str(ROOT), os.environ.get("PYTHONPATH", "")])}
    if not hasattr(os, "fork"):
        alone = [sys.executable, "-m", COMMAND, *line]
        return subprocess.run(alone, capture_output=True, text=True, env=env, cwd=here, check=False)
    with tempfile.TemporaryDirectory() as folder:
        out, err = Path(folder, "out"), Path(folder, "err")
        code = _asked({"words": line, "cwd": here, "env": env, "out": str(out), "err": str(err)})
        return subprocess.CompletedProcess(line, code, out.read_text(encoding="utf-8"), err.read_text(encoding="utf-8"))


def _asked(what: dict[str, Any]) -> int:
    global _server
    if _server is None or _server.poll() is not None:
        _server = subprocess.Popen(
            [sys.executable, "-m", __name__], stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True, cwd=ROOT
        )
    assert _server.stdin is not None
    assert _server.stdout is not None
    try:
        print(json.dumps(what), file=_server.stdin, flush=True)
        return int(_server.stdout.readline())
    except BaseException:  # a time limit: what comes later would be taken for the next answer
        _server.kill()
        _server = None
        raise


def _serve() -> None:
    for module in IMPORTED:
        importlib.import_module(module)
    gc.collect()
    gc.freeze()  # what stays for good is not searched, and so not copied, by each child
    for line in sys.stdin:
        asked = json.loads(line)
        if (child := os.fork()) == 0:
            return _become(asked)
        _, status = os.waitpid(child, 0)
        print(os.waitstatus_to_exitcode(status), flush=True)
    return None


def _become(asked: dict[str, Any]) -> None:
    """Be the command; what it raises ends this process as it would end the command's."""
    os.chdir(asked["cwd"])
    os.environ.clear()
    os.environ.update(asked["env"])
    for number, (name, mode) in enumerate(((os.devnull, "r"), (asked["out"], "w"), (asked["err"], "w"))):
        with open(name, mode) as file:
            os.dup2(file.fileno(), number)
    sys.stdin, sys.stdout, sys.stderr = (
        open(number, mode, encoding="utf-8", closefd=False)  # noqa: SIM115 - until the process ends
        for number, mode in enumerate(("r", "w", "w"))
    )
    sys.argv[1:] = asked["words"]
    runpy.run_module(COMMAND, run_name="__main__", alter_sys=True)


if __name__ == "__main__":
    with contextlib.suppress(KeyboardInterrupt):
        _serve()

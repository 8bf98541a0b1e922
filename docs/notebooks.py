"""Tutorials as notebooks: blocks of a Markdown page become cells that `build.py` runs.

A page stays what a terminal takes: each line of an `sh` block is a command, a `yaml` block that begins with `# NAME` is
that file, `python` is Python. As cells they are `%%sh`, `%%writefile NAME` and Python; `shown` takes these first lines
off again where a page is drawn, and the notebook that can be downloaded keeps them.
"""

from __future__ import annotations

import re
from pathlib import Path
from typing import Any

HEAD = """---
file_format: mystnb
kernelspec:
  name: python3
  display_name: Python 3
---

"""
BLOCK = re.compile(r"^```(sh|python|yaml)\n(.*?)^```$", flags=re.MULTILINE | re.DOTALL)
FILE = re.compile(r"# (\S+\.(?:yaml|csv))\n")
TITLE = re.compile(r"^(# .*\n)", flags=re.MULTILINE)
SHELL, WRITE = "%%sh\n", "%%writefile "
LANGUAGES = ((re.compile(re.escape(SHELL)), "sh"), (re.compile(WRITE + r".*\n"), "yaml"))
STARTUP = """import os, subprocess, sys
from IPython.core.magic import register_cell_magic

os.path.lexists(".venv") or os.symlink(sys.prefix, ".venv")
for name in ("FORCE_COLOR", "CLICOLOR_FORCE", "CLICOLOR", "PY_COLORS"):
    os.environ.pop(name, None)


@register_cell_magic
def sh(line, cell):  # IPython's own shows output in pieces of 100 bytes, each as a line of its own once it is merged
    done = subprocess.run(cell, shell=True, text=True, capture_output=True)
    if done.returncode:
        raise RuntimeError(done.stdout + done.stderr)
    if done.stdout.strip():  # what tells the progress, on standard error, is left out
        print("\\n".join(row.rstrip() for row in done.stdout.splitlines()))
"""


def notebook(text: str, name: str) -> str:
    """Text of a page as a MyST notebook; below its title stands where the notebook itself is."""
    there = f"Run when these pages were built; as a notebook with its outputs: {{nb-download}}`{name}.ipynb`\n"
    return HEAD + BLOCK.sub(_cells, TITLE.sub(rf"\1\n{there}", text, count=1))


def commands(block: str) -> list[str]:
    """Commands of an `sh` block, lines that end in a backslash with the next."""
    lines = block.replace("\\\n", "\\\0").splitlines()
    return [line.replace("\0", "\n") for line in lines if line.strip() and not line.startswith("#")]


def _cells(found: re.Match[str]) -> str:
    language, body = found.groups()
    if language == "sh":
        return "\n\n".join(_cell(f"{SHELL}{line}\n", "scroll-output") for line in commands(body))
    if language == "python":
        return _cell(body)
    file = FILE.match(body)
    return _cell(f"{WRITE}{file[1]}\n{body}", "remove-output") if file else found[0]


def _cell(body: str, tag: str = "") -> str:
    tags = f":tags: [{tag}]\n\n" if tag else ""
    return f"```{{code-cell}} ipython3\n{tags}{body}```"


def shown(app: Any, tree: Any) -> None:
    """Draw shell and file cells as their own language, without the line that makes them cells."""
    from docutils import nodes

    for block in tree.findall(nodes.literal_block):
        text = block.astext()
        for first, language in LANGUAGES:
            if found := first.match(text):
                block.children = [nodes.Text(text[found.end() :])]
                block.rawsource = text[found.end() :]
                block["language"] = language


def prepare(profile: Path) -> None:
    """Write the profile of the kernels: quiet, without colours, `.venv` in the folder where a notebook runs."""
    (profile / "startup").mkdir(parents=True)
    # the kernel serves this build alone, on this machine: that it does so without encryption is no news
    (profile / "ipython_kernel_config.py").write_text("get_config().IPKernelApp.log_level = 40\n", encoding="utf-8")
    (profile / "startup" / "environment.py").write_text(STARTUP, encoding="utf-8")

"""Where lines of code may break on a narrow screen: names behind their parts, commands not inside an option.

Tags alone are added: what is copied from a page stays as it is.
"""

from __future__ import annotations

import re
from typing import Any

CODE = re.compile(r'(<span class="pre">)([^<]*)(</span>)')
SHELL = re.compile(r'<div class="highlight-sh\b.*?</pre>', flags=re.DOTALL)
OPTION = re.compile(r"(?<=>)--?[A-Za-z][\w-]*")  # a token of its own
BEHIND = re.compile(r"(?<=\w)([/_=:]|\.(?!\d))(?=\w)")  # no number is broken


def breakable(body: str) -> str:
    """HTML of a page with a `<wbr>` behind each part of a name in inline code, and options of commands in one piece."""
    body = CODE.sub(lambda found: found[1] + BEHIND.sub(r"\1<wbr>", found[2]) + found[3], body)
    return SHELL.sub(lambda found: OPTION.sub(r'<span class="whole">\g<0></span>', found[0]), body)


def fold(app: Any, page: str, template: str, context: dict[str, Any], tree: Any) -> None:
    """Do so with a page that Sphinx is about to write."""
    if "body" in context:
        context["body"] = breakable(context["body"])

"""Names in code may break behind their parts, so that a table fits a narrow screen; what is copied stays as it is."""

from __future__ import annotations

import re
from typing import Any

CODE = re.compile(r'(<span class="pre">)([^<]*)(</span>)')
BEHIND = re.compile(r"(?<=\w)([/_=:]|\.(?!\d))(?=\w)")  # no number is broken


def breakable(body: str) -> str:
    """HTML of a page with a `<wbr>` behind each part of a name in inline code, which leaves no mark in a copy."""
    return CODE.sub(lambda found: found[1] + BEHIND.sub(r"\1<wbr>", found[2]) + found[3], body)


def fold(app: Any, page: str, template: str, context: dict[str, Any], tree: Any) -> None:
    """Do so with a page that Sphinx is about to write."""
    if "body" in context:
        context["body"] = breakable(context["body"])

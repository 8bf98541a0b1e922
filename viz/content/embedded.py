"""What stands in a page beside its text: numbers for a script, the scripts, and the policy that names them."""

from __future__ import annotations

import base64
import hashlib
import json
import re
from collections.abc import Iterable
from typing import Any

_SIGNS = {ord(c): f"\\u{ord(c):04x}" for c in "<>&\u2028\u2029"}
_ENDS = re.compile(r"<(?=/script|!--)", re.IGNORECASE)


def embedded(value: Any) -> str:
    """JSON of bare values in which no sign can end the element that it stands in, or open another."""
    return json.dumps(value, separators=(",", ":"), allow_nan=False).translate(_SIGNS)


def in_script(text: str) -> str:
    """A script as it may stand in a page: its strings and patterns mean the same, none ends the element."""
    return _ENDS.sub(r"<\\", text)


def policy(scripts: Iterable[str], *more: str) -> str:
    """Content security policy under which these very scripts run, nothing else runs, and nothing is fetched.

    Styles stand in the page, also those of single lines in a figure. `more` are directives in place of those here.
    """
    hashes = " ".join(sorted({f"'sha256-{_digest(text)}'" for text in scripts})) or "'none'"
    rules = {"default-src": "'none'", "script-src": hashes, "style-src": "'unsafe-inline'"}
    rules |= {"connect-src": "'none'", "base-uri": "'none'", "form-action": "'none'"}
    for directive in more:
        name, _, what = directive.partition(" ")
        rules[name] = f"{rules[name]} {what}" if name == "script-src" else what
    return "; ".join(f"{name} {what}" for name, what in rules.items())


def _digest(text: str) -> str:
    return base64.b64encode(hashlib.sha256(text.encode()).digest()).decode("ascii")

"""A page taken apart: its elements with their attributes, its tables, what it would fetch."""

from __future__ import annotations

import re
from dataclasses import dataclass, field
from html.parser import HTMLParser

from viz.pages.page import TEMPLATES

_VOID = {"meta", "br", "hr", "img", "link", "input"}


@dataclass
class Parts(HTMLParser):
    """What a parser saw; `rows` are the texts of the cells of each table row."""

    text: str
    tags: list[tuple[str, dict[str, str]]] = field(default_factory=list)
    rows: list[list[str]] = field(default_factory=list)
    words: list[str] = field(default_factory=list)
    open: list[str] = field(default_factory=list)

    def __post_init__(self) -> None:
        super().__init__()
        self.feed(self.text)
        self.close()
        assert self.open == [], f"never closed: {self.open}"

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        self.tags.append((tag, {k: v or "" for k, v in attrs}))
        if tag not in _VOID:
            self.open.append(tag)
        if tag == "tr":
            self.rows.append([])
        if tag in ("td", "th"):
            self.rows[-1].append("")

    def handle_startendtag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        self.tags.append((tag, {k: v or "" for k, v in attrs}))

    def handle_endtag(self, tag: str) -> None:
        assert self.open.pop() == tag, f"{tag} closes another"

    def handle_data(self, data: str) -> None:
        if self.open and self.open[-1] in ("td", "th"):
            self.rows[-1][-1] += data
        if self.open and self.open[-1] != "style":
            self.words.append(data)

    @property
    def said(self) -> str:
        """All text of the page."""
        return re.sub(r"\s+", " ", " ".join(self.words))

    def fetched(self) -> list[str]:
        """Everything that a browser would load or run from elsewhere."""
        reader = f"<script>\n{(TEMPLATES / 'reader.js').read_text(encoding='utf-8')}</script>"  # ours, to the letter
        found = ["script"] * (sum(t == "script" for t, _ in self.tags) - self.text.count(reader))
        found += [t for t, _ in self.tags if t in ("link", "img", "iframe", "object", "embed", "base")]
        for _, attributes in self.tags:
            found += [v for k, v in attributes.items() if k in ("src", "srcset", "data", "action", "poster")]
            found += [v for k, v in attributes.items() if k.endswith("href") and not v.startswith("#")]
            found += [k for k in attributes if k.startswith("on")]
        found += re.findall(r"url\((?!#)[^)]*\)|@import[^;]*|[a-z]+://[^\s\"'<]*", self.text)
        return found

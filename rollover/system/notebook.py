"""What a notebook shows of a result: a headline, sentences and a table as HTML, without any script."""

from __future__ import annotations

from collections.abc import Collection, Sequence
from html import escape

from rollover.system.errors import excerpt, sentence

MOST_ROWS, MOST_SENTENCES = 40, 12  # of a result in a notebook: what fits on a screen


def card(
    headline: str,
    sentences: Sequence[str] = (),
    headings: Sequence[str] = (),
    rows: Sequence[Sequence[str]] = (),
    *,
    words: Collection[int] = (0,),
) -> str:
    """A block of HTML; columns `words` are set to the left, numbers to the right. Every text is escaped."""
    lines = [f"<p><b>{escape(excerpt(headline))}</b></p>"]
    lines += [f"<p>{escape(sentence(text))}</p>" for text in sentences[:MOST_SENTENCES]]
    if len(sentences) > MOST_SENTENCES:
        lines.append(f"<p>{len(sentences) - MOST_SENTENCES} more sentences</p>")
    if rows:
        lines.append(f"<table>{_row('th', headings, words)}")
        lines += [_row("td", row, words) for row in rows[:MOST_ROWS]]
        lines.append("</table>")
    if len(rows) > MOST_ROWS:
        lines.append(f"<p>{len(rows) - MOST_ROWS} more rows</p>")
    return "<div>" + "\n".join(lines) + "</div>"


def _row(tag: str, cells: Sequence[str], words: Collection[int]) -> str:
    sides = ("left" if k in words else "right" for k in range(len(cells)))
    made = (
        f'<{tag} style="text-align:{side};padding:.1em .6em">{escape(excerpt(cell))}</{tag}>'
        for side, cell in zip(sides, cells, strict=True)
    )
    return f"<tr>{''.join(made)}</tr>"

"""HTML building blocks; text from a recording is escaped."""

from __future__ import annotations

import base64
import re
from collections.abc import Iterable, Sequence
from functools import cache
from html import escape
from pathlib import Path

__all__ = ["document", "marked", "paragraph", "picture", "section", "table"]

_STYLE = Path(__file__).with_name("style.css")


def document(title: str, head: Iterable[str], sections: Iterable[str], foot: str = "") -> str:
    """A whole page: `head` below the title, `sections` in columns, `foot` at the end."""
    return "\n".join(
        [
            "<!doctype html>",
            '<html lang="en"><head><meta charset="utf-8">',
            '<meta name="viewport" content="width=device-width, initial-scale=1">',
            # Without an icon in the page, browsers request one from the server.
            '<link rel="icon" href="data:,">',
            f"<title>{escape(title)}</title><style>{_style()}</style></head><body>",
            f"<header><h1>{escape(title)}</h1>",
            *head,
            '</header><main class="columns">',
            *sections,
            "</main>",
            f"<footer>{escape(foot)}</footer></body></html>\n",
        ]
    )


def section(title: str, *content: str, wide: bool = False) -> str:
    """A section of the page, across both columns if `wide`."""
    kind = ' class="wide"' if wide else ""
    return f"<section{kind}><h2>{escape(title)}</h2>{''.join(content)}</section>"


def marked(text: str) -> str:
    """A text as HTML, what stands between backticks in it as code."""
    return re.sub(r"`([^`]+)`", r"<code>\1</code>", escape(text))


def paragraph(text: str, kind: str = "") -> str:
    """A paragraph of text with the CSS class `kind`."""
    return f'<p class="{kind}">{marked(text)}</p>' if kind else f"<p>{marked(text)}</p>"


def picture(data: bytes, alt: str, *, media: str = "image/png", caption: str = "") -> str:
    """An image embedded in the page."""
    text = f"<figcaption>{escape(caption)}</figcaption>" if caption else ""
    kind = "" if caption else ' class="plot"'
    source = f"data:{media};base64,{base64.b64encode(data).decode()}"
    return f'<figure{kind}><img src="{source}" alt="{escape(alt)}">{text}</figure>'


def table(head: Sequence[str], rows: Iterable[Sequence[object]]) -> str:
    """A table; numbers are aligned to the right."""
    rows = list(rows)
    body = [
        "<tr>" + "".join(_cell(value, first=not place) for place, value in enumerate(row)) + "</tr>"
        for row in rows
    ]
    numeric = [
        any(isinstance(value, int | float) for value in column)
        for column in zip(*rows, strict=True)
    ]
    titles = "".join(
        f'<th class="number">{escape(title)}</th>' if right else f"<th>{escape(title)}</th>"
        for title, right in zip(head, numeric, strict=False)
    )
    return (
        f'<div class="scroll"><table><thead><tr>{titles}</tr></thead>'
        f"<tbody>{''.join(body)}</tbody></table></div>"
    )


def _cell(value: object, *, first: bool) -> str:
    if first:
        return f"<th>{escape(str(value))}</th>"
    if isinstance(value, float):
        return f'<td class="number">{value:,.1f}</td>'
    if isinstance(value, int):
        return f'<td class="number">{value:,}</td>'
    return f"<td>{marked(str(value))}</td>"


@cache
def _style() -> str:
    return _STYLE.read_text(encoding="utf-8")

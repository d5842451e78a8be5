"""HTML pages from templates; text of a recording is escaped."""

from __future__ import annotations

import base64
import re
from pathlib import Path

from jinja2 import Environment, FileSystemLoader, StrictUndefined
from markupsafe import Markup, escape

__all__ = ["render_page"]

_FOLDER = Path(__file__).parent


def render_page(template: str | Path, **values: object) -> str:
    """Render a template, which may extend `page.html` and import from `parts.html`.

    Args:
        template: A file's name in this folder, or the path of a file elsewhere.
        values: What the template shows; `page.html` shows `title` and, in its foot, `origin`.
    """
    path = _FOLDER / template
    environment = Environment(
        loader=FileSystemLoader([path.parent, _FOLDER]),
        autoescape=True,
        undefined=StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
        keep_trailing_newline=True,
    )
    environment.filters |= {"marked": _marked, "base64": _base64}
    return environment.get_template(path.name).render(values)


def _marked(text: object) -> Markup:
    """A text as HTML, what stands between backticks in it as code."""
    escaped = str(escape(str(text)))
    return Markup(re.sub(r"`([^`]+)`", r"<code>\1</code>", escaped))  # noqa: S704 - escaped


def _base64(data: bytes) -> str:
    return base64.b64encode(data).decode()

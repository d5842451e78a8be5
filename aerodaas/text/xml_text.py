"""XML texts of strangers: bounded in depth and elements, without entities."""

from __future__ import annotations

import io
import math
from xml.etree import ElementTree as ET

from aerodaas.errors import ConfigError

__all__ = ["XmlError", "parse_xml"]

_MOST_LEVELS = 40
_UNREAD = ("<!DOCTYPE", "<!ENTITY", "\0")
"""Entities could grow without end; zero bytes, as UTF-16 has, would hide them."""


class XmlError(ConfigError):
    """Fault of an XML text, as a sentence without its subject: `is no XML`."""

    def __init__(self, problem: str, line: int | None = None) -> None:
        """Keep the line of the text, where the `problem` has one."""
        super().__init__(problem)
        self.line = line


def parse_xml(content: str | bytes, kind: str, most_elements: float = math.inf) -> ET.Element:
    """Parse an XML text and return its root.

    Args:
        content: The text; bytes are read in the encoding that they declare.
        kind: Kind of document, for the error, such as `KML`.
        most_elements: Greatest number of elements.

    Raises:
        XmlError: If it is not XML, declares entities, has more than 40 levels or `most_elements`
            elements, or an encoding that is not read.
    """
    text = content if isinstance(content, str) else content.decode("latin-1")
    if any(one in text for one in _UNREAD):
        raise XmlError(
            f"declares entities, or is no UTF-8, and {kind} declares no entities; this file is not "
            "read"
        )
    source = io.StringIO(content) if isinstance(content, str) else io.BytesIO(content)
    events = ET.iterparse(source, ["start", "end"])  # noqa: S314 - has no entities
    level = elements = 1
    try:
        root: ET.Element = next(events)[1]
        # Event by event, so that a bound is met before all of a deep tree is there.
        for event, _ in events:
            level += 1 if event == "start" else -1
            elements += event == "start"
            if level > _MOST_LEVELS:
                raise XmlError(f"is nested more than {_MOST_LEVELS} levels deep; {kind} never is")
            if elements > most_elements:
                raise XmlError(f"has more than {most_elements} elements: split it")
    except ET.ParseError as error:
        raise XmlError(f"is no XML: {error}", error.position[0]) from None
    except (LookupError, ValueError):
        raise XmlError("is in an encoding that is not read; use UTF-8") from None
    return root

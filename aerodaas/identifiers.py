"""What ids and names may look like, and what keeps the project's own streams apart from them.

Streams are named `robot/sensor`, `robot/analysis`, or by the id alone where no robot is meant.
Streams of the project's own (a robot's states, commands, acknowledgements) hold `INTERNAL`, which
no id may, so that neither can be taken for the other.
"""

from __future__ import annotations

import re
from typing import Annotated

from pydantic import Field

from aerodaas.errors import GraphError

__all__ = ["INTERNAL", "Identifier", "internal", "is_internal", "require_name", "safe_name"]

INTERNAL = "@"
"""Begins the part of a stream's name that is the project's own."""
Identifier = Annotated[str, Field(pattern=r"^[A-Za-z][A-Za-z0-9_\-]*$", max_length=64)]
"""An id of an environment file."""
_NAME = re.compile(r"[^\W\d][\w\-]{0,63}")


def internal(owner: str, name: str) -> str:
    """Name of a stream of the project's own that belongs to a robot or to a node.

    >>> internal("drone", "state")
    'drone/@state'
    """
    return f"{owner}/{INTERNAL}{name}"


def is_internal(stream: str) -> bool:
    """Tell whether a stream is the project's own rather than a sensor's or an analysis'."""
    return INTERNAL in stream


def require_name(name: str, owner: str) -> str:
    """Return the name of an analysis; raises GraphError where it could be no part of a stream's."""
    if not _NAME.fullmatch(name):
        raise GraphError(
            f"{owner}: an analysis cannot be called {name!r}; "
            "a name is made of letters, digits, _ and -, a letter first"
        )
    return name


def safe_name(text: str) -> str:
    """A name as like `text` as may be, such as that of an application's file."""
    name = re.sub(r"[^\w\-]", "_", text)
    return name if _NAME.fullmatch(name) else f"_{name}"[:64]

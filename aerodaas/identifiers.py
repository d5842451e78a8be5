"""Syntax of ids and names, and their separation from the project's own streams.

Streams are named `robot/sensor`, `robot/analysis`, or by the id alone where no robot is meant.
Streams of the project's own (a robot's states, commands, acknowledgements) hold `INTERNAL`, which
no id may, so that neither can be taken for the other.
"""

from __future__ import annotations

import re
from collections.abc import Iterable, Mapping
from typing import Annotated, TypeVar

from pydantic import AfterValidator, Field

from aerodaas.errors import AmbiguousIdError, GraphError, UnknownIdError

__all__ = [
    "INTERNAL",
    "Identifier",
    "ScopedName",
    "ScopedWord",
    "Word",
    "find_scoped",
    "internal",
    "is_internal",
    "require_name",
    "short",
    "told",
]


V = TypeVar("V")
INTERNAL = "@"
"""Begins the part of a stream's name that is the project's own."""
Identifier = Annotated[str, Field(pattern=r"^[A-Za-z][A-Za-z0-9_\-]*$", max_length=64)]
"""An id of an environment file."""
ScopedName = Annotated[
    str, Field(pattern=r"^[A-Za-z_][A-Za-z0-9_\-]*(/[A-Za-z_][A-Za-z0-9_\-]*)?$", max_length=129)
]
"""`robot/name`, or the name alone where only one robot has it."""
_NAME = re.compile(r"[^\W\d][\w\-]{0,63}")
_LONGEST = 64
"""Most characters of a name."""


def _short_parts(name: str) -> str:
    if any(len(part) > _LONGEST for part in name.split("/")):
        raise ValueError(f"a name has at most {_LONGEST} characters, and so has its robot's")
    return name


# A pattern that counted (`{0,63}`) would take 1 to 3 MB for each field, for it is compiled into so
# many copies of all letters of all scripts.
Word = Annotated[str, Field(pattern=r"^[^\W\d][\w\-]*$", max_length=_LONGEST)]
"""A name in a document or a request, in letters of any script."""
ScopedWord = Annotated[
    str,
    Field(pattern=r"^[^\W\d][\w\-]*(/[^\W\d][\w\-]*)?$", max_length=2 * _LONGEST + 1),
    AfterValidator(_short_parts),
]
"""`robot/name` in a document or a request, or the name alone."""


def internal(owner: str, name: str) -> str:
    """Name of a stream of the project's own that belongs to a robot or to a node.

    >>> internal("drone", "state")
    'drone/@state'
    """
    return f"{owner}/{INTERNAL}{name}"


def is_internal(stream: str) -> bool:
    """Whether a stream is the project's own rather than a sensor's or an analysis'."""
    return INTERNAL in stream


def short(name: str) -> str:
    """A scoped name without its robot's."""
    return name.rpartition("/")[2]


def told(of: str, table: Mapping[str, V]) -> V | None:
    """Value that `table` holds under the scoped name `of`, or else under its short one."""
    return table[of] if of in table else table.get(short(of))


def find_scoped(kind: str, wanted: str, known: Iterable[str]) -> str:
    """The one of the scoped names `known` that is `wanted`, in full or by its short name.

    Raises UnknownIdError where there is none, AmbiguousIdError where the short name fits several.
    """
    names = list(known)
    if wanted in names:
        return wanted
    fitting = [name for name in names if short(name) == wanted]
    if len(fitting) > 1:
        raise AmbiguousIdError(kind, wanted, fitting)
    if not fitting:
        raise UnknownIdError(kind, wanted, names)
    return fitting[0]


def require_name(name: str, owner: str) -> str:
    """Return the name of an analysis; raises GraphError where it could be no part of a stream's."""
    if not _NAME.fullmatch(name):
        raise GraphError(
            f"{owner}: an analysis cannot be called {name!r}; "
            "a name is made of letters, digits, _ and -, a letter first"
        )
    return name

"""The paper's camelCase spellings, mapped to the project's snake_case names in one place.

The paper spells a method both `getRobotByID` (API table) and `getRobotById` (listings). Any
object that inherits `PaperNames` answers to either spelling of every method it has.
"""

from __future__ import annotations

import re
from typing import Any

__all__ = ["PaperNames", "snake_case"]

_ACRONYM_OR_WORD = re.compile(r"(?<=[a-z0-9])(?=[A-Z])|(?<=[A-Z])(?=[A-Z][a-z])")


def snake_case(name: str) -> str:
    """Spell a camelCase name in snake_case: `getRobotByID` becomes `get_robot_by_id`."""
    return _ACRONYM_OR_WORD.sub("_", name).lower()


class PaperNames:
    """Mixin: an unknown camelCase attribute is looked up under its snake_case name."""

    def __getattr__(self, name: str) -> Any:  # noqa: ANN401 - any attribute may be asked for
        """Resolve `name` by its snake_case spelling; AttributeError if that is no name either."""
        alias = snake_case(name)
        if alias == name or name.startswith("_"):
            message = f"{type(self).__name__!r} object has no attribute {name!r}"
            raise AttributeError(message)
        return getattr(self, alias)

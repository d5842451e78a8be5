"""Columns whose values are the project's own: texts, enums, and what becomes JSON."""

from __future__ import annotations

import enum
import json
from collections.abc import Callable
from typing import Any

from sqlalchemy import Dialect, Text
from sqlalchemy.types import TypeDecorator

__all__ = ["EnumText", "JsonText", "Words", "tuples"]


def _clean(text: str) -> str:
    """A text that every database takes: no half of a surrogate pair, no character 0."""
    return text.encode("utf-8", "replace").decode().replace("\0", "\N{REPLACEMENT CHARACTER}")


class Words(TypeDecorator[str]):
    """A text of any length."""

    impl = Text
    cache_ok = True

    def process_bind_param(self, value: str | None, dialect: Dialect) -> str | None:  # noqa: ARG002
        """To the database."""
        return None if value is None else _clean(value)


class EnumText(TypeDecorator[Any]):
    """A member of an enum of texts, by its value."""

    impl = Text
    cache_ok = True

    def __init__(self, kind: type[enum.Enum]) -> None:
        """Keep members of `kind`."""
        super().__init__()
        self.kind = kind

    def process_bind_param(self, value: enum.Enum | None, dialect: Dialect) -> str | None:  # noqa: ARG002
        """To the database."""
        return None if value is None else str(value.value)

    def process_result_value(self, value: str | None, dialect: Dialect) -> enum.Enum | None:  # noqa: ARG002
        """From the database."""
        return None if value is None else self.kind(value)


class JsonText(TypeDecorator[Any]):
    """What JSON can say, as text; `read` makes of it what the row's class holds."""

    impl = Text
    cache_ok = True

    def __init__(self, read: Callable[[Any], Any] | None = None) -> None:
        """Read with `read`, or what JSON gives."""
        super().__init__()
        self.read = read

    def process_bind_param(self, value: object, dialect: Dialect) -> str | None:  # noqa: ARG002
        """To the database."""
        if value is None:
            return None
        return json.dumps(sorted(value) if isinstance(value, frozenset) else value, allow_nan=False)

    def process_result_value(self, value: str | None, dialect: Dialect) -> Any:  # noqa: ANN401, ARG002
        """From the database."""
        if value is None:
            return None
        content = json.loads(value)
        return self.read(content) if self.read else content


def tuples(content: Any) -> Any:  # noqa: ANN401 - lists of lists of anything
    """Lists, also nested ones, as tuples."""
    return tuple(map(tuples, content)) if isinstance(content, list) else content

"""Records that travel: a decorator that makes dataclasses quick to pickle."""

from __future__ import annotations

import dataclasses
from operator import attrgetter
from typing import Any, TypeVar

__all__ = ["travels"]

C = TypeVar("C", bound=type[Any])


def travels(cls: C) -> C:
    """Pickle a dataclass by its constructor's arguments.

    The state methods that `dataclass(slots=True)` writes look every field up anew, at several
    times the cost, and these records are pickled on every hop of every frame.
    """
    names = [field.name for field in dataclasses.fields(cls)]
    one = len(names) == 1
    values = attrgetter(*names)

    def reduce(self: Any) -> tuple[Any, tuple[Any, ...]]:  # noqa: ANN401 - an instance of `cls`
        return type(self), ((values(self),) if one else values(self))

    cls.__reduce__ = reduce  # type: ignore[assignment]
    return cls

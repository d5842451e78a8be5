"""Questions about type annotations."""

from __future__ import annotations

import typing
from typing import Any

__all__ = ["is_subclass"]


def is_subclass(annotation: Any, *parents: type) -> bool:  # noqa: ANN401 - any annotation
    """Whether an annotation is a class below one of `parents`.

    On Python 3.10 `list[int]` claims to be a class, and `issubclass` raises TypeError for it.
    """
    plain = isinstance(annotation, type) and typing.get_origin(annotation) is None
    return plain and issubclass(annotation, parents)

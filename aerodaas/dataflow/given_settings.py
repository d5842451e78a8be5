"""Settings of an object as its constructor was given them, so that they can be written down."""

from __future__ import annotations

import functools
import inspect
from collections.abc import Callable
from typing import Any

__all__ = ["GivenSettings"]

_GIVEN = "_given"
_UNDER_WAY = "_under_construction"
"""Attribute while the constructor runs, whose base's constructor is not the one that was called."""


class GivenSettings:
    """Base of classes whose instances know the arguments that they were made with."""

    def __init_subclass__(cls, **more: Any) -> None:  # noqa: ANN401 - of other bases
        """Have the constructor note its arguments; a subclass' stands before its base's."""
        super().__init_subclass__(**more)
        if "__init__" in vars(cls):
            # Not by __new__, which would hide the constructor's signature from help().
            type.__setattr__(cls, "__init__", _noting(vars(cls)["__init__"]))

    def given_settings(self) -> dict[str, Any]:
        """The constructor's arguments by name, without those left to their defaults.

        A copy that was sent to another process does not know them.
        """
        noted: tuple[Any, ...] | None = vars(self).get(_GIVEN)
        if noted is None:
            return {}
        init, args, kwargs = noted
        arguments = dict(inspect.signature(init).bind(self, *args, **kwargs).arguments)
        del arguments[next(iter(arguments))]
        return arguments


def _noting(init: Callable[..., None]) -> Callable[..., None]:
    @functools.wraps(init)
    def noting(self: object, *args: Any, **kwargs: Any) -> None:  # noqa: ANN401 - as the constructor's
        known = vars(self)
        if _UNDER_WAY in known:
            init(self, *args, **kwargs)
            return
        known[_GIVEN], known[_UNDER_WAY] = (init, args, kwargs), True
        try:
            init(self, *args, **kwargs)
        finally:
            del known[_UNDER_WAY]

    return noting

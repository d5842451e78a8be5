"""Records with something in each field, so that a field that is lost on some way shows."""

from __future__ import annotations

import dataclasses
import enum
import types
import typing
from typing import Any

import numpy as np

from aerodaas.messages.actions import Action, action_kinds
from aerodaas.messages.appearance import ZONE_BYTES, ZONES
from aerodaas.messages.detections import Detection, Detections
from aerodaas.messages.frames import Frame

__all__ = ["filled", "names"]

_PLAIN: dict[Any, Any] = {bool: True, int: 3, float: 0.375, str: "word", bytes: b"x", Any: 0.625}
_SPECIAL: dict[Any, dict[str, Any]] = {
    Detection: {
        "keypoints": np.full((2, 3), 0.5, np.float32),
        "appearance": bytes(ZONES * ZONE_BYTES),
    },
    Detections: {"nearest": np.full((2, 3), 5, np.uint16)},
    Frame: {"image": np.full((2, 3, 3), 7, np.uint8), "depth": np.full((2, 3), 9, np.uint16)},
}


def names(kind: Any) -> tuple[str, ...]:  # noqa: ANN401 - a dataclass or a named tuple
    """Names of a record's fields."""
    own: tuple[str, ...] | None = getattr(kind, "_fields", None)
    return own or tuple(one.name for one in dataclasses.fields(kind))


def filled(hint: Any, **given: Any) -> Any:  # noqa: ANN401, PLR0911 - an annotation's; one each
    """Something of an annotation; of a record, with a value unlike its default in each field."""
    # From NumPy 2.5 on, NDArray is a named alias.
    meant = getattr(typing.get_origin(hint), "__value__", None)
    hint = hint if meant is None else meant[typing.get_args(hint)]
    origin, inner = typing.get_origin(hint), typing.get_args(hint)
    if hint in _PLAIN:
        return _PLAIN[hint]
    if origin is typing.Union or isinstance(hint, types.UnionType):
        return filled(next(one for one in inner if one is not type(None)))
    if hint == tuple[Action, ...]:
        return tuple({one.slot: one for one in map(filled, action_kinds().values())}.values())
    if origin is tuple:
        return tuple(filled(one) for one in inner if one is not Ellipsis)
    if origin is dict:
        return {"name": filled(inner[1])}
    if origin is typing.Literal:
        return inner[-1]
    if origin is np.ndarray:
        return np.full(3, 0.5) if "float" in str(hint) else np.full(3, 5, np.uint16)
    if issubclass(hint, enum.Enum):
        return list(hint)[-1]
    hints = typing.get_type_hints(hint)
    special = {**_SPECIAL.get(hint, {}), **given}
    if hint is action_kinds().get("trigger_photos"):
        # Distance and interval take the place of one another.
        special = {"interval": None, **special}
    return hint(
        **{one: special[one] if one in special else filled(hints[one]) for one in names(hint)}
    )

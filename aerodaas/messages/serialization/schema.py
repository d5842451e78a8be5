"""The JSON of messages, which pydantic derives from their annotations.

It is one form for every border of trust. NaN is null where a field may be NaN; an array is a list
of lists, and a vector `{"x": …, "y": …, "z": …}`; bytes are Base64.
"""

from __future__ import annotations

from collections.abc import Mapping
from functools import lru_cache
from typing import Any, Literal, TypeVar

import numpy as np
from pydantic import TypeAdapter, ValidationError
from pydantic_core import PydanticSerializationError, from_json, to_json

from aerodaas.errors import AeroDaaSError
from aerodaas.messages.serialization.records import unsent_fields

__all__ = [
    "MessageError",
    "json_of",
    "json_schema_of",
    "json_text",
    "message_of",
    "message_of_text",
]

T = TypeVar("T")
_LONGEST_REASON = 300


class MessageError(AeroDaaSError):
    """A message is malformed, or of a class that is not known here."""


@lru_cache(maxsize=256)
def _adapter(kind: type[T]) -> TypeAdapter[T]:
    return TypeAdapter(kind)


def _number(value: object) -> Any:  # noqa: ANN401 - one of Python's numbers
    if isinstance(value, np.generic):
        return value.item()
    raise TypeError(f"a {type(value).__name__} is none of JSON's types")


def json_of(message: object) -> Any:  # noqa: ANN401 - JSON
    """The JSON value of a message, without its unsent fields.

    Args:
        message: An instance of a dataclass of `aerodaas.messages`.

    Returns:
        A value of JSON's own types.

    Raises:
        MessageError: If a field holds what JSON cannot.
    """
    return from_json(json_text(message))


def json_schema_of(kind: type) -> dict[str, Any]:
    """The JSON schema of a message's class, without its unsent fields."""
    schema = _adapter(kind).json_schema()
    for name in unsent_fields(kind):
        del schema["properties"][name]
    return schema


def json_text(
    message: object,
    *,
    without_none: bool = False,
    without: Mapping[str, Any] = {},
    **more: str | float | None,
) -> bytes:
    """The JSON text of a message, without its unsent fields.

    Args:
        message: An instance of a dataclass of `aerodaas.messages`.
        without_none: Whether fields that are None are left out.
        without: Further fields that are left out, in the form of pydantic's `exclude`.
        **more: Values that stand before the message's own fields, by name.

    Returns:
        The text in UTF-8.

    Raises:
        MessageError: If a field holds what JSON cannot.
    """
    try:
        # Fields are not checked here: whoever reads the message checks them.
        text = _adapter(type(message)).dump_json(
            message,
            exclude=dict(without),
            exclude_none=without_none,
            warnings="none",
            fallback=_number,
        )
        return to_json(more)[:-1] + b"," + text[1:] if more else text
    except (PydanticSerializationError, TypeError, ValueError) as error:
        reason = f"{type(message).__name__} cannot be written as JSON: {error}"
        raise MessageError(reason[:_LONGEST_REASON]) from None


def message_of(
    kind: type[T],
    value: Any,  # noqa: ANN401 - JSON
    *,
    unknown_fields: Literal["forbid", "ignore"] = "forbid",
) -> T:
    """Read a message from its JSON value, and check each field against its annotation.

    Args:
        kind: Class of the message.
        value: The JSON value; it may be a stranger's.
        unknown_fields: Whether a field that the class does not have is refused or left out.

    Returns:
        The message.

    Raises:
        MessageError: If it is malformed, with the field's name.
    """
    try:
        # As text, since JSON has no tuples and no enumerations to be strict about.
        text = to_json(value, inf_nan_mode="constants")
    except (ValueError, TypeError, RecursionError) as error:
        raise _malformed(kind, error) from None
    return message_of_text(kind, text, unknown_fields=unknown_fields)


def message_of_text(
    kind: type[T],
    text: bytes,
    *,
    unknown_fields: Literal["forbid", "ignore"] = "forbid",
) -> T:
    """Read a message from its JSON text, as `message_of` reads its value.

    Args:
        kind: Class of the message.
        text: The JSON text; it may be a stranger's.
        unknown_fields: Whether a field that the class does not have is refused or left out.

    Raises:
        MessageError: If it is malformed, with the field's name.
    """
    try:
        return _adapter(kind).validate_json(text, strict=True, extra=unknown_fields)
    except ValidationError as error:
        first = error.errors(include_url=False, include_context=False, include_input=False)[0]
        place = ".".join(map(str, (kind.__name__, *first["loc"])))
        raise MessageError(f"{place}: {first['msg']}"[:_LONGEST_REASON]) from None
    except AeroDaaSError as error:
        raise MessageError(f"{kind.__name__}: {error}"[:_LONGEST_REASON]) from None
    except (ValueError, TypeError, RecursionError) as error:
        raise _malformed(kind, error) from None


def _malformed(kind: type, error: Exception) -> MessageError:
    reason = f"{kind.__name__}: {type(error).__name__}: {error}"
    return MessageError(reason[:_LONGEST_REASON])

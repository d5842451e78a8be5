"""Forms of numbers and NumPy arrays in JSON: annotations from which pydantic derives its checks."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING, Annotated, Any, TypeAlias

import numpy as np
from numpy.typing import NDArray

if TYPE_CHECKING:
    from pydantic import GetCoreSchemaHandler, GetJsonSchemaHandler
    from pydantic_core import CoreSchema

__all__ = [
    "XYZ",
    "Int64",
    "NanIsNull",
    "NestedLists",
    "Real",
    "SignedBits",
    "StrictlyTyped",
]

Array: TypeAlias = NDArray[Any]
_AXES = ("x", "y", "z")


@dataclass(frozen=True)
class SignedBits:
    """A whole number of so many bits, one of them the sign.

    Args:
        count: Number of bits.
    """

    count: int

    def __get_pydantic_core_schema__(
        self, source: object, handler: GetCoreSchemaHandler
    ) -> CoreSchema:
        """Schema by which pydantic reads and writes the number."""
        from pydantic_core import core_schema  # noqa: PLC0415 - slow to load

        del source, handler
        end = 1 << self.count - 1
        return core_schema.int_schema(ge=-end, lt=end, strict=True)


Int64: TypeAlias = Annotated[int, SignedBits(64)]
"""A whole number of 64 bits."""


@dataclass(frozen=True)
class NanIsNull:
    """A number that is null in JSON where it is NaN."""

    def __get_pydantic_core_schema__(
        self, source: object, handler: GetCoreSchemaHandler
    ) -> CoreSchema:
        """Schema by which pydantic reads and writes the number."""
        from pydantic_core import core_schema  # noqa: PLC0415 - slow to load

        return core_schema.no_info_before_validator_function(_nan_of_null, handler(source))

    def __get_pydantic_json_schema__(
        self, core: CoreSchema, handler: GetJsonSchemaHandler
    ) -> dict[str, Any]:
        """JSON schema of the number."""
        return {**handler(core), "type": ["number", "null"]}


Real: TypeAlias = Annotated[float, NanIsNull()]
"""A number that may be NaN."""


@dataclass(frozen=True)
class StrictlyTyped:
    """A value of the annotated type itself: no number as a text, no flag as a number."""

    def __get_pydantic_core_schema__(
        self, source: object, handler: GetCoreSchemaHandler
    ) -> CoreSchema:
        """Schema by which pydantic reads and writes the value."""
        schema = handler(source)
        schema["strict"] = True  # type: ignore[typeddict-unknown-key] - any scalar's has it
        return schema


@dataclass(frozen=True)
class XYZ:
    """A float64 array of shape (3,) as `{"x": …, "y": …, "z": …}`; NaN is null."""

    def __get_pydantic_core_schema__(
        self, source: object, handler: GetCoreSchemaHandler
    ) -> CoreSchema:
        """Schema by which pydantic reads and writes the array."""
        from pydantic_core import core_schema  # noqa: PLC0415 - slow to load

        del source
        number = handler.generate_schema(float | None)
        axes = core_schema.typed_dict_schema(
            {axis: core_schema.typed_dict_field(number, required=True) for axis in _AXES}
        )
        written = core_schema.plain_serializer_function_ser_schema(_xyz, return_schema=axes)
        return core_schema.no_info_after_validator_function(_vector, axes, serialization=written)


@dataclass(frozen=True)
class NestedLists:
    """An array of rows and columns as a list of lists; NaN is null.

    Args:
        dtype: Number type in memory.
        columns: Number of columns; None for any.
        longest: Most rows, and most elements.
    """

    dtype: type[np.generic]
    columns: int | None = None
    longest: int = 100_000

    def __get_pydantic_core_schema__(
        self, source: object, handler: GetCoreSchemaHandler
    ) -> CoreSchema:
        """Schema by which pydantic reads and writes the array."""
        from pydantic_core import core_schema  # noqa: PLC0415 - slow to load

        del source
        whole = issubclass(self.dtype, np.integer)
        number = handler.generate_schema(int if whole else float | None)
        row = core_schema.list_schema(
            number, min_length=self.columns, max_length=self.columns or self.longest
        )
        lists = core_schema.list_schema(row, max_length=self.longest)
        written = core_schema.plain_serializer_function_ser_schema(
            np.ndarray.tolist, return_schema=lists
        )
        return core_schema.no_info_after_validator_function(
            self._array, lists, serialization=written
        )

    def _array(self, value: list[Any]) -> Array:
        try:
            # A list of lists of different lengths, and a number outside of the type's range, raise.
            array = np.array(value, np.float64 if self.dtype is np.float32 else self.dtype)
        except OverflowError as error:
            raise ValueError(str(error)) from None
        if array.size > self.longest:
            raise ValueError(f"an array of {array.size} numbers; at most {self.longest}")
        # Without rows, JSON does not tell the length of one.
        shape = (len(value), self.columns) if self.columns else array.shape
        return array.astype(self.dtype, copy=False).reshape(shape)


def _nan_of_null(value: object) -> object:
    return math.nan if value is None else value


def _xyz(vector: Array) -> dict[str, float]:
    return dict(zip(_AXES, map(float, vector), strict=True))


def _vector(value: dict[str, float | None]) -> Array:
    return np.array([math.nan if value[axis] is None else value[axis] for axis in _AXES])

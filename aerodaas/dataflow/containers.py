"""The containers that an application holds: one item, or a list of them."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from typing import TypeVar, overload

from aerodaas.dataflow.interfaces import IAeroData
from aerodaas.dataflow.names import PaperNames

__all__ = ["AeroData", "AeroListData"]

E = TypeVar("E")


class AeroData(PaperNames, IAeroData[E]):
    """One item of type E that the application can read and replace."""

    def __init__(self, data: E) -> None:
        """Hold `data`."""
        self._data = data

    @property
    def data(self) -> E:
        """The item held."""
        return self._data

    def get_data(self) -> E:
        """Return the item held."""
        return self._data

    def set_data(self, data: E) -> None:
        """Replace the item held."""
        self._data = data


class AeroListData(AeroData[list[E]], Sequence[E]):
    """A list of items, such as waypoints, that is itself an `AeroData`."""

    def __init__(self, data: Iterable[E] = ()) -> None:
        """Hold the items of `data`, in order."""
        super().__init__(list(data))

    @overload
    def __getitem__(self, index: int) -> E: ...
    @overload
    def __getitem__(self, index: slice) -> list[E]: ...
    def __getitem__(self, index: int | slice) -> E | list[E]:
        """Item or slice, as a list gives it."""
        return self._data[index]

    def __len__(self) -> int:
        """Count the items."""
        return len(self._data)

    def __iter__(self) -> Iterator[E]:
        """Iterate over the items in order."""
        return iter(self._data)

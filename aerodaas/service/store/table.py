"""Rows of one table as values of one class."""

from __future__ import annotations

import dataclasses
from collections.abc import Callable, Iterable, Sequence
from typing import Any, ClassVar, Generic, TypeVar

from sqlalchemy import ColumnElement, Table, select, update

from aerodaas.service.errors import RefusedError
from aerodaas.service.store.database import Database

__all__ = ["Rows"]

Row = TypeVar("Row")


class Rows(Generic[Row]):
    """Keeps values of one dataclass in the table with a column for each of its fields."""

    _table: ClassVar[Table]
    _kind: ClassVar[type]
    _what: ClassVar[str]

    def __init__(self, database: Database) -> None:
        """Keep in an open database."""
        self._database = database
        (self._key,) = self._table.primary_key.columns

    def add(self, row: Row) -> None:
        """Keep a new row.

        Raises:
            RefusedError: With status 409, if there is one of the same key.
            StoreError: If the database does not take it.
        """
        values = self._values(row)
        with self._database.writing() as connection:
            statement = self._database.insert(self._table).values(values)
            new = statement.on_conflict_do_nothing().returning(self._key)
            if connection.execute(new).one_or_none() is None:
                raise RefusedError(409, f"there is a {self._what} {values[self._key.name]} already")

    def put(self, *rows: Row) -> None:
        """Keep all of these in one transaction, each in place of the one of the same key.

        Raises:
            StoreError: If the database does not take them; then none of them is kept.
        """
        new = self._database.insert(self._table)
        statement = new.on_conflict_do_update(index_elements=[self._key], set_=dict(new.excluded))
        with self._database.writing() as connection:
            if rows:
                connection.execute(statement, [self._values(row) for row in rows])

    def get(self, key: str) -> Row | None:
        """The row of a key; None if there is none."""
        return next(iter(self._select(self._key == key, limit=1)), None)

    def demand(self, key: str) -> Row:
        """The row of a key.

        Raises:
            RefusedError: With status 404, if there is none.
            StoreError: If the database does not answer.
        """
        row = self.get(key)
        if row is None:
            raise RefusedError(404, f"there is no {self._what} {key}")
        return row

    def update(self, key: str, change: Callable[[Row], Row]) -> Row:
        """Change a row in one transaction, in which nobody else can change it.

        Args:
            key: The row's key.
            change: Returns the changed row, or the given one for no change. What it raises
                leaves the row as it was, and is raised. It must not use the store.

        Returns:
            The row as it is now.

        Raises:
            RefusedError: With status 404, if there is none.
            StoreError: If the database does not take the change.
        """
        chosen = self._key == key
        with self._database.writing() as connection:
            found = connection.execute(
                select(self._table).where(chosen).with_for_update()
            ).one_or_none()
            if found is None:
                raise RefusedError(404, f"there is no {self._what} {key}")
            row = self._row(found)
            changed = change(row)
            if changed != row:
                connection.execute(update(self._table).where(chosen).values(self._values(changed)))
            return changed

    def _select(
        self,
        *conditions: ColumnElement[bool],
        order: Iterable[ColumnElement[Any]] = (),
        limit: int | None = None,
    ) -> list[Row]:
        statement = select(self._table).where(*conditions).order_by(*order, self._key).limit(limit)
        with self._database.reading() as connection:
            return [self._row(found) for found in connection.execute(statement)]

    def _row(self, found: Sequence[Any]) -> Row:
        row: Row = self._kind(*found)
        return row

    def _values(self, row: Row) -> dict[str, Any]:
        fields = dataclasses.fields(self._kind)
        return {field.name: getattr(row, field.name) for field in fields}

"""Commands whose modules are imported when they are called: a list of all imports none of them."""

from __future__ import annotations

from functools import cached_property
from importlib import import_module
from typing import Any

import typer
import typer.main
from typer.core import TyperCommand, TyperGroup

from aerodaas.cli.options import ExampleGroup

__all__ = ["DeferredCommand"]


class DeferredCommand(TyperCommand):
    """A command of which the list of all tells name and summary."""

    name: str

    def __init__(
        self, name: str, place: str, summary: str, *, panel: str | None = None, words: bool = False
    ) -> None:
        """Name the command.

        Args:
            name: The word by which it is called.
            place: `module:attribute` of its function, or of a Typer application of several.
            summary: The first sentence of its help.
            panel: Title above it in the list; None for the list's own.
            words: Whether words after `--` are an application's own; a misspelt option is none.
        """
        super().__init__(name, help=summary, rich_help_panel=panel)
        self._place = place
        self._settings = {"allow_extra_args": True} if words else {}

    @cached_property
    def loaded(self) -> TyperCommand | TyperGroup:
        """The command itself, with its whole help and its parameters."""
        module, _, attribute = self._place.partition(":")
        found = getattr(import_module(module), attribute)
        holder = typer.Typer(cls=ExampleGroup, rich_markup_mode="markdown")
        if isinstance(found, typer.Typer):
            holder.add_typer(found, name=self.name)
        else:
            holder.command(self.name, context_settings=self._settings)(found)
        (command,) = typer.main.get_group(holder).commands.values()
        assert isinstance(command, TyperCommand | TyperGroup)  # noqa: S101 - made by Typer
        return command

    def make_context(
        self,
        info_name: str | None,
        args: list[str],
        parent: Any = None,  # noqa: ANN401 - Click's, which Typer has of its own since 0.17
        **extra: Any,  # noqa: ANN401 - as above
    ) -> Any:  # noqa: ANN401 - as above
        """Begin a call of the command itself."""
        return self.loaded.make_context(info_name, args, parent, **extra)

"""Commands whose modules are imported when they are called: a list of all imports none of them."""

from __future__ import annotations

from collections.abc import Callable
from functools import cached_property
from typing import Any

import typer
import typer.main
from typer.core import TyperCommand, TyperGroup

from aerodaas.cli.options import ExampleGroup
from aerodaas.config.extensions import Command, imported

__all__ = ["DeferredCommand", "deferred_group"]


class DeferredCommand(TyperCommand):
    """A command of which the list of all tells name and summary."""

    name: str

    def __init__(self, command: Command) -> None:
        """List `command`; its module is imported when it is called."""
        super().__init__(command.name, help=command.summary, rich_help_panel=command.panel)
        self._place = command.place
        self._settings = {"allow_extra_args": True} if command.words else {}

    @cached_property
    def loaded(self) -> TyperCommand | TyperGroup:
        """The command itself, with its whole help and its parameters."""
        found = imported(self._place)
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


def deferred_group(commands: Callable[[], tuple[Command, ...]]) -> type[ExampleGroup]:
    """Class of a group of commands whose modules are imported when they are called.

    Args:
        commands: Gives the commands in the order in which help lists them, after those that the
            group has besides.
    """

    class Group(ExampleGroup):
        """A group of deferred commands."""

        def __init__(self, **settings: Any) -> None:  # noqa: ANN401 - Typer's
            deferred = {one.name: DeferredCommand(one) for one in commands()}
            settings["commands"] = {**(settings.get("commands") or {}), **deferred}
            super().__init__(**settings)

    return Group

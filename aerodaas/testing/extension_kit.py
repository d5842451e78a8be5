"""Checks an extension by the rules of `aerodaas.config.extensions`.

In the extension's own tests::

    from aerodaas.testing.extension_kit import check_extension

    def test_the_extension_keeps_the_rules():
        check_extension(EXTENSION)
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import get_args

from aerodaas.cli.app import commands
from aerodaas.cli.recordings.export import formats
from aerodaas.config.extensions import Command, Extension, Hook, imported
from aerodaas.config.plugins import is_built_in
from aerodaas.errors import ConfigError

__all__ = ["check_extension"]


def check_extension(extension: Extension) -> None:
    """Check that all that an extension names can be imported, and that no name is the core's.

    Raises:
        ConfigError: With the first rule that the extension breaks.
    """
    if not extension.name.isidentifier():
        raise ConfigError(f"an extension's name is an identifier, not {extension.name!r}")
    if not extension.summary.endswith("."):
        raise ConfigError(f"{extension.name}: the summary is a sentence, and ends with a full stop")
    for place in _places(extension):
        _require(place, extension)
    for kind, plugins in extension.plugins.items():
        for name, place in plugins.items():
            if is_built_in(kind, name) and not place.startswith("aerodaas."):
                raise ConfigError(f"{extension.name}: {name!r} is one of the project's own {kind}")
    _check_words(extension, "command", extension.commands, commands())
    _check_words(extension, "format of export", extension.exports, formats())


def _require(place: str, extension: Extension) -> None:
    try:
        imported(place)
    except (ImportError, AttributeError, ValueError) as error:
        raise ConfigError(f"{extension.name}: {place!r} cannot be imported: {error}") from error


def _places(extension: Extension) -> Iterator[str]:
    """Every `module:attribute` that an extension names."""
    for plugins in extension.plugins.values():
        yield from plugins.values()
    for command in (*extension.commands, *extension.exports, *extension.lab):
        yield command.place
    for kind in extension.vehicles:
        yield from [kind.find] if kind.find else []
    for view in extension.views:
        yield from (view.prepare, view.open)
    yield from extension.settings.values()
    yield from extension.elevation_formats.values()
    for hook in get_args(Hook):
        yield from getattr(extension, hook)
    yield from extension.services.values()
    yield from extension.decoders.values()


def _check_words(
    extension: Extension, what: str, added: tuple[Command, ...], known: tuple[Command, ...]
) -> None:
    places = {command.name: command.place for command in known}
    for command in added:
        if places.get(command.name, command.place) != command.place:
            raise ConfigError(f"{extension.name}: there is a {what} {command.name!r} already")

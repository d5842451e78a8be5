"""Examples in a command's help can be copied: each stands on a line of its own."""

from __future__ import annotations

from collections.abc import Iterator

import pytest
import typer.main
from rich.console import Console
from rich.markdown import Markdown
from typer.core import TyperCommand, TyperGroup
from typer.testing import CliRunner

from aerodaas.cli.app import app
from aerodaas.cli.app import commands as all_commands
from aerodaas.cli.deferred import DeferredCommand
from aerodaas.config.extensions import Command


def commands(group: TyperGroup, name: str) -> Iterator[tuple[str, TyperCommand | TyperGroup]]:
    """All commands of a group and of those within it, by their words."""
    for word, one in group.commands.items():
        one = one.loaded if isinstance(one, DeferredCommand) else one  # noqa: PLW2901
        assert isinstance(one, TyperCommand | TyperGroup)
        yield f"{name} {word}", one
        if isinstance(one, TyperGroup):
            yield from commands(one, f"{name} {word}")


ROOT = typer.main.get_command(app)
assert isinstance(ROOT, TyperGroup)
ALL = dict(commands(ROOT, "aerodaas"))


@pytest.mark.parametrize("name", ALL)
def test_each_example_has_its_line(name: str) -> None:
    """As in the docstring, where a terminal is wide enough."""
    text = ALL[name].help or ""
    console = Console(width=200)
    with console.capture() as capture:
        console.print(Markdown(text))
    shown = [line.strip() for line in capture.get().splitlines()]
    block = text.partition("```text\n")[2].partition("\n```")[0]
    for example in block.splitlines():
        assert example.strip() in shown


@pytest.mark.parametrize("command", all_commands(), ids=lambda command: command.name)
def test_the_list_tells_the_first_sentence_of_each_help(command: Command) -> None:
    """The list of all commands, which loads none of them, says the same as the command itself."""
    first, _, _ = (DeferredCommand(command).loaded.help or "").partition("\n\n")
    assert command.summary == first.replace("\n", " ").partition(" ```text")[0]


def test_there_are_examples() -> None:
    """Three commands in four teach by one; the others are words like `pause`."""
    taught = [name for name, one in ALL.items() if "```text" in (one.help or "")]
    assert len(taught) >= 0.75 * len(ALL), sorted(set(ALL) - set(taught))


@pytest.mark.parametrize("group", ["cluster", "sim"])
def test_a_group_shows_its_examples_as_they_are(group: str) -> None:
    """A group is a command of another one, and its help is made ready once."""
    shown = CliRunner().invoke(app, [group, "--help"]).output
    assert "`" not in shown
    assert f"  aerodaas {group} " in shown

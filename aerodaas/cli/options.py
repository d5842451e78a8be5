"""Options that several commands share, and examples in their help."""

from __future__ import annotations

import re
from pathlib import Path
from typing import Annotated, Any, TypeAlias

import typer
from typer.core import TyperGroup

__all__ = ["ENVIRONMENT", "EnvironmentFile", "ExampleGroup", "OtherEnvironment", "Overrides"]

ENVIRONMENT = Path("environment.json")
"""The environment file where none is named."""

EnvironmentFile: TypeAlias = Annotated[Path, typer.Option(help="The environment file.")]
OtherEnvironment: TypeAlias = Annotated[
    Path | None, typer.Option(help="Environment file instead of the application's own.")
]
Overrides: TypeAlias = Annotated[
    list[str] | None,
    typer.Option("--set", help="Lay `id.setting=value` over the environment file."),
]


_BLOCK = re.compile(r"(?:^(?: {4}|aerodaas ).*(?:\n|$))+", re.MULTILINE)
"""Examples of a docstring: lines indented by four, or commands where it is nothing but these, for
then their indentation is everybody's and gone."""

_FENCE = "```text\n"


class ExampleGroup(TyperGroup):
    """A group whose commands' examples are code blocks.

    Typer takes the indentation of a docstring's rest away where each of its lines but the first is
    indented, and Markdown then joins them to one paragraph. A fence has no indentation to lose.
    """

    def __init__(self, **settings: Any) -> None:  # noqa: ANN401 - Typer's
        super().__init__(**settings)
        for one in (self, *self.commands.values()):
            one.help = _fenced(one.help or "")


def _fenced(text: str) -> str:
    if _FENCE in text:
        return text  # a group has been through its own hands before its parent's
    return _BLOCK.sub(lambda found: f"{_FENCE}{_dedented(found[0])}\n```\n", text)


def _dedented(block: str) -> str:
    return "\n".join(line.removeprefix("    ") for line in block.rstrip("\n").split("\n"))

"""Options that several commands share."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, TypeAlias

import typer

__all__ = ["ENVIRONMENT", "EnvironmentFile", "OtherEnvironment", "Overrides"]

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

"""Targets by name, with their seeds and corpus."""

from __future__ import annotations

import importlib
import pkgutil
import random
from collections.abc import Callable, Iterable
from dataclasses import dataclass
from pathlib import Path

from aerodaas.errors import UnknownIdError

__all__ = ["CORPUS", "Target", "load_target", "target_names"]

CORPUS = Path(__file__).resolve().parents[2] / "tests" / "fuzz" / "corpus"
"""One folder of inputs for each target."""
_PACKAGE = "tools.fuzz.targets"


@dataclass(frozen=True)
class Target:
    """Code under test: what it is fed with, and how."""

    name: str
    seeds: Callable[[], Iterable[bytes]]
    run: Callable[[bytes], None]
    mutate: Callable[[bytes, random.Random], bytes] | None = None

    def pool(self) -> list[bytes]:
        """Seeds and corpus, each input once."""
        folder = CORPUS / self.name
        files = sorted(folder.iterdir()) if folder.is_dir() else []
        return list(dict.fromkeys([*self.seeds(), *(file.read_bytes() for file in files)]))


def target_names() -> list[str]:
    """Names of all targets of the project."""
    folder = Path(__file__).parent / "targets"
    return sorted(found.name for found in pkgutil.iter_modules([str(folder)]))


def load_target(name: str) -> Target:
    """Import a target by its name, or by the dotted path of a module elsewhere.

    Raises:
        UnknownIdError: If no target has this name.
    """
    if "." not in name and name not in target_names():
        raise UnknownIdError("fuzzing target", name, target_names())
    module = importlib.import_module(name if "." in name else f"{_PACKAGE}.{name}")
    return Target(
        name.rpartition(".")[2], module.seeds, module.run, getattr(module, "mutate", None)
    )

"""A Containerfile as stages of instructions: the part of its language that ours uses.

The reference is https://docs.docker.com/reference/dockerfile/.
"""

from __future__ import annotations

import json
import re
from dataclasses import dataclass, field
from pathlib import Path
from typing import NamedTuple

__all__ = ["Instruction", "Stage", "expanded", "read"]

_VARIABLE = re.compile(r"\$(?:\{(\w+)\}|(\w+))")


class Instruction(NamedTuple):
    """One instruction."""

    name: str
    """Such as `RUN`."""
    words: str
    """What follows, its lines joined."""

    def listed(self) -> list[str]:
        """The words of the JSON form, as in `CMD ["a", "b"]`; raises ValueError for another."""
        found = json.loads(self.words)
        if not isinstance(found, list):
            raise ValueError(f"{self.name} {self.words} is no list")  # noqa: TRY004 - of a file
        return [str(word) for word in found]


@dataclass(frozen=True, slots=True)
class Stage:
    """The instructions from one `FROM` to the next."""

    base: str
    name: str
    """Empty without `AS`."""
    instructions: list[Instruction] = field(default_factory=list)

    def of(self, name: str) -> list[Instruction]:
        """The instructions of one name, in order."""
        return [one for one in self.instructions if one.name == name]


def read(path: Path) -> tuple[dict[str, str], list[Stage]]:
    """Read a Containerfile.

    Returns:
        The arguments before the first `FROM`, with their defaults, and the stages; bases with the
        defaults filled in.
    """
    arguments: dict[str, str] = {}
    stages: list[Stage] = []
    for instruction in _instructions(path.read_text(encoding="utf-8")):
        if instruction.name == "FROM":
            base, _, name = expanded(instruction.words, arguments).partition(" AS ")
            stages.append(Stage(base, name))
        elif stages:
            stages[-1].instructions.append(instruction)
        else:
            name, _, default = instruction.words.partition("=")
            arguments[name] = default
    return arguments, stages


def expanded(text: str, variables: dict[str, str]) -> str:
    """A text with `$NAME` and `${NAME}` filled in; unknown ones stay."""
    return _VARIABLE.sub(lambda found: variables.get(found[1] or found[2], found[0]), text)


def _instructions(text: str) -> list[Instruction]:
    found = []
    whole = ""
    for line in text.splitlines():
        # A comment may stand between the lines of an instruction, too.
        if line.lstrip().startswith("#"):
            continue
        whole += line.removesuffix("\\")
        if not line.endswith("\\") and whole.strip():
            name, _, words = whole.strip().partition(" ")
            found.append(Instruction(name, words.strip()))
            whole = ""
    return found

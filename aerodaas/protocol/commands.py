"""Commands to a flying robot by the word that the wire has for each."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Literal, TypeAlias

from aerodaas.mission.commands import (
    ClearNavigation,
    Command,
    End,
    Pause,
    Resume,
    ReturnHome,
)

__all__ = ["COMMANDS", "CommandWord", "word_for"]

CommandWord: TypeAlias = Literal["pause", "resume", "clear", "return-home", "land"]

COMMANDS: Mapping[CommandWord, Command] = {
    "pause": Pause(),
    "resume": Resume(),
    "clear": ClearNavigation(),
    "return-home": ReturnHome("its user asked to return"),
    "land": End("its user asked to land"),
}


def word_for(command: Command) -> CommandWord | None:
    """The word for a command; None for one that the wire has no word for."""
    return next((word for word, one in COMMANDS.items() if type(one) is type(command)), None)

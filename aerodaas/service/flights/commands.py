"""Commands that a user or an operator can give to a flying robot."""

from __future__ import annotations

from collections.abc import Mapping

from aerodaas.mission.commands import (
    ClearNavigation,
    Command,
    End,
    Pause,
    Resume,
    ReturnHome,
)

__all__ = ["COMMANDS"]

COMMANDS: Mapping[str, Command] = {
    "pause": Pause(),
    "resume": Resume(),
    "clear": ClearNavigation(),
    "return-home": ReturnHome("its user asked to return"),
    "land": End("its user asked to land"),
}
"""By the name in a request."""

"""Place of a part of a run."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

__all__ = ["Placement"]


@dataclass(frozen=True)
class Placement:
    """Kind of node, or the node, on which to place an actor."""

    kind: Literal["edge", "cloud"] = "edge"
    node: str | None = None
    """Address, name or id of one node, if the kind alone is ambiguous."""

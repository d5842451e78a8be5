"""The document of a guest: its dataflow as data, which its owner checks and then flies."""

from __future__ import annotations

from typing import Annotated, Any, Literal

from pydantic import BaseModel, ConfigDict, Field, ValidationError

from aerodaas.config.checked import explained
from aerodaas.errors import GraphError
from aerodaas.identifiers import ScopedWord

__all__ = ["GuestDocument", "GuestNavigation", "GuestNode", "GuestTrigger", "read_document"]

_MOST = 64
_MOST_WAYPOINTS = 10_000


class _Strict(BaseModel):
    model_config = ConfigDict(extra="forbid", frozen=True, strict=True)


class GuestTrigger(_Strict):
    """A trigger of an analysis: wakes another one, or calls a robot's method."""

    target: ScopedWord
    method: Literal["end_mission", "pause_mission", "resume_mission"] | None = None


class GuestNode(_Strict):
    """One analysis of a guest."""

    id: ScopedWord
    robot: ScopedWord | None = None
    inputs: list[ScopedWord] = Field(default_factory=list, max_length=_MOST)
    """Sensors by full id, and the guest's own analyses."""
    external: bool = False
    rate: Annotated[float, Field(gt=0, le=1000, allow_inf_nan=False)] = 1.0
    """Hz of an external one."""
    compute: ScopedWord | None = None
    navigation: bool = False
    """Whether its results are navigation."""
    scheduled: bool = False
    dormant: bool = False
    triggers: list[GuestTrigger] = Field(default_factory=list, max_length=_MOST)


class GuestNavigation(_Strict):
    """Navigation of a robot by a guest: waypoints, or the stream of one of its analyses."""

    robot: ScopedWord
    stream: ScopedWord | None = None
    waypoints: list[Any] = Field(default_factory=list, max_length=_MOST_WAYPOINTS)
    """As `items.encoded` writes them."""
    ordered: bool = True
    priority: Annotated[int, Field(ge=0, le=1000)] | None = None
    index: Annotated[int, Field(ge=0, le=_MOST_WAYPOINTS)] | None = None
    deadline: Annotated[float, Field(gt=0, allow_inf_nan=False)] | None = None
    clear_on: ScopedWord | None = None


class GuestDocument(_Strict):
    """The dataflow of a guest, version 1."""

    version: Literal[1]
    nodes: list[GuestNode] = Field(max_length=_MOST)
    navigation: list[GuestNavigation] = Field(default_factory=list, max_length=_MOST)


def read_document(content: object) -> GuestDocument:
    """Check a document that a guest sent; raises GraphError that names the place."""
    try:
        return GuestDocument.model_validate(content)
    except ValidationError as error:
        raise GraphError(
            f"its document: {explained(error, GuestDocument, content)[:500]}"
        ) from None

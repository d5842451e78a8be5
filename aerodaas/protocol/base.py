"""Bases and bounded numbers of the JSON models that the service and its clients exchange."""

from __future__ import annotations

from typing import Annotated

from pydantic import BaseModel, ConfigDict, Field

from aerodaas.messages.waypoints import LARGEST

__all__ = ["AnswerModel", "Area", "Minutes", "Number", "Positive", "RequestModel"]

Number = Annotated[float, Field(ge=-LARGEST, le=LARGEST, allow_inf_nan=False)]
Positive = Annotated[float, Field(gt=0, le=LARGEST, allow_inf_nan=False)]
Area = Annotated[list[tuple[Number, Number]], Field(min_length=3, max_length=100)]
"""A polygon's corners (east, north) in metres of the provider's local frame."""
Minutes = Annotated[float, Field(gt=0, le=24 * 60)]
"""Length of a lease, at most a day."""


class RequestModel(BaseModel):
    """Base of requests: unknown keys are errors."""

    model_config = ConfigDict(extra="forbid", frozen=True)


class AnswerModel(BaseModel):
    """Base of answers; a stored row becomes one by its attributes of the same names."""

    model_config = ConfigDict(frozen=True, from_attributes=True)

"""Bases of what is said over the wire."""

from __future__ import annotations

from pydantic import BaseModel, ConfigDict

__all__ = ["AnswerModel", "RequestModel"]


class RequestModel(BaseModel):
    """Base of requests: unknown keys are errors."""

    model_config = ConfigDict(extra="forbid", frozen=True)


class AnswerModel(BaseModel):
    """Base of answers."""

    model_config = ConfigDict(frozen=True)

"""What a provider's service alone tells the process of a flight."""

from __future__ import annotations

from typing import Annotated

from pydantic import Field

from aerodaas.protocol.bases import RequestModel

__all__ = ["FlightLeaseIn"]


class FlightLeaseIn(RequestModel):
    """State of the lease that a flight is flown under."""

    ends: Annotated[float, Field(allow_inf_nan=False)] | None = None
    """Unix seconds of its end; None once it has ended."""
    reason: str = ""
    """Why it has ended."""

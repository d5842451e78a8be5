"""How far a drone keeps from other aircraft, and what it does when one comes."""

from __future__ import annotations

from typing import Annotated, Literal

from pydantic import Field

from aerodaas.config.checked import Positive, Strict

__all__ = ["TrafficConfig", "TrafficLimits"]


class TrafficConfig(Strict):
    """Other aircraft, as the vehicle hears them (ADS-B), and what they mean in flight."""

    action: Literal["ignore", "warn", "hold", "return", "land"] = "warn"
    """When one comes too near: nothing; people are told; the drone holds until it is gone; comes
    home; or lands where it is. With the latter three it also keeps away, as from other drones, and
    does not take off."""
    distance: Positive = 500.0
    """Metres along the ground."""
    height: Positive = 150.0
    """Metres above and below; one whose height is not known is at every height."""
    lookahead: Annotated[float, Field(ge=2, le=300)] = 20.0
    """Seconds ahead for which its way and the drone's are judged."""
    own_address: Annotated[str, Field(pattern=r"^[0-9A-Fa-f]{6}$")] | None = None
    """24-bit address (six hexadecimal digits) of the drone's own transponder, whose echo is no
    traffic."""


class TrafficLimits(Strict):
    """How far a drone keeps from other aircraft."""

    traffic: TrafficConfig = TrafficConfig()
    """Other aircraft, as the vehicle hears them, and what they mean in flight."""

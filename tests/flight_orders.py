"""Orders of flights, as a provider's service writes them."""

from __future__ import annotations

import time
from pathlib import Path

from aerodaas.service.flights.orders import FlightOrder

__all__ = ["order_in"]


def order_in(folder: Path, **changes: object) -> FlightOrder:
    """An order for drone `one` of the fleet in `folder`, under a lease of a minute."""
    usual = {
        "mission": "m",
        "lease": "l",
        "fleet": folder / "fleet.json",
        "robots": ["one"],
        "locks": folder / "locks",
        "ends": time.time() + 60,
        "minutes": 1,
    }
    return FlightOrder.model_validate({**usual, **changes})

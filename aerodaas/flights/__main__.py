"""`python -m aerodaas.flights FOLDER`: fly the order in a folder, or rehearse it."""

from __future__ import annotations

import sys
from pathlib import Path

from aerodaas.service.flights.folder import FlightFolder, end_with_starter
from aerodaas.service.flights.orders import FlightOrder


def main() -> None:
    """Fly or rehearse."""
    path = Path(sys.argv[1])
    if FlightOrder.read(FlightFolder(path).order).rehearsal:
        end_with_starter()
        from aerodaas.flights.rehearsal import rehearse  # noqa: PLC0415 - loads the simulator

        rehearse(path)
        return
    from aerodaas.flights.process import fly  # noqa: PLC0415 - the simulator's and Ray's

    fly(path)


if __name__ == "__main__":
    main()

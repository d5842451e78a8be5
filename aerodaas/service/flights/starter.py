"""Start of a flight's process, detached from the service."""

from __future__ import annotations

import os
import subprocess
import sys

from aerodaas.config.secrets import MAVLINK_KEY
from aerodaas.service.flights.folder import FlightFolder

__all__ = ["service_free_environment", "start_process"]

_KEPT_OUT = "AERODAAS_"
"""Variables of the service itself, which hold its tokens."""


def service_free_environment(*, vehicles: bool) -> dict[str, str]:
    """The environment's variables without the service's own.

    Those of `vehicles` stay for a process that is connected with them.
    """
    kept = {MAVLINK_KEY} if vehicles else set()
    return {
        name: value
        for name, value in os.environ.items()
        if name in kept or not name.startswith(_KEPT_OUT)
    }


def start_process(folder: FlightFolder, *, tied: bool, vehicles: bool) -> subprocess.Popen[bytes]:
    """Start the process of the order in `folder`, in a session of its own.

    A flight goes on when the service ends, and Ctrl-C at the service's terminal does not reach
    it. A rehearsal is `tied`: it ends with the service, whatever ends that (see `tie`). Only what
    is connected with `vehicles` gets their secrets.
    """
    with folder.log.open("ab") as log:
        return subprocess.Popen(  # noqa: S603 - our own module
            [sys.executable, "-m", "aerodaas.flights", str(folder.path)],
            stdin=subprocess.PIPE if tied else subprocess.DEVNULL,
            stdout=log,
            stderr=log,
            start_new_session=True,
            env=service_free_environment(vehicles=vehicles),
        )

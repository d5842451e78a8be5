"""Forwarding of all packets between the vehicle and a ground station or another program."""

from __future__ import annotations

from collections.abc import Callable

from aerodaas.drivers.mavlink.wire.transport import open_transport
from aerodaas.drivers.pin import Pin

__all__ = ["Forwarder"]


class Forwarder:
    """Forwarder of unchanged packets, signatures included.

    The other program may command the vehicle, as a ground station does; where it is waited for
    (`udpin`), the first one to send is it, and stays it.
    """

    def __init__(self, url: str, name: str, may_move: Callable[[], bool]) -> None:
        """Open `url` for robot `name`; raises ConfigError and VehicleError.

        `may_move` decides whether another program may take the first one's place.
        """
        self._wire = open_transport(url, f"{name}, forward")
        self.pin = Pin("the ground station", may_move)
        self.strangers = 0
        """Datagrams of other programs."""

    def fileno(self) -> int:
        """File descriptor to wait for."""
        return self._wire.fileno()

    def send(self, content: bytes) -> None:
        """Forward a packet of the vehicle."""
        self._wire.send(content, (self.pin.address,))

    def receive(self, now: float) -> list[bytes]:
        """Packets of the other program for the vehicle at `now` (seconds); never blocks."""
        arrived = self._wire.receive()
        admitted = [content for content, peer in arrived if self.pin.admits(peer, now)]
        self.strangers += len(arrived) - len(admitted)
        return admitted

    def close(self) -> None:
        """Stop forwarding."""
        self._wire.close()

"""Forwarding of all packets between the vehicle and a ground station or another program."""

from __future__ import annotations

from aerodaas.drivers.mavlink.wire.transport import Peer, open_transport

__all__ = ["Forwarder"]


class Forwarder:
    """Forwarder of unchanged packets, signatures included."""

    def __init__(self, url: str, name: str) -> None:
        """Open `url` for robot `name`; raises ConfigError and VehicleError."""
        self._wire = open_transport(url, f"{name}, forward")
        self._peer: Peer = None

    def fileno(self) -> int:
        """File descriptor to wait for."""
        return self._wire.fileno()

    def send(self, content: bytes) -> None:
        """Forward a packet of the vehicle."""
        self._wire.send(content, (self._peer,))

    def receive(self) -> list[bytes]:
        """Packets of the other program for the vehicle; never blocks."""
        arrived = self._wire.receive()
        if arrived:
            self._peer = arrived[-1][1]
        return [content for content, _ in arrived]

    def close(self) -> None:
        """Stop forwarding."""
        self._wire.close()

"""Video from where the vehicle says that it is: an address that is known in flight alone."""

from __future__ import annotations

import logging

import numpy as np
from numpy.typing import NDArray

from aerodaas.cameras.live import LiveSource
from aerodaas.config.secrets import SecretUrl

__all__ = ["TOLD", "VehicleAddressedSource"]

_log = logging.getLogger(__name__)

TOLD = "mavlink"
"""The `path` of a camera whose address the vehicle tells."""
_PROTOCOLS = "rtsp,rtp,srtp,tls,udp,tcp"
"""Protocols that FFmpeg may use for such an address, whatever the stream refers it to: no files."""


class VehicleAddressedSource:
    """A live source whose address comes later; the first one counts, and there is no other."""

    finished = False
    """Always False, as of a `LiveSource`."""

    def __init__(self, sensor: str) -> None:
        """Wait for the address of the camera `sensor`."""
        self._sensor = sensor
        self._source: LiveSource | None = None

    @property
    def skipped(self) -> int:
        """Number of frames that could not be decoded."""
        return 0 if self._source is None else self._source.skipped

    def follow(self, address: str) -> None:
        """Begin to read from `address`, unless one was told before."""
        if not address or self._source is not None:
            return
        secret = SecretUrl(address)
        _log.warning("%s: the vehicle says that its video is at %s", self._sensor, secret)
        self._source = LiveSource(secret, protocols=_PROTOCOLS)
        self._source.start()

    def open(self) -> None:
        """Return no frame: none can be there yet."""

    def newest(self, stamp: int) -> tuple[NDArray[np.uint8], int] | None:
        """As of a `LiveSource`; None before the address is known."""
        return None if self._source is None else self._source.newest(stamp)

    def close(self) -> None:
        """Stop decoding."""
        if self._source is not None:
            self._source.close()

"""MAVLink 2 signing: the key, which is never printed, and the accepted packets."""

from __future__ import annotations

import hashlib
import hmac
import os
import time
from pathlib import Path
from typing import Any

from aerodaas.config.secrets import MAVLINK_KEY
from aerodaas.drivers.mavlink.settings import MavlinkSettings
from aerodaas.drivers.mavlink.wire.dialect import mavlink
from aerodaas.errors import ConfigError

__all__ = ["SignedCodec", "load_key", "sign_with", "signature_fits"]

_BYTES = 32
_EPOCH = 1_420_070_400
"""1 January 2015 in seconds of the Unix epoch, where the timestamps of signatures begin."""
_TICKS = 100_000
"""Ticks of a timestamp in a second."""
_RADIO_STATUS = 109
"""Messages that radios insert themselves, without a key."""


def load_key(settings: MavlinkSettings, name: str) -> bytes | None:
    """The key of a robot, or None for unsigned flight.

    Args:
        settings: Name the file of the key, unless the variable `MAVLINK_KEY` holds it.
        name: Id of the robot, for errors.

    Raises:
        ConfigError: If the key cannot be read; the message never holds any of it.
    """
    text = os.environ.get(MAVLINK_KEY, "")
    if text:
        return _key(text.encode(), f"{name}: the variable {MAVLINK_KEY}")
    if settings.signing_key is None:
        return None
    path = settings.signing_key.get_secret_value()
    try:
        content = Path(path).read_bytes()
    except OSError as error:
        # Not named: a path that is none may be the key itself.
        raise ConfigError(
            f"{name}: cannot read the file that signing_key names: {error.strerror}"
        ) from None
    return _key(content, f"{name}: the signing key in {path}")


def _key(content: bytes, place: str) -> bytes:
    if len(content) == _BYTES:
        return content
    try:
        key = bytes.fromhex(content.decode("ascii").strip())
    except ValueError:
        key = b""
    if len(key) != _BYTES:
        raise ConfigError(f"{place} must be {_BYTES} bytes or {2 * _BYTES} hexadecimal digits")
    return key


class _Clocked(mavlink.MAVLinkSigning):  # type: ignore[misc]
    """State of signing whose timestamps are the clock's.

    pymavlink counts on from its start. Of two of our processes that talk to one vehicle, such as a
    flight and a look at the vehicle's list, the older one's packets would then be replays.
    """

    _newest = 0

    @property
    def timestamp(self) -> int:
        """Timestamp of the next signed packet: never one that was signed or received before."""
        return max(self._newest, int((time.time() - _EPOCH) * _TICKS))

    @timestamp.setter
    def timestamp(self, value: int) -> None:
        self._newest = value


def sign_with(mav: Any, key: bytes, vehicle: int = 0) -> None:  # noqa: ANN401 - pymavlink has no types
    """Make `mav` sign its packets, and refuse unsigned ones.

    The link id is the same in each run: until it is started again, a vehicle remembers sixteen
    streams of signed packets (MAVLINK_MAX_SIGNING_STREAMS of the C library), and drops all others.

    Args:
        mav: pymavlink's codec.
        key: 32 bytes.
        vehicle: System id of the vehicle, of which the link id is made.
    """
    mav.signing = signing = _Clocked()
    signing.secret_key = key
    signing.sign_outgoing = True
    signing.link_id = vehicle % 256
    signing.allow_unsigned_callback = _let_through


def _let_through(_: object, message_id: int) -> bool:
    return message_id == _RADIO_STATUS


def signature_fits(key: bytes, frame: bytes | bytearray) -> bool:
    """Whether the signature of a signed packet was made with `key`.

    Args:
        key: 32 bytes.
        frame: The packet with its signature.
    """
    expected = hashlib.sha256(key + bytes(frame[:-6])).digest()[:6]
    return hmac.compare_digest(expected, bytes(frame[-6:]))


class SignedCodec(mavlink.MAVLink):  # type: ignore[misc]
    """Codec that checks a packet's signature before its timestamp is used.

    pymavlink stores the timestamp first, so that one forged packet from the future would lock the
    true sender out.
    """

    @property
    def refused(self) -> int:
        """Whole packets that were unsigned, wrongly signed or replayed."""
        return int(self.signing.reject_count)

    def check_signature(self, msgbuf: bytearray, srcSystem: int, srcComponent: int) -> bool:  # noqa: N803 - pymavlink's names
        """Check the signature, then whether its timestamp is newer than all before.

        Args:
            msgbuf: The packet with its signature.
            srcSystem: System id of its sender.
            srcComponent: Component id of its sender.
        """
        if not signature_fits(self.signing.secret_key, msgbuf):
            return False
        return bool(super().check_signature(msgbuf, srcSystem, srcComponent))

"""The token of a request."""

from __future__ import annotations

from collections.abc import Mapping

__all__ = ["SUBPROTOCOL", "bearer"]

SUBPROTOCOL = "aerodaas"
"""What a browser's WebSocket speaks; beside it, its token: a browser sets no further headers."""
_BEARER = "bearer."


def bearer(headers: Mapping[str, str]) -> str:
    """The token that a request carries, empty for none.

    In `Authorization: Bearer TOKEN`; or, of a browser's WebSocket, as the subprotocol
    `bearer.TOKEN` beside `aerodaas`, which is the one that is answered.
    """
    kind, _, token = headers.get("authorization", "").partition(" ")
    if kind.lower() == "bearer":
        return token.strip()
    offered = [one.strip() for one in headers.get("sec-websocket-protocol", "").split(",")]
    if SUBPROTOCOL not in offered:
        return ""
    return next((one[len(_BEARER) :] for one in offered if one.startswith(_BEARER)), "")

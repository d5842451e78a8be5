"""The cloud's executor: runs analyses on frames that come as references, several at once."""

from __future__ import annotations

from typing import Any

from aerodaas.actors.streams import decode_message, encode_message
from aerodaas.analytics.base import Analytics, ComputeKind
from aerodaas.data import Alert
from aerodaas.status import Message
from aerodaas.vehicle import VehicleState

__all__ = ["CloudExecutor"]


class CloudExecutor:
    """Holds the analyses of `prepare`; Ray runs as many `execute` at once as it was told."""

    def prepare(self, analyses: dict[str, Analytics[Any]]) -> None:
        """Open the analyses, by stream."""
        self._analyses = analyses
        for analysis in analyses.values():
            analysis.open()

    def execute(self, stream: str, data: bytes) -> bytes:
        """Analyse the item of an encoded message; returns the message with the result in it."""
        message = decode_message(memoryview(data))
        context = _Context(message.header.stamp)
        result = self._analyses[stream].process(message.item, context)
        fields = (message.stream, message.seq, message.stamp, message.header, message.captured)
        return encode_message(Message(*fields, message.hops, result))


class _Context:
    """What an analysis may ask of the cloud: the time of its item, and nobody to alert."""

    kind: ComputeKind = "cloud"

    def __init__(self, stamp: int) -> None:
        self._stamp = stamp

    def now(self) -> int:
        return self._stamp

    def vehicle(self) -> VehicleState | None:
        return None

    def alert(self, alert: Alert) -> None:
        raise NotImplementedError(f"an analysis in the cloud cannot alert: {alert.text}")

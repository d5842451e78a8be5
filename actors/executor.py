"""The cloud's executor: runs analyses on frames that come as references, several at once."""

from __future__ import annotations

from typing import Any

from aerodaas.actors.streams import decode_message, encode_message
from aerodaas.analytics.base import Analytics, ComputeKind
from aerodaas.clock import host_time_ns
from aerodaas.data import Alert
from aerodaas.errors import AeroDaaSError
from aerodaas.status import Hop, Message
from aerodaas.vehicle import VehicleState

__all__ = ["CloudExecutor", "UnpreparedError"]


class UnpreparedError(AeroDaaSError):
    """An executor that Ray has restarted holds no analyses yet."""


class CloudExecutor:
    """Holds the analyses of `prepare`; Ray runs as many `execute` at once as it was told."""

    def __init__(self) -> None:
        """Hold nothing yet: the analyses would be kept for restarts."""
        self._analyses: dict[str, Analytics[Any]] = {}

    def prepare(self, analyses: dict[str, Analytics[Any]]) -> None:
        """Open the analyses, by stream."""
        for analysis in analyses.values():
            analysis.open()
        self._analyses = analyses

    def ready(self) -> bool:
        """Whether it is prepared; one that Ray has restarted is not."""
        return bool(self._analyses)

    def execute(self, stream: str, data: bytes) -> bytes:
        """Analyse the item of an encoded message; returns the message with the result in it."""
        if not self._analyses:
            raise UnpreparedError("the executor in the cloud was restarted")
        received = host_time_ns()
        message = decode_message(memoryview(data))
        context = _Context(message.header.stamp)
        result = self._analyses[stream].process(message.item, context)
        fields = (message.stream, message.seq, message.stamp, message.header, message.captured)
        hops = (*message.hops, Hop(stream, received, host_time_ns()))
        return encode_message(Message(*fields, hops, result))


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

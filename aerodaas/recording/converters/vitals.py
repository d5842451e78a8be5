"""Converter of the vitals of the run's processes, one channel per process."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

from aerodaas.clock import seconds
from aerodaas.messages.envelope import Message
from aerodaas.messages.vitals import Vitals
from aerodaas.recording.converters.base import Session, convert
from aerodaas.recording.encoding import Entry, json_bytes, json_schema

__all__: list[str] = []

VITALS = json_schema(
    "Vitals",
    stamp="integer",
    actor="string",
    machine="string",
    cpu_cores="number",
    cpu_seconds="number",
    memory_mb="number",
    machine_cpu="number",
    machine_memory="number",
    gpus={"type": "array", "items": {"type": "object"}},
)


@convert.register
def vitals(item: Vitals, message: Message[Any], session: Session) -> Iterator[Entry]:
    """Write a reading, with the number of cores in use since the last one."""
    actor, _, machine = message.header.source.partition("@")
    key = ("vitals", actor)
    before: Vitals | None = session.last.get(key)
    session.last[key] = item
    took = seconds(item.taken - before.taken) if before else 0.0
    used = item.cpu_seconds - before.cpu_seconds if before else 0.0
    value = {
        "stamp": message.stamp,
        "actor": actor,
        "machine": machine,
        "cpu_seconds": item.cpu_seconds,
        "memory_mb": item.memory / 1e6,
        "machine_cpu": item.machine_cpu,
        "machine_memory": item.machine_memory,
        "gpus": [{"busy": gpu.busy, "memory": gpu.memory} for gpu in item.gpus],
    }
    # The counter of a restarted actor starts from zero.
    if took > 0 and used >= 0:
        value["cpu_cores"] = used / took
    yield Entry("/" + message.stream, VITALS, json_bytes(value), message.stamp)

"""Streams between actors: keep-latest, counted drops, one behaviour over two transports.

Between actors of one node a message is sent in shared memory (`shared_memory.py`, iceoryx2); to
another node in a Ray call or as an ObjectRef (`remote.py`). Placement decides, transparently to
publishers and subscribers.
"""

from aerodaas.actors.streams.codec import UnreadableError
from aerodaas.actors.streams.codec import decode as decode_message
from aerodaas.actors.streams.codec import encode as encode_message
from aerodaas.actors.streams.publisher import Publisher, RemoteReader
from aerodaas.actors.streams.remote import UNDER_WAY
from aerodaas.actors.streams.shared_memory import (
    MAX_DEPTH,
    shared_memory_available,
    shared_memory_obstacle,
)
from aerodaas.actors.streams.subscriber import Subscriber

__all__ = [
    "MAX_DEPTH",
    "UNDER_WAY",
    "Publisher",
    "RemoteReader",
    "Subscriber",
    "UnreadableError",
    "decode_message",
    "encode_message",
    "shared_memory_available",
    "shared_memory_obstacle",
]

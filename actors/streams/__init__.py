"""Streams between actors: keep-latest, counted drops, one behaviour over two transports.

Between actors of one node a message is sent through a socket, a large one in shared memory
(`local_publisher.py`, `local_subscriber.py`); to another node in a Ray call or as an ObjectRef
(`remote.py`). Placement decides, transparently to publishers and subscribers.
"""

from aerodaas.actors.streams.availability import shared_memory_available, shared_memory_obstacle
from aerodaas.actors.streams.codec import UnreadableError
from aerodaas.actors.streams.codec import decode as decode_message
from aerodaas.actors.streams.codec import encode as encode_message
from aerodaas.actors.streams.local_publisher import MAX_DEPTH
from aerodaas.actors.streams.publisher import UNDER_WAY, Publisher, RemoteReader
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

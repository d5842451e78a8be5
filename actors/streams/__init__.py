"""Streams between actors: keep-latest, counted drops, one behaviour over two transports.

Between actors of one node a message travels in shared memory (`_shared.py`, iceoryx2); to
another node as a Ray ObjectRef (`_remote.py`). Placement decides; nobody else sees which.
"""

from aerodaas.actors.streams._codec import UnreadableError
from aerodaas.actors.streams._codec import decode as decode_message
from aerodaas.actors.streams._codec import encode as encode_message
from aerodaas.actors.streams._inbox import Inbox
from aerodaas.actors.streams._outlet import Outlet, RemoteReader
from aerodaas.actors.streams._remote import UNDER_WAY
from aerodaas.actors.streams._shared import MAX_DEPTH, shared_memory_available

__all__ = [
    "MAX_DEPTH",
    "UNDER_WAY",
    "Inbox",
    "Outlet",
    "RemoteReader",
    "UnreadableError",
    "decode_message",
    "encode_message",
    "shared_memory_available",
]

"""Bounds of what is read from a recording, which may be a stranger's.

A recording that keeps within them costs memory and time in proportion to its size on disk. What
exceeds one is skipped and counted, or refused with the bound's name.
"""

from __future__ import annotations

__all__ = [
    "MAX_ATTACHMENT",
    "MAX_CHANNELS",
    "MAX_CHUNK",
    "MAX_DEPTH",
    "MAX_HELD",
    "MAX_JSON",
    "MAX_KEYS",
    "MAX_METADATA",
    "MAX_NUMBER",
    "MAX_PROTOBUF_FIELDS",
    "MAX_RATIO",
    "MAX_ROS",
    "MAX_UNPACKED",
    "MAX_VIDEO_GROUP",
]

MAX_CHUNK = 128 << 20
"""Bytes of a chunk once unpacked. Writers aim at 1 to 8 MB; a chunk with one raw 8K picture,
which is larger than that, takes 100 MB."""
MAX_RATIO = 200
"""Bytes unpacked for each byte of the file. Flights' chunks reach 20, synthetic depth 100."""
MAX_UNPACKED = 64 << 20
"""Bytes that a file may unpack to beyond `MAX_RATIO`, so that a tiny one is not refused."""
MAX_HELD = 256 << 20
"""Bytes of messages held back to be put in order, where chunks overlap in time."""
MAX_JSON = 32 << 20
"""Bytes of a JSON message; objects take up to twenty times as many in memory."""
MAX_ROS = 1 << 20
"""Bytes of a ROS 2 message other than a picture: a thousand detections take 400 kB, and thirty
times as much as objects."""
MAX_PROTOBUF_FIELDS = 1 << 20
"""Bytes of a protobuf message, less its own bytes such as a picture's, that is written as a table;
a message of two bytes within it takes a hundred times as many."""
MAX_NUMBER = 1 << 63
"""Largest number of a message of ours, whatever its unit. Plots fail near the ends of floating
point."""
MAX_DEPTH = 32
"""Levels of nesting of a JSON message; ours have six, and Python's stack ends near 1000."""
MAX_METADATA = 1 << 20
"""Bytes of a metadata record; ours hold a few hundred."""
MAX_ATTACHMENT = 64 << 20
"""Bytes of an attachment: environments and sources take a few thousand, maps more."""
MAX_CHANNELS = 4096
"""Channels, and schemas, of a file; a flight has a few dozen for each robot."""
MAX_VIDEO_GROUP = 64 << 20
"""Bytes of a video kept since its last key frame; a second of ours takes about one million."""
MAX_KEYS = 256
"""Robots, streams, cameras, actors and labels that a report tells apart, of each kind."""

"""Unpacking of a chunk to no more bytes than it says, and than a recording may have."""

from __future__ import annotations

from io import BytesIO

import zstandard
from lz4.frame import LZ4FrameDecompressor
from mcap.records import Chunk

from aerodaas.recording.decoding.limits import MAX_CHUNK

__all__ = ["TooLargeError", "unpacked"]


class TooLargeError(ValueError):
    """A recording exceeds one of the bounds in `limits`."""


def unpacked(chunk: Chunk) -> bytes:
    """The records of a chunk.

    Args:
        chunk: The chunk as it is in the file.

    Returns:
        Its contents; `chunk.uncompressed_size` bytes.

    Raises:
        TooLargeError: If it has more than `MAX_CHUNK` bytes, or more than it says.
        ValueError: If it is damaged, or packed in a way unknown.
    """
    size = chunk.uncompressed_size
    if size > MAX_CHUNK:
        raise TooLargeError(f"has a chunk of {size} bytes, more than {MAX_CHUNK}")
    # One byte more than it says shows a lie without unpacking all of it.
    if chunk.compression == "zstd":
        reader = zstandard.ZstdDecompressor(max_window_size=MAX_CHUNK).stream_reader(
            BytesIO(chunk.data), read_across_frames=True
        )
        data = reader.read(size + 1)
    elif chunk.compression == "lz4":
        try:
            data = LZ4FrameDecompressor().decompress(chunk.data, max_length=size + 1)
        except RuntimeError as error:
            raise ValueError(f"LZ4: {error}") from None
    elif not chunk.compression:
        data = chunk.data
    else:
        raise ValueError(f"chunks packed by {chunk.compression!r} cannot be read")
    if len(data) > size:
        raise TooLargeError(f"has a chunk with more than the {size} bytes that it claims")
    if len(data) < size:
        raise ValueError(f"a chunk has {len(data)} of {size} bytes")
    return data

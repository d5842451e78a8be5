"""Messages survive the way through bytes, and large arrays are not copied."""

from __future__ import annotations

import struct
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra import numpy as arrays
from numpy.typing import NDArray

from aerodaas.actors.streams.codec import Encoded, decode
from aerodaas.messages.envelope import Message, TraceSpan
from aerodaas.messages.frames import Frame, Header


def _message(item: object) -> Message[object]:
    return Message("s", 3, 5, Header(1, 2, "cam"), 7, (TraceSpan("a", 1, 2),), item)


@given(
    st.lists(
        arrays.arrays(
            st.sampled_from([np.dtype(kind) for kind in ("u1", "f4", "<f8", ">f8", "i8")]),
            arrays.array_shapes(min_dims=1, max_dims=3, min_side=0, max_side=40),
        ),
        max_size=4,
    )
)
def test_arrays_of_any_shape_come_back_equal(items: list[NDArray[Any]]) -> None:
    """Encoding and decoding is the identity."""
    restored = decode(memoryview(Encoded(_message(items)).to_bytes()))
    assert restored.spans == (TraceSpan("a", 1, 2),)
    assert isinstance(restored.item, list)
    for before, after in zip(items, restored.item, strict=True):
        np.testing.assert_array_equal(before, after)
        assert before.dtype == after.dtype


@pytest.mark.parametrize("vector", [np.array([1.0, -2.5, np.nan]), np.arange(6.0)[::2]])
def test_a_short_vector_has_no_buffer_and_is_read_only(vector: NDArray[np.float64]) -> None:
    """Not one of its own, with its alignment, for 24 bytes; nobody changes it for the others."""
    data = Encoded(_message(vector)).to_bytes()
    head, start = struct.unpack_from("<II", data)
    assert len(data) == start == 8 + head
    restored = decode(memoryview(data)).item
    assert isinstance(restored, np.ndarray)
    np.testing.assert_array_equal(restored, vector)
    with pytest.raises(ValueError, match="read-only"):
        restored[0] = 1.0


def test_a_frame_is_a_view_of_the_buffer_and_read_only() -> None:
    """A reader neither copies a picture nor can it spoil it for the others."""
    image = np.arange(48 * 64 * 3, dtype=np.uint8).reshape(48, 64, 3)
    whole = bytearray(Encoded(_message(Frame(Header(0, 0, "c"), image))).to_bytes())
    frame = decode(memoryview(whole)).item
    assert isinstance(frame, Frame)
    whole[-1] ^= 0xFF
    assert frame.image[-1, -1, -1] == image[-1, -1, -1] ^ 0xFF
    with pytest.raises(ValueError, match="read-only"):
        frame.image[0, 0, 0] = 1


@pytest.mark.parametrize(
    ("part", "room", "fits"),
    [(slice(None), 4096, True), (slice(None), 64, False), (slice(1, None), 4096, False)],
)
def test_a_message_is_written_around_an_array_that_is_there(
    part: slice, room: int, *, fits: bool
) -> None:
    """If its first array begins there, and the rest has room before it."""
    whole = np.zeros(room + 200_000, np.uint8)
    array = np.frombuffer(whole, np.uint8, 48 * 64 * 3, room)
    image = array.reshape(48, 64, 3)
    image[...] = np.arange(48 * 64 * 3, dtype=np.uint8).reshape(48, 64, 3)
    depth = np.arange(48 * 64, dtype=np.uint16).reshape(48, 64)
    frame = Frame(Header(0, 0, "c"), image[part], depth=depth[part])
    encoded = Encoded(_message(frame))
    size = encoded.size_around(array, room)
    assert (size is not None) is fits
    if size is not None:
        encoded.write_into(whole.data, room)
        assert decode(whole[:size].data).item == frame
    assert encoded.size_around(image.copy().reshape(-1), room) is None
    assert decode(memoryview(encoded.to_bytes())).item == frame

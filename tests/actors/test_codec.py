"""Messages survive the way through bytes, and large arrays are not copied."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra import numpy as arrays
from numpy.typing import NDArray

from aerodaas.actors.streams.codec import Encoded, decode
from aerodaas.types.data import Frame, Header
from aerodaas.types.status import Message, TraceSpan


def _message(item: object) -> Message[object]:
    return Message("s", 3, 5, Header(1, 2, "cam"), 7, (TraceSpan("a", 1, 2),), item)


@given(
    st.lists(
        arrays.arrays(
            st.sampled_from([np.uint8, np.float32, np.int64]),
            arrays.array_shapes(min_dims=1, max_dims=3, max_side=40),
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

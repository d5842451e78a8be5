"""Codecs of frames for another node: what is decoded there is what was sent."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from aerodaas.actors.dispatch.frame_uplink import FrameUplink
from aerodaas.errors import SourceError
from aerodaas.messages.envelope import Message
from aerodaas.messages.frames import Frame, Header
from aerodaas.runtime.dispatch.frame_codec import Codec, CodedFrame, decoded

CODECS = [Codec("none"), Codec("jpeg"), Codec("png")]


def frame(image: np.ndarray) -> Frame:
    """A frame of a camera."""
    return Frame(Header(1, 2, "drone/camera"), image)


def scene(size: tuple[int, int] = (360, 640)) -> Frame:
    """A picture that compresses as those of a camera do: smooth, with some noise."""
    random = np.random.default_rng(1)
    rows = np.linspace(0, 200, size[0])[:, None, None] + np.zeros((*size, 3))
    return frame((rows + random.normal(0, 3, rows.shape)).clip(0, 255).astype(np.uint8))


def coded(codec: Codec, sent: Frame) -> CodedFrame:
    """The frame as it is sent."""
    found = codec.encoded(sent)
    assert isinstance(found, CodedFrame)
    return found


@given(
    st.sampled_from([Codec("png"), Codec("none")]),
    arrays(np.uint8, st.tuples(st.integers(1, 40), st.integers(1, 40), st.just(3))),
)
def test_lossless_is_lossless(codec: Codec, image: np.ndarray) -> None:
    """To the last bit, with everything else about the frame."""
    sent = frame(image)
    found = decoded(codec.encoded(sent))
    assert np.array_equal(found.image, image)
    assert found.header == sent.header


def test_a_jpeg_is_close_and_small() -> None:
    """JPEG is smaller than PNG, and PNG smaller than the pixels."""
    sent = scene()
    jpeg, png = coded(Codec("jpeg"), sent), coded(Codec("png"), sent)
    assert np.abs(decoded(jpeg).image.astype(int) - sent.image).mean() < 4
    assert jpeg.data.size < png.data.size < sent.image.nbytes


def test_what_arrives_damaged_is_told() -> None:
    """Not a crash, not a wrong picture."""
    damaged = CodedFrame(Header(1, 2, "cam"), np.zeros(9, np.uint8), None, None)
    with pytest.raises(SourceError, match="frame 1 of cam arrived damaged"):
        decoded(damaged)


def test_what_coding_takes_is_expected_of_the_next_frame() -> None:
    """Encoding as measured here, decoding as the other end has said."""
    uplink = FrameUplink(Codec("png"))
    assert uplink.expected == 0.0
    message: Message[Frame] = Message("cam", 1, 0, Header(1, 2, "cam"), 0, (), scene())
    transfer = uplink.pack(message)
    assert transfer is uplink.pack(message), "encoded once"
    assert len(transfer.data) < transfer.original == scene().nbytes
    encoding = uplink.expected
    assert 0.0 < encoding < 5.0
    uplink.uplink.depart(("cam", 1), len(transfer.data), 0.0)
    uplink.arrived(("cam", 1), 0.0, 0.25)
    assert uplink.expected >= encoding + 0.25
    uplink.close()


@pytest.mark.parametrize("codec", CODECS, ids=str)
def test_depth_arrives_exactly_whatever_becomes_of_the_picture(codec: Codec) -> None:
    """Damage to it is told."""
    plain = scene()
    depth = np.random.default_rng(2).integers(0, 2**16, plain.image.shape[:2]).astype(np.uint16)
    sent = codec.encoded(Frame(plain.header, plain.image, depth=depth))
    arrived = decoded(sent)
    assert arrived.depth is not None
    np.testing.assert_array_equal(arrived.depth, depth)
    if isinstance(sent, CodedFrame):
        assert sent.depth is not None
        with pytest.raises(SourceError, match="arrived damaged"):
            decoded(dataclasses.replace(sent, depth=sent.depth[:40]))

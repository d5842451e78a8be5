"""How a frame travels: the rule, and that what arrives is what was sent."""

from __future__ import annotations

import dataclasses
from itertools import pairwise

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from aerodaas.actors.dispatch.frame_codec import (
    CODINGS,
    CodedFrame,
    Coder,
    Coding,
    CodingCost,
    decoded,
    fastest,
)
from aerodaas.types.data import Frame, Header
from aerodaas.types.errors import SourceError

SECONDS = st.floats(0, 10)
COSTS = st.dictionaries(
    st.sampled_from(CODINGS["auto"]),
    st.builds(CodingCost, st.floats(1, 1e7), SECONDS, SECONDS),
    min_size=1,
)


def frame(image: np.ndarray) -> Frame:
    """A frame of a camera."""
    return Frame(Header(1, 2, "drone/camera"), image)


def scene(size: tuple[int, int] = (360, 640)) -> Frame:
    """A picture that compresses as those of a camera do: smooth, with some noise."""
    random = np.random.default_rng(1)
    rows = np.linspace(0, 200, size[0])[:, None, None] + np.zeros((*size, 3))
    return frame((rows + random.normal(0, 3, rows.shape)).clip(0, 255).astype(np.uint8))


@given(COSTS, st.floats(1e3, 1e10), SECONDS)
def test_what_is_chosen_is_there_first(
    costs: dict[str, CodingCost], bandwidth: float, latency: float
) -> None:
    """No other coding would take less, for any costs and any link."""

    def link(size: float) -> float:
        return latency + size / bandwidth

    coding, seconds = fastest(costs, link)  # type: ignore[arg-type]
    assert coding in costs
    totals = [one.encode + one.decode + link(one.size) for one in costs.values()]
    assert seconds == pytest.approx(min(totals))


@given(COSTS)
def test_the_slower_the_link_the_smaller_what_is_sent(costs: dict[str, CodingCost]) -> None:
    """Size never grows as bandwidth falls."""
    chosen = [
        fastest(costs, lambda size, b=bandwidth: size / b)[0]  # type: ignore[arg-type,misc]
        for bandwidth in (1e10, 1e8, 1e6, 1e4, 1e2)
    ]
    sizes = [costs[coding].size for coding in chosen]
    assert all(after <= before for before, after in pairwise(sizes))


def test_a_fast_link_carries_pictures_as_they_are_and_a_slow_one_does_not() -> None:
    """With costs measured on this machine; lossless where it must be."""
    coder, picture = Coder(), scene()
    costs = coder.costs(picture, CODINGS["auto"])
    assert fastest(costs, lambda size: size / 1e12)[0] == "raw"
    assert fastest(costs, lambda size: size / 1e4)[0] == "jpeg"
    lossless = coder.costs(picture, CODINGS["lossless"])
    assert fastest(lossless, lambda size: size / 1e4)[0] == "png"
    assert set(coder.costs(picture, CODINGS["none"])) == {"raw"}
    assert costs["jpeg"].size < costs["png"].size < costs["raw"].size == picture.image.nbytes


def test_what_decoding_takes_there_changes_the_choice() -> None:
    """A node that decompresses slowly gets pictures as they are, in time."""
    coder, picture = Coder(), scene()

    def link(size: float) -> float:
        return size / 1e4

    assert fastest(coder.costs(picture, CODINGS["auto"]), link)[0] == "jpeg"
    for _ in range(20):
        for coding in ("jpeg", "png"):
            coder.took_to_decode(picture, coding, 1000.0)
    assert fastest(coder.costs(picture, CODINGS["auto"]), link)[0] == "raw"


def test_what_was_not_chosen_is_measured_again_now_and_then() -> None:
    """A scene that compresses worse than at first sight is noticed without sending it so."""
    coder = Coder()
    before = coder.costs(scene(), CODINGS["auto"])["jpeg"].size
    noise = frame(np.random.default_rng(2).integers(0, 255, (360, 640, 3), np.uint8))
    after = before
    for _ in range(200):
        after = coder.costs(noise, CODINGS["auto"])["jpeg"].size
    assert after > before


@given(arrays(np.uint8, st.tuples(st.integers(1, 40), st.integers(1, 40), st.just(3))))
def test_lossless_is_lossless(image: np.ndarray) -> None:
    """To the last bit, with everything else about the frame."""
    sent = Coder().encode(frame(image), "png")
    assert isinstance(sent, CodedFrame)
    found = decoded(sent)
    assert np.array_equal(found.image, image)
    assert found.header == sent.header


def test_jpeg_is_close() -> None:
    """Within what eyes and networks overlook."""
    picture = scene()
    found = decoded(Coder().encode(picture, "jpeg"))
    assert np.abs(found.image.astype(int) - picture.image).mean() < 4


def test_what_arrives_damaged_is_told() -> None:
    """Not a crash, not a wrong picture."""
    damaged = CodedFrame(Header(1, 2, "cam"), np.zeros(9, np.uint8), "png", None, None)
    with pytest.raises(SourceError, match="frame 1 of cam arrived damaged"):
        decoded(damaged)


@pytest.mark.parametrize("coding", ["raw", "jpeg", "png"])
def test_depth_arrives_exactly_whatever_becomes_of_the_picture(coding: Coding) -> None:
    """It is counted in what travels, and damage to it is told."""
    plain = scene()
    depth = np.random.default_rng(2).integers(0, 2**16, plain.image.shape[:2]).astype(np.uint16)
    sent = Frame(plain.header, plain.image, depth=depth)
    coder = Coder()
    coded = coder.encode(sent, coding)
    arrived = decoded(coded)
    assert arrived.depth is not None
    np.testing.assert_array_equal(arrived.depth, depth)
    without = Coder().costs(plain, (coding,))[coding]
    assert coder.costs(sent, (coding,))[coding].size > without.size + depth.nbytes / 2
    if isinstance(coded, CodedFrame):
        assert coded.depth is not None
        with pytest.raises(SourceError, match="arrived damaged"):
            decoded(dataclasses.replace(coded, depth=coded.depth[:40]))

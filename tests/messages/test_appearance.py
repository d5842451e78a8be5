"""How a person looks, in 24 bytes: the same for the same person, another for another."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray

from aerodaas.geometry.frames import Box
from aerodaas.messages.appearance import ZONE_BYTES, ZONES, appearance_in_box, unlikeness

GRASS, SKY = (60, 140, 90), (200, 150, 120)
YELLOW = (30, 240, 230)
Colours = tuple[tuple[int, int, int], tuple[int, int, int], tuple[int, int, int]]
"""Hair, sleeves and trousers, BGR."""
ANNA: Colours = ((20, 20, 25), (140, 80, 50), (70, 40, 35))
BERT: Colours = ((120, 130, 140), (40, 40, 140), (75, 95, 110))


def picture(
    wears: Colours, *, behind: tuple[int, int, int] = GRASS, left: int = 300, light: float = 1.0
) -> tuple[NDArray[np.uint8], Box]:
    """Somebody in a yellow vest 80 pixels high, `left` pixels from the edge, and the vest's box."""
    image = np.empty((360, 640, 3), np.float64)
    image[:] = behind
    hair, sleeves, trousers = wears
    top, tall, wide = 120, 80, 56
    image[top - 32 : top - 4, left + 16 : left + 40] = hair
    image[top : top + 70, left - 14 : left + wide + 14] = sleeves
    image[top : top + tall, left : left + wide] = YELLOW
    image[top + tall : top + 160, left + 6 : left + wide - 6] = trousers
    lit = (image * light).clip(0, 255).astype(np.uint8)
    return lit, (float(left), float(top), float(left + wide), float(top + tall))


def look(wears: Colours, **how: object) -> bytes:
    """The appearance of somebody in a picture."""
    image, box = picture(wears, **how)  # type: ignore[arg-type]
    found = appearance_in_box(image, box, "vest")
    assert found is not None
    return found


def test_another_person_in_the_same_vest_looks_otherwise() -> None:
    """Two people differ by more than the same one before another background."""
    same = unlikeness([look(ANNA)], [look(ANNA, behind=SKY, left=200)])
    other = unlikeness([look(ANNA)], [look(BERT)])
    assert same is not None
    assert other is not None
    assert same < 2.0
    assert other > 10.0


def test_shade_changes_little() -> None:
    """Half of the light leaves somebody more like themselves than like another."""
    shaded = look(ANNA, light=0.5)
    own, other = unlikeness([look(ANNA)], [shaded]), unlikeness([look(BERT)], [shaded])
    assert own is not None
    assert other is not None
    assert own < 4.0 < other


@pytest.mark.parametrize(
    ("label", "box"),
    [
        ("car", (300.0, 120.0, 356.0, 200.0)),
        ("vest", (0.0, 120.0, 56.0, 200.0)),
        ("vest", (584.0, 120.0, 640.0, 200.0)),
        ("vest", (300.0, 0.0, 356.0, 80.0)),
        ("vest", (300.0, 280.0, 356.0, 360.0)),
        ("vest", (300.0, 120.0, 304.0, 130.0)),
        ("vest", (280.0, 120.0, 376.0, 180.0)),
        ("vest", (float("nan"), 120.0, 356.0, 200.0)),
    ],
)
def test_what_does_not_show_clothes_has_no_appearance(label: str, box: Box) -> None:
    """Other things, boxes that the picture's edge cuts, what is far away, and who lies."""
    image, _ = picture(ANNA)
    assert appearance_in_box(image, box, label) is None


def test_a_whole_person_is_described_by_the_whole_box() -> None:
    """The chest is where a person has it."""
    image, (left, top, right, _) = picture(ANNA)
    tall = 80 / 0.32
    box = (left - 14, top - 0.14 * tall, right + 14, top + 0.86 * tall)
    whole = appearance_in_box(image, box, "person")
    assert whole is not None
    likeness = unlikeness([whole], [look(ANNA)])
    assert likeness is not None
    assert likeness < 4.0


appearances = st.binary(min_size=ZONES * ZONE_BYTES, max_size=ZONES * ZONE_BYTES)


@given(some=st.lists(appearances, max_size=4), others=st.lists(appearances, max_size=4))
def test_unlikeness_is_symmetric_and_bounded(some: list[bytes], others: list[bytes]) -> None:
    """It does not matter who is compared with whom."""
    there, back = unlikeness(some, others), unlikeness(others, some)
    assert there == back
    assert there is None or 0.0 <= there <= 20.0


def test_zones_that_cannot_be_told_are_left_out() -> None:
    """One zone in common is too little to tell; two are enough."""
    one = look(ANNA)
    unknown = bytes(ZONE_BYTES)
    assert unlikeness([one], [one[:ZONE_BYTES] + 3 * unknown]) is None
    assert unlikeness([one], [one[: 2 * ZONE_BYTES] + 2 * unknown]) == 0.0
    assert unlikeness([one], []) is None


@settings(max_examples=200)
@given(
    corners=st.tuples(*[st.floats(-1e4, 1e4) for _ in range(4)]),
    label=st.sampled_from(["vest", "person"]),
    seed=st.integers(0, 10),
)
def test_any_box_is_described_or_not(corners: Box, label: str, seed: int) -> None:
    """No box raises; what is described has the length."""
    image = np.random.default_rng(seed).integers(0, 256, (90, 160, 3)).astype(np.uint8)
    found = appearance_in_box(image, corners, label)
    assert found is None or len(found) == ZONES * ZONE_BYTES

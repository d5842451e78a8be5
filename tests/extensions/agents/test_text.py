"""Text of the world is one bounded, printable line, and marked as data."""

from __future__ import annotations

import unicodedata

from hypothesis import given
from hypothesis import strategies as st

from aerodaas.extensions.agents.text import LONGEST, plain, untrusted, world

TEXTS = st.text(st.characters(), max_size=2000)


@given(TEXTS)
def test_a_text_of_the_world_controls_nothing(text: str) -> None:
    """No controls, no direction marks, no line breaks, no unassigned characters; bounded."""
    found = world(text)
    if found is None:
        assert not text.strip()
        return
    assert found.untrusted
    assert len(found.text) <= LONGEST
    assert all(unicodedata.category(one)[0] != "C" for one in found.text)
    assert all(unicodedata.category(one)[0] != "Z" or one == " " for one in found.text)


@given(st.text("abcXYZ 019.,;-äß", max_size=LONGEST))
def test_plain_words_stay(text: str) -> None:
    """Nothing else is taken from them but surplus blanks."""
    assert plain(text) == " ".join(text.split())


def test_direction_marks_and_breaks_are_replaced() -> None:
    """What reverses or hides text would have a person read something else than a model."""
    assert plain("land\u202e here\u2066\x1b[2J\n\nnow") == "land� here��[2J now"


def test_a_cut_text_says_so() -> None:
    """A long one ends in an ellipsis, however long it is."""
    for length in (LONGEST + 1, 10_000_000):
        assert plain("x" * length) == "x" * (LONGEST - 1) + "…"


@given(st.lists(TEXTS, max_size=40))
def test_lists_are_bounded(texts: list[str]) -> None:
    """The newest stay."""
    found = untrusted(texts)
    assert len(found) <= 20
    kept = [one for one in texts if one.strip()]
    assert [one.text for one in found] == [plain(one) for one in kept[-len(found) :]][: len(found)]

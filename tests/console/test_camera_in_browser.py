"""A camera on the page in a real browser: what was found is drawn on the frame it was found in."""

from __future__ import annotations

from collections.abc import Iterator

import pytest
from camera_pages import COUNT_DECODED, DECODES, opened_camera
from required import needs_peer
from scripted_camera import SHOWN, Reader, camera_console, require_own_frames

from aerodaas.messages.waypoints import TargetState
from tools.browser import Browser

pytestmark = [pytest.mark.slow, pytest.mark.wall_clock, needs_peer("AERODAAS_BROWSER")]


@pytest.fixture(scope="module")
def browser() -> Iterator[Browser]:
    """One for all tests here."""
    with Browser() as browser:
        yield browser


@pytest.mark.parametrize(
    ("form", "before", "decodes"),
    [
        ("jpeg", COUNT_DECODED, False),
        ("h264", COUNT_DECODED, True),
        ("h264", "delete window.VideoDecoder", False),
    ],
)
def test_bodies_and_depth_are_drawn_on_their_own_frame(
    browser: Browser, form: str, before: str, *, decodes: bool
) -> None:
    """By a grey that tells which frame it is, and a body whose place does."""
    with camera_console() as server:
        page = opened_camera(browser, server.address(), form, before)
        assert page.run(DECODES) is decodes
        assert page.run("document.querySelector('[data-testid=video]').dataset.points") == "2"
        require_own_frames(page.run(SHOWN))
        # By keyboard: the button is pressed, and the legend names the range.
        page.run("document.querySelector('.video [aria-pressed]').focus()")
        page.key(" ")
        page.until("document.querySelector('[data-testid=video]').dataset.range === '2'")
        assert page.text("[data-testid=scale]").split() == ["0", "2", "m"]
        near, unmeasured = page.run(
            "[5, 300].map(x => [...document.querySelector('[data-testid=video]')"
            ".getContext('2d').getImageData(x, 170, 1, 1).data])"
        )
        # The far end of the colours is violet; what was not measured stays grey.
        assert near[2] > near[1] + 10
        assert max(unmeasured[:3]) - min(unmeasured[:3]) <= 6
        page.press(".video [aria-pressed]")
        page.until("document.querySelector('[data-testid=scale]') === null")
        assert page.complaints() == []


CORNERS = """new Promise(done => {
  const screen = document.querySelector('[data-testid=video]');
  const found = [];
  new MutationObserver((_, watch) => {
    const turn = Math.round(screen.dataset.stamp / 1e8) % 20;
    const pen = screen.getContext('2d');
    found.push([...pen.getImageData(20 + 10 * turn - 5, 28, 1, 1).data].slice(0, 3));
    if (found.length < 12) return;
    watch.disconnect();
    done(found);
  }).observe(screen, { attributeFilter: ['data-stamp'] });
})"""
"""Of a dozen pictures: a pixel outside the box of the very frame, where a corner's mark is."""


def test_what_is_followed_is_told_apart_on_its_own_frame(
    browser: Browser, monkeypatch: pytest.MonkeyPatch
) -> None:
    """By corners around its box and a word; where no box is known, by the word alone."""
    word = "document.querySelector('[data-testid=target]')"
    with camera_console() as server:
        page = opened_camera(browser, server.address(), "jpeg", "")
        assert page.run(f"{word}.getAttribute('role')") == "status"
        assert page.run(f"{word}.innerText") == ""
        assert not any(max(one) == 255 for one in page.run(CORNERS))
        for state, said in (
            (TargetState.SURE, "◎ follows"),
            (TargetState.UNCERTAIN, "target uncertain: holds"),
            (TargetState.LIKELY, "◎ follows the likelier one"),
            (TargetState.UNSEEN, "target not in sight"),
        ):
            monkeypatch.setattr(Reader, "targets", state)
            page.until(f"{word}.innerText === '{said}'")
            marks = [min(one) > 230 for one in page.run(CORNERS)]
            if state is TargetState.SURE:
                assert all(marks)
            elif state is not TargetState.LIKELY:
                assert not any(marks[2:])
        assert page.complaints() == []

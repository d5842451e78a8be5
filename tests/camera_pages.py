"""The page's camera in a browser: opened, with what is decoded counted."""

from __future__ import annotations

from tools.browser import Browser, Page

__all__ = ["COUNT_DECODED", "DECODES", "opened_camera"]

COUNT_DECODED = """
  VideoDecoder.prototype.decode = (decode => function (...words) {
    window.decoded = (window.decoded ?? 0) + 1;
    return decode.apply(this, words);
  })(VideoDecoder.prototype.decode);
"""
"""Counts the pictures that come as H.264; to be run before the page's own script."""
DECODES = "(window.decoded ?? 0) > 0"
"""Whether any came."""


def opened_camera(
    browser: Browser, address: str, form: str, before: str, shown: str = "points > 0"
) -> Page:
    """The page, once a picture is shown of which something holds; a script runs before its own."""
    page = browser.open("about:blank")
    page.before(before)
    page.go(f"{address}&pictures={form}")
    page.until(f"document.querySelector('[data-testid=video]')?.dataset.{shown}")
    return page

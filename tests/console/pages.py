"""What the tests of the console's page do with it."""

from __future__ import annotations

import json

from tools.browser import Page

__all__ = ["click_map", "until_state"]


def until_state(page: Page, *states: str) -> None:
    """Wait until the page says that the drone is in one of these states."""
    page.until(
        f"{json.dumps(states)}.includes(document.querySelector('[data-testid=state]')?.innerText)"
    )


def click_map(page: Page, east: float, north: float) -> None:
    """Click a place of the map."""
    x, y = page.run(
        "(map => { const box = map.getBoundingClientRect(); const of = map.dataset; return ["
        f"box.x + box.width / 2 + ({east} - of.east) * of.scale,"
        f"box.y + box.height / 2 - ({north} - of.north) * of.scale]; }})"
        "(document.querySelector('[data-testid=map]'))"
    )
    page.click(x, y)

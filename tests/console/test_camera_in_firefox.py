"""The console in Firefox: it connects, draws the drone, and bodies on their own frames."""

from __future__ import annotations

import pytest
from firefox import Firefox
from required import needs_peer
from scripted_camera import SHOWN, camera_console, require_own_frames

pytestmark = [pytest.mark.slow, pytest.mark.wall_clock, needs_peer("AERODAAS_FIREFOX")]


def test_the_page_draws_the_drone_and_its_camera() -> None:
    """In H.264 where this Firefox decodes it, else in JPEG."""
    with Firefox() as page, camera_console() as server:
        page.go(f"{server.address()}&pictures=h264")
        page.until("document.querySelector('[data-testid=connection]')?.innerText === 'live'")
        page.until("document.querySelector('[data-drone]')")
        page.until("document.querySelector('[data-testid=video]')?.dataset.points > 0")
        require_own_frames(page.run(SHOWN))

"""A survey planned by a camera, as its operator sees it in a real browser."""

from __future__ import annotations

import pytest
from hovering import console
from required import needs_peer
from test_piloting_in_browser import draw, fill

from tools.browser import Browser, Page

pytestmark = [pytest.mark.slow, pytest.mark.wall_clock, needs_peer("AERODAAS_BROWSER")]

LENS = {"horizontal_fov": 60, "width": 4000, "height": 3000}
CAMERAS = [
    {"id": "front", "type": "camera", "settings": LENS},
    {"id": "map", "type": "camera", "driver": "video", "settings": {**LENS, "gimbal": {}}},
]
CAMERAS[1]["settings"] |= {"photo_interval": 2.0, "path": "map.mp4"}  # type: ignore[operator]
FENCE = {"polygon": [[-30, -30], [30, -30], [30, 30], [-30, 30]]}
ROBOT = {"id": "drone", "sensors": CAMERAS, "limits": {"geofence": FENCE, "cruise_speed": 1.0}}


def choose(page: Page, name: str, value: str) -> None:
    """Choose from a list of the survey's form."""
    page.run(
        f"(list => {{ list.value = {value!r};"
        "list.dispatchEvent(new Event('change', {bubbles: true})); })"
        f"(document.querySelector('.surveyform [name={name}]'))"
    )


def shows(page: Page, what: str, text: str) -> None:
    """Wait until a part of the form says so."""
    page.until(f"document.querySelector('[data-testid={what}]')?.innerText.includes({text!r})")


@pytest.mark.parametrize("width", [1360, 400])
def test_pictures_are_shown_before_they_are_flown(width: int) -> None:
    """Resolution, count and time between two; where the camera is too slow, and cannot survey."""
    with console(robots=[ROBOT]) as (server, run), Browser() as browser:
        page = browser.open(server.address(), width, 1000)
        page.until("document.querySelector('.mapkeys .draw')")
        draw(page, (-5, -5), (5, -5), (5, 5), (-5, 5))
        # The camera on a gimbal is chosen; the other one looks ahead.
        assert page.run("document.querySelector('[name=camera]').value") == "map"
        choose(page, "by", "resolution")
        fill(page, "resolution", "0.2")
        shows(page, "survey-plan", "0.20 cm/pixel")
        shows(page, "survey-plan", "6.9 m")
        assert page.run("document.querySelectorAll('.survey .photos').length") == 1
        shows(page, "survey-warning", "needs 2 s for one: fly at 0.7")
        fill(page, "front", "60")
        page.until("!document.querySelector('[data-testid=survey-warning]')")
        fits = "document.documentElement.scrollWidth <= document.documentElement.clientWidth"
        assert page.run(fits)
        choose(page, "camera", "front")
        shows(page, "survey-problem", "looks 0 degrees down")
        choose(page, "camera", "")
        fill(page, "width", "4")
        shows(page, "survey-plan", "of 4.0 m")
        assert page.run("document.querySelector('.survey .photos')") is None
        assert [one for one in page.complaints() if "422" not in one] == []
        assert not run.commands

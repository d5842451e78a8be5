"""A camera at a provider, watched as H.264 by whom its mission's tenant lets, and nobody else."""

from __future__ import annotations

import json
import time
from collections.abc import Iterator
from typing import Any

import pytest
from camera_pages import COUNT_DECODED, DECODES, opened_camera
from required import needs_peer
from served import Served, document, fleet, robot
from websockets.exceptions import InvalidStatus
from websockets.sync.client import ClientConnection, connect

from tools.browser import Browser

pytestmark = [pytest.mark.slow, pytest.mark.wall_clock]

WAY = ((20.0, 0.0), (20.0, 20.0), (0.0, 20.0), (0.0, 0.0)) * 6
CAMERA = "one/cam"
WIDE, HIGH = 320, 240
BRIGHT = f"""(screen => {{
  const all = screen.getContext('2d').getImageData(0, 0, {WIDE}, {HIGH}).data;
  return all.reduce((sum, one) => sum + one, 0) / all.length;
}})(document.querySelector('[data-testid=video]'))"""


@pytest.fixture(scope="module")
def provider() -> Iterator[Served]:
    """Two drones, each with a small camera."""
    drones = [robot("one"), robot("two", 30.0)]
    for drone in drones:
        lens = {"width": WIDE, "height": HIGH, "pitch": 40}
        drone["sensors"].append({"id": "cam", "type": "camera", "rate": 5, "settings": lens})
    with Served(fleet(*drones), "--no-rehearse") as served:
        yield served


def fly(provider: Served, drone: str, token: str) -> str:
    """A mission that flies for minutes, under a lease of its own; returns its id."""
    flight = document(drone, *WAY, sensors=[f"{drone}/odometry", f"{drone}/cam"])
    lease = provider.ask("POST", "/v1/leases", {"robots": [drone], "minutes": 10}, token)["id"]
    body = {"document": flight, "lease": lease}
    id_ = str(provider.ask("POST", "/v1/missions", body, token)["id"])
    provider.until(lambda: f"{drone}/cam" in provider.mission(id_)["streams"])
    return id_


@pytest.fixture(scope="module")
def asha(provider: Served) -> str:
    """A pilot's token."""
    return provider.user("asha", "farm")


@pytest.fixture(scope="module")
def mission(provider: Served, asha: str) -> str:
    """Their mission, which flies."""
    return fly(provider, "one", asha)


def watch(provider: Served, mission: str, token: str) -> ClientConnection:
    """The live view of a mission with its camera; raises InvalidStatus where it is refused."""
    url = f"{provider.url.replace('http', 'ws')}/v1/missions/{mission}/live"
    query = f"streams={CAMERA}&pictures=h264"
    return connect(f"{url}?{query}", additional_headers={"Authorization": f"Bearer {token}"})


def pictures(socket: ClientConnection, seconds: float, most: int) -> list[dict[str, Any]]:
    """Messages of pictures, each of which has bytes after it, that come in a while."""
    found: list[dict[str, Any]] = []
    until = time.monotonic() + seconds
    while len(found) < most and (left := until - time.monotonic()) > 0:
        try:
            message = json.loads(socket.recv(left))
        except TimeoutError:
            break
        if message["kind"] == "item":
            assert isinstance(socket.recv(20.0), bytes)
            found.append(message)
    return found


@needs_peer("AERODAAS_BROWSER")
def test_the_tenants_viewer_sees_it_decoded(provider: Served, mission: str) -> None:
    """In the page, by WebCodecs; one picture after another, in the camera's size and no black."""
    viewer = provider.user("vera", "farm", "viewer")
    address = f"{provider.url}/#token={viewer}&mission={mission}"
    with Browser() as browser:
        page = opened_camera(browser, address, "h264", COUNT_DECODED, "stamp > 0")
        screen = "document.querySelector('[data-testid=video]')"
        assert page.run(DECODES)
        first = float(page.run(f"{screen}.dataset.stamp"))
        page.until(f"{screen}.dataset.stamp >= {first + 1e9}")
        assert page.run(f"[{screen}.width, {screen}.height]") == [WIDE, HIGH]
        assert page.run(BRIGHT) > 60
        assert page.run("document.querySelectorAll('.command:disabled').length") == 5
        assert page.complaints() == []


@needs_peer("AERODAAS_BROWSER")
def test_the_fleet_shows_the_camera_of_the_chosen_drone(provider: Served, mission: str) -> None:
    """Only in flight, and only to an account that may sense."""
    del mission
    blind = provider.user("bea", "farm", scopes=["fly"])
    with Browser() as browser:
        pages = [
            browser.open(f"{provider.url}/#token={token}")
            for token in (provider.user("vito", "farm", "viewer"), blind)
        ]
        for page in pages:
            page.until("document.querySelector('[data-row=one]')?.innerText.includes('enroute')")
            page.press("[data-row=one] th button")
            page.until("document.querySelector('.chosendrone')?.innerText.includes('enroute')")
        seeing, other = pages
        seeing.until("document.querySelector('[data-testid=video]')?.dataset.stamp > 0")
        assert "cam" in seeing.text(".video")
        assert other.run("document.querySelector('.video')") is None
        seeing.press("[data-row=two] th button")
        seeing.until("document.querySelector('.video') === null")
        assert [one for page in pages for one in page.complaints()] == []


@needs_peer("AERODAAS_BROWSER")
def test_who_may_not_sense_sees_no_camera(provider: Served, mission: str) -> None:
    """Their page has the map alone; another tenant's page has no such mission."""
    blind = provider.user("ben", "farm", scopes=["fly"])
    stranger = provider.user("eve", "city")
    with Browser() as browser:
        page = browser.open(f"{provider.url}/#token={blind}&mission={mission}&pictures=h264")
        page.until("document.querySelector('[data-testid=state]')")
        assert page.run("document.querySelector('.video')") is None
        page = browser.open(f"{provider.url}/#token={stranger}&mission={mission}&pictures=h264")
        page.until("document.body?.innerText.includes('No mission yet')")
        assert page.run("document.querySelector('.video')") is None
    for token, status in ((blind, 403), (stranger, 404), ("", 401)):
        with pytest.raises(InvalidStatus) as refused, watch(provider, mission, token):
            pass
        assert refused.value.response.status_code == status


def test_a_lease_of_another_drone_is_none_of_this_camera(provider: Served, mission: str) -> None:
    """Who flies beside it names its stream in vain; its own tenant goes on getting it."""
    ivan = provider.user("ivan", "port")
    own = fly(provider, "two", ivan)
    with watch(provider, own, ivan) as socket:
        assert pictures(socket, 4.0, 1) == []
    with pytest.raises(InvalidStatus) as refused, watch(provider, mission, ivan):
        pass
    assert refused.value.response.status_code == 404
    provider.ask("DELETE", f"/v1/missions/{own}", None, ivan)
    with watch(provider, mission, provider.user("vidya", "farm", "viewer")) as socket:
        found = pictures(socket, 60.0, 8)
    assert len(found) == 8
    assert all(one["item"]["format"] == "h264" for one in found)
    assert found[0]["key"]

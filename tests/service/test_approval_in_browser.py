"""A proposed mission on the console: what an operator is shown, and what the decision leads to."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import numpy as np
import pytest
from required import needs_peer
from served import Served, document, fleet, robot

from tools.browser import Browser, Page

pytestmark = [pytest.mark.slow, pytest.mark.wall_clock, needs_peer("AERODAAS_BROWSER")]

WAY = ((0.0, 12.0), (14.0, 22.0), (14.0, 2.0))
"""Past the mast."""
WHY = "<b>They</b> said yes:\u202e approve it"
CAMERA = {"id": "cam", "type": "camera", "rate": 1, "settings": {"width": 64, "height": 48}}
HOOK = {"actuators": [{"id": "hook", "type": "gripper"}]}


@pytest.fixture(scope="module")
def provider() -> Iterator[Served]:
    """Two drones in a world with a mast, which are rehearsed; one of them films and delivers."""
    drones = [robot("one"), robot("two", 8.0)]
    drones[0] = {**drones[0], **HOOK, "sensors": [*drones[0]["sensors"], CAMERA]}
    world = {**fleet(*drones), "simulation": {"world": "tower", "seed": 5}}
    with Served(world, "--actuator", "farm=one/hook") as served:
        yield served


@pytest.fixture(scope="module")
def operator(provider: Served) -> str:
    """Token of a person who approves."""
    return provider.user("olga", "farm", "operator")


@pytest.fixture(scope="module")
def agent(provider: Served) -> str:
    """Token of an agent."""
    return provider.user("planner", "farm", scopes=["propose", "sense"])


def proposed(provider: Served, agent: str, content: dict[str, Any]) -> str:
    """Id of a mission that an agent has proposed and rehearsed, and that awaits its approval."""
    wanted = {"document": content, "minutes": 6, "why": WHY}
    id_ = str(provider.ask("POST", "/v1/proposals", wanted, agent)["id"])
    rehearsed = provider.ask("POST", f"/v1/proposals/{id_}/rehearse", {"seeds": 2}, agent)
    assert rehearsed["phase"] == "rehearsing", rehearsed
    provider.until(lambda: provider.mission(id_)["verdict"] is not None)
    found = provider.ask("POST", f"/v1/proposals/{id_}/request", None, agent)
    assert found["phase"] == "awaiting_approval", found
    return id_


def opened(browser: Browser, provider: Served, token: str, mission: str) -> Page:
    """The page of a mission, at the address that its approver is sent."""
    page = browser.open(f"{provider.url}/#token={token}&mission={mission}")
    page.until("document.querySelector('[data-testid=figures]')")
    return page


def press(page: Page, selector: str) -> None:
    """Press a button that may be pressed."""
    page.until(f"document.querySelector('{selector}:not(:disabled)')")
    page.press(selector)


def text(page: Page, part: str) -> str:
    """The text of a part of the page."""
    return page.text(f"[data-testid={part}]")


def test_an_operator_reads_a_proposal_and_approves_it(
    provider: Served, operator: str, agent: str
) -> None:
    """All of it is shown; an actuator has to be ticked, and the envelope is what was drawn."""
    content = document("one", *WAY, name="delivery", sensors=["one/odometry", "one/cam"])
    content["navigation"][0]["waypoints"][1]["actuate"] = {"hook": "release"}
    mission = proposed(provider, agent, content)
    with Browser() as browser:
        page = browser.open(f"{provider.url}/#token={operator}")
        # What awaits an approval comes first among the missions.
        page.until("document.querySelector('.missions li:first-child .awaiting_approval')")
        page.press(".missions .awaiting_approval")
        page.until("document.querySelector('[data-testid=picture]')?.naturalWidth > 0")
        assert "planner" in page.text(".request")
        # The agent's own words are text, set apart.
        assert "<b>They</b> said yes:" in page.text("[data-testid=why] blockquote")
        assert "one" in text(page, "summary")
        assert "first" in text(page, "difference")
        assert "one/cam" in text(page, "records")
        assert page.run("document.querySelectorAll('.map [data-waypoint]').length") == len(WAY)
        assert page.run("document.querySelectorAll('.scenery .tower').length") > 0
        tracks = "[...document.querySelectorAll('[data-planned] .trail, .profile .trail')]"
        lengths = page.run(f"{tracks}.map(one => one.points.length)")
        assert all(length > 10 for length in lengths)
        figures = text(page, "figures")
        assert all(unit in figures for unit in ("of 6 min", "%", "reserve", "Nearest thing"))
        shown = provider.ask("GET", f"/v1/missions/{mission}", None, operator)
        hash_ = shown["proposal"]["hash"]
        assert text(page, "hash") == hash_[:12]
        assert page.run("document.querySelector('[data-testid=hash]').title.slice(-64)") == hash_
        nearest = shown["verdict"]["clearance"]
        if nearest is not None:
            assert nearest["thing"] in figures

        # Its hook was not ticked.
        assert "one/hook" in text(page, "now")
        assert page.run("document.querySelector('.approve').disabled")
        press(page, '.terms [name="one/hook"]')
        page.until("document.querySelector('[data-testid=now]').innerText.includes('good for 2')")
        press(page, ".terms [name=envelope]")
        page.until("document.querySelectorAll('.map .corner').length === 4")
        press(page, ".approve")
        page.until("document.querySelector('[data-testid=sure]')")
        assert provider.mission(mission)["phase"] == "awaiting_approval"
        press(page, "[data-testid=sure] .primary")
        provider.until(lambda: provider.mission(mission)["proposal"]["approval"] is not None)
        approval = provider.mission(mission)["proposal"]["approval"]
        assert (approval["account"], approval["actuators"]) == ("olga", ["one/hook"])
        assert approval["hash"] == hash_
        corners = [[-5, -5], [19, -5], [19, 27], [-5, 27]]
        assert np.array(approval["envelope"]["area"]) == pytest.approx(np.array(corners), abs=1.1)
        # On to the flight.
        page.until("document.querySelector('.command.pause:not(:disabled)')", 90)
        page.until("document.querySelector('[data-testid=state]')?.innerText === 'enroute'", 90)
        assert page.complaints() == []
    provider.ask("DELETE", f"/v1/missions/{mission}")
    assert provider.until_phase(mission)["phase"] == "cancelled"


def test_what_has_changed_since_it_was_shown_is_not_approved(
    provider: Served, operator: str, agent: str
) -> None:
    """The service refuses a hash that it does not have any more, and the page says why."""
    mission = proposed(provider, agent, document("two", *WAY, name="round"))
    stale = (
        "window.fetch = (ask => (to, how) => ask(to, {...how, body: how?.body?.replace("
        '/"hash":"..../, \'"hash":"0000\')}))(window.fetch)'
    )
    with Browser() as browser:
        page = opened(browser, provider, operator, mission)
        page.run(f"{stale};0")
        press(page, ".approve")
        press(page, "[data-testid=sure] .primary")
        page.until("document.querySelector('[data-testid=refusal]')")
        assert "since its last rehearsal" in text(page, "refusal")
        assert provider.mission(mission)["phase"] == "awaiting_approval"
        # The agent's own account decides nothing, and neither does a pilot's.
        pilot = provider.user("paul", "farm")
        for token in (agent, pilot):
            other = browser.open(f"{provider.url}/#token={token}")
            other.until("document.querySelector('.missions')")
            # A link in a tab that has the page already.
            other.run(f"location.hash = 'mission={mission}'")
            other.until("document.querySelector('[data-testid=now]')")
            assert other.run("document.querySelector('.approve, .terms')") is None
            assert other.complaints() == []
        press(page, ".refuse")
        press(page, "[data-testid=sure] .primary")
        page.until("document.querySelector('[data-testid=phase]').innerText === 'cancelled'")
    assert provider.mission(mission)["phase"] == "cancelled"

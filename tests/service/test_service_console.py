"""The console at a provider's address: its page for anybody, missions by token and role."""

from __future__ import annotations

from collections.abc import Iterator

import pytest
from required import needs_peer
from served import Served, document, fleet, robot

from aerodaas.environment.provider.client import ProviderClient
from aerodaas.messages.health import Verdict
from tools.browser import Browser

pytestmark = [pytest.mark.slow, pytest.mark.wall_clock]

FAR = ((20.0, 0.0), (20.0, 20.0))
AREA = [[-5, -5], [25, -5], [25, 25], [-5, 25]]


@pytest.fixture(scope="module")
def provider() -> Iterator[Served]:
    """Three drones in real time, without rehearsals."""
    drones = [robot("one"), robot("two", 8.0), robot("three", 16.0)]
    with Served(fleet(*drones), "--no-rehearse") as served:
        yield served


@pytest.fixture(scope="module")
def mission(provider: Served) -> str:
    """A mission in flight, of the administrator's tenant."""
    wanted = {"robots": ["one"], "minutes": 10, "area": AREA}
    lease = provider.ask("POST", "/v1/leases", wanted)["id"]
    answer = provider.ask(
        "POST", "/v1/missions", {"document": document("one", *FAR), "lease": lease}
    )
    id_ = str(answer["id"])
    provider.until(lambda: "one" in provider.mission(id_)["status"])
    return id_


def test_the_page_is_there_for_anybody_and_nothing_else_is(provider: Served) -> None:
    """The page's files alone need no token."""
    for path in ("/", "/console.js", "/console.css"):
        status, content = provider.send("GET", path, token="")
        assert status == 200
        assert content
    for path in ("/v1/missions", "/v1/fleet", "/index.html", "//", "/console.js/", "/v1/../"):
        assert provider.send("GET", path, token="")[0] == 401
    assert provider.send("POST", "/", b"{}", token="")[0] == 405


def test_the_list_before_take_off_is_told_between_missions_and_in_them(provider: Served) -> None:
    """To every account, as the drone's charge is; with a client's method, too."""
    viewer = provider.user("list", "others", "viewer")
    client = ProviderClient(provider.url, viewer)
    provider.until(lambda: bool(client.preflight("one").items))
    told = client.preflight("one")
    assert told.verdict is Verdict.GOOD
    assert {one.name for one in told.items} >= {"vehicle", "battery", "fence", "wind", "link"}
    assert client.fleet().robots[0].preflight is Verdict.GOOD


def test_what_lies_below_a_mission_is_told_to_who_sees_it(provider: Served, mission: str) -> None:
    """Another tenant has no such mission; the world of this fleet, which all see, is empty."""
    path = f"/v1/missions/{mission}/scenery"
    assert provider.ask("GET", path) == {"shapes": [], "tiles": None}
    assert provider.ask("GET", "/v1/fleet/scenery") == {"shapes": [], "tiles": None}
    stranger = provider.user("stranger", "others", "operator")
    viewer = provider.user("looker", "others", "viewer")
    assert provider.send("GET", path, token=stranger)[0] == 200
    assert provider.send("GET", path, token=viewer)[0] == 404


@needs_peer("AERODAAS_BROWSER")
def test_missions_are_watched_and_commanded_by_role(provider: Served, mission: str) -> None:
    """An operator pauses a mission from the page; a viewer of its tenant sees that, and no more."""
    tenant = provider.ask("GET", "/v1/me")["tenant"]
    viewer = provider.user("vera", tenant, "viewer")
    with Browser() as browser:
        pages = [
            browser.open(f"{provider.url}/#token={token}&mission={mission}")
            for token in (provider.token, viewer)
        ]
        pilot, watcher = pages
        pilot.until("document.querySelector('.command.pause:not(:disabled)')")
        pilot.run("document.querySelector('.command.pause').click()")
        pilot.until("document.querySelector('.orders li')?.dataset.stage === 'done'")
        for page in pages:
            page.until("document.querySelector('[data-testid=state]')?.innerText === 'paused'")
            # Where the lease is for stands on the map.
            page.until("document.querySelectorAll('[data-lease] polygon').length === 1")
            assert "admin: one" in page.run("document.querySelector('.leased').textContent")
            assert page.complaints() == []
        assert watcher.run("document.querySelectorAll('.command:disabled').length") == 5
        pilot.run("document.querySelector('.command.return-home').click()")
        watcher.until(
            "document.querySelector('[data-testid=banner]')?.innerText.includes('over')", 90
        )
        # The same page plays what has been recorded: for both, and from one moment to the other.
        for page in pages:
            page.until("document.querySelector('.banner button')", 60)
            page.run("document.querySelector('.banner button').click()")
            page.until("document.querySelector('.timeline')", 60)
            page.key("Home")
            page.until("document.querySelector('[data-testid=state]')?.innerText === 'taking off'")
            page.key("End")
            page.until("document.querySelector('[data-testid=state]').innerText === 'landed'")
            assert page.complaints() == []


def test_a_recording_is_played_to_its_own_tenant_once_it_is_there(
    provider: Served, mission: str
) -> None:
    """To no other one, and to no token that may not sense."""
    provider.ask("DELETE", f"/v1/missions/{mission}")
    path = f"/v1/missions/{mission}/playback"
    provider.until(lambda: provider.mission(mission)["recording"])
    provider.until(lambda: provider.ask("GET", path)["flight"])
    assert list(provider.ask("GET", path)["flight"]["tracks"]) == ["one"]
    picture = f"{path}/picture?stream=one/cam&at=1"
    assert provider.send("GET", picture)[0] == 422
    stranger = provider.user("eve", "others")
    blind = provider.user("ben", provider.ask("GET", "/v1/me")["tenant"], scopes=["fly"])
    for route in (path, picture):
        assert provider.send("GET", route, token=stranger)[0] == 404
        assert provider.send("GET", route, token=blind)[0] == 403
        assert provider.send("GET", route, token="")[0] == 401


def state_of(provider: Served, mission: str, drone: str) -> str:
    """What a drone of a mission does; empty while that is not known."""
    status = provider.mission(mission)["status"].get(drone)
    return str(status["mission"]["state"]) if status else ""


@needs_peer("AERODAAS_BROWSER")
def test_a_fleet_is_watched_and_commanded_by_role(provider: Served) -> None:
    """Each account commands at once the drones that it may command one by one, and no other."""
    pilot, viewer = provider.user("paul", "orchard"), provider.user("vic", "orchard", "viewer")
    way = ((40.0, 40.0), (40.0, 0.0), (0.0, 40.0), (40.0, 40.0))
    missions = {}
    for drone, token in (("two", pilot), ("three", provider.token)):
        answer = provider.ask("POST", "/v1/missions", {"document": document(drone, *way)}, token)
        missions[drone] = str(answer["id"])
    provider.until(
        lambda: all(state_of(provider, id_, drone) == "enroute" for drone, id_ in missions.items())
    )
    with Browser() as browser:
        pages = [
            browser.open(f"{provider.url}/#token={token}")
            for token in (pilot, viewer, provider.token)
        ]
        for page in pages:
            page.until("document.querySelectorAll('[data-row]').length === 3")
            page.until("document.querySelector('[data-row=two]').innerText.includes('enroute')")
            assert page.run("document.querySelectorAll('[data-drone]').length") == 3
        own, watching, every = pages
        # Another tenant's drone is on the map, and whose it is stays its own affair.
        assert "enroute" not in own.text("[data-row=three]")
        assert own.run("document.querySelector('[data-row=three] input').disabled")
        assert watching.run("document.querySelectorAll('.command:disabled').length") == 2

        own.run("document.querySelector('.command.pause').click()")
        own.until("document.querySelector('[data-testid=orders] [data-stage=done]')")
        assert state_of(provider, missions["two"], "two") == "paused"
        assert state_of(provider, missions["three"], "three") != "paused"
        every.until("document.querySelector('[data-row=two]').innerText.includes('paused')")

        # Those that are selected; to have all return is asked once more.
        every.run("document.querySelector('[data-row=three] input').click()")
        every.until("document.querySelector('.command.pause').innerText === 'Hold 1'")
        every.run("document.querySelector('.command.pause').click()")
        every.until("document.querySelector('[data-testid=orders] [data-stage=done]')")
        assert state_of(provider, missions["three"], "three") == "paused"
        every.key("Escape")
        every.until("document.querySelector('.command.return-home').innerText === 'Return all'")
        every.run("document.querySelector('.command.return-home').click()")
        every.until("document.querySelector('.command.return-home').innerText.includes('sure')")
        assert state_of(provider, missions["two"], "two") == "paused"
        every.run("document.querySelector('.command.return-home').click()")
        home = {"returning", "landing", "landed"}
        provider.until(lambda: all(state_of(provider, missions[d], d) in home for d in missions))
        # A mission is opened from its row.
        watching.press("[data-row=two] [data-label=Mission] button")
        watching.until("document.querySelector('[data-testid=now]')?.innerText.includes('two')")
        assert [one for page in pages for one in page.complaints()] == []
    given = [(one["account"], one["target"]) for one in provider.ask("GET", "/v1/audit?limit=1000")
             if one["action"] in {"mission.pause", "mission.return-home"}]  # fmt: skip
    assert ("paul", f"{missions['two']}/two") in given
    assert not [one for one in given if one[0] == "paul" and one[1] != f"{missions['two']}/two"]

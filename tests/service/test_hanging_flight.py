"""A flight whose process hangs is not shown as if it flew."""

from __future__ import annotations

import time

import pytest
from required import needs_peer
from served import Served, document, fleet, process_of, robot

from tools.browser import Browser

pytestmark = [pytest.mark.slow, pytest.mark.wall_clock, needs_peer("AERODAAS_BROWSER")]

_BANNER = "document.querySelector('[data-testid=banner]')"


def test_the_page_says_that_what_it_shows_is_old() -> None:
    """The service answers all the same, and repeats the last that it heard."""
    with Served(fleet(robot("one")), "--no-rehearse") as provider, Browser() as browser:
        wanted = {"document": document("one", (20.0, 0.0), (20.0, 20.0), (0.0, 20.0))}
        id_ = str(provider.ask("POST", "/v1/missions", wanted)["id"])
        provider.until(lambda: "one" in provider.mission(id_)["status"])
        viewer = provider.user("vera", provider.ask("GET", "/v1/me")["tenant"], "viewer")
        page = browser.open(f"{provider.url}/#token={viewer}&mission={id_}")
        page.until("document.querySelector('[data-testid=state]')?.innerText === 'enroute'", 60)
        assert page.run(f"{_BANNER} === null")
        flight = process_of(provider, id_)
        flight.suspend()
        try:
            page.until(f"{_BANNER}?.innerText.includes('The flight has been silent')")
            told = provider.mission(id_)["told"]["one"]
            time.sleep(1.0)
            # Who asks once sees how old it is.
            assert provider.mission(id_)["told"] == {"one": told}
            assert time.time() - told > 2.5
            # The service is there: only the flight is not.
            assert page.run("document.querySelector('[data-testid=connection]').innerText") == (
                "silent"
            )
        finally:
            flight.resume()
        page.until(f"{_BANNER} === null")
        assert page.complaints() == []

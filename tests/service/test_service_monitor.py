"""A vehicle behind the service between missions: watched, flown, unplugged, and found again."""

from __future__ import annotations

from typing import Any

import pytest
from served import Served, document, fleet, free_port, robot

from tools.mavlink_vehicle import AutopilotOptions, EmulatedAutopilot

pytestmark = [pytest.mark.slow, pytest.mark.wall_clock]


def test_a_vehicle_stays_known_between_its_missions() -> None:
    """Its UDP port, which one process can have, goes to the mission and back."""
    port = free_port()
    drone = robot("one")
    drone |= {"driver": "mavlink", "settings": {"url": f"udpin:127.0.0.1:{port}"}}
    options = AutopilotOptions(peer=("127.0.0.1", port), ready_after=0.0, battery=0.9)
    with Served(fleet(drone), "--no-rehearse") as provider:

        def seen() -> dict[str, Any]:
            (found,) = provider.ask("GET", "/v1/fleet")["robots"]
            return dict(found)

        provider.until(lambda: "not reachable since" in seen()["objection"], 30)
        assert "no HEARTBEAT" in seen()["objection"]
        body = {"document": document("one", (1, 0)), "minutes": 5}
        for path, wanted in (("/v1/missions", body), ("/v1/leases", {"robots": ["one"]})):
            status, text = provider.ask("POST", path, wanted)
            assert status == 409
            assert text.startswith("one: not reachable since")
        noted = [one for one in provider.ask("GET", "/v1/audit") if not one["accepted"]]
        assert sum("not reachable" in one["text"] for one in noted) == 2
        with EmulatedAutopilot(options):
            provider.until(lambda: seen()["link"] == "connected" and not seen()["objection"], 40)
            assert seen()["battery"] == pytest.approx(0.9, abs=0.02)
            id_ = provider.ask("POST", "/v1/missions", body)["id"]
            provider.until(lambda: seen()["mission"] == id_ and seen()["mode"] == "guided", 60)
            assert seen()["link"] == "mission"
            ended = provider.until_phase(id_)
            assert (ended["phase"], ended["reason"]) == ("landed", "")
            provider.until(lambda: seen()["link"] == "connected", 40)
            assert seen()["mode"] == "grounded"
            heard = seen()["heard"]
        provider.until(lambda: seen()["link"] == "lost" and "not reach" in seen()["objection"], 30)
        assert seen()["since"] >= heard
        with EmulatedAutopilot(options):
            provider.until(lambda: seen()["link"] == "connected", 40)

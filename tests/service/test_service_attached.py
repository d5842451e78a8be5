"""Two applications on one drone, of two tenants: one flies it, the other senses beside it."""

from __future__ import annotations

import json
import time
from collections.abc import Iterator
from typing import Any

import pytest
from served import Served, document, fleet, process_of, robot
from websockets.sync.client import connect

from aerodaas.recording.reader import Recording

pytestmark = [pytest.mark.slow, pytest.mark.wall_clock]

ROUND = ((25.0, 0.0), (25.0, 25.0), (0.0, 25.0)) * 4
"""A way of minutes: whoever is attached takes a while to start."""
WATCHING = {
    "format": "aerodaas-mission",
    "version": 1,
    "name": "watching",
    "sensors": ["one/cam"],
    "analyses": [
        {
            "id": "one/seen",
            "analysis": "SyntheticAnalytics",
            "settings": {"name": "seen", "edge_ms": 1, "cloud_ms": 1},
            "reads": ["one/cam"],
            "compute": "edge",
        }
    ],
}


@pytest.fixture(scope="module")
def provider() -> Iterator[Served]:
    """A drone with a small camera."""
    drone = robot("one")
    lens = {"width": 160, "height": 120}
    drone["sensors"].append({"id": "cam", "type": "camera", "rate": 5, "settings": lens})
    with Served(fleet(drone), "--no-rehearse", "--most-attached", "1") as served:
        yield served


def items(provider: Served, mission: str, token: str, count: int) -> list[Any]:
    """So many items of what an attached mission finds."""
    url = f"{provider.url.replace('http', 'ws')}/v1/missions/{mission}/live?streams=one/seen"
    found: list[Any] = []
    with connect(url, additional_headers={"Authorization": f"Bearer {token}"}) as socket:
        until = time.monotonic() + 120.0
        while len(found) < count:
            assert time.monotonic() < until
            text = json.loads(socket.recv(120.0))
            if text.get("kind") == "item":
                found.append(text["item"])
    return found


def test_another_tenant_senses_beside_the_flight(provider: Served) -> None:
    """By what its owner grants, until that is withdrawn; that it hangs costs the flight nothing."""
    users = {name: provider.user(name, f"t{name}") for name in ("asha", "bela", "eve")}
    narrow = {"account": "bela", "scopes": ["sense", "compute"]}
    bela = provider.ask("POST", "/v1/tokens", narrow)["secret"]
    flight = document("one", *ROUND, sensors=["one/odometry", "one/cam"])
    body = {"document": flight, "minutes": 10, "grants": {"tbela": ["one/cam"]}}
    host = provider.ask("POST", "/v1/missions", body, users["asha"])["id"]
    provider.until(lambda: "one/cam" in provider.mission(host)["streams"])
    wanted = {"document": WATCHING, "attach": host}
    assert provider.ask("POST", "/v1/missions", wanted, users["eve"])[0] == 404
    id_ = provider.ask("POST", "/v1/missions", wanted, bela)["id"]
    command = {"robot": "one", "command": "land"}
    for token, status in ((bela, 403), (users["bela"], 403), (users["asha"], 404)):
        way = f"/v1/missions/{id_}/commands"
        provider.until_phase(id_, "flying")
        assert provider.send("POST", way, command, token)[0] == status
    assert len(items(provider, id_, bela, 3)) == 3
    for path in (f"/v1/missions/{id_}", f"/v1/missions/{id_}/recording"):
        assert provider.send("GET", path, token=users["asha"])[0] == 404
    assert provider.send("GET", f"/v1/missions/{host}", token=bela)[0] == 404
    stuck = process_of(provider, id_)
    stuck.suspend()

    def flown() -> float:
        return float(provider.mission(host)["status"]["one"]["mission"]["distance"])

    before = flown()
    provider.until(lambda: flown() > before + 4.0)
    stuck.resume()
    assert provider.mission(host)["alerts"] == []
    provider.ask("DELETE", f"/v1/missions/{host}/grants/tbela", None, users["asha"])
    ended = provider.until_phase(id_)
    assert (ended["phase"], ended["reason"]) == ("landed", "tasha has withdrawn its grant")
    assert provider.mission(host)["phase"] == "flying"
    assert provider.ask("POST", "/v1/missions", wanted, bela)[0] == 404
    status, content = provider.send("GET", f"/v1/missions/{id_}/recording", token=bela)
    assert status == 200
    fetched = provider.folder / "attached.mcap"
    fetched.write_bytes(content)
    with Recording.open(fetched) as recording:
        assert recording.complete
        assert any("seen" in topic for topic in recording.topics)
    provider.ask("DELETE", f"/v1/missions/{host}", None, users["asha"])
    assert provider.until_phase(host)["status"]["one"]["mission"]["state"] == "landed"
    (used,) = [one for one in provider.ask("GET", "/v1/usage") if one["mission"] == id_]
    assert (used["tenant"], used["flight_seconds"]) == ("tbela", 0.0)
    noted = [one for one in provider.ask("GET", "/v1/audit?limit=200") if not one["accepted"]]
    assert {"eve", "bela"} <= {one["account"] for one in noted}
    assert any("senses only" in one["text"] for one in noted)

"""What tenants may use, as an administrator sets it while the service runs."""

from __future__ import annotations

import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest
from offered import PILOT, Provider
from served import Served, document, fleet, robot

from aerodaas.environment.provider.logins import client_for
from aerodaas.errors import ConfigError
from aerodaas.protocol.schemas import MissionIn, MissionPhase, TenantChange
from aerodaas.service.errors import RefusedError
from aerodaas.service.flights.orders import FlightOrder
from aerodaas.service.mission import ActiveMission, LostFlightError
from aerodaas.service.store import Tenant, Usage


@pytest.mark.slow
def test_quotas_are_set_and_hold_at_once() -> None:
    """What is not named stays; null is no limit again; others see what is theirs."""
    with Served(fleet(robot("one")), "--no-rehearse", "--no-monitor") as served:
        token, other = served.user("pia", "farm"), served.user("carl", "city")
        admin, pilot = client_for(served.url, served.token), client_for(served.url, token)
        assert {one.name for one in admin.tenants()} >= {"farm", "city"}
        assert [one.name for one in client_for(served.url, other).tenants()] == ["city"]
        made = admin.change_tenant("farm", TenantChange(flight_minutes=1.0, max_height=9.0))
        assert (made.flight_minutes, made.max_height, made.weight) == (1.0, 9.0, 1.0)
        assert pilot.tenants() == [made]
        wish = {"robots": ["one"], "minutes": 5}
        status, text = served.ask("POST", "/v1/leases", wish, token)
        assert (status, "leaves 1.0 flight minutes" in text) == (403, True)
        made = admin.change_tenant("farm", TenantChange(flight_minutes=None))
        assert (made.flight_minutes, made.max_height) == (None, 9.0)
        assert served.ask("POST", "/v1/leases", wish, token)["state"] == "granted"
        told = [one.text for one in admin.audit() if one.action == "tenant.change"]
        assert told == ['{"flight_minutes":null}', '{"flight_minutes":1.0,"max_height":9.0}']
        with pytest.raises(ConfigError, match="no tenant nobody"):
            admin.change_tenant("nobody", TenantChange(weight=2.0))
        for bad in ({"flight_minutes": -1}, {"weight": 0}, {"weight": None}, {"hours": 3}):
            assert served.send("PATCH", "/v1/tenants/farm", bad)[0] == 422


@pytest.fixture
def provider(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[Provider]:
    """A provider whose tenant `farm` has used up its calls of the cloud."""
    compute = [{"id": "near", "kind": "edge"}, {"id": "far", "kind": "cloud"}]
    made = Provider(tmp_path, monkeypatch, compute=compute)
    made.monitor.see("one")
    made.store.tenants.put(Tenant("farm", cloud_calls=3))
    mission = made.flying()
    made.land()
    made.turns()
    made.monitor.see("one")
    made.store.usage.put(Usage(mission.id, "farm", "pilot", time.time(), cloud_calls=3))
    yield made
    made.close()


@pytest.mark.parametrize(
    ("place", "scheduler", "fits"),
    [
        ("near", None, True),
        (None, None, True),
        ("far", None, False),
        ("near", "dems", False),
    ],
)
def test_only_what_may_call_the_cloud_needs_calls(
    provider: Provider,
    place: str | None,
    scheduler: str | None,
    fits: bool,  # noqa: FBT001 - a parameter
) -> None:
    """An analytics scheduler may place any analysis there."""
    found: dict[str, Any] = {"id": "one/people", "analysis": "OnnxDetector", "reads": ["one/cam"]}
    found |= {"compute": place} if place else {}
    more = {"analytics_scheduler": scheduler} if scheduler else {}
    flight = document("one", (5, 0), sensors=["one/cam"], analyses=[found], **more)
    wanted = MissionIn.model_validate({"document": flight})
    if fits:
        provider.missions.submit(PILOT, wanted)
    else:
        with pytest.raises(RefusedError, match="cloud calls of farm are used up"):
            provider.missions.submit(PILOT, wanted)


def test_the_recording_of_a_lost_flight_can_be_deleted(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """It has told of no usage."""
    provider = Provider(tmp_path, monkeypatch)
    mission = provider.flying()
    provider.started[-1].recording.write_bytes(b"begun")

    def lost(_: ActiveMission) -> None:
        raise LostFlightError("its processes have ended")

    monkeypatch.setattr(ActiveMission, "flight_outcome", lost)
    provider.turns()
    assert provider.phase(mission) is MissionPhase.FAILED
    assert provider.missions.shown(mission.id).recording
    provider.missions.delete_recording(PILOT, mission.id)
    assert not provider.missions.shown(mission.id).recording
    provider.close()


def test_a_flight_has_the_weight_of_its_tenant(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """As it is when the flight begins."""
    provider = Provider(tmp_path, monkeypatch, edge_slots=1)
    provider.store.tenants.put(Tenant("farm", weight=3.0))
    provider.flying()
    edge = FlightOrder.read(provider.started[-1].order).edge
    assert edge is not None
    assert (edge.tenant, edge.weight) == ("farm", 3.0)
    provider.close()

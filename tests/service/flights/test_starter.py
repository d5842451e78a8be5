"""What the service's own processes are given of its environment."""

from __future__ import annotations

import pytest

from aerodaas.service.flights.folder import service_free_environment


@pytest.mark.parametrize("vehicles", [True, False])
def test_only_who_is_connected_with_vehicles_gets_their_key(
    monkeypatch: pytest.MonkeyPatch,
    vehicles: bool,  # noqa: FBT001
) -> None:
    """Nobody gets the service's own tokens; all else is handed on."""
    monkeypatch.setenv("AERODAAS_MAVLINK_KEY", "k" * 64)
    monkeypatch.setenv("AERODAAS_TOKEN", "t")
    monkeypatch.setenv("LANG", "C")
    given = service_free_environment(vehicles=vehicles)
    ours = {name for name in given if name.startswith("AERODAAS_")}
    assert ours == ({"AERODAAS_MAVLINK_KEY"} if vehicles else set())
    assert given["LANG"] == "C"

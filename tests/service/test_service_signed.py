"""A vehicle that obeys a key alone, behind a service that has it in its environment."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import pytest
from served import Served, document, fleet, free_port, robot

from tools.mavlink_vehicle import AutopilotOptions, EmulatedAutopilot

pytestmark = [pytest.mark.slow, pytest.mark.wall_clock]

VARIABLE = "AERODAAS_MAVLINK_KEY"
KEY = bytes(range(100, 132))


def holders() -> Iterator[str]:
    """Command lines of the processes that were started with the key."""
    for process in Path("/proc").glob("[0-9]*"):
        try:
            variables = (process / "environ").read_bytes()
            command = (process / "cmdline").read_bytes()
        except OSError:
            continue
        if KEY.hex().encode() in variables:
            yield command.replace(b"\0", b" ").decode()


def test_a_signed_vehicle_is_watched_and_flown(monkeypatch: pytest.MonkeyPatch) -> None:
    """The key reaches who watches and who flies it; no other actor's process, and no file."""
    monkeypatch.setenv(VARIABLE, KEY.hex())
    port = free_port()
    drone = robot("one")
    drone |= {"driver": "mavlink", "settings": {"url": f"udpin:127.0.0.1:{port}"}}
    options = AutopilotOptions(peer=("127.0.0.1", port), ready_after=0.0, battery=0.9, key=KEY)
    with EmulatedAutopilot(options), Served(fleet(drone), "--no-rehearse") as provider:

        def link() -> str:
            return str(provider.ask("GET", "/v1/fleet")["robots"][0]["link"])

        provider.until(lambda: link() == "connected", 60)
        body = {"document": document("one", (1, 0)), "minutes": 5}
        id_ = provider.ask("POST", "/v1/missions", body)["id"]
        provider.until_phase(id_, "flying")
        provider.until(lambda: bool(provider.mission(id_)["status"]), 60)
        held = list(holders())
        ended = provider.until_phase(id_)
        assert (ended["phase"], ended["reason"]) == ("landed", "")
        known = (" serve ", "aerodaas.service.monitor", "aerodaas.flights")
        assert {next((one for one in known if one in line), line) for line in held} == {*known}
        files = [path for path in provider.folder.rglob("*") if path.is_file()]
        assert any(path.suffix == ".mcap" for path in files)
        contents = [path.read_bytes() for path in files]
        assert not any(KEY in one or KEY.hex().encode() in one for one in contents)

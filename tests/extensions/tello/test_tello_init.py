"""`aerodaas init` for a Tello: found by its state or by asking it, and only asked if wished."""

from __future__ import annotations

import socket
import threading

import pytest
from flying import FLAT, Flyer, hop, robot
from init_command import LOOPBACK, Command, beating, free_udp, init_command, load

from aerodaas.cameras import devices
from aerodaas.config.extensions import VehicleDiscovery
from aerodaas.drivers.mavlink import discovery as mavlink_discovery
from aerodaas.drivers.mavlink.discovery import MavlinkDiscovery
from aerodaas.errors import ConfigError
from aerodaas.extensions.tello import discovery as tello_discovery
from aerodaas.extensions.tello.discovery import find_tello

__all__ = ["init_command"]


def test_a_tello_that_is_found_is_written(
    init_command: Command, monkeypatch: pytest.MonkeyPatch
) -> None:
    """With its address and its own camera; its notes are printed where none is found."""
    asked: list[object] = []
    tello = VehicleDiscovery("192.168.10.1")

    def find(_: float, ask: str | None) -> VehicleDiscovery:
        asked.append(ask)
        return tello

    monkeypatch.setattr(mavlink_discovery, "hear_vehicles", lambda _: MavlinkDiscovery())
    monkeypatch.setattr(devices, "video_devices", lambda: ([], []))
    monkeypatch.setattr(tello_discovery, "find_tello", find)
    code, told = init_command("--discover")
    assert (code, "tello at 192.168.10.1" in told) == (0, True)
    assert load().robots[0].settings == {"address": "192.168.10.1"}
    assert init_command("--discover", "--ask", "192.168.10.7", "--force")[0] == 0
    assert asked == [None, "192.168.10.7"]
    tello = VehicleDiscovery(None, ("as in a Tello's Wi-Fi",))
    code, told = init_command("--discover", "-o", "other.json")
    assert (code, "no vehicle was found" in told, "Wi-Fi" in told) == (2, True, True)


def test_a_tello_is_asked_only_if_wished(monkeypatch: pytest.MonkeyPatch) -> None:
    """Without it nothing arrives; with it `command` does, and the answer is the Tello's."""
    monkeypatch.setattr(tello_discovery, "STATE_PORT", free_udp())
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as tello:
        tello.bind((LOOPBACK, 0))
        tello.settimeout(0.0)
        port = tello.getsockname()[1]
        assert find_tello(0.2, port=port).address is None
        with pytest.raises(BlockingIOError):
            tello.recvfrom(100)
        tello.settimeout(5.0)

        def answer(source: socket.socket) -> None:
            content, peer = tello.recvfrom(100)
            source.sendto(b"ok" if content == b"command" else b"error", peer)

        with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as stranger:
            stranger.bind(("127.0.0.2", 0))
            for source, found in ((stranger, None), (tello, LOOPBACK)):
                thread = threading.Thread(target=answer, args=(source,))
                thread.start()
                assert find_tello(0.4, LOOPBACK, port=port).address == found
                thread.join()
    silent = find_tello(0.1, LOOPBACK, port=free_udp())
    assert silent == VehicleDiscovery(None, (f"no Tello answers at {LOOPBACK}",))


def test_a_tello_that_talks_is_heard(monkeypatch: pytest.MonkeyPatch) -> None:
    """Its state packets say where it is; a host in its network is told how to ask."""
    port = free_udp()
    monkeypatch.setattr(tello_discovery, "STATE_PORT", port)
    state = (
        b"mid:-1;x:0;y:0;z:0;mpry:0,0,0;pitch:0;roll:0;yaw:0;vgx:0;vgy:0;vgz:0;templ:60;temph:62;"
        b"tof:10;h:0;bat:87;baro:1.0;time:0;agx:0.0;agy:0.0;agz:-999.0;\r\n"
    )
    with beating(state, port=port):
        assert find_tello(5.0).address == LOOPBACK
    monkeypatch.setattr(tello_discovery, "_own_addresses", lambda: ["10.0.0.2", "192.168.10.3"])
    assert "--ask" in " ".join(find_tello(0.1).notes)
    monkeypatch.setattr(tello_discovery, "_own_addresses", lambda: ["10.0.0.2", "192.168.11.3"])
    assert find_tello(0.1).notes == ()


def test_a_tellos_camera_on_another_drone_is_refused_before_the_flight(flyer: Flyer) -> None:
    """With the driver that its robot would need."""
    camera = {"id": "cam", "driver": "tello"}
    with pytest.raises(ConfigError, match="tello"):
        flyer.fly(
            lambda env: env.get_robot_by_id("drone").navigate(hop((1, 0))),
            {**FLAT, "robots": [robot(sensors=[camera])]},
        )

"""`aerodaas init` writes environments that load and can be checked, and sends nothing unasked."""

from __future__ import annotations

import itertools
import json
import socket
import struct
import time
from pathlib import Path

import pytest
from init_command import LOOPBACK, Command, beating, free_udp, init_command, load

from aerodaas.cameras import devices
from aerodaas.cameras.devices import VideoDevice, capability, video_devices
from aerodaas.config.environment_choices import EnvironmentChoices, vehicle_kinds
from aerodaas.drivers.mavlink import discovery as mavlink_discovery
from aerodaas.drivers.mavlink.discovery import HeardVehicle, MavlinkDiscovery, hear_vehicles
from aerodaas.drivers.mavlink.wire.dialect import mavlink

__all__ = ["init_command"]


@pytest.mark.parametrize("vehicle", vehicle_kinds())
def test_every_choice_loads(init_command: Command, vehicle: str) -> None:
    """Each vehicle with its own cameras, none, a stream and a folder; the schema lies beside."""
    Path("pictures").mkdir()
    cameras = [[], ["none"], ["rtsp://127.0.0.1:8554/front", "pictures"]]
    for words in cameras:
        given = list(itertools.chain.from_iterable(("--camera", word) for word in words))
        code, told = init_command("--vehicle", vehicle, *given, "--force")
        assert code == 0, told
        assert "next: aerodaas check environment.json" in told
        config = load()
        (robot,) = config.robots
        assert robot.driver == vehicle_kinds()[vehicle].driver
        own = 1 if vehicle_kinds()[vehicle].camera is not None else 0
        seen = [sensor for sensor in robot.sensors if sensor.type == "camera"]
        assert len(seen) == (own if not words else len(words) - words.count("none"))
        assert all(config.has_pictures(sensor) for sensor in seen)
        assert robot.limits.geofence.polygon
    assert json.loads(Path("environment.json").read_text())["$schema"] == "environment.schema.json"
    assert "properties" in json.loads(Path("environment.schema.json").read_text())


def test_what_was_written_can_be_checked(init_command: Command) -> None:
    """`aerodaas check` of the environment alone asks vehicle and camera, and nothing flies."""
    assert init_command("--vehicle", "simulated")[0] == 0
    code, told = init_command("environment.json", command="check")
    words = " ".join(told.split())
    assert code == 0, told
    assert "ok environment robots: 1; sensors: 3; compute: edge" in words
    assert "ok drone simulated answers: grounded" in words
    assert "ok drone/camera simulated gives pictures of 640 x 360" in words
    code, told = init_command("environment.json", "--set", "drone.wings=2", command="check")
    assert (code, "wings" in told) == (2, True)
    code, told = init_command("environment.json", "--no-connect", command="check")
    assert (code, "answers" in told) == (0, False)


def test_questions_are_asked(init_command: Command, monkeypatch: pytest.MonkeyPatch) -> None:
    """A wrong vehicle is asked for again, cameras are split at commas, and silence is told."""
    found = [VideoDevice("/dev/video7", "HD Webcam")]
    monkeypatch.setattr(devices, "video_devices", lambda: (found, []))
    answers = "heli\nardupilot\ntcp:127.0.0.1:5760\n/dev/video7, rtsp://h/a\n"
    code, told = init_command(answers=answers)
    assert code == 0, told
    assert "/dev/video7 is there: HD Webcam" in told
    (robot,) = load().robots
    assert robot.settings == {"url": "tcp:127.0.0.1:5760"}
    assert [
        (one.id, one.settings.get("path")) for one in robot.sensors if one.type == "camera"
    ] == [
        ("camera", "/dev/video7"),
        ("camera2", "rtsp://h/a"),
    ]
    code, told = init_command("-o", "other.json", answers="px4\n")
    assert code == 2
    assert "give --vehicle" in told
    assert not Path("other.json").exists()


@pytest.mark.parametrize(
    ("words", "message"),
    [
        (("--vehicle", "py4"), "did you mean px4?"),
        (("--url", "udpin:127.0.0.1:1"), "name the vehicle, too"),
        (("--vehicle", "simulated", "--url", "x"), "a simulated drone has no address"),
        (("--vehicle", "px4", "--camera", "simulated"), "is a simulated drone's own"),
        (("--vehicle", "simulated", "--camera", "holiday.mp4"), "no camera 'holiday.mp4'"),
        (("--vehicle", "simulated", "-c", "none", "-c", "simulated"), "goes with no other camera"),
        (("--vehicle", "px4", "--ask", "192.168.10.1"), "goes with --discover"),
    ],
)
def test_what_cannot_be_is_refused(
    init_command: Command, words: tuple[str, ...], message: str
) -> None:
    """With the remedy, and nothing is written."""
    code, told = init_command(*words)
    assert code == 2
    assert message in told
    assert not list(Path().iterdir())


def test_a_file_that_is_there_stays(init_command: Command) -> None:
    """Unless --force says otherwise; before anything is asked or listened for."""
    Path("environment.json").write_text("mine")
    for words in ((), ("--vehicle", "px4"), ("--discover",)):
        code, told = init_command(*words)
        assert (code, Path("environment.json").read_text()) == (2, "mine")
        assert "--force" in told
    Path("environment.schema.json").write_text("mine, too")
    assert init_command("--vehicle", "px4", "--output", "other.json")[0] == 0
    assert Path("environment.schema.json").read_text() == "mine, too"
    assert init_command("--vehicle", "px4", "--force")[0] == 0
    assert load().robots[0].driver == "mavlink"


def test_a_folder_of_pictures_is_found_from_the_file(init_command: Command, tmp_path: Path) -> None:
    """The path is written as seen from the environment file's folder."""
    Path("pictures").mkdir()
    assert init_command("--vehicle", "px4", "-c", "pictures", "-o", "env/field.json")[0] == 0
    (robot,) = load("env/field.json").robots
    assert robot.sensors[0].settings["path"] == "../pictures"
    assert (tmp_path / "env" / "environment.schema.json").is_file()


def test_what_is_found_is_written(init_command: Command, monkeypatch: pytest.MonkeyPatch) -> None:
    """The first vehicle, with its system where several share the address, and all cameras."""
    url = "udpin:127.0.0.1:14540"
    heard = MavlinkDiscovery(
        (HeardVehicle("px4", url, 3), HeardVehicle("px4", url, 4)), ("port 14550 is taken",)
    )
    monkeypatch.setattr(mavlink_discovery, "hear_vehicles", lambda _: heard)
    monkeypatch.setattr(devices, "video_devices", lambda: ([VideoDevice("/dev/video0", "W")], []))
    searched = {name: kind for name, kind in vehicle_kinds().items() if not kind.find}
    monkeypatch.setattr("aerodaas.cli.init.vehicle_kinds", lambda: searched)
    code, told = init_command("--discover")
    assert code == 0, told
    for line in ("px4, system 4", "port 14550 is taken", "/dev/video0: W"):
        assert line in told
    (robot,) = load().robots
    assert robot.settings == {"url": url, "system": 3}
    assert robot.sensors[0].settings["path"] == "/dev/video0"
    monkeypatch.setattr(mavlink_discovery, "hear_vehicles", lambda _: MavlinkDiscovery())
    code, told = init_command("--discover", "-o", "other.json")
    assert (code, "no vehicle was found" in told) == (2, True), told


def heartbeat(system: int, kind: int, autopilot: int) -> bytes:
    """One packet."""
    message = mavlink.MAVLink_heartbeat_message(kind, autopilot, 0, 0, 3, 3)
    packed: bytes = message.pack(mavlink.MAVLink(None, system, 1))
    return packed


def test_vehicles_are_heard_and_get_nothing() -> None:
    """Each by its system and its kind; a rover and noise are told; no packet goes to them."""
    port, quiet = free_udp(), free_udp()
    packets = (
        heartbeat(1, mavlink.MAV_TYPE_QUADROTOR, mavlink.MAV_AUTOPILOT_PX4),
        heartbeat(2, mavlink.MAV_TYPE_HEXAROTOR, mavlink.MAV_AUTOPILOT_ARDUPILOTMEGA),
        heartbeat(3, mavlink.MAV_TYPE_GROUND_ROVER, mavlink.MAV_AUTOPILOT_PX4),
    )
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as holder:
        holder.bind((LOOPBACK, 0))
        taken = holder.getsockname()[1]
        urls = [f"udpin:0.0.0.0:{port}", f"udpin:127.0.0.1:{quiet}", f"udpin:127.0.0.1:{taken}"]
        began = time.monotonic()
        with beating(*packets, port=port) as sender:
            found = hear_vehicles(0.4, [*urls, "tcp:127.0.0.1:1"])
            with pytest.raises(BlockingIOError):
                sender.recvfrom(100)
        assert time.monotonic() - began < 3.0
    url = f"udpin:127.0.0.1:{port}"
    assert found.vehicles == (HeardVehicle("px4", url, 1), HeardVehicle("ardupilot", url, 2))
    taken_note, rover = found.notes
    assert f"port {taken} is taken" in taken_note
    assert "ground rover" in rover


def test_noise_is_told() -> None:
    """Packets that cannot be read, such as of another protocol."""
    port = free_udp()
    with beating(b"\xfd\x00noise noise noise noise", port=port):
        found = hear_vehicles(0.3, [f"udpin:127.0.0.1:{port}"])
    assert found.vehicles == ()
    assert "none that can be read" in " ".join(found.notes)


def test_only_nodes_that_capture_are_cameras(tmp_path: Path) -> None:
    """As the kernel's struct says: a node's own flags go before the device's."""

    def answer(device: int, node: int) -> bytes:
        card = b"HD Webcam\0".ljust(32, b"\0")
        return struct.pack("16s32s32sIII12x", b"uvcvideo", card, b"usb", 0x60000, device, node)

    capture, streaming, metadata, own = 0x1, 0x0400_0000, 0x0080_0000, 0x8000_0000
    device = own | capture | streaming | metadata
    assert capability(answer(device, capture | streaming)) == "HD Webcam"
    assert capability(answer(device, metadata | streaming)) is None
    assert capability(answer(capture | streaming, 0)) == "HD Webcam"
    assert capability(answer(capture, 0)) is None
    (tmp_path / "video0").touch()
    (tmp_path / "videodev").touch()
    found, notes = video_devices(tmp_path)
    assert (found, len(notes)) == ([], 1)
    assert notes[0].startswith(f"{tmp_path / 'video0'}: ")


def test_addresses_and_systems_reach_the_file(tmp_path: Path) -> None:
    """As options or discovery gave them."""
    document = EnvironmentChoices("px4", "serial:/dev/ttyACM0:57600", 7).document(
        "s.json", tmp_path
    )
    (robot,) = document["robots"]
    assert robot["settings"] == {"url": "serial:/dev/ttyACM0:57600", "system": 7}
    assert document["$schema"] == "s.json"
    assert "simulation" not in document

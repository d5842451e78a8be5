"""`aerodaas init` writes environments that load and can be checked, and sends nothing unasked."""

from __future__ import annotations

import io
import itertools
import json
import socket
import struct
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path

import pytest

from aerodaas.cameras import devices
from aerodaas.cameras.devices import VideoDevice, capability, video_devices
from aerodaas.cli.app import main
from aerodaas.config.environment_choices import VEHICLES, EnvironmentChoices
from aerodaas.config.model import EnvironmentConfig
from aerodaas.drivers.mavlink import discovery as mavlink_discovery
from aerodaas.drivers.mavlink.discovery import HeardVehicle, MavlinkDiscovery, hear_vehicles
from aerodaas.drivers.mavlink.wire.dialect import mavlink
from aerodaas.drivers.tello import discovery as tello_discovery
from aerodaas.drivers.tello.discovery import TelloDiscovery, find_tello
from aerodaas.runtime.checks import check_environment

LOOPBACK = "127.0.0.1"
Command = Callable[..., tuple[int, str]]


@pytest.fixture
def init(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> Command:
    """The command in an empty folder, with answers to its questions: exit code and all it says."""
    monkeypatch.chdir(tmp_path)

    def run(*words: str, answers: str = "", command: str = "init") -> tuple[int, str]:
        monkeypatch.setattr("sys.argv", ["aerodaas", command, *words])
        monkeypatch.setattr("sys.stdin", io.StringIO(answers))
        with pytest.raises(SystemExit) as ended:
            main()
        told = capsys.readouterr()
        return int(ended.value.code or 0), told.out + told.err

    return run


def load(path: str = "environment.json") -> EnvironmentConfig:
    """The file, checked as an application's is."""
    config = EnvironmentConfig.load(path)
    check_environment(config, path)
    return config


@pytest.mark.parametrize("vehicle", VEHICLES)
def test_every_choice_loads(init: Command, vehicle: str) -> None:
    """Each vehicle with its own cameras, none, a stream and a folder; the schema lies beside."""
    Path("pictures").mkdir()
    cameras = [[], ["none"], ["rtsp://127.0.0.1:8554/front", "pictures"]]
    for words in cameras:
        given = list(itertools.chain.from_iterable(("--camera", word) for word in words))
        code, told = init("--vehicle", vehicle, *given, "--force")
        assert code == 0, told
        assert "next: aerodaas check environment.json" in told
        config = load()
        (robot,) = config.robots
        assert robot.driver == {"px4": "mavlink", "ardupilot": "mavlink"}.get(vehicle, vehicle)
        own = 1 if vehicle in {"simulated", "tello"} else 0
        seen = [sensor for sensor in robot.sensors if sensor.type == "camera"]
        assert len(seen) == (own if not words else len(words) - words.count("none"))
        assert all(config.has_pictures(sensor) for sensor in seen)
        assert robot.limits.geofence.polygon
    assert json.loads(Path("environment.json").read_text())["$schema"] == "environment.schema.json"
    assert "properties" in json.loads(Path("environment.schema.json").read_text())


def test_what_was_written_can_be_checked(init: Command) -> None:
    """`aerodaas check` of the environment alone asks vehicle and camera, and nothing flies."""
    assert init("--vehicle", "simulated")[0] == 0
    code, told = init("environment.json", command="check")
    words = " ".join(told.split())
    assert code == 0, told
    assert "ok environment robots: 1; sensors: 3; compute: edge" in words
    assert "ok drone simulated answers: grounded" in words
    assert "ok drone/camera simulated gives pictures of 640 x 360" in words
    code, told = init("environment.json", "--set", "drone.wings=2", command="check")
    assert (code, "wings" in told) == (2, True)
    code, told = init("environment.json", "--no-connect", command="check")
    assert (code, "answers" in told) == (0, False)


def test_questions_are_asked(init: Command, monkeypatch: pytest.MonkeyPatch) -> None:
    """A wrong vehicle is asked for again, cameras are split at commas, and silence is told."""
    found = [VideoDevice("/dev/video7", "HD Webcam")]
    monkeypatch.setattr(devices, "video_devices", lambda: (found, []))
    answers = "heli\nardupilot\ntcp:127.0.0.1:5760\n/dev/video7, rtsp://h/a\n"
    code, told = init(answers=answers)
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
    code, told = init("-o", "other.json", answers="px4\n")
    assert code == 2
    assert "nobody answers: say --vehicle" in told
    assert not Path("other.json").exists()


@pytest.mark.parametrize(
    ("words", "message"),
    [
        (("--vehicle", "py4"), "did you mean px4?"),
        (("--url", "udpin:127.0.0.1:1"), "say whose it is, too"),
        (("--vehicle", "simulated", "--url", "x"), "a simulated drone has no address"),
        (("--vehicle", "px4", "--camera", "simulated"), "is a simulated drone's own"),
        (("--vehicle", "simulated", "--camera", "holiday.mp4"), "no camera 'holiday.mp4'"),
        (("--vehicle", "tello", "-c", "none", "-c", "tello"), "goes with no other camera"),
        (("--vehicle", "tello", "--ask-tello", "192.168.10.1"), "goes with --discover"),
    ],
)
def test_what_cannot_be_is_refused(init: Command, words: tuple[str, ...], message: str) -> None:
    """With the remedy, and nothing is written."""
    code, told = init(*words)
    assert code == 2
    assert message in told
    assert not list(Path().iterdir())


def test_a_file_that_is_there_stays(init: Command) -> None:
    """Unless --force says otherwise; before anything is asked or listened for."""
    Path("environment.json").write_text("mine")
    for words in ((), ("--vehicle", "px4"), ("--discover",)):
        code, told = init(*words)
        assert (code, Path("environment.json").read_text()) == (2, "mine")
        assert "--force" in told
    Path("environment.schema.json").write_text("mine, too")
    assert init("--vehicle", "px4", "--output", "other.json")[0] == 0
    assert Path("environment.schema.json").read_text() == "mine, too"
    assert init("--vehicle", "px4", "--force")[0] == 0
    assert load().robots[0].driver == "mavlink"


def test_a_folder_of_pictures_is_found_from_the_file(init: Command, tmp_path: Path) -> None:
    """The path is written as seen from the environment file's folder."""
    Path("pictures").mkdir()
    assert init("--vehicle", "px4", "-c", "pictures", "-o", "env/field.json")[0] == 0
    (robot,) = load("env/field.json").robots
    assert robot.sensors[0].settings["path"] == "../pictures"
    assert (tmp_path / "env" / "environment.schema.json").is_file()


def test_what_is_found_is_written(init: Command, monkeypatch: pytest.MonkeyPatch) -> None:
    """The first vehicle, with its system where several share the address, and all cameras."""
    url = "udpin:127.0.0.1:14540"
    heard = MavlinkDiscovery(
        (HeardVehicle("px4", url, 3), HeardVehicle("px4", url, 4)), ("port 14550 is taken",)
    )
    asked: list[object] = []
    tello = TelloDiscovery("192.168.10.1")
    monkeypatch.setattr(mavlink_discovery, "hear_vehicles", lambda _: heard)

    def look(_: float, ask: str | None) -> TelloDiscovery:
        asked.append(ask)
        return tello

    monkeypatch.setattr(tello_discovery, "find_tello", look)
    monkeypatch.setattr(devices, "video_devices", lambda: ([VideoDevice("/dev/video0", "W")], []))
    code, told = init("--discover")
    assert code == 0, told
    for line in ("px4, system 4", "port 14550 is taken", "tello at 192.168.10.1", "/dev/video0: W"):
        assert line in told
    (robot,) = load().robots
    assert robot.settings == {"url": url, "system": 3}
    assert robot.sensors[0].settings["path"] == "/dev/video0"
    assert init("--discover", "--vehicle", "tello", "--force", "-c", "tello")[0] == 0
    assert load().robots[0].settings == {"address": "192.168.10.1"}
    assert init("--discover", "--ask-tello", "192.168.10.7", "--force")[0] == 0
    assert asked == [None, None, "192.168.10.7"]
    monkeypatch.setattr(mavlink_discovery, "hear_vehicles", lambda _: MavlinkDiscovery())
    tello = TelloDiscovery(None, ("as in a Tello's Wi-Fi",))
    code, told = init("--discover", "-o", "other.json")
    assert (code, "no vehicle was found" in told, "Wi-Fi" in told) == (2, True, True)


@contextmanager
def beating(*messages: object, port: int) -> Iterator[socket.socket]:
    """A sender of these packets to a port of loopback, ten times a second."""
    over = threading.Event()
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as sender:
        sender.bind((LOOPBACK, 0))
        sender.settimeout(0.0)

        def send() -> None:
            while not over.wait(0.1):
                for message in messages:
                    sender.sendto(message if isinstance(message, bytes) else b"", (LOOPBACK, port))

        thread = threading.Thread(target=send)
        thread.start()
        try:
            yield sender
        finally:
            over.set()
            thread.join()


def heartbeat(system: int, kind: int, autopilot: int) -> bytes:
    """One packet."""
    message = mavlink.MAVLink_heartbeat_message(kind, autopilot, 0, 0, 3, 3)
    packed: bytes = message.pack(mavlink.MAVLink(None, system, 1))
    return packed


def free_udp() -> int:
    """A port that nobody uses at present."""
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as probe:
        probe.bind((LOOPBACK, 0))
        port: int = probe.getsockname()[1]
        return port


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
    assert silent == TelloDiscovery(None, (f"no Tello answers at {LOOPBACK}",))


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
    assert "--ask-tello" in " ".join(find_tello(0.1).notes)
    monkeypatch.setattr(tello_discovery, "_own_addresses", lambda: ["10.0.0.2", "192.168.11.3"])
    assert find_tello(0.1).notes == ()


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

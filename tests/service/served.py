"""A provider's service as its users meet it: a process of its own, behind a socket."""

from __future__ import annotations

import contextlib
import json
import re
import signal
import socket
import subprocess
import sys
import tempfile
import time
import urllib.error
import urllib.request
from collections.abc import Callable
from pathlib import Path
from typing import Any

import psutil
from typing_extensions import Self

START_SECONDS = 60.0
FLIGHT_SECONDS = 240.0
OVER = {"landed", "applied", "refused", "cancelled", "failed"}


def free_port() -> int:
    """A UDP port that nobody uses at present."""
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as probe:
        probe.bind(("127.0.0.1", 0))
        port: int = probe.getsockname()[1]
        return port


def robot(name: str, east: float = 0.0, **limits: object) -> dict[str, Any]:
    """A simulated drone that stands `east` metres of home, with odometry."""
    fence = {"polygon": [[-30, -30], [60, -30], [60, 60], [-30, 60]], "ceiling": 20}
    return {
        "id": name,
        "start": [east, 0, 0],
        "sensors": [{"id": "odometry", "type": "odometry", "rate": 10}],
        "limits": {"geofence": fence, "cruise_speed": 2, **limits},
    }


def fleet(*robots: dict[str, Any]) -> dict[str, Any]:
    """An environment file of these drones."""
    return {
        "name": "campus",
        "robots": list(robots),
        "compute": [{"id": "edge", "kind": "edge"}],
        "simulation": {"world": "empty", "seed": 5},
    }


def quick(environment: Path) -> dict[str, Any]:
    """An environment file whose drone flies 2 m/s and films three pictures a second.

    What is flown twice and compared shows the same as at the file's own pace.
    """
    content: dict[str, Any] = json.loads(environment.read_text())
    for one in content["robots"]:
        one["limits"]["cruise_speed"] = 2.0
        for sensor in one["sensors"]:
            sensor["rate"] = 3
    return content


def document(robot: str, *places: tuple[float, float], **changes: object) -> dict[str, Any]:
    """A mission document that visits these places, 2 m up."""
    waypoints = [
        {"id": f"wp{number}", "x": east, "y": north, "z": 2.0, "waypoint_type": "local"}
        for number, (east, north) in enumerate(places)
    ]
    return {
        "format": "aerodaas-mission",
        "version": 1,
        "name": "visits",
        "sensors": [f"{robot}/odometry"],
        "navigation": [{"robot": robot, "waypoints": waypoints}],
        **changes,
    }


class Served:
    """A service, with the administrator's token; ends its flights when it is left."""

    def __init__(self, content: dict[str, Any], *words: str) -> None:
        """Serve an environment file of this content with further words of the command line."""
        # A socket's path is short.
        self._temporary = tempfile.TemporaryDirectory(prefix="served-", dir="/tmp")
        self.folder = Path(self._temporary.name)
        self._file = self.folder / "fleet.json"
        self._file.write_text(json.dumps(content), encoding="utf-8")
        self._words = words
        self.token = ""
        self.url = ""

    def __enter__(self) -> Self:
        self.start()
        return self

    def __exit__(self, *_: object) -> None:
        with contextlib.suppress(Exception):
            for mission in self.ask("GET", "/v1/missions"):
                if mission["phase"] not in OVER:
                    self.ask("DELETE", f"/v1/missions/{mission['id']}")
            self.until(lambda: all(one["phase"] in OVER for one in self.ask("GET", "/v1/missions")))
        self.stop()
        self._temporary.cleanup()

    def start(self) -> None:
        """Start the service and wait until it answers."""
        command = [sys.executable, "-m", "aerodaas", "serve", str(self._file)]
        command += ["--state", str(self.folder / "s"), "--port", "0", *self._words]
        self.log = self.folder / "log"
        with self.log.open("a") as log:
            began = log.tell()
            self.process = subprocess.Popen(command, stdout=log, stderr=log)
        until = time.monotonic() + START_SECONDS
        while time.monotonic() < until and self.process.poll() is None:
            said = self.log.read_text()[began:]
            if found := re.search(r"shown this once: (\S+)", said):
                self.token = found[1]
            if found := re.search(r"at (https?://\S+)", said):
                self.url = found[1]
                with contextlib.suppress(OSError):
                    self.ask("GET", "/v1/me")
                    return
            time.sleep(0.1)
        raise AssertionError(self.log.read_text())

    def stop(self, number: int = signal.SIGTERM) -> None:
        """End the service's process; flights go on."""
        self.process.send_signal(number)
        self.process.wait(30)

    def ask(self, method: str, path: str, body: object = None, token: str | None = None) -> Any:  # noqa: ANN401 - JSON
        """Send a request; returns the answer's JSON, or the status and text of a refusal."""
        status, content = self.send(method, path, body, token)
        found: Any = json.loads(content) if content else None
        return found if status < 400 else (status, found["text"])

    def send(
        self, method: str, path: str, body: object = None, token: str | None = None
    ) -> tuple[int, bytes]:
        """Send a request; returns status and body."""
        data = body if isinstance(body, bytes) or body is None else json.dumps(body).encode()
        headers = {"Authorization": f"Bearer {self.token if token is None else token}"}
        headers["Content-Type"] = "application/json"
        request = urllib.request.Request(self.url + path, data, headers, method=method)  # noqa: S310
        try:
            with urllib.request.urlopen(request, timeout=20) as response:  # noqa: S310 - loopback
                return response.status, response.read()
        except urllib.error.HTTPError as error:
            return error.code, error.read()

    def user(self, name: str, tenant: str, role: str = "pilot", **more: object) -> str:
        """Make an account; returns a token of it."""
        self.ask("POST", "/v1/accounts", {"name": name, "tenant": tenant, "role": role, **more})
        return str(self.ask("POST", "/v1/tokens", {"account": name})["secret"])

    def mission(self, id_: str) -> dict[str, Any]:
        """A mission as the administrator sees it."""
        found: dict[str, Any] = self.ask("GET", f"/v1/missions/{id_}")
        return found

    def until_phase(self, id_: str, *phases: str) -> dict[str, Any]:
        """Wait until a mission is in one of these phases, or over; returns it."""
        self.until(lambda: self.mission(id_)["phase"] in OVER | set(phases))
        return self.mission(id_)

    def until(self, condition: Callable[[], bool], seconds: float = FLIGHT_SECONDS) -> None:
        """Wait until something holds."""
        until = time.monotonic() + seconds
        while not condition():
            assert time.monotonic() < until, self.log.read_text()[-3000:]
            time.sleep(0.1)


def process_of(provider: Served, mission: str) -> psutil.Process:
    """The process of a mission."""
    folder = str(provider.folder / "s" / "m" / mission)
    for process in psutil.process_iter(["cmdline"]):
        line = process.info["cmdline"] or [""]
        if "aerodaas.flights" in line and line[-1].startswith(folder):
            return process
    raise AssertionError(mission)

"""Attacks a service of its own on loopback, and prints what its operator waits for meanwhile.

    python -m tools.attacks            # all of them, one after the other
    python -m tools.attacks documents views --seconds 20

Each attack is bounded in connections and time. The operator holds and resumes a simulated drone in
flight all the while, and lands it at the end. Exit code 1 if an answer took longer than a second.
"""

from __future__ import annotations

import contextlib
import http.client
import json
import multiprocessing
import re
import signal
import socket
import statistics
import subprocess
import sys
import tempfile
import threading
import time
from collections import Counter
from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path
from typing import Annotated, Any

import psutil
import typer
from websockets.exceptions import WebSocketException
from websockets.sync.client import ClientConnection, connect

from aerodaas.cli.app import run_typer

app = typer.Typer(add_completion=False, pretty_exceptions_enable=False)
_FLIGHT_SECONDS = 300.0
_ANSWER_SECONDS = 1.0
"""Within which an operator is answered."""
_PAUSE = 0.2
FENCE = {"polygon": [[-90, -90], [90, -90], [90, 90], [-90, 90]], "ceiling": 20}
FLEET = {
    "name": "attacked",
    "robots": [
        {
            "id": "one",
            "sensors": [{"id": "odometry", "type": "odometry", "rate": 10}],
            "limits": {"geofence": FENCE, "cruise_speed": 2},
        }
    ],
    "compute": [{"id": "edge", "kind": "edge"}],
    "simulation": {"world": "empty", "seed": 5},
}


@dataclass(frozen=True)
class Target:
    """A service with a mission in flight, as an attacker knows it."""

    port: int
    mission: str
    viewer: str
    """Token of a viewer of the mission's tenant."""
    pilot: str

    def ask(self, method: str, path: str, token: str, body: bytes | None = None) -> int:
        """Send a request on a connection of its own; returns the status, 0 for no answer."""
        connection = http.client.HTTPConnection("127.0.0.1", self.port, timeout=60)
        headers = {"Authorization": f"Bearer {token}", "Content-Type": "application/json"}
        try:
            connection.request(method, path, body, headers)
            answer = connection.getresponse()
            answer.read()
        except (OSError, http.client.HTTPException):
            return 0
        finally:
            connection.close()
        return answer.status

    def socket(self, path: str, token: str) -> ClientConnection:
        """Open a WebSocket below the mission."""
        url = f"ws://127.0.0.1:{self.port}/v1/missions/{self.mission}/{path}"
        headers = {"Authorization": f"Bearer {token}"}
        return connect(url, additional_headers=headers, proxy=None, open_timeout=30)


def document(**changes: object) -> bytes:
    """A submission, which no service flies."""
    base = {"format": "aerodaas-mission", "version": 1, "sensors": ["one/odometry"]}
    return json.dumps({"document": {**base, **changes}}, separators=(",", ":")).encode()


def hostile_documents() -> list[bytes]:
    """Documents of up to 4 MiB that take long to be parsed, checked or worded."""
    settings = {"id": "one/a", "analysis": "MonitoringAnalytics"}
    place = {"x": 1.0, "y": 1.0, "z": 2.0}
    places = [{"id": f"w{number}", **place} for number in range(1200)]
    navigation = [{"robot": "one", "waypoints": places} for _ in range(64)]
    return [
        document(navigation=[{"robot": "one", "waypoints": [0] * 10_000}] * 64),
        document(analyses=[{**settings, "settings": {"a": [0] * 1_900_000}}]),
        document(analyses=[{**settings, "settings": {"a": [[[]]] * 400_000}}]),
        document(**{f"key{number}": 0 for number in range(250_000)}),
        document(navigation=navigation),
    ]


def repeat(job: Callable[[int], object], workers: int, seconds: float, told: Counter[str]) -> None:
    """Do a job again and again in threads, and count what comes of it."""
    end = time.monotonic() + seconds

    def work(number: int) -> None:
        while time.monotonic() < end:
            told[str(job(number))] += 1

    threads = [threading.Thread(target=work, args=(one,), daemon=True) for one in range(workers)]
    for one in threads:
        one.start()
    for one in threads:
        one.join(seconds + 60)


def documents(target: Target, seconds: float, told: Counter[str]) -> None:
    """Submit hostile documents, by a viewer and by a pilot, fifteen at once of each."""
    bodies = hostile_documents()

    def submit(number: int) -> int:
        token = target.viewer if number % 2 else target.pilot
        return target.ask("POST", "/v1/missions", token, bodies[number // 2 % len(bodies)])

    repeat(submit, 30, seconds, told)


def answers(target: Target, seconds: float, told: Counter[str]) -> None:
    """Send texts of a megabyte, which take long to be parsed, to the user's side's connection."""
    text = json.dumps({"number": 1, "item": [[]] * 330_000}, separators=(",", ":"))

    def flood(_: int) -> str:
        try:
            with target.socket("here", target.pilot) as socket_:
                end = time.monotonic() + seconds
                while time.monotonic() < end:
                    socket_.send(text)
        except (OSError, WebSocketException) as error:
            time.sleep(_PAUSE)
            return type(error).__name__
        return "sent"

    repeat(flood, 4, seconds, told)


def views(target: Target, seconds: float, told: Counter[str]) -> None:
    """Open 1,010 live views by one viewer, and read none of them."""
    with contextlib.ExitStack() as stack:
        end = time.monotonic() + seconds
        for _ in range(1010):
            if time.monotonic() > end:
                break
            try:
                stack.enter_context(target.socket("live?rate=20", target.viewer))
                told["open"] += 1
            except (OSError, WebSocketException) as error:
                told[type(error).__name__] += 1
        time.sleep(max(0.0, end - time.monotonic()))


def connections(target: Target, seconds: float, told: Counter[str]) -> None:
    """Open 150 connections a second without a token, and say nothing."""
    opened: list[socket.socket] = []
    began = time.monotonic()
    while time.monotonic() < began + seconds:
        with contextlib.suppress(OSError):
            opened.append(socket.create_connection(("127.0.0.1", target.port), timeout=5))
            told["opened"] += 1
        time.sleep(max(0.0, began + len(opened) / 150 - time.monotonic()))
    for one in opened:
        one.close()


def messages(target: Target, seconds: float, told: Counter[str]) -> None:
    """Begin a message of 64 MiB on each of forty WebSockets, and never end one."""
    with contextlib.ExitStack() as stack:
        for number in range(40):
            path = "live" if number % 2 else "here"
            with contextlib.suppress(OSError, WebSocketException):
                opened = stack.enter_context(target.socket(path, target.pilot))
                opened.socket.settimeout(5)
                opened.socket.sendall(b"\x81\xff" + (64 << 20).to_bytes(8, "big") + bytes(4))
                for _ in range(63):
                    opened.socket.sendall(b" " * (1 << 20))
                    told["MiB sent"] += 1
        time.sleep(seconds)


def tokens(target: Target, seconds: float, told: Counter[str]) -> None:
    """Guess tokens of the right form, by sixteen connections at once."""
    guess = "aerodaas_0123456789abcdef_" + "a" * 43
    repeat(lambda _: target.ask("GET", "/v1/fleet", guess), 16, seconds, told)


def requests(target: Target, seconds: float, told: Counter[str]) -> None:
    """Ask for everything that a viewer may see, by forty connections at once."""
    paths = ("/v1/missions", "/v1/fleet", f"/v1/missions/{target.mission}/scenery", "/v1/usage")
    repeat(
        lambda number: target.ask("GET", paths[number % len(paths)], target.viewer),
        40,
        seconds,
        told,
    )


ATTACKS: dict[str, Callable[[Target, float, Counter[str]], None]] = {
    one.__name__: one
    for one in (documents, answers, views, connections, messages, tokens, requests)
}


@dataclass
class Operator:
    """Holds and resumes the drone in flight, and measures how long each answer takes."""

    port: int
    token: str
    mission: str
    took: list[float] = field(default_factory=list)
    failed: Counter[str] = field(default_factory=Counter)

    def command(self, word: str) -> None:
        """Give one command, by a connection of its own."""
        began = time.monotonic()
        target = Target(self.port, self.mission, "", "")
        body = json.dumps({"robot": "one", "command": word}).encode()
        status = target.ask("POST", f"/v1/missions/{self.mission}/commands", self.token, body)
        self.took.append(time.monotonic() - began)
        if status != http.HTTPStatus.OK:
            self.failed[str(status)] += 1

    def until(self, over: Callable[[], bool]) -> None:
        """Hold and resume until something is over."""
        while not over():
            for word in ("pause", "resume"):
                self.command(word)
                time.sleep(_PAUSE)

    def report(self, name: str) -> bool:
        """Print the answers' times since the last report; returns whether each came in time."""
        worst, count = max(self.took), len(self.took)
        median = statistics.median(self.took)
        typer.echo(f"{name}: {count} answers, median {median:.3f} s, longest {worst:.3f} s")
        if self.failed:
            typer.echo(f"  not answered as asked: {dict(self.failed)}")
        good = worst <= _ANSWER_SECONDS and not self.failed
        self.took, self.failed = [], Counter()
        return good


class Service:
    """A service of its own in a folder, with one simulated drone in flight."""

    def __init__(self, folder: Path) -> None:
        (folder / "fleet.json").write_text(json.dumps(FLEET), encoding="utf-8")
        self._log = folder / "log"
        command = [sys.executable, "-m", "aerodaas", "serve", str(folder / "fleet.json")]
        command += ["--state", str(folder / "s"), "--port", "0", "--no-rehearse"]
        with self._log.open("w") as log:
            self.process = subprocess.Popen(command, stdout=log, stderr=log)  # noqa: S603 - ours
        self.port = int(self._said(r"at http://127\.0\.0\.1:(\d+)"))
        self._admin = self._said(r"shown this once: (\S+)")

    def close(self) -> None:
        """End the service's process, whose flight has landed."""
        self.process.send_signal(signal.SIGTERM)
        self.process.wait(30)

    def ask(self, method: str, path: str, body: object = None, token: str = "") -> Any:  # noqa: ANN401
        """Send a request; returns the answer's JSON."""
        connection = http.client.HTTPConnection("127.0.0.1", self.port, timeout=60)
        headers = {"Authorization": f"Bearer {token or self._admin}"}
        headers["Content-Type"] = "application/json"
        connection.request(method, path, None if body is None else json.dumps(body), headers)
        with contextlib.closing(connection):
            answer = connection.getresponse()
            content = answer.read()
            if answer.status >= http.HTTPStatus.BAD_REQUEST:
                raise RuntimeError(f"{method} {path}: {content.decode()}")
            return json.loads(content)

    def user(self, name: str, role: str) -> str:
        """Make an account; returns a token of it."""
        self.ask("POST", "/v1/accounts", {"name": name, "tenant": "farm", "role": role})
        return str(self.ask("POST", "/v1/tokens", {"account": name})["secret"])

    def fly(self, pilot: str) -> str:
        """Have the drone fly to and fro; returns the mission once it is in the air."""
        places = [
            {"id": f"w{number}", "x": 40.0 * (number % 2), "y": 0.0, "z": 5.0}
            for number in range(200)
        ]
        flown = {"format": "aerodaas-mission", "version": 1, "sensors": ["one/odometry"]}
        flown["navigation"] = [{"robot": "one", "waypoints": places}]
        body = {"document": flown, "minutes": 120}
        mission = str(self.ask("POST", "/v1/missions", body, pilot)["id"])
        self._until(lambda: self._state(mission) == "enroute")
        return mission

    def land(self, operator: Operator) -> None:
        """Call the drone home, land it, and wait until it stands."""
        for word in ("return-home", "land"):
            operator.command(word)
        self._until(lambda: self._mission(operator.mission)["phase"] != "flying")

    def _mission(self, mission: str) -> dict[str, Any]:
        return dict(self.ask("GET", f"/v1/missions/{mission}"))

    def _state(self, mission: str) -> str | None:
        found = self._mission(mission)
        if found["phase"] in {"failed", "refused", "cancelled", "landed"}:
            raise RuntimeError(f"the drone does not fly: {found['reason']}")
        return found["status"].get("one", {}).get("mission", {}).get("state")

    def _said(self, form: str) -> str:
        self._until(lambda: re.search(form, self._log.read_text()) is not None)
        return str(re.findall(form, self._log.read_text())[0])

    def _until(self, so: Callable[[], bool]) -> None:
        end = time.monotonic() + _FLIGHT_SECONDS
        while not so():
            if time.monotonic() > end or self.process.poll() is not None:
                raise RuntimeError(self._log.read_text()[-3000:])
            time.sleep(_PAUSE)


def attacked(name: str, target: Target, seconds: float, told: Any) -> None:  # noqa: ANN401 - a queue
    """Carry out an attack, in a process of its own, and tell what came of it."""
    found: Counter[str] = Counter()
    try:
        ATTACKS[name](target, seconds, found)
    finally:
        told.put(dict(found))


@app.command()
def main(
    names: Annotated[list[str] | None, typer.Argument(help=f"Of {', '.join(ATTACKS)}.")] = None,
    *,
    seconds: Annotated[float, typer.Option(help="Of each attack.", min=1.0)] = 15.0,
) -> None:
    """Attack a service, and print how long its operator waits for answers meanwhile."""
    if unknown := set(names or ()) - set(ATTACKS):
        raise typer.BadParameter(f"no attack {', '.join(unknown)}: there is {', '.join(ATTACKS)}")
    good = True
    spawned = multiprocessing.get_context("spawn")
    with tempfile.TemporaryDirectory(prefix="attacks-", dir="/tmp") as folder:
        service = Service(Path(folder))
        try:
            pilot = service.user("pilot", "pilot")
            mission = service.fly(pilot)
            operator = Operator(service.port, service.user("olga", "operator"), mission)
            target = Target(service.port, mission, service.user("vera", "viewer"), pilot)
            until = time.monotonic() + seconds / 3
            operator.until(lambda: time.monotonic() > until)
            operator.report("no attack")
            for name in names or ATTACKS:
                told = spawned.Queue()
                attack = spawned.Process(target=attacked, args=(name, target, seconds, told))
                attack.start()
                operator.until(lambda one=attack: not one.is_alive())
                good &= operator.report(name)
                memory = psutil.Process(service.process.pid).memory_info().rss >> 20
                typer.echo(f"  attack: {told.get(timeout=10)}; the service has {memory} MiB")
            service.land(operator)
            good &= operator.report("return and land")
        finally:
            service.close()
    if not good:
        raise typer.Exit(1)


if __name__ == "__main__":
    run_typer(app)

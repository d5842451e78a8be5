"""Take the documentation's pictures of the console, from flights that are flown for them.

`python -m tools.console_pictures` writes them to `docs/images`. It flies `vehicle_tracking` in
simulation, once in real time to look on and once for the recording, and two drones of a provider's
five. It has an agent propose an inspection. It opens the console of each in the browser that is
installed.
"""

from __future__ import annotations

import json
import re
import signal
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import IO

import typer

from aerodaas.environment.provider.client import ProviderClient
from aerodaas.protocol.proposals import ProposalIn
from aerodaas.protocol.schemas import AccountIn, LeaseIn, MissionIn, Role, Scope, TokenIn
from tools.browser import Browser, Page

_ROOT = Path(__file__).resolve().parents[1]
_IMAGES = _ROOT / "docs" / "images"
_APPLICATION = "apps/vehicle_tracking.py"
_WAIT_SECONDS = 180.0
_FOUND = "document.querySelector('[data-testid=video]')?.dataset.boxes > 0"
_LATE = "Number(document.querySelectorAll('.state .figure dd')[5].innerText.split(' ')[0]) > 45"
"""The drone has left the first waypoint, and follows."""
_SETTLED = 1.0
_CONSOLE = r"(http://\S+#token=\S+)"
_SERVICE = r"shown this once: (\S+)[\s\S]* at (http://\S+)"
_FENCE = [[-30, -30], [60, -30], [60, 60], [-30, 60]]
_AREA = [(-5.0, -5.0), (25.0, -5.0), (25.0, 25.0), (-5.0, 25.0)]
_WAYS = {"alpha": ((20, 0), (20, 20), (0, 20), (0, 0)), "bravo": ((8, 40), (40, 40), (40, 8))}
_MAST = ((0, 14, 6), (12, 26, 10), (24, 30, 14), (40, 24, 16), (36, 8, 10), (14, 4, 6))
_WHY = "Lightning struck the mast on Friday: pictures of its upper half, from all sides."
_FLYING = "document.querySelector('[data-row={}]')?.innerText.includes('enroute')"


def main() -> None:
    """Fly, look on, and write the pictures."""
    _IMAGES.mkdir(parents=True, exist_ok=True)
    with tempfile.TemporaryDirectory() as temporary:
        folder = Path(temporary)
        words = ("run", _APPLICATION, "--no-view", "--record")
        console = ("--console", "--console-address", "127.0.0.1:0")
        with _told(*words, str(folder / "live"), *console) as (address,), Browser() as browser:
            page = browser.open(address, 1360, 900)
            page.until(f"{_FOUND} && {_LATE}", _WAIT_SECONDS)
            _take(page, "console-live.webp")
        command = [sys.executable, "-m", "aerodaas", *words, str(folder / "flight")]
        subprocess.run(command, cwd=_ROOT, check=True, stdout=subprocess.DEVNULL)  # noqa: S603 - ours
        recording = str(folder / "flight" / "flight.mcap")
        watching = ("view", recording, "--at", "95", "--address", "127.0.0.1:0")
        with _told(*watching) as (address,), Browser() as browser:
            for name, width, height, scheme in (
                ("console-playback.webp", 1360, 900, "light"),
                ("console-phone.webp", 400, 860, "dark"),
            ):
                page = browser.open(address, width, height)
                page.resize(width, height, scheme)
                page.until(_FOUND, _WAIT_SECONDS)
                _take(page, name)
        _take_fleet(folder)
        _take_approval(folder)


def _take_fleet(folder: Path) -> None:
    """Have two drones of a provider's five fly, and take the picture of its first page."""
    environment = {
        "name": "campus",
        "robots": [
            {
                "id": name,
                "start": [8 * place, 0, 0],
                "sensors": [{"id": "odometry", "type": "odometry", "rate": 10}],
                "limits": {"geofence": {"polygon": _FENCE, "ceiling": 20}, "cruise_speed": 2},
            }
            for place, name in enumerate(("alpha", "bravo", "charlie", "delta", "echo"))
        ],
        "compute": [{"id": "edge", "kind": "edge"}],
        "simulation": {"world": "campus", "seed": 5},
    }
    file = folder / "fleet.json"
    file.write_text(json.dumps(environment))
    words = ("serve", str(file), "--state", str(folder / "s"), "--port", "0", "--no-rehearse")
    with _told(*words, said=_SERVICE) as (token, url), Browser() as browser:
        client = ProviderClient(url, token)
        lease = client.request_lease(LeaseIn(robots=["alpha"], area=_AREA))
        missions = []
        for name, way in _WAYS.items():
            document = {
                "format": "aerodaas-mission",
                "version": 1,
                "name": f"{name} survey",
                "sensors": [f"{name}/odometry"],
                "navigation": [{"robot": name, "waypoints": [
                    {"id": f"wp{place}", "x": x, "y": y, "z": 2.0, "waypoint_type": "local"}
                    for place, (x, y) in enumerate(way)
                ]}],
            }  # fmt: skip
            own = lease.id if name in lease.robots else None
            wanted = MissionIn.model_validate({"document": document, "lease": own})
            missions.append(client.submit(wanted).id)
        page = browser.open(f"{url}/#token={token}", 1360, 900)
        page.until(" && ".join(map(_FLYING.format, _WAYS)), _WAIT_SECONDS)
        page.press("[data-row=alpha] th button")
        _take(page, "console-fleet.webp")
        # Flights outlive their service.
        for mission in missions:
            client.cancel(mission)
        while not all(client.mission(mission).phase.over for mission in missions):
            time.sleep(_SETTLED)


def _take_approval(folder: Path) -> None:
    """Have an agent propose the inspection of a mast, and take the picture of its page."""
    environment = {
        "name": "mast",
        "robots": [
            {
                "id": "alpha",
                "sensors": [{"id": "cam", "type": "camera", "rate": 1}],
                "limits": {"geofence": {"polygon": _FENCE, "ceiling": 20}, "cruise_speed": 2},
            }
        ],
        "simulation": {"world": "tower", "seed": 5, "wind": [2, 1, 0]},
    }
    file = folder / "mast.json"
    file.write_text(json.dumps(environment))
    words = ("serve", str(file), "--state", str(folder / "a"), "--port", "0")
    with _told(*words, said=_SERVICE) as (token, url), Browser() as browser:
        client = ProviderClient(url, token)
        scopes = [Scope.PROPOSE, Scope.SENSE]
        client.add_account(AccountIn(name="inspector", tenant="telecom", scopes=scopes))
        client.add_account(AccountIn(name="olga", tenant="telecom", role=Role.OPERATOR))
        tokens = [client.issue_token(TokenIn(account=one)).secret for one in ("inspector", "olga")]
        agent = ProviderClient(url, tokens[0] or "")
        proposed = ""
        # The second one is compared with the first.
        for number, ways in enumerate((_MAST[:-1], _MAST)):
            document = {
                "format": "aerodaas-mission",
                "version": 1,
                "name": "mast inspection",
                "sensors": ["alpha/cam"],
                "navigation": [{"robot": "alpha", "waypoints": [
                    {"id": f"m{place}", "x": x, "y": y, "z": z, "waypoint_type": "local",
                     "hover_duration": 3.0}
                    for place, (x, y, z) in enumerate(ways)
                ]}],
            }  # fmt: skip
            wanted = {"document": document, "why": _WHY, "parent": proposed if number else None}
            proposed = agent.propose(ProposalIn.model_validate(wanted)).id
        agent.rehearse(proposed)
        while agent.mission(proposed).verdict is None:
            time.sleep(_SETTLED)
        agent.request_approval(proposed)
        page = browser.open(f"{url}/#token={tokens[1]}&mission={proposed}", 1360, 900)
        page.until("document.querySelector('[data-testid=picture]')?.naturalWidth > 0")
        _take(page, "console-approval.webp")


@contextmanager
def _told(*words: str, said: str = _CONSOLE) -> Iterator[Sequence[str]]:
    """Run `aerodaas`; the groups of what it says first that matches `said`."""
    with tempfile.TemporaryFile("w+") as log:
        process = subprocess.Popen(  # noqa: S603 - ours
            [sys.executable, "-m", "aerodaas", *words], cwd=_ROOT, stdout=log, stderr=log
        )
        try:
            yield _found(process, log, said)
        finally:
            process.send_signal(signal.SIGINT)
            process.wait(_WAIT_SECONDS)


def _found(process: subprocess.Popen[bytes], log: IO[str], pattern: str) -> Sequence[str]:
    until = time.monotonic() + _WAIT_SECONDS
    while True:
        log.seek(0)
        said = log.read()
        if found := re.search(pattern, said):
            return found.groups()
        if process.poll() is not None or time.monotonic() > until:
            raise SystemExit(said or "it does not tell where its console is")
        time.sleep(0.2)


def _take(page: Page, name: str) -> None:
    time.sleep(_SETTLED)
    page.picture(_IMAGES / name)
    size = (_IMAGES / name).stat().st_size
    sys.stdout.write(f"{_IMAGES / name}: {size / 1e3:.0f} kB\n")


if __name__ == "__main__":
    typer.run(main)

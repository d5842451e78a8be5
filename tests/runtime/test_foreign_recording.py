"""A stranger's recording, replayed: what it says of code, packages and addresses does nothing."""

from __future__ import annotations

import json
import sys
import threading
from http.server import BaseHTTPRequestHandler, HTTPServer
from pathlib import Path

import pytest
from flying import FLAT, Flyer, hop, robot
from rewritten import rewritten

from aerodaas import Analytics, Environment, Odometry
from aerodaas.analytics.base import Context
from aerodaas.errors import UnknownIdError
from aerodaas.recording.reader import Recording

pytestmark = pytest.mark.slow


class Watch(Analytics[int]):
    """Counts what it is shown."""

    accepts = (Odometry,)
    produces = int
    isolated = True

    def process(self, item: Odometry, context: Context) -> int:  # noqa: ARG002
        """Count on."""
        self.count = getattr(self, "count", 0) + 1
        return self.count


def short(env: Environment) -> None:
    """One waypoint, and an analysis with an actor of its own."""
    drone = env.get_robot_by_id("drone")
    drone.navigate(hop((1.0, 0), hover=0.2))
    Watch().analyse(drone.get_sensor_by_id("odom_drone").get_data_stream())


@pytest.fixture(scope="module")
def flown(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A recorded flight."""
    flyer = Flyer(tmp_path_factory.mktemp("flown"))
    run = flyer.fly(short, {**FLAT, "robots": [robot("drone")]}, record=flyer.folder / "first")
    assert run.recording is not None
    return run.recording


def test_nothing_foreign_runs_and_nothing_is_sent(
    flown: Path, flyer: Flyer, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A package that leaves a mark when built, a driver when imported, an endpoint that listens."""
    mark = flyer.folder / "executed"
    package = flyer.folder / "package"
    package.mkdir()
    (package / "setup.py").write_text(
        f"open({str(mark)!r}, 'w')\nfrom setuptools import setup\nsetup(name='x', version='1')\n"
    )
    (flyer.folder / "foreign_driver.py").write_text(
        f"open({str(mark)!r}, 'w')\nfrom aerodaas.drivers.simulated import SimulatedVehicle\n"
    )
    monkeypatch.syspath_prepend(flyer.folder)
    heard: list[str] = []

    class Ear(BaseHTTPRequestHandler):
        def do_POST(self) -> None:
            heard.append(str(self.headers))

    server = HTTPServer(("127.0.0.1", 0), Ear)
    threading.Thread(target=server.serve_forever, args=(0.02,), daemon=True).start()
    with Recording.open(flown) as recording:
        content = json.loads(recording.attachment("environment.json"))
    content["runtime_env"] = {
        "watch": {"packages": [f"x @ file://{package}"], "env_vars": {"LD_PRELOAD": "/nowhere.so"}}
    }
    content["robots"][0]["driver"] = "foreign_driver:SimulatedVehicle"
    url = f"http://127.0.0.1:{server.server_port}/"
    content["compute"] = [
        {"id": "edge", "kind": "edge"},
        {"id": "fn", "kind": "http", "endpoint": {"url": url, "token_env": "HOME"}},
    ]
    foreign = rewritten(
        flown, flyer.folder / "foreign.mcap", environment=json.dumps(content).encode()
    )

    def build(env: Environment) -> None:
        with pytest.raises(UnknownIdError):
            env.get_compute_resource_by_id("fn")
        assert env.config.runtime_env == {}
        short(env)

    replayed = flyer.fly(build, replay=foreign, record=flyer.folder / "again")
    server.shutdown()
    assert replayed.recording is not None
    assert not mark.exists()
    assert "foreign_driver" not in sys.modules
    assert heard == []

"""A recorded environment brings geometry, ids, rates and calibration, and nothing that acts."""

from __future__ import annotations

import json
import threading
import types
import typing
from collections.abc import Callable, Iterator
from http.server import BaseHTTPRequestHandler, HTTPServer
from pathlib import Path
from typing import Any

import pytest
from core_settings import core_fields
from pydantic import BaseModel
from rewritten import rewritten
from synthetic_flight import SyntheticFlight, record

from aerodaas.cli.lab.recorded_workload import RecordedWorkload
from aerodaas.config.model import CameraConfig, EnvironmentConfig
from aerodaas.config.plugins import load_plugin
from aerodaas.config.sections.preflight import PreflightConfig
from aerodaas.config.sections.robot import GimbalConfig
from aerodaas.drivers.mavlink.settings import MavlinkSettings
from aerodaas.errors import AeroDaaSError, ConfigError, RecordingError
from aerodaas.recording.recorded_environment import allowed_content, left_out
from aerodaas.recording.replay.environment import replay_environment

GOOD: dict[str, Any] = {
    "home": {"latitude": 12.97, "longitude": 77.59, "altitude": 900},
    "robots": [
        {
            "id": "tello",
            "start": [1, 2, 0],
            "limits": {"cruise_speed": 2.0},
            "sensors": [
                {
                    "id": "camera",
                    "rate": 7,
                    "settings": {"width": 320, "height": 180, "mount": [0.1, 0.0, 0.0]},
                }
            ],
        }
    ],
}

_TAKING = ("photo_interval", "zoom")
"""How new pictures are taken."""
LOCAL_ALONE = {
    "$schema",
    "robots.sensors.settings.path",
    "robots.sensors.settings.topic",
    "sensors.settings.path",
    "sensors.settings.topic",
    # No replay turns a gimbal or zooms: its camera shows the recorded pictures, each with its lens.
    *(f"{place}sensors.settings.{one}" for place in ("robots.", "") for one in _TAKING),
    *(
        f"{place}sensors.settings.gimbal.{name}"
        for place in ("robots.", "")
        for name in GimbalConfig.model_fields
    ),
    "compute.node",
    "compute.endpoint.url",
    "compute.endpoint.protocol",
    "compute.endpoint.models",
    "compute.endpoint.timeout",
    "compute.endpoint.retries",
    "compute.endpoint.cost",
    "compute.endpoint.token_env",
    "compute.endpoint.token_header",
    "compute.settings",
    "runtime_env",
    # A reader's page would fetch pictures from wherever a stranger's recording says.
    "map_tiles.url",
    "map_tiles.attribution",
    "map_tiles.max_zoom",
    # Paths of files, and what belongs to them.
    "terrain.files",
    "terrain.clearance",
    "home.above_sea",
    "recording.application_source",
    "recording.enabled",
    "recording.path",
    "recording.images",
    "recording.jpeg_quality",
    "remote.host",
    "remote.port",
    "remote.token",
    "simulation.world",
    # An application that is replayed runs in its own time; a network may name a file.
    "simulation.execution_times",
    "simulation.network",
    "simulation.network_period",
    # Policies of who flies: whether a parachute may be fired, what a take-off is refused for.
    "robots.actuators.may_release",
    *(f"robots.preflight.{name}" for name in core_fields(PreflightConfig)),
}
"""Fields that no recording brings. A new field of the model belongs here, or into the allow-list
if it describes where and how the drone flew, and can do nothing on the reader's machine."""


@pytest.fixture(scope="module")
def flown(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A recorded flight with a camera."""
    path = tmp_path_factory.mktemp("flown") / "flight.mcap"
    record(path, SyntheticFlight(rate=4, hover=0.5, frames=1))
    return path


def foreign(flown: Path, folder: Path, content: object) -> Path:
    """The recording, with another environment in it."""
    return rewritten(flown, folder / "foreign.mcap", environment=json.dumps(content).encode())


def with_robot(**fields: Any) -> dict[str, Any]:  # noqa: ANN401
    """A good environment with more said of its robot."""
    return {**GOOD, "robots": [{**GOOD["robots"][0], **fields}]}


def fields_of(model: type[BaseModel], place: str = "") -> Iterator[str]:
    """Dotted names of all fields of a model, and of those inside."""
    for name, field in core_fields(model).items():
        full = f"{place}{field.alias or name}"
        inner = list(_models(field.annotation))
        if full.endswith("sensors.settings"):
            inner = [CameraConfig]
        if not inner:
            yield full
        for one in inner:
            yield from fields_of(one, f"{full}.")


def _models(kind: object) -> Iterator[type[BaseModel]]:
    if isinstance(kind, type) and issubclass(kind, BaseModel):
        yield kind
    elif typing.get_origin(kind) in {list, dict, typing.Union, types.UnionType, typing.Annotated}:
        # The keys of a dictionary are no model.
        for part in typing.get_args(kind):
            yield from _models(part)


def filled(place: list[str], value: object) -> dict[str, Any]:
    """A document with `value` at a place, in lists where the environment has lists."""
    content: Any = value
    for depth in range(len(place) - 1, -1, -1):
        content = {place[depth]: content}
        if depth and place[depth - 1] in {"robots", "sensors", "actuators", "compute"}:
            content = [content]
        elif depth and place[depth - 1] in {"tasks", "tenants", "runtime_env"}:
            content = {"any": content}
    return typing.cast("dict[str, Any]", content)


def test_every_field_of_the_model_is_either_allowed_or_named_as_local() -> None:
    """A field that is added to the model is out until somebody decides, and this test tells."""
    left = set()
    for name in fields_of(EnvironmentConfig):
        place = name.split(".")
        kept: list[object] = []
        for value in (1, "simulated", "dems", "ordered", [1.0, 2.0], {"any": 1}):
            content = allowed_content(filled(place, value))
            if json.dumps(value) in json.dumps(content):
                kept.append(value)
        if not kept:
            left.add(name)
    assert {name for name in left if not name.startswith(("robots.settings", "runtime_env"))} == {
        name for name in LOCAL_ALONE if not name.startswith("runtime_env")
    }
    assert {name for name in left if name.startswith("runtime_env")}


@pytest.mark.parametrize(
    "content",
    [
        {"brand_new": 1},
        {"robots": [{"id": "one", "brand_new": {"deep": 1}}]},
        {"robots": [{"id": "one", "settings": {"brand_new": 1}}]},
        {"robots": [{"id": "one", "limits": {"brand_new": 1}}]},
        {"simulation": {"brand_new": 1}},
        {"schedulers": {"tasks": {"one": {"brand_new": 1}}}},
        {"compute": [{"id": "one", "brand_new": 1}]},
    ],
)
def test_a_field_that_nobody_has_heard_of_is_left_out(content: dict[str, Any]) -> None:
    """By default, wherever it stands."""
    assert "brand_new" not in json.dumps(allowed_content(content))


@pytest.mark.parametrize(
    "model", [MavlinkSettings, load_plugin("drivers", "simulated").settings_model]
)
def test_of_a_drivers_settings_only_its_speeds_are_read(model: Any) -> None:  # noqa: ANN401
    """No address, no key, no file; and no text in the place of a speed."""
    names = getattr(model, "model_fields", None) or model.__annotations__
    for value in (3, "udpin:0.0.0.0:1"):
        content = allowed_content({"robots": [{"settings": dict.fromkeys(names, value)}]})
        kept = set(content["robots"][0]["settings"])
        assert kept == (kept & {"max_speed", "max_climb", "full_speed", "full_climb"})
        assert bool(kept) == (value == 3)


def test_what_describes_the_flight_is_taken(flown: Path, tmp_path: Path) -> None:
    """Home, start, limits, rates and lens are those of the recording."""
    config = replay_environment(foreign(flown, tmp_path, GOOD))
    assert config.home is not None
    assert config.home.latitude == 12.97
    (robot,) = config.robots
    assert (robot.id, robot.driver, robot.start) == ("tello", "replayed", (1, 2, 0))
    assert robot.limits.cruise_speed == 2.0
    (camera,) = robot.sensors
    assert (camera.driver, camera.rate, camera.settings["width"]) == ("replayed", 7, 320)
    assert left_out(GOOD) == []


def test_packages_variables_and_images_are_left_out(flown: Path, tmp_path: Path) -> None:
    """What an analysis has for itself is the local side's to say."""
    env = {
        "one": {"packages": ["x @ file:///nowhere/x"]},
        "two": {"image_uri": "evil/image"},
        "three": {"env_vars": {"LD_PRELOAD": "/nowhere/x.so"}},
    }
    content = {**GOOD, "runtime_env": env}
    assert replay_environment(foreign(flown, tmp_path, content)).runtime_env == {}
    assert left_out(content) == [
        "runtime_env.one.packages",
        "runtime_env.three.env_vars",
        "runtime_env.two.image_uri",
    ]


@pytest.mark.parametrize("place", ["robot", "camera", "reading", "trajectory", "analytics"])
def test_a_plug_in_is_not_imported(
    flown: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, place: str
) -> None:
    """Neither a driver nor a scheduler: the module on the path leaves no mark."""
    mark = tmp_path / "imported"
    module = tmp_path / "foreign_plug_in.py"
    module.write_text(f"open({str(mark)!r}, 'w')\nclass Plug:\n    settings_model = None\n")
    monkeypatch.syspath_prepend(tmp_path)
    name = "foreign_plug_in:Plug"
    content = {
        "robot": with_robot(driver=name),
        "camera": with_robot(sensors=[{"id": "camera", "driver": name}]),
        "reading": with_robot(sensors=[{"id": "gps", "type": "gps", "driver": name}]),
        "trajectory": {**GOOD, "schedulers": {"trajectory": name}},
        "analytics": {**GOOD, "schedulers": {"analytics": name}},
    }[place]
    config = replay_environment(foreign(flown, tmp_path, content))
    assert name not in config.model_dump_json()
    for robot in config.robots:
        load_plugin("drivers", robot.driver)(robot, config)
        for sensor in robot.sensors:
            if sensor.type == "camera":
                load_plugin("cameras", config.camera_driver(sensor))(sensor, config)
    assert not mark.exists()


def test_an_endpoint_hears_nothing(flown: Path, tmp_path: Path) -> None:
    """A resource with an address in the recording does not exist; a local one of its id does."""
    heard: list[str] = []

    class Ear(BaseHTTPRequestHandler):
        def do_POST(self) -> None:
            heard.append(self.headers.get("Authorization", ""))

    with HTTPServer(("127.0.0.1", 0), Ear) as server:
        thread = threading.Thread(target=server.serve_forever, args=(0.02,), daemon=True)
        thread.start()
        endpoint = {"url": f"http://127.0.0.1:{server.server_port}/", "token_env": "PATH"}
        fn = {"id": "fn", "kind": "http", "endpoint": endpoint}
        content = {**GOOD, "compute": [{"id": "edge"}, fn]}
        path = foreign(flown, tmp_path, content)
        config = replay_environment(path)
        assert config.compute != "auto"
        assert [one.id for one in config.compute] == ["edge"]
        assert str(server.server_port) not in config.model_dump_json()
        server.shutdown()
        thread.join()
    assert heard == []
    assert "compute.fn.endpoint" in left_out(content)
    mine = {"url": "http://127.0.0.1:9/mine", "models": {}}
    local = {
        "robots": [{"id": "other"}],
        "compute": [{"id": "fn", "kind": "http", "endpoint": mine}],
    }
    given = tmp_path / "local.json"
    given.write_text(json.dumps(local))
    resources = replay_environment(path, given).compute
    assert resources != "auto"
    (found,) = [one for one in resources if one.id == "fn"]
    assert found.endpoint is not None
    assert found.endpoint.url.get_secret_value() == "http://127.0.0.1:9/mine"


def test_addresses_and_paths_are_left_out(flown: Path, tmp_path: Path) -> None:
    """Nodes, remote control, the world's file, vehicles' addresses, pictures' sources."""
    sensors = [{"id": "camera", "driver": "video", "settings": {"path": "http://203.0.113.9/x"}}]
    content = with_robot(
        driver="mavlink", settings={"url": "udpout:203.0.113.9:1", "max_speed": 4}, sensors=sensors
    ) | {
        "compute": [{"id": "edge", "node": "203.0.113.9"}],
        "remote": {"host": "203.0.113.9", "port": 8350, "token": "x" * 16},
        "simulation": {"world": "/etc/203.0.113.9.json", "seed": 4},
        "recording": {"path": "/203.0.113.9"},
    }
    config = replay_environment(foreign(flown, tmp_path, content))
    assert "203.0.113.9" not in config.model_dump_json()
    assert config.simulation.seed == 4
    (robot,) = config.robots
    made = load_plugin("drivers", "replayed")(robot, config)
    assert (made.capabilities.driver, made.capabilities.max_speed) == ("mavlink", 4)
    assert left_out(content) == ["compute.edge.node", "remote.host", "remote.token"]


def test_the_local_file_gives_what_is_missing(flown: Path, tmp_path: Path) -> None:
    """Its driver, its packages, its scheduler; but the recording's start and limits."""
    content = with_robot(driver="mine:Drone") | {"schedulers": {"analytics": "mine:Plan"}}
    local = {
        "robots": [{"id": "tello", "driver": "mavlink", "start": [9, 9, 0]}, {"id": "other"}],
        "runtime_env": {"one": {"packages": ["numpy==1.26"]}},
        "schedulers": {"analytics": "dems"},
    }
    given = tmp_path / "local.json"
    given.write_text(json.dumps(local))
    config = replay_environment(foreign(flown, tmp_path, content), given)
    (robot,) = config.robots
    assert list(robot.start) == [1, 2, 0]
    assert robot.settings["driver"] == "mavlink"
    assert config.runtime_env["one"].packages == ["numpy==1.26"]
    assert config.schedulers.analytics == "dems"
    assert left_out(content) == ["robots.tello.driver", "schedulers.analytics"]


@pytest.mark.parametrize(
    "content",
    [
        [],
        1,
        "x",
        None,
        {"robots": 1},
        {"robots": [1]},
        {"robots": [{"id": []}]},
        {"robots": [{"id": "a", "sensors": {"x": 1}}]},
        {"robots": [{"id": "a", "limits": 5}], "home": [1]},
        {"robots": [{"id": "a"}], "compute": {"a": 1}, "schedulers": [], "simulation": "x"},
        {"home": {"latitude": 1e308, "longitude": "x"}},
        {"home": "x"},
    ],
)
def test_an_environment_of_odd_shape_is_refused_in_words(
    flown: Path, tmp_path: Path, content: object
) -> None:
    """Replay and lab raise the project's own errors, or do without."""
    path = foreign(flown, tmp_path, content)
    left_out(content)
    for use in (
        lambda: replay_environment(path),
        lambda: RecordedWorkload.read(path),
    ):
        said = refusal_of(use)
        assert not said or str(path) in said


def refusal_of(use: Callable[[], object]) -> str:
    """The project's own error that a use raises; empty where it does without."""
    try:
        use()
    except AeroDaaSError as error:
        return str(error)
    return ""


def test_deep_or_broken_json_is_refused(flown: Path, tmp_path: Path) -> None:
    """Nesting does not overflow the stack."""
    for data in (
        b"[" * 100_000,
        b'{"a":' * 500 + b"1" + b"}" * 500,
        b"\xff",
        b'{"name": "\\ud800"}',
    ):
        path = rewritten(flown, tmp_path / "deep.mcap", environment=data)
        with pytest.raises((RecordingError, ConfigError)):
            replay_environment(path)

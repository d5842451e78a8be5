"""Everything of a graph and of an environment is checked before anything starts."""

from __future__ import annotations

import sys
import types
from pathlib import Path
from typing import Any
from unittest.mock import patch

import pytest
from flying import FLAT, Flyer, hop, robot
from hypothesis import given
from hypothesis import strategies as st
from pydantic import BaseModel, ConfigDict

from aerodaas import Analytics, Environment, Frame
from aerodaas.analytics import SyntheticAnalytics
from aerodaas.analytics.base import Context
from aerodaas.config.model import LimitsConfig, validated
from aerodaas.drivers.simulated import SimulatedVehicle
from aerodaas.errors import AeroDaaSError, ConfigError, GraphError, UnknownIdError
from aerodaas.runtime.checks import check_served
from aerodaas.simulation.airframe import Airframe

CAMERA = {"id": "cam1", "rate": 5, "settings": {"width": 64, "height": 36}}


class Says(Analytics[float]):
    """Says how bright it is."""

    accepts = (Frame,)
    produces = float

    def process(self, item: Frame, context: Context) -> float:  # noqa: ARG002
        """Return the mean."""
        return float(item.image.mean())


class Ticks(Analytics[float]):
    """Says one now and then."""

    produces = float

    def process(self, item: None, context: Context) -> float:  # noqa: ARG002
        """Return one."""
        return 1.0


def content(*robots: dict[str, Any], **sections: Any) -> dict[str, Any]:  # noqa: ANN401
    """An environment with a camera."""
    return {**FLAT, "robots": list(robots) or [robot(sensors=[CAMERA])], **sections}


def launched(flyer: Flyer, env: Environment) -> None:
    """Start, but for the flight, whose runtime must not have been reached."""
    with (
        flyer.options(speed=1.0, simulated_time=False),
        patch(
            "aerodaas.environment.run.Run._runtime",
            side_effect=AssertionError("nothing was refused"),
        ),
    ):
        env.launch()


@pytest.fixture
def folder(tmp_path: Path) -> Flyer:
    """Writes environments; nothing of it flies."""
    return Flyer(tmp_path)


def opened(folder: Flyer, described: dict[str, Any], **overrides: Any) -> Environment:  # noqa: ANN401
    """The environment with its one robot told to fly."""
    env = Environment(folder.write(described), overrides)
    env.get_robot_by_id("drone").navigate(hop((1, 0)))
    return env


@pytest.mark.parametrize(
    ("setting", "message"),
    [
        ("cam1.widht", r"sensor drone/cam1: settings: widht: .*did you mean width\?"),
        ("drone.mas", r"robot drone: settings: mas: .*did you mean mass\?"),
        ("drone.limits.max_sped", r"max_sped: .*did you mean max_speed\?"),
        ("drone.limits.geofence.cieling", r"cieling: .*did you mean ceiling\?"),
        ("cam1.width", r"width: Input should be a valid integer.*, not 'x'"),
    ],
)
def test_a_misspelt_setting_is_refused_with_the_right_one(
    folder: Flyer, setting: str, message: str
) -> None:
    """At the environment's making, by file, owner, setting, value and remedy."""
    path = folder.write(content())
    with pytest.raises(ConfigError, match=message):
        Environment(path, {setting: "x"})


@pytest.mark.parametrize(
    ("described", "message"),
    [
        ({"robots": [{"id": "d", "driver": "simulatd"}]}, r"did you mean simulated\?"),
        (
            {"robots": [{"id": "d", "sensors": [{"id": "c", "driver": "foldr"}]}]},
            r"did you mean folder\?",
        ),
        (
            {"robots": [{"id": "d"}], "schedulers": {"trajectory": "nearest"}},
            r"known: .*nearest_neighbor",
        ),
        (
            {"robots": [{"id": "d", "driver": "mavlink", "settings": {"ulr": "udpin:0:1"}}]},
            r"did you mean url\?",
        ),
    ],
)
def test_plug_ins_and_their_settings_are_known_at_once(
    folder: Flyer, described: dict[str, Any], message: str
) -> None:
    """Names of drivers, cameras and schedulers, and what ours take."""
    with pytest.raises(AeroDaaSError, match=message):
        Environment(folder.write(described))


LIMITS = LimitsConfig()


@pytest.mark.parametrize(
    ("limits", "message"),
    [
        ({"battery_return": 0.1, "battery_land": 0.2}, "battery_return .* at least battery_land"),
        ({"cruise_speed": 3, "max_speed": 2}, "cruise_speed .* must not exceed max_speed"),
        ({"takeoff_height": 9, "geofence": {"ceiling": 8}}, "takeoff_height .* ceiling"),
        ({"takeoff_height": 1, "geofence": {"floor": 2}}, "takeoff_height .* floor"),
    ],
)
def test_limits_that_contradict_each_other(limits: dict[str, Any], message: str) -> None:
    """Both settings are named, with their values."""
    with pytest.raises(ConfigError, match=message):
        validated({"robots": [{"id": "d", "limits": limits}]}, "here")


@given(st.floats(0, 1), st.floats(0, 1), st.floats(0.1, 9), st.floats(0.1, 9))
def test_limits_are_taken_where_they_agree(
    back: float, land: float, cruise: float, top: float
) -> None:
    """And only there."""
    limits = {
        "battery_return": back,
        "battery_land": land,
        "cruise_speed": cruise,
        "max_speed": top,
    }
    try:
        taken = bool(validated({"robots": [{"id": "d", "limits": limits}]}, "here"))
    except ConfigError:
        taken = False
    assert taken == (back >= land and cruise <= top)


def test_an_airframe_lands_by_itself_below_what_it_takes_off_with() -> None:
    """A failsafe above the least charge for take-off would land what has just taken off."""
    with pytest.raises(ValueError, match="battery_failsafe"):
        Airframe(battery_failsafe=0.5, battery_minimum=0.2)


@pytest.mark.parametrize("method", ["wait", "navigate", "start_mission", "get_sensors"])
def test_a_trigger_calls_what_it_can(folder: Flyer, method: str) -> None:
    """Any other method is refused where it is written, with those that there are."""
    env = opened(folder, content())
    drone = env.get_robot_by_id("drone")
    watch = Says()
    watch.analyse(drone.get_sensor_by_id("cam1").get_data_stream())
    with pytest.raises(GraphError, match=rf"drone\.end_mission.*; not drone\.{method}\n  at test_"):
        watch.trigger(getattr(drone, method))
    watch.trigger(drone.end_mission)
    watch.trigger(drone.pauseMission)


def test_a_condition_is_a_function(folder: Flyer) -> None:
    """Found at the call rather than at the first result."""
    drone = opened(folder, content()).get_robot_by_id("drone")
    with pytest.raises(GraphError, match="function of a result, not True"):
        Says().trigger(drone.end_mission, when=True)  # type: ignore[arg-type]


def test_a_trigger_of_a_robot_that_stays_behind_is_refused(folder: Flyer) -> None:
    """It would never do anything."""
    env = opened(folder, content(robot(sensors=[CAMERA]), robot("other")))
    watch = Says()
    watch.analyse(env.get_robot_by_id("drone").get_sensor_by_id("cam1").get_data_stream())
    watch.trigger(env.get_robot_by_id("other").end_mission)
    with pytest.raises(GraphError, match=r"other does not fly: call other\.navigate"):
        launched(folder, env)


@pytest.mark.parametrize("rate", [0.0, -1.0, float("nan"), float("inf"), "fast"])
def test_an_external_source_needs_a_rate(folder: Flyer, rate: Any) -> None:  # noqa: ANN401
    """One that never comes, or always, is told before Ray."""
    env = opened(folder, content())
    source = Ticks().deploy(env.get_compute_resource_by_id("edge"))
    source.rate = rate
    source.instantiate()
    with pytest.raises(GraphError, match="ticks: its rate must be a positive number"):
        launched(folder, env)


@pytest.mark.parametrize("section", ["runtime_env", "schedulers"])
def test_what_is_told_of_an_analysis_that_is_not_there(folder: Flyer, section: str) -> None:
    """It would have no effect; the one that is there is named."""
    told: dict[str, Any] = {"modle": {}}
    described = told if section == "runtime_env" else {"tasks": told, "analytics": "edf"}
    env = opened(folder, content(**{section: described}))
    model = SyntheticAnalytics("model", 10, 20).deploy(env.get_compute_resource_by_id("edge"))
    model.analyse(env.get_robot_by_id("drone").get_sensor_by_id("cam1").get_data_stream())
    with pytest.raises(UnknownIdError, match=r"'modle'; known: .*did you mean model\?"):
        launched(folder, env)


def test_a_shared_file_may_tell_of_analyses_that_ship(folder: Flyer) -> None:
    """One file serves several applications."""
    schedulers = {"tasks": {"vip_detection": {}}, "analytics": "edf"}
    env = opened(folder, content(schedulers=schedulers))
    model = SyntheticAnalytics("model", 10, 20).deploy(env.get_compute_resource_by_id("edge"))
    model.analyse(env.get_robot_by_id("drone").get_sensor_by_id("cam1").get_data_stream())
    with pytest.raises(AssertionError, match="nothing was refused"):
        launched(folder, env)


@pytest.mark.parametrize("driver", ["folder", "recorded", "video", "mcap"])
def test_what_a_camera_plays_must_be_there(folder: Flyer, driver: str) -> None:
    """Missing on this machine, it is told with what may have been meant."""
    (folder.folder / "pictures").mkdir()
    path = str(folder.folder / "pictres")
    camera = {"id": "cam1", "driver": driver, "settings": {"path": path}}
    env = opened(folder, content(robot(sensors=[camera])))
    with pytest.raises(ConfigError, match=r"there is no .*pictres; did you mean pictures\?"):
        launched(folder, env)


class Modelled(BaseModel):
    """Settings of a stranger's driver."""

    model_config = ConfigDict(extra="forbid")

    baud: int = 9600


class Stranger(SimulatedVehicle):
    """A driver with settings of its own."""

    settings_model = Modelled  # type: ignore[assignment]


class Careless(SimulatedVehicle):
    """A driver that says nothing of its settings."""

    settings_model = None  # type: ignore[assignment]


@pytest.mark.parametrize(("kind", "refused"), [(Stranger, True), (Careless, False)])
def test_a_strangers_settings_are_checked_if_it_says_how(
    folder: Flyer, kind: type, *, refused: bool
) -> None:
    """By `settings_model`; a plug-in without one takes what it likes."""
    module = types.ModuleType("strangers_module")
    module.Driver = kind  # type: ignore[attr-defined]
    described = {**robot(), "driver": "strangers_module:Driver", "settings": {"bauds": 1}}
    with patch.dict(sys.modules, {"strangers_module": module}):
        env = opened(folder, content(described))
        if refused:
            with pytest.raises(ConfigError, match=r"robot drone: .*did you mean baud\?"):
                launched(folder, env)
        else:
            with pytest.raises(AssertionError, match="nothing was refused"):
                launched(folder, env)


@pytest.mark.parametrize("address", ["8765", "here:", ":80", "here:http", "here:70000"])
def test_an_address_to_serve_at_has_a_port(address: str) -> None:
    """Told before the recorder would find out."""
    with pytest.raises(ConfigError, match="--live-address takes host:port"):
        check_served("--live-address", address)
    check_served("--live-address", None)
    check_served("--live-address", "127.0.0.1:0")

"""The catalogue shows what an application is built from, and no way to the hardware."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

from aerodaas.config.model import EnvironmentConfig, validated
from aerodaas.config.redaction import catalogue
from aerodaas.environment.document.flying import compile_application

APPS = Path(__file__).resolve().parents[2] / "apps"
SIX = {
    "disaster_survey": "disaster",
    "farm_survey": "farm",
    "search_and_rescue": "rescue",
    "situation_awareness": "campus",
    "tower_inspection": "tower",
    "vehicle_tracking": "vehicle",
}
"""The applications that ship, by environment."""
PRIVATE = "s3cret"
FLEET = {
    "name": "fleet",
    "home": {"latitude": 13.0, "longitude": 77.5},
    "robots": [
        {
            "id": "px4",
            "driver": "mavlink",
            "settings": {"url": f"udpin:{PRIVATE}.example:14540", "signing_key": PRIVATE},
            "limits": {"max_speed": 7, "geofence": {"polygon": [[0, 0], [50, 0], [50, 50]]}},
            "start": [1, 2, 0],
            "start_yaw": 30,
            "edge": "edge",
            "sensors": [
                {
                    "id": "front",
                    "settings": {
                        "path": f"rtsp://user:{PRIVATE}@camera/1",
                        "pitch": 20,
                        "horizontal_fov": 90,
                        "gimbal": {"lowest": -80},
                    },
                },
                {"id": "blind", "settings": {"pitch": 90}},
                {"id": "odom", "type": "odometry"},
            ],
        },
        {
            "id": "tello",
            "driver": "mavlink",
            "settings": {"host": f"{PRIVATE}.local"},
            "sensors": [
                {"id": "phone", "type": "gps", "settings": {"path": f"/home/{PRIVATE}/log.gpx"}}
            ],
        },
    ],
    "compute": [
        {"id": "edge", "kind": "edge", "node": f"{PRIVATE}-jetson", "settings": {"x": PRIVATE}},
        {
            "id": "lambda",
            "kind": "http",
            "endpoint": {
                "url": f"https://{PRIVATE}.example/v2",
                "models": {"vests": f"{PRIVATE}-7"},
                "token_env": "S3CRET",
            },
        },
    ],
    "remote": {"host": "127.0.0.1", "token": f"{PRIVATE}-{PRIVATE}-{PRIVATE}"},
    "runtime_env": {"vests": {"env_vars": {"KEY": PRIVATE}}},
    "recording": {"path": f"/srv/{PRIVATE}"},
    "simulation": {"world": f"/srv/{PRIVATE}.json"},
    "schedulers": {"trajectory": f"{PRIVATE}:Own"},
}


def test_it_has_no_way_in() -> None:
    """No address, path, node, key, driver or plug-in of the provider's stands in it."""
    text = json.dumps(catalogue(validated(FLEET, "fleet")).model_dump(mode="json", by_alias=True))
    assert PRIVATE not in text.lower()
    for word in ("mavlink", "udpin", "rtsp", "14540"):
        assert word not in text


def test_it_has_what_an_application_asks_for() -> None:
    """Robots with limits, fences and starts; calibrated sensors; compute by id and kind; home."""
    config = validated(FLEET, "fleet")
    shown = catalogue(config)
    assert shown.home == config.home
    for one, whole in zip(shown.robots, config.robots, strict=True):
        assert (one.id, one.limits, one.mission) == (whole.id, whole.limits, whole.mission)
        assert (one.start, one.start_yaw) == (whole.start, whole.start_yaw)
    sensors = {sensor.full_id: sensor for sensor in shown.all_sensors()}
    # The camera without a source could not be flown.
    assert set(sensors) == {"px4/front", "px4/odom", "tello/phone"}
    lens = {"pitch": 20, "horizontal_fov": 90, "gimbal": {"lowest": -80}}
    assert sensors["px4/front"].settings == lens
    assert sensors["tello/phone"].settings == {"path": "http://tello-phone.path.invalid"}
    assert shown.compute != "auto"
    assert [(one.id, one.kind) for one in shown.compute] == [("edge", "edge"), ("lambda", "http")]
    endpoint = shown.compute[1].endpoint
    assert endpoint is not None
    assert endpoint.models == {"vests": "vests"}
    assert catalogue(shown) == shown


@pytest.mark.parametrize("name", sorted(SIX))
def test_applications_compile_to_the_same_document_against_it(name: str, tmp_path: Path) -> None:
    """Each that ships, character by character; also one that asks for a sensor's `path`."""
    whole = EnvironmentConfig.load(APPS / "environments" / f"{SIX[name]}.json")
    shown = tmp_path / f"{SIX[name]}.json"
    shown.write_text(json.dumps(catalogue(whole).model_dump(mode="json", by_alias=True)))
    application = APPS / f"{name}.py"
    theirs = compile_application(application, [], shown)
    assert theirs.text() == compile_application(application, []).text()
    given = [one.settings.get("source") for one in theirs.analyses]
    asks = name == "situation_awareness"
    assert ({"$property": ["phone", "path"]} in given) == asks

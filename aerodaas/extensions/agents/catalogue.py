"""What a mission document may hold: topics for agents, without paths, addresses and drivers."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from aerodaas.config.checked import near
from aerodaas.config.model import EnvironmentConfig
from aerodaas.config.plugins import PluginKind, plugin_names
from aerodaas.errors import AeroDaaSError, ConfigError
from aerodaas.extensions.agents.answers import Topic
from aerodaas.extensions.agents.frames import FRAMES, HEADING
from aerodaas.extensions.agents.schema import document_schema, untitled
from aerodaas.extensions.agents.text import plain

__all__ = ["TOPICS", "topic_of"]

TOPICS = ("missions", "analyses", "analysis:NAME", "schedulers", "conditions", "document", "frames")
_ANALYSIS = "analysis:"
_CONDITIONS = (
    "A trigger of an analysis has `target`, `when` and, for a robot, `command`:",
    "end_mission or pause_mission. Without `when` each result triggers.",
    '{"$settings": "Near", "of": {"place": [57, 6], "metres": 3}}: near a place.',
    '{"$settings": "Below", "of": {"reading": "battery", "limit": 0.4}}, and "Above": of readings.',
    '{"$condition": "hand_raised"} and {"$condition": "fallen"}: of a person\'s pose.',
)
_SCHEDULERS = (
    'trajectory_scheduler: {"name": …} orders the waypoints of a navigation with "ordered": false.',
    "analytics_scheduler: … chooses when and where analyses run; without one each runs as it can.",
)


def topic_of(name: str, fleet: EnvironmentConfig) -> Topic:
    """A topic of the catalogue.

    Args:
        name: One of `TOPICS`.
        fleet: The fleet's catalogue.

    Raises:
        ConfigError: For an unknown topic or analysis; names the nearest one.
    """
    if name.startswith(_ANALYSIS):
        return _analysis(name.removeprefix(_ANALYSIS))
    topics: dict[str, Callable[[], Topic]] = {
        "missions": lambda: Topic(topic=name, text=list(FRAMES), content=_missions(fleet)),
        "analyses": lambda: Topic(topic=name, names=plugin_names("analytics")),
        "schedulers": lambda: Topic(topic=name, text=list(_SCHEDULERS), content=_schedulers()),
        "conditions": lambda: Topic(topic=name, text=list(_CONDITIONS)),
        "document": lambda: Topic(topic=name, text=list(FRAMES), content=document_schema(fleet)),
        "frames": lambda: Topic(topic=name, text=list(FRAMES)),
    }
    if name not in topics:
        raise ConfigError(f"there is no such topic{near(plain(name), TOPICS)}")
    return topics[name]()


def _schedulers() -> dict[str, list[str]]:
    kinds: tuple[PluginKind, ...] = ("trajectory_schedulers", "analytics_schedulers")
    return {kind: plugin_names(kind) for kind in kinds}


def _analysis(name: str) -> Topic:
    known = plugin_names("analytics")
    if name not in known:
        raise ConfigError(f"there is no such analysis{near(plain(name), known)}")
    from aerodaas.documents.arguments import argument_model  # noqa: PLC0415 - slow to load

    try:
        schema = untitled(argument_model("analytics", name).model_json_schema())
    except AeroDaaSError:
        raise ConfigError(f"{name} is not installed at this service: choose another one") from None
    text = [plain(line, 500) for line in str(schema.pop("description", "")).split("\n\n")]
    return Topic(topic=f"{_ANALYSIS}{name}", text=text, content=schema)


def _missions(fleet: EnvironmentConfig) -> dict[str, Any]:
    """Documents to begin from, by what they do."""
    robot = fleet.robots[0]
    up = min(robot.limits.geofence.ceiling, max(robot.limits.takeoff_height, 3.0))
    square = [
        {"id": f"corner{number}", "x": x, "y": y, "z": up, HEADING: heading}
        for number, (x, y, heading) in enumerate(
            [(0.0, 5.0, 0), (5.0, 5.0, 90), (5.0, 0.0, 180), (0.0, 0.0, 270)], 1
        )
    ]
    base = {"format": "aerodaas-mission", "version": 1}
    visit: dict[str, Any] = {
        **base,
        "name": "square",
        "navigation": [{"robot": robot.id, "waypoints": square}],
    }
    cameras = [one.full_id for one in robot.sensors if one.type == "camera"]
    if not cameras:
        return {"visit": visit}
    resource = {} if fleet.compute == "auto" else {"compute": fleet.compute[0].id}
    find = {"id": f"{robot.id}/find", "analysis": "VipDetectionAnalytics", "reads": cameras[:1]}
    follow = {"id": f"{robot.id}/follow", "analysis": "VipFollowAnalytics", "reads": [find["id"]]}
    return {
        "visit": visit,
        "follow": {
            **base,
            "name": "follow",
            "sensors": cameras[:1],
            "analyses": [find | resource, follow | {"settings": {"distance": 4.0}} | resource],
            "navigation": [{"robot": robot.id, "stream": follow["id"]}],
        },
    }

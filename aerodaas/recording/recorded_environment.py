"""What a recording may say of its environment; all else comes from the local side alone.

A recording is a stranger's data. Geometry, ids, rates and calibration describe the flight;
code, packages, containers, plug-ins, addresses, paths and environment variables would act on the
reader's machine. `_ALLOWED` and extensions name each field that is read; any other is left out.
"""

from __future__ import annotations

import copy
from collections.abc import Callable, Iterator, Mapping
from fnmatch import fnmatchcase
from functools import cache
from typing import Any, TypeAlias

from aerodaas.config.checked import checked
from aerodaas.config.extensions import extensions
from aerodaas.config.model import EnvironmentConfig, HomeConfig
from aerodaas.config.plugins import PluginKind, is_built_in
from aerodaas.errors import RecordingError
from aerodaas.recording.decoding.messages import decode_json
from aerodaas.recording.reader import Recording

__all__ = ["allowed_content", "left_out", "merged", "recorded_content", "recorded_home"]

Rule: TypeAlias = "Callable[[object], bool] | dict[str, Rule] | list[Rule]"
"""Which values of a field are read: by a check, by field (`*` for any key), or by list item."""

_ANY_KEY = "*"


def _plain(value: object) -> bool:
    """Whether a value is a number, a word or a nested list of these; the model checks the rest."""
    if isinstance(value, list | tuple):
        return all(map(_plain, value))
    return value is None or isinstance(value, bool | int | float | str)


def _word(value: object) -> bool:
    return isinstance(value, str)


def _number(value: object) -> bool:
    return isinstance(value, int | float)


def _named(kind: PluginKind) -> Callable[[object], bool]:
    """Whether a value names a plug-in of this project's own, whose class does nothing by itself."""
    return lambda value: isinstance(value, str) and is_built_in(kind, value)


def _fields(*names: str) -> dict[str, Rule]:
    return dict.fromkeys(names, _plain)


_SENSOR: dict[str, Rule] = {
    "id": _word,
    **_fields("type", "rate"),
    "driver": _named("cameras"),
    "settings": _fields(
        "width", "height", "horizontal_fov", "mount", "pitch", "yaw", "depth_range", "loop"
    ),
}
_ACTUATOR: dict[str, Rule] = {
    "id": _word,
    # Whether a parachute may be fired is the policy of who flies.
    **_fields("type", "instance", "channel"),
    "rest": _word,
    "positions": {_ANY_KEY: _number},
}
_LIMITS: dict[str, Rule] = {
    **_fields(
        "cruise_speed",
        "max_speed",
        "max_climb",
        "max_yaw_rate",
        "max_acceleration",
        "max_range",
        "reaction_time",
        "rangefinder_clearance",
        "separation",
        "takeoff_height",
        "takeoff_timeout",
        "preflight_timeout",
        "arrival_radius",
        "command_timeout",
        "silence_return",
        "link_timeout",
        "return_timeout",
        "endurance",
        "battery_return",
        "battery_land",
    ),
    "geofence": _fields("polygon", "floor", "ceiling", "margin", "no_fly"),
}
_ROBOT: dict[str, Rule] = {
    "id": _word,
    **_fields("edge", "start", "start_yaw"),
    "driver": _named("drivers"),
    # The drivers' capabilities, which shape setpoints; no address and no key.
    "settings": dict.fromkeys(("max_speed", "max_climb", "full_speed", "full_climb"), _number),
    "sensors": [_SENSOR],
    "actuators": [_ACTUATOR],
    "limits": _LIMITS,
    "mission": _fields(
        "on_complete",
        "resume_after",
        "plan_timeout",
        "stall_timeout",
    ),
}
_TASK = _fields(
    "benefit",
    "deadline",
    "edge_time",
    "cloud_time",
    "edge_cost",
    "cloud_cost",
    "qoe_bonus",
    "qoe_share",
    "qoe_window",
)
_ALLOWED: dict[str, Rule] = {
    "name": _plain,
    "home": _fields("latitude", "longitude", "altitude"),
    "robots": [_ROBOT],
    "sensors": [_SENSOR],
    "compute": [
        {
            "id": _word,
            **_fields("kind", "simulated", "executors", "compression"),
        }
    ],
    "schedulers": {
        "trajectory": _named("trajectory_schedulers"),
        "analytics": _named("analytics_schedulers"),
        "tasks": {_ANY_KEY: _TASK},
        "tenants": {_ANY_KEY: _fields("analyses", "weight")},
    },
    "simulation": _fields("seed", "wind", "gust", "sensor_noise"),
}
"""The core's fields that are read from a recording. A field that is not here is left out, unless an
extension names it (`Extension.recorded_settings`)."""

_NOT_MISSED = (
    "$schema",
    "compute",
    "recording.*",
    "simulation.world",
    "simulation.execution_times",
    "simulation.network*",
    "robots.*.settings.*",
    "robots.*.sensors.*",
    "sensors.*",
)
"""Fields that no replay needs: the players take their place."""


def recorded_content(recording: Recording) -> Any:  # noqa: ANN401 - a stranger's JSON
    """The recorded environment as it stands in the file, to be passed to `allowed_content`.

    Raises:
        RecordingError: If there is none, or it is no JSON.
    """
    if "environment.json" not in recording.attachments:
        raise RecordingError(
            f"{recording.path} holds no environment, so no run of ours has written it; to fly by "
            'its pictures, name it as the "path" of a camera with the driver "mcap"'
        )
    try:
        return decode_json(recording.attachment("environment.json"))
    except ValueError:
        raise RecordingError(
            f"the environment in {recording.path} is no JSON: the recording is damaged"
        ) from None


def recorded_home(recording: Recording) -> HomeConfig | None:
    """Where the recording pins the local frame; None if it does not say.

    Raises:
        RecordingError: If the recorded environment is no JSON.
        ConfigError: If the place is not on the globe.
    """
    if "environment.json" not in recording.attachments:
        return None
    home = allowed_content(recorded_content(recording)).get("home")
    return checked(HomeConfig, home, f"the home in {recording.path}") if home else None


def allowed_content(content: object) -> dict[str, Any]:
    """The fields of a recorded environment that may be read, as far as they are there."""
    kept = _kept(content, _allowed())
    found: dict[str, Any] = kept if isinstance(kept, dict) else {}
    if isinstance(content, dict) and content.get("compute") == "auto":
        found["compute"] = "auto"
    return found


@cache
def _allowed() -> dict[str, Rule]:
    """Every field that is read from a recording, those of extensions included."""
    rules = copy.deepcopy(_ALLOWED)
    for extension in extensions().values():
        for name in extension.recorded_settings:
            place: Any = rules
            *parts, last = name.split(".")
            for part in parts:
                inner: Rule = [{}] if part.endswith("[]") else {}
                place = place.setdefault(part.removesuffix("[]"), inner)
                place = place[0] if isinstance(place, list) else place
            place[last] = _plain
    return rules


def left_out(content: object) -> list[str]:
    """Parts of a recorded environment that a replay does not read, sorted.

    Args:
        content: The recorded environment, from `recorded_content`.

    Returns:
        Dotted names, with ids in the place of list indices: `robots.drone.driver`.
    """
    minimal = EnvironmentConfig.model_validate({"robots": [{"id": "any"}]})
    usual = dict(_leaves(minimal.model_dump(mode="json", by_alias=True)))
    known = {name for name, _ in _leaves(allowed_content(content))}
    missed = set()
    for name, value in _leaves(content):
        silent = any(fnmatchcase(name, pattern) for pattern in _NOT_MISSED)
        if name not in known and not silent and value not in (None, "", usual.get(name)):
            # An endpoint or a runtime_env is given as a whole.
            missed.add(".".join(name.split(".")[:3]))
    return sorted(missed)


def merged(recorded: dict[str, Any], local: Mapping[str, Any]) -> dict[str, Any]:
    """Lay what may be read of a recording over a local environment.

    Robots and sensors are those of the recording, compute resources those of both. A resource of
    the kind `http` is left out where the local side gives it no endpoint.

    Args:
        recorded: What may be read of the recording.
        local: Content of the local environment file.
    """
    content = _merged(recorded, local)
    if isinstance(content.get("compute"), list):
        content["compute"] = [
            one for one in content["compute"] if one.get("kind") != "http" or one.get("endpoint")
        ]
    return content


def _kept(value: object, rule: Rule) -> Any:  # noqa: ANN401 - None where nothing is kept
    if isinstance(rule, list):
        items = value if isinstance(value, list) else []
        return [_kept(item, rule[0]) for item in items if isinstance(item, dict)]
    if isinstance(rule, dict):
        if not isinstance(value, dict):
            return None
        found = {}
        for key, item in value.items():
            inner = rule.get(key, rule.get(_ANY_KEY))
            if inner is None:
                continue
            kept = _kept(item, inner)
            if kept is not None:
                found[key] = kept
        return found
    return value if rule(value) else None


def _leaves(value: object, place: tuple[str, ...] = ()) -> Iterator[tuple[str, object]]:
    if isinstance(value, dict):
        for key, item in value.items():
            yield from _leaves(item, (*place, str(key)))
    elif isinstance(value, list) and any(isinstance(item, dict) for item in value):
        for index, item in enumerate(value):
            known = item.get("id") if isinstance(item, dict) else None
            yield from _leaves(item, (*place, str(known or index)))
    elif value != []:
        yield ".".join(place), value


def _merged(recorded: dict[str, Any], local: Mapping[str, Any]) -> dict[str, Any]:
    result = {**local, **recorded}
    for key, mine in recorded.items():
        other = local.get(key)
        if isinstance(mine, dict) and isinstance(other, Mapping):
            result[key] = _merged(mine, other)
        elif key in {"robots", "sensors", "compute"} and isinstance(mine, list):
            known = {one["id"]: one for one in (other if isinstance(other, list) else [])}
            result[key] = [_merged(one, known.pop(one.get("id"), {})) for one in mine]
            if key == "compute":
                result[key] += known.values()
        elif key == "compute" and isinstance(other, list):
            result[key] = other
    return result

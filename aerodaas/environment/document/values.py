"""Values in a mission document: settings of analyses and schedulers as JSON, and back.

Numbers, texts, lists and mappings stand for themselves. An object with one key that begins with a
dollar sign is something else: an analysis, settings of a known class, a condition, a model by the
hash of its file, a sensor's property, a folder for output, or the environment.
"""

from __future__ import annotations

import dataclasses
import hashlib
import importlib
from collections.abc import Mapping
from pathlib import Path, PurePosixPath, PureWindowsPath
from typing import Any, Literal, TypeGuard

import numpy as np

from aerodaas.analytics.base import Analytics, ResourceUse
from aerodaas.analytics.models import DETECTOR
from aerodaas.analytics.models.cache import fetched_path, model_folder, model_named
from aerodaas.config.plugins import load_plugin, plugin_names
from aerodaas.documents.arguments import CONDITIONS, SETTINGS
from aerodaas.environment.environment import Environment
from aerodaas.errors import AeroDaaSError, GraphError

__all__ = ["ValueReader", "ValueWriter", "registered_name"]

_OUTPUT = Path("runs")
"""Folder, in the working directory, of all that a document's analyses write."""


def _hash_of(path: Path) -> str:
    """SHA-256 of a file, hexadecimal; raises GraphError if it cannot be read."""
    try:
        return hashlib.sha256(path.read_bytes()).hexdigest()
    except OSError as error:
        raise GraphError(f"cannot read the model {path}: {error.strerror}") from None


class ValueWriter:
    """Writes values of one environment's application."""

    def __init__(self, environment: Environment) -> None:
        """Know the `environment`, to which values may refer."""
        self._environment = environment
        self.models: dict[str, Path] = {}
        """Files of the models that were written, by SHA-256."""

    def analysis(self, work: Analytics[Any]) -> tuple[str, dict[str, Any]]:
        """Registered name and settings of an analysis; raises GraphError if it has none."""
        name = registered_name("analytics", type(work))
        if name is None:
            raise GraphError(
                f"{type(work).__name__} is the application's own code, which no document holds: "
                "keep it at your side by deploy(env.here), where it runs while a provider flies "
                "the rest, or have its package register it as an entry point of "
                "`aerodaas.analytics` wherever it is to fly"
            )
        return name, self.settings(work.given_settings(), work.resources, name)

    def settings(
        self, given: Mapping[str, Any], bound: Mapping[str, ResourceUse], owner: str
    ) -> dict[str, Any]:
        """The arguments of a constructor as data.

        Args:
            given: Arguments by name.
            bound: Resources of the environment that arguments name, by the argument's name.
            owner: Name of the class, for errors.

        Raises:
            GraphError: For an argument that is no data.
        """
        return {
            name: self._resource(value, bound[name], f"{owner}({name}=…)")
            if name in bound and value is not None
            else self.value(value, f"{owner}({name}=…)")
            for name, value in given.items()
        }

    def value(self, value: object, place: str) -> Any:  # noqa: ANN401 - any JSON
        """Any value as data; tuples become lists, and references objects.

        Args:
            value: Argument, or a part of one.
            place: Where it stands, for errors.

        Raises:
            GraphError: With its `place`, for a value that is no data.
        """
        if value is self._environment.env_data:
            raise GraphError(
                f"{place}: no document holds the environment's data, which may be secret; an "
                "analysis says in its `resources` which of its arguments is the environment's"
            )
        plain = value.item() if isinstance(value, np.generic) else value
        if plain is None or isinstance(plain, bool | int | float | str):
            return plain
        if isinstance(value, list | tuple):
            return [self.value(one, place) for one in value]
        found = self._reference(value, place)
        if found is None and _is_mapping(value):
            found = {key: self.value(one, place) for key, one in value.items()}
        if found is None:
            what = getattr(value, "__qualname__", None) or repr(value)[:60]
            raise GraphError(f"{place}: {what} is code or an object, which no document can hold")
        return found

    def _reference(self, value: object, place: str) -> dict[str, Any] | None:
        """Reference to an object that both ends know; None for any other."""
        if value is self._environment:
            return {"$environment": "handle"}
        if isinstance(value, Analytics):
            name, settings = self.analysis(value)
            return {"$analysis": name, "settings": settings}
        for name, target in SETTINGS.items():
            if type(value) is _imported(target):
                return {"$settings": name, "of": self._fields(value, place)}
        for name, target in CONDITIONS.items():
            if value is _imported(target):
                return {"$condition": name}
        return None

    def _fields(self, value: Any, place: str) -> dict[str, Any]:  # noqa: ANN401 - a dataclass
        return {
            one.name: self.value(getattr(value, one.name), place)
            for one in dataclasses.fields(value)
            if getattr(value, one.name) != one.default
        }

    def _resource(self, value: object, use: ResourceUse, place: str) -> dict[str, Any]:
        if use == "environment":
            if value is self._environment.env_data:
                return {"$environment": "data"}
            if found := self._reference(value, place):
                return found
            raise GraphError(f"{place} comes from the environment file alone: leave it out")
        path = Path(str(value))
        if use == "model":
            named = model_named(str(value))
            if named is None:
                sha256 = _hash_of(path)
            else:
                # It was verified when the analysis read it.
                path, sha256 = fetched_path(named), named.sha256
            self.models[sha256] = path
            return {"$model": path.name, "sha256": sha256}
        if use == "output":
            return {"$output": path.name}
        for sensor in self._environment.config.all_sensors():
            handle = self._environment.sensor(sensor)
            for name in sensor.settings:
                if handle.get_sensor_property(name) == str(value):
                    return {"$property": [sensor.full_id, name]}
        raise GraphError(
            f"{place} reads {value}, which only this machine has: name it as a setting of a sensor "
            "of the environment file, and take it from there by get_sensor_property"
        )


class ValueReader:
    """Reads values into objects of this machine."""

    def __init__(self, environment: Environment, models: Path) -> None:
        """Know the `environment` to which values refer, and the folder of further models."""
        self._environment = environment
        self._models = models
        self._hashes: dict[Path, str] = {}
        """SHA-256 of the models that were read so far."""

    def analysis(self, name: str, settings: Mapping[str, Any]) -> Analytics[Any]:
        """Make a registered analysis.

        Args:
            name: Its registered name.
            settings: Arguments of its constructor by name, as the document has them.

        Raises:
            GraphError: For a setting that it does not take, and if the name is that of no analysis.
        """
        kind = load_plugin("analytics", name)
        made = self.made(kind, settings, name)
        if not isinstance(made, Analytics):
            raise GraphError(f"{name} is no analysis")
        return made

    def made(self, kind: Any, settings: Mapping[str, Any], owner: str) -> Any:  # noqa: ANN401 - any class
        """An instance of `kind`.

        Args:
            kind: Class, with the `resources` of its arguments if it has any.
            settings: Arguments of its constructor by name, as the document has them.
            owner: Name of the class, for errors.

        Raises:
            GraphError: For settings that it does not take.
        """
        bound: Mapping[str, ResourceUse] = getattr(kind, "resources", {})
        found = {
            name: self._resource(value, bound[name], f"{owner}.{name}")
            if name in bound and value is not None
            else self.value(value, f"{owner}.{name}")
            for name, value in settings.items()
        }
        try:
            return kind(**found)
        except AeroDaaSError:
            raise
        except Exception as error:  # noqa: BLE001 - a stranger's values in any constructor
            raise GraphError(f"{owner} does not take these settings: {error}"[:300]) from None

    def value(self, content: Any, place: str) -> Any:  # noqa: ANN401 - any value
        """Any value from its data; lists become tuples.

        Args:
            content: Data of the document.
            place: Where it stands, for errors.

        Raises:
            GraphError: With its `place`, for a value of an unknown kind.
        """
        if isinstance(content, list):
            return tuple(self.value(one, place) for one in content)
        if not isinstance(content, dict):
            return content
        kind = next((key for key in content if key.startswith("$")), None)
        if kind is None:
            return {key: self.value(one, place) for key, one in content.items()}
        return self._special(kind, content, place)

    def _special(self, kind: str, content: dict[str, Any], place: str) -> Any:  # noqa: ANN401
        match content:
            case {"$environment": "handle", **rest} if not rest:
                return self._environment
            case {"$condition": str(name), **rest} if not rest and name in CONDITIONS:
                return _imported(CONDITIONS[name])
            case {"$analysis": str(name), "settings": dict(settings), **rest} if not rest:
                return self.analysis(name, settings)
            case {"$settings": str(name), "of": dict(of), **rest} if not rest and name in SETTINGS:
                return self.made(_imported(SETTINGS[name]), of, f"{place}: {name}")
        raise GraphError(f"{place}: there is no {kind} {str(content[kind])[:40]!r} here")

    def _resource(self, content: Any, use: ResourceUse, place: str) -> Any:  # noqa: ANN401
        if isinstance(content, dict):
            match use, content:
                case "environment", {"$environment": "data", **rest} if not rest:
                    # Nowhere else: an analysis that takes it for a setting names it in its error.
                    return self._environment.env_data
                case "environment", {"$environment": str(), **rest} if not rest:
                    return self._special("$environment", content, place)
                case "model", {"$model": str(name), "sha256": str(wanted), **rest} if not rest:
                    return self._model(name, wanted, place)
                case "output", {"$output": str(name), **rest} if not rest and _is_plain(name):
                    return _OUTPUT / name
                case "input", {"$property": [str(sensor), str(name)], **rest} if not rest:
                    handle = self._environment.get_env_sensor_by_id(sensor)
                    return handle.get_sensor_property(name)
        raise GraphError(f"{place}: a document names no file or address of this machine")

    def _model(self, name: str, wanted: str, place: str) -> Path:
        folders = (model_folder(), self._models, DETECTOR.parent)
        files = [one for folder in folders for one in sorted(folder.glob("*.onnx"))]
        # Those so called first: a hash takes the whole file.
        for path in sorted(files, key=lambda one: one.name not in (name, f"{wanted}.onnx")):
            if path not in self._hashes:
                self._hashes[path] = _hash_of(path)
            if self._hashes[path] == wanted:
                return path
        raise GraphError(
            f"{place}: there is no model {name!r} with the SHA-256 {wanted[:16]}… here: put it "
            f"into {self._models}"
        )


def _is_mapping(value: object) -> TypeGuard[Mapping[str, object]]:
    return isinstance(value, Mapping) and all(
        isinstance(key, str) and not key.startswith("$") for key in value
    )


def _is_plain(name: str) -> bool:
    """Whether a name is one part of a path, on any system."""
    return (
        name not in {"", ".", ".."}
        and PurePosixPath(name).name == name
        and PureWindowsPath(name).name == name
    )


def registered_name(
    kind: Literal["analytics", "trajectory_schedulers"], wanted: type
) -> str | None:
    """Name by which a class is registered.

    Args:
        kind: Kind of plug-in.
        wanted: The class.

    Returns:
        The name, or None if the class is not registered.
    """
    names = plugin_names(kind)
    first = [wanted.__name__] if wanted.__name__ in names else names
    return next((name for name in first if load_plugin(kind, name) is wanted), None)


def _imported(target: str) -> Any:  # noqa: ANN401 - a class or a function
    module, _, name = target.partition(":")
    return getattr(importlib.import_module(module), name)

"""Arguments of registered analyses and schedulers, as a mission document holds them.

The model of a plug-in's arguments is made from its constructor: types and ranges from the
annotations, defaults from the signature, descriptions from `Args:` of the docstring. An argument
that is code or an object has no form in a document, and is left out.
"""

from __future__ import annotations

import ast
import dataclasses
import functools
import importlib
import inspect
import json
import operator
import re
import textwrap
import threading
import types
import typing
from collections.abc import Callable, Mapping
from typing import Annotated, Any, Literal, Union

from pydantic import (
    BaseModel,
    ConfigDict,
    Field,
    TypeAdapter,
    ValidationError,
    create_model,
    model_validator,
)

from aerodaas.analytics.base import Analytics, ResourceUse
from aerodaas.config.checked import explained
from aerodaas.config.plugins import PluginKind, load_plugin
from aerodaas.config.schema import attribute_texts
from aerodaas.dataflow.interfaces import IEnvironment, INavigate
from aerodaas.errors import GraphError, UnknownIdError

__all__ = [
    "CONDITIONS",
    "SETTINGS",
    "AnalysisValue",
    "argument_model",
    "check_arguments",
    "class_texts",
    "condition_adapter",
]

_parsing = threading.Lock()
"""Held while source is parsed: CPython 3.11 raises SystemError where two threads parse at once."""

SETTINGS = {
    "Above": "aerodaas.analytics.conditions:Above",
    "Below": "aerodaas.analytics.conditions:Below",
    "FollowGains": "aerodaas.following.follow_settings:FollowGains",
    "FollowLimits": "aerodaas.following.follow_settings:FollowLimits",
    "LostPolicy": "aerodaas.following.follow_settings:LostPolicy",
    "Near": "aerodaas.analytics.conditions:Near",
    "TargetChoice": "aerodaas.following.follow_settings:TargetChoice",
    "TargetSize": "aerodaas.following.target:TargetSize",
}
"""Dataclasses that a document may hold, as `{"$settings": NAME, "of": …}`."""
CONDITIONS = {
    "fallen": "aerodaas.analytics.people.body_pose:fallen",
    "hand_raised": "aerodaas.analytics.people.body_pose:hand_raised",
}
"""Functions that a trigger may have for its condition, as `{"$condition": NAME}`."""
_SCALARS = (bool, int, float, str, type(None))
_ARGUMENT = re.compile(r"^ {4}(\w+): (.*?)(?=^ {4}\w+: |\Z)", re.DOTALL | re.MULTILINE)


class _Value(BaseModel):
    model_config = ConfigDict(extra="forbid", strict=True, allow_inf_nan=False)


class AnalysisValue(_Value):
    """A registered analysis as the argument of another one, such as a detector."""

    name: str = Field(alias="$analysis", description="Registered name of the analysis.")
    settings: dict[str, Any] = Field(description="Arguments of the analysis.")

    @model_validator(mode="after")
    def _has_its_arguments(self) -> AnalysisValue:
        try:
            check_arguments("analytics", self.name, self.settings)
        except (GraphError, UnknownIdError) as error:
            raise ValueError(str(error)) from None
        return self


class ModelFile(_Value):
    """A model file by the hash of its content, for a file has no path in a document."""

    name: str = Field(alias="$model", description="Name of the file.")
    sha256: str = Field(pattern="^[0-9a-f]{64}$", description="SHA-256 of the file, hexadecimal.")


class OutputFolder(_Value):
    """A folder for results in the working directory of the flight."""

    name: str = Field(alias="$output", pattern=r"^[^/\\]+$", description="Name of the folder.")


class SensorProperty(_Value):
    """A property of a sensor of the environment file, such as the `path` of a log."""

    place: tuple[str, str] = Field(
        alias="$property", description="Full id of the sensor, and name of the property."
    )


class EnvironmentData(_Value):
    """The environment's own data."""

    kind: Literal["data", "handle"] = Field(alias="$environment", description="Which form of it.")


class EnvironmentHandle(_Value):
    """The environment of the flight."""

    kind: Literal["handle"] = Field(alias="$environment", description="Always `handle`.")


class NamedCondition(_Value):
    """A condition by name."""

    name: Literal[tuple(CONDITIONS)] = Field(  # type: ignore[valid-type]
        alias="$condition", description="Name of the condition."
    )


_RESOURCES: Mapping[ResourceUse, type[BaseModel]] = {
    "model": ModelFile,
    "output": OutputFolder,
    "input": SensorProperty,
    "environment": EnvironmentData,
}


def check_arguments(kind: PluginKind, name: str, settings: Mapping[str, Any]) -> None:
    """Check a plug-in's arguments without making it.

    Args:
        kind: Kind of plug-in.
        name: Its registered name.
        settings: Arguments by name, as a document has them.

    Raises:
        GraphError: For arguments that it does not take; names the nearest known ones.
        AeroDaaSError: What `load_plugin` raises.
    """
    model = argument_model(kind, name)
    try:
        model.model_validate_json(json.dumps(settings))
    except ValidationError as error:
        raise GraphError(f"{name}: {explained(error, model, settings)}") from None


@functools.cache
def argument_model(kind: PluginKind, name: str) -> type[BaseModel]:
    """Model of a plug-in's arguments in a document.

    Args:
        kind: `analytics` or `trajectory_schedulers`.
        name: Registered name.

    Raises:
        AeroDaaSError: What `load_plugin` raises.
    """
    made: Any = load_plugin(kind, name)
    init = made.__init__ if isinstance(made, type) else made
    signature = inspect.signature(init)
    hints, texts = _hints(made, init), _described(init)
    bound: Mapping[str, ResourceUse] = getattr(made, "resources", {})
    parameters = list(signature.parameters.values())[isinstance(made, type) :]
    if kind == "trajectory_schedulers" and parameters:
        parameters = parameters[1:]  # The environment, which whoever flies it gives.
    fields = {}
    for one in parameters:
        if one.kind in {one.VAR_POSITIONAL, one.VAR_KEYWORD}:
            continue
        hint = hints.get(one.name, Any)
        form = _bound(hint, bound[one.name]) if one.name in bound else _form(hint)
        if form is not None:
            fields[one.name] = (form, _field(one.default, texts.get(one.name, "")))
    summary = inspect.getdoc(made) or ""
    config = ConfigDict(extra="forbid", strict=True, allow_inf_nan=False)
    make: Any = create_model
    made_model: type[BaseModel] = make(name, __config__=config, __doc__=summary, **fields)
    return made_model


def _field(default: object, text: str) -> Any:  # noqa: ANN401 - pydantic's description of a field
    """A field with its default, which the schema shows where JSON can hold it."""
    description = text or None
    if default is inspect.Parameter.empty:
        return Field(description=description)
    try:
        json.dumps(default, allow_nan=False)
    except (TypeError, ValueError):
        return Field(default_factory=lambda: default, description=description)
    return Field(default=default, description=description)


def _hints(made: object, init: Callable[..., Any]) -> dict[str, Any]:
    """Annotations of a constructor; Any where one names what only type checkers import."""
    plain = inspect.unwrap(init)
    scopes = [vars(one) for one in getattr(made, "__mro__", ())[::-1]]
    known = {key: value for scope in scopes for key, value in scope.items()}
    known |= getattr(plain, "__globals__", {})
    written = getattr(plain, "__annotations__", {})
    return {name: _resolved(hint, known) for name, hint in written.items()}


def _resolved(hint: object, known: dict[str, Any]) -> Any:  # noqa: ANN401 - an annotation
    holder = types.SimpleNamespace(__annotations__={"it": hint})
    try:
        return typing.get_type_hints(holder, known, include_extras=True)["it"]
    except (NameError, AttributeError, TypeError, SyntaxError):
        return Any


def _described(init: Callable[..., Any]) -> dict[str, str]:
    """Descriptions under `Args:` of a docstring, by argument."""
    _, _, rest = (inspect.getdoc(init) or "").partition("\nArgs:\n")
    block = re.split(r"^\S", rest, maxsplit=1, flags=re.MULTILINE)[0]
    return {name: " ".join(text.split()) for name, text in _ARGUMENT.findall(block)}


def _bound(hint: Any, use: ResourceUse) -> Any:  # noqa: ANN401 - annotations
    model = _RESOURCES[use]
    parts = [typing.get_origin(one) or one for one in (hint, *typing.get_args(hint))]
    if use == "environment" and Mapping not in parts:
        return None  # The environment file alone gives it.
    return model | None if type(None) in typing.get_args(hint) else model


def _form(hint: Any) -> Any:  # noqa: ANN401, PLR0911 - annotations; one line a kind
    """Annotation of an argument's form in a document; None for code and objects."""
    origin, inner = typing.get_origin(hint), typing.get_args(hint)
    if hint is Any or hint in _SCALARS or origin is Literal:
        return hint
    if origin is Annotated:
        form = _form(inner[0])
        return None if form is None else Annotated[(form, *inner[1:])]
    if origin in {Union, types.UnionType}:
        forms = [form for one in inner if (form := _form(one)) is not None]
        useful = [form for form in forms if form is not type(None)]
        return functools.reduce(operator.or_, forms) if useful else None
    if isinstance(origin, type) and issubclass(origin, Mapping):
        form = _form(inner[-1])
        return None if form is None else dict[str, form]  # type: ignore[valid-type]
    if origin is tuple and inner[-1] is not ...:
        return tuple[tuple(_form(one) for one in inner)]  # type: ignore[misc]
    if isinstance(origin, type) and issubclass(origin, (list, tuple, typing.Sequence)):
        form = _form(inner[0])
        return None if form is None else list[form]  # type: ignore[valid-type]
    return _object(origin or hint)


def _object(kind: Any) -> Any:  # noqa: ANN401 - a class, and an annotation
    if not isinstance(kind, type):
        return None
    if issubclass(kind, Analytics):
        return AnalysisValue
    if issubclass(kind, (IEnvironment, INavigate)):
        return EnvironmentHandle
    target = f"{kind.__module__}:{kind.__qualname__}"
    return _settings_value(kind.__name__) if target in SETTINGS.values() else None


@functools.cache
def _settings_value(name: str) -> type[BaseModel]:
    """Model of `{"$settings": NAME, "of": …}`."""
    module, _, attribute = SETTINGS[name].partition(":")
    kind = getattr(importlib.import_module(module), attribute)
    hints = typing.get_type_hints(kind, include_extras=True)
    texts = class_texts(kind)
    fields: dict[str, Any] = {}
    for one in dataclasses.fields(kind):
        missing = one.default is dataclasses.MISSING
        default = inspect.Parameter.empty if missing else one.default
        fields[one.name] = (_form(hints[one.name]), _field(default, texts.get(one.name, "")))
    make: Any = create_model
    of = make(name, __base__=_Value, __doc__=inspect.getdoc(kind), **fields)
    key = Field(alias="$settings", pattern=f"^{name}$", description=f"Always `{name}`.")
    whole: type[BaseModel] = make(
        f"{name}Value",
        __base__=_Value,
        __doc__=inspect.getdoc(kind),
        kind=(str, key),
        of=(of, Field(description="Its fields; those left out keep their defaults.")),
    )
    return whole


def class_texts(kind: type) -> dict[str, str]:
    """Docstrings of a class' attributes, by name, each on one line."""
    with _parsing:
        node = ast.parse(textwrap.dedent(inspect.getsource(kind))).body[0]
    texts = attribute_texts(node) if isinstance(node, ast.ClassDef) else {}
    return {name: " ".join(text.split()) for name, text in texts.items()}


@functools.cache
def condition_adapter() -> TypeAdapter[Any]:
    """Validator of a trigger's condition, as a document holds one that is not code."""
    conditions = [_settings_value(name) for name in ("Above", "Below", "Near")]
    forms: Any = functools.reduce(operator.or_, conditions, NamedCondition | None)
    return TypeAdapter(forms)

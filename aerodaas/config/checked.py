"""Validation of settings from files: strict models, and the wording of errors."""

from __future__ import annotations

import difflib
import re
import types
import typing
from collections.abc import Iterable, Iterator, Sequence
from typing import Annotated, Any, ClassVar, TypeVar

from pydantic import (
    BaseModel,
    ConfigDict,
    Field,
    GetCoreSchemaHandler,
    PlainSerializer,
    Secret,
    SecretBytes,
    SecretStr,
    SerializationInfo,
    SerializerFunctionWrapHandler,
    ValidationError,
    model_serializer,
)
from pydantic_core import CoreSchema, ErrorDetails

from aerodaas.config.extensions import SettingsSection, section_models
from aerodaas.config.secrets import HIDDEN, SecretUrl, cleaned, is_secret_name, shown, shown_text
from aerodaas.errors import ConfigError

__all__ = [
    "Count",
    "Extensible",
    "Finite",
    "Fraction",
    "NotNegative",
    "Positive",
    "PositiveFraction",
    "Settings",
    "Strict",
    "added_settings",
    "checked",
    "explained",
    "is_subclass",
    "near",
]


def is_subclass(annotation: Any, *parents: type) -> bool:  # noqa: ANN401 - any annotation
    """Whether an annotation is a class below one of some classes.

    On Python 3.10 `list[int]` claims to be a class, and `issubclass` raises TypeError for it.

    Args:
        annotation: Any annotation.
        *parents: The classes.
    """
    plain = isinstance(annotation, type) and typing.get_origin(annotation) is None
    return plain and issubclass(annotation, parents)


Positive = Annotated[float, Field(gt=0, allow_inf_nan=False)]
NotNegative = Annotated[float, Field(ge=0, allow_inf_nan=False)]
Finite = Annotated[float, Field(allow_inf_nan=False)]
Fraction = Annotated[float, Field(ge=0, le=1)]
PositiveFraction = Annotated[float, Field(gt=0, le=1)]
Count = Annotated[int, Field(ge=1)]


def _shown_settings(settings: dict[str, Any]) -> dict[str, Any]:
    return dict(shown(settings))


Settings = Annotated[dict[str, Any], PlainSerializer(_shown_settings, when_used="json")]
"""Settings of a plug-in, which may hold secrets."""


def _without_logins(value: Any) -> Any:  # noqa: ANN401 - as nested as its input
    """URLs in texts without user, password and parameters, in any setting."""
    if isinstance(value, str):
        return shown_text(value)
    if isinstance(value, list):
        return [_without_logins(one) for one in value]
    if isinstance(value, dict):
        return {key: _without_logins(one) for key, one in value.items()}
    return value


class Strict(BaseModel):
    """Unknown keys are mistakes, not wishes.

    Neither `repr` nor JSON holds a secret; `model_dump()` keeps them, for a copy.
    """

    model_config = ConfigDict(extra="forbid", frozen=True)

    @model_serializer(mode="wrap")
    def _serialized(
        self, dump: SerializerFunctionWrapHandler, info: SerializationInfo
    ) -> dict[str, Any]:
        content: dict[str, Any] = dump(self)
        return _without_logins(content) if info.mode == "json" else content

    def __repr_args__(self) -> Iterator[tuple[str | None, Any]]:
        for name, value in super().__repr_args__():
            # Which settings of a plug-in are secrets, its own model alone knows.
            hidden = dict.fromkeys(value, HIDDEN) if name == "settings" else value
            yield name, _without_logins(hidden)


class Extensible(Strict):
    """A section of an environment file to which extensions add settings (`Extension.settings`).

    They are added when the first such section is validated, once every module can be imported.
    """

    model_config = ConfigDict(defer_build=True)
    section: ClassVar[SettingsSection]

    @classmethod
    def __get_pydantic_core_schema__(
        cls, source: type[BaseModel], handler: GetCoreSchemaHandler
    ) -> CoreSchema:
        for extension, model in section_models(cls.section).items():
            for name, field in model.model_fields.items():
                if cls.model_fields.setdefault(name, field) is not field:
                    raise ConfigError(
                        f"the extension {extension!r} adds {name!r} to the settings of "
                        f"{cls.section}, which have it already: uninstall the extension"
                    )
        return handler(source)


M = TypeVar("M", bound=BaseModel)
_WORD = re.compile(r"[\w .\-]{0,40}")


def checked(model: type[M], content: object, place: str, hint: str = "") -> M:
    """Make a model of some content.

    Args:
        model: Class of the model.
        content: Plain data, such as a file's.
        place: Where it stands, for the error.
        hint: Text put behind the error.

    Raises:
        ConfigError: Names `place`, setting and remedy.
    """
    try:
        return model.model_validate(content)
    except ValidationError as error:
        raise ConfigError(f"{place}: {explained(error, model, content)}{hint}") from None


def added_settings(section: Extensible, model: type[M]) -> M:
    """The settings that an extension has added to a section.

    Args:
        section: A section of an environment file.
        model: The extension's model for it.
    """
    return model.model_construct(**{name: getattr(section, name) for name in model.model_fields})


def explained(error: ValidationError, model: type[BaseModel], content: object) -> str:
    """The errors, setting by setting, each with its value and the allowed ones; no secrets.

    Args:
        error: Error of the validation.
        model: Class that was validated.
        content: Content that was validated; its secrets are left out of the text.
    """
    problems = [one for one in error.errors() if not _is_other_choice(one)] or error.errors()
    text = "; ".join(_problem(one, model, content) for one in problems)
    # A validator's own words may quote what it was given.
    return cleaned(text, [content, *_typed_secrets(model, content)])


def near(name: str, known: Iterable[str]) -> str:
    """Suggestion of a similar name, to put behind an error.

    Args:
        name: Unknown name.
        known: Names that there are.
    """
    choices = sorted(known)
    close = difflib.get_close_matches(name, choices, n=1, cutoff=0.6)
    meant = f"; did you mean {close[0]}?" if close else ""
    return f"{meant} (known: {', '.join(choices) or 'none'})"


def _is_other_choice(problem: ErrorDetails) -> bool:
    """Pydantic's error types for a scalar where an object is needed."""
    return problem["type"] == "literal_error" and not isinstance(problem["input"], str)


def _problem(problem: ErrorDetails, model: type[BaseModel], content: object) -> str:
    # Among several kinds that a setting may have, pydantic names the one that it tried.
    *kinds, last = problem["loc"] or ("file",)
    # The last part may be a stranger's key of any form.
    place = (*(one for one in kinds if not (isinstance(one, str) and "[" in one)), last)
    if problem["type"] != "extra_forbidden" and isinstance(last, str) and "[" in last:
        place = place[:-1]
    said = problem["msg"].removeprefix("Value error, ")
    text = ".".join(str(part) for part in place) or "file"
    whose = _whose(content, place)
    if problem["type"] == "extra_forbidden":
        models = _models_at(model, place[:-1])
        known = {field.alias or name for one in models for name, field in one.model_fields.items()}
        others = any(issubclass(one, Extensible) for one in models)
        remedy = "; if an extension adds it, install that extension" if others else ""
        return f"{text}: there is no such setting{whose}{near(str(place[-1]), known)}{remedy}"
    value = problem["input"]
    number = value is None or isinstance(value, bool | int | float)
    # A word may be printed, but no address, which may hold a password, and no secret.
    word = isinstance(value, str) and _WORD.fullmatch(value)
    shown = repr(value) if number or word else ""
    if problem["type"] == "missing" or not shown or _is_secret(model, place):
        return f"{text}: {said}{whose}"
    return f"{text}: {said}, not {shown}{whose}"


def _is_secret(model: type[BaseModel], place: Sequence[int | str]) -> bool:
    """Whether the setting at `place` holds a secret, by its name or by its type."""
    kinds: list[Any] = [model]
    for part in place:
        kinds = [inner for kind in kinds for inner in _inside(kind, part)]
        if (isinstance(part, str) and is_secret_name(part)) or any(map(_hides, kinds)):
            return True
    return False


def _hides(kind: Any) -> bool:  # noqa: ANN401 - an annotation
    return is_subclass(kind, Secret, SecretStr, SecretBytes)


def _typed_secrets(kind: Any, content: object) -> Iterator[SecretStr]:  # noqa: ANN401
    """The texts in `content` where an annotation has a secret type."""
    for one in _alternatives(kind):
        if _hides(one) and not issubclass(one, SecretUrl):
            if isinstance(content, str | int | float):
                yield SecretStr(str(content))
        elif isinstance(content, dict):
            for name, value in content.items():
                for inner in _inside(one, name) if one is not Any else ():
                    yield from _typed_secrets(inner, value)
        elif isinstance(content, list) and typing.get_origin(one) in {list, tuple}:
            for inner in typing.get_args(one)[-1:]:
                for value in content:
                    yield from _typed_secrets(inner, value)


def _whose(content: object, place: Sequence[int | str]) -> str:
    """The ids along `place`, which are clearer than list indices: ` (of drone, cam)`."""
    found = []
    for part in place:
        try:
            content = content[part]  # type: ignore[index]
        except (TypeError, LookupError):
            break
        if isinstance(content, dict) and isinstance(part, int) and "id" in content:
            found.append(str(content["id"]))
    return f" (of {', '.join(found)})" if found else ""


def _models_at(model: type[BaseModel], place: Sequence[int | str]) -> list[type[BaseModel]]:
    """Models of the settings at `place`."""
    kinds: list[Any] = [model]
    for part in place:
        kinds = [inner for kind in kinds for inner in _inside(kind, part)]
    return [kind for kind in kinds if is_subclass(kind, BaseModel)]


def _inside(kind: Any, part: int | str) -> list[Any]:  # noqa: ANN401 - an annotation
    if is_subclass(kind, BaseModel):
        fields = kind.model_fields
        return _alternatives(fields[part].annotation) if part in fields else []
    arguments = typing.get_args(kind)
    if typing.get_origin(kind) in {list, tuple, dict} and arguments:
        return _alternatives(arguments[-1])
    return [kind]


def _alternatives(kind: Any) -> list[Any]:  # noqa: ANN401 - an annotation
    if typing.get_origin(kind) is typing.Annotated:
        return _alternatives(typing.get_args(kind)[0])
    if typing.get_origin(kind) in {typing.Union, types.UnionType}:
        return [one for inner in typing.get_args(kind) for one in _alternatives(inner)]
    return [kind]

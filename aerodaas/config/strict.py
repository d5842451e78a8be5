"""What all parts of the environment file have in common: strictness, and keeping secrets."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Annotated, Any

from pydantic import (
    BaseModel,
    ConfigDict,
    Field,
    PlainSerializer,
    SerializationInfo,
    SerializerFunctionWrapHandler,
    model_serializer,
)

from aerodaas.config.secrets import HIDDEN, shown, shown_text

__all__ = ["Finite", "NotNegative", "Positive", "Settings", "Strict"]

Positive = Annotated[float, Field(gt=0, allow_inf_nan=False)]
NotNegative = Annotated[float, Field(ge=0, allow_inf_nan=False)]
Finite = Annotated[float, Field(allow_inf_nan=False)]


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

"""What a robot's Remote ID says: who operates it, from where, and which aircraft it is."""

from __future__ import annotations

import re
from typing import Annotated, Literal

from pydantic import Field, PlainSerializer, SecretStr, field_validator, model_validator
from typing_extensions import Self

from aerodaas.config.checked import Finite, Strict
from aerodaas.config.sections.preflight import PreflightLevel

__all__ = ["OperatorPlaceConfig", "RemoteIdConfig", "RemoteIdLevel", "RobotRemoteId"]

_PUBLIC = 16
"""Characters of a European operator's number that are public: all but the last three."""
_EUROPEAN = re.compile(r"([A-Z]{3})([0-9a-z]{12})([0-9a-z])(?:-?([0-9a-z]{3}))?")
"""EN 4709-002: country (ISO 3166-1 alpha-3), twelve characters, check character, secret ones."""
_WHOLE = re.compile(r"[A-Za-z]{3}[0-9A-Za-z]{13}-?[0-9A-Za-z]{3}")
"""What looks like such a number with its secret characters, in whatever case."""
_ALPHABET = "0123456789abcdefghijklmnopqrstuvwxyz"
_SERIAL = re.compile(r"[0-9A-HJ-NP-Z]{4}([1-9A-F])([0-9A-HJ-NP-Z]{1,15})")
"""ANSI/CTA-2063-A: manufacturer, length of what follows as a hexadecimal digit, no letters I, O."""


class OperatorPlaceConfig(Strict):
    """Where the operator stands, on WGS84: degrees and metres."""

    latitude: Annotated[float, Field(ge=-90, le=90)]
    longitude: Annotated[float, Field(ge=-180, le=180)]
    altitude: Finite | None = None
    """Above the ellipsoid, as GPS counts; None: not known."""


class RemoteIdConfig(Strict):
    """Remote ID data of operator and aircraft (ASTM F3411-22a, EN 4709-002).

    It is personal: no recording, log or catalogue has it.
    """

    operator_id: SecretStr | None = None
    """The operator's number, at most 20 characters. Of a European one the three secret characters
    at its end serve for its check character alone: they are sent to nobody and kept nowhere."""
    uas_id: Annotated[str, Field(pattern=r"^[!-~]{1,20}$")] | None = None
    """The aircraft's own number, at most 20 characters; None where the transmitter knows it."""
    uas_id_type: Literal["serial", "registration"] = "serial"
    """A serial number by ANSI/CTA-2063-A, or what an authority has given out."""
    description: Annotated[str, Field(pattern=r"^[ -~]{0,23}$")] = ""
    """What it flies for, in at most 23 ASCII characters."""
    operator: OperatorPlaceConfig | None = Field(default=None, repr=False)
    """Where the operator stands; None: where it took off."""
    category: Literal["open", "specific", "certified"] | None = None
    """European category of the operation; None outside of the EU's rules."""
    uas_class: Annotated[int, Field(ge=0, le=6)] | None = None
    """Number of its European class, C0 to C6; None: none, as of one that was built at home."""

    @property
    def european(self) -> bool:
        """Whether it is classified by the EU's rules."""
        return self.category is not None or self.uas_class is not None

    @field_validator("operator_id")
    @classmethod
    def _public(cls, number: SecretStr | None) -> SecretStr | None:
        """The number without its secret characters, once its check character is right."""
        if number is None:
            return None
        text = number.get_secret_value()
        if not re.fullmatch(r"[!-~]{1,20}", text):
            raise ValueError("an operator's number has 1 to 20 ASCII characters, none a blank")
        found = _EUROPEAN.fullmatch(text)
        if found is None:
            if _WHOLE.fullmatch(text):
                raise ValueError(
                    "a European operator's number has three capital letters, and small ones after "
                    "them, as FIN87astrdge12k8-xyz has"
                )
            return number
        _, body, check, secret = found.groups()
        if secret is not None and _check_character(body + secret) != check:
            raise ValueError(
                "a European operator's number whose check character (the 16th) does not fit: "
                "mistyped, in its secret end perhaps"
            )
        return SecretStr(text[:_PUBLIC])

    @model_validator(mode="after")
    def _agrees(self) -> Self:
        number = self.operator_id
        if self.european and number and not _EUROPEAN.fullmatch(number.get_secret_value()):
            raise ValueError(
                "operator_id: by the EU's rules (category, uas_class) it has the form "
                "FIN87astrdge12k8-xyz: country, twelve characters, check character, secret end"
            )
        if self.uas_id is not None and self.uas_id_type == "serial":
            found = _SERIAL.fullmatch(self.uas_id)
            if found is None or int(found[1], 16) != len(found[2]):
                raise ValueError(
                    "uas_id: a serial number by ANSI/CTA-2063-A has four characters of the "
                    "manufacturer, one that counts the rest (1 to F), and that many: digits and "
                    'capital letters without I and O, such as 1581F5FKD229400DR3K0; "uas_id_type": '
                    '"registration" is for others'
                )
        return self


class RobotRemoteId(Strict):
    """Setting of a robot: its Remote ID."""

    remote_id: Annotated[
        RemoteIdConfig | None, PlainSerializer(lambda _: None, return_type=None, when_used="json")
    ] = None
    """What its Remote ID tells of operator and aircraft; no recording and no other JSON has it."""


class RemoteIdLevel(Strict):
    """Setting of the list before take-off: a Remote ID transmitter that is not ready."""

    remote_id: PreflightLevel = "warn"
    """Whether a Remote ID transmitter says that it is ready."""


def _check_character(text: str) -> str:
    """The check character of `text` by Luhn's algorithm modulo 36, as EN 4709-002 has it."""
    base, total = len(_ALPHABET), 0
    for index, character in enumerate(reversed(text)):
        doubled = _ALPHABET.index(character) * (2 if index % 2 == 0 else 1)
        total += doubled // base + doubled % base
    return _ALPHABET[-total % base]

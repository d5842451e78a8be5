"""Remote ID in an environment file: what is refused, and what is kept nowhere."""

from __future__ import annotations

import json
from typing import Any

import pytest

from aerodaas.config.checked import added_settings, checked
from aerodaas.config.model import EnvironmentConfig
from aerodaas.config.redaction import catalogue, public_document
from aerodaas.errors import ConfigError
from aerodaas.extensions.remote_id.settings import RemoteIdConfig, RobotRemoteId
from aerodaas.recording.recorded_environment import allowed_content

EXAMPLE = "FIN87astrdge12k8-xyz"
"""EN 4709-002's own."""
SERIAL = "1581F5FKD229400DR3K0"


def made(**content: Any) -> RemoteIdConfig:  # noqa: ANN401
    """What is read of a file; raises ConfigError."""
    return checked(RemoteIdConfig, content, "robot drone: remote_id")


def operator_of(config: EnvironmentConfig) -> RemoteIdConfig | None:
    """What its only robot tells."""
    return added_settings(config.robots[0], RobotRemoteId).remote_id


def number_of(config: RemoteIdConfig) -> str:
    """The operator's number as it is sent."""
    assert config.operator_id is not None
    return config.operator_id.get_secret_value()


@pytest.mark.parametrize("given", [EXAMPLE, EXAMPLE.replace("-", ""), EXAMPLE[:16]])
@pytest.mark.parametrize("category", ["open", None])
def test_the_secret_end_of_an_operators_number_is_not_kept(
    given: str, category: str | None
) -> None:
    """With a hyphen, without, and left out at once; by the EU's rules and by nobody's."""
    assert number_of(made(operator_id=given, category=category)) == EXAMPLE[:16]


@pytest.mark.parametrize(
    "given",
    [
        "FIN87astrdge12k9-xyz",
        "FIN87astrdge12k8-xyy",
        "FIN87astrdeg12k8-xyz",
        "FIN87astrdge12k8xya",
    ],
)
def test_a_check_character_that_does_not_fit_is_refused(given: str) -> None:
    """One letter wrong, or two swapped; the number itself is not quoted."""
    with pytest.raises(ConfigError, match="check character") as refused:
        made(operator_id=given)
    assert given not in str(refused.value)
    assert given[-3:] not in str(refused.value)


@pytest.mark.parametrize("given", ["FIN87ASTRDGE12K8-XYZ", "fin87astrdge12k8-xyz"])
def test_a_european_number_in_another_case_is_no_other_countrys(given: str) -> None:
    """It would be sent with its secret end."""
    with pytest.raises(ConfigError, match="three capital letters"):
        made(operator_id=given)


@pytest.mark.parametrize("given", ["", "x" * 21, "FIN 87", "FIN\u00e9", "a\n"])
def test_an_operators_number_has_twenty_characters_at_most(given: str) -> None:
    """Of ASCII, without blanks."""
    with pytest.raises(ConfigError, match="1 to 20 ASCII"):
        made(operator_id=given)


def test_twenty_characters_of_another_country_are_sent_as_they_are() -> None:
    """No check character is known of them; by the EU's rules they are refused."""
    whole = "GBR-OP-ABCDEFGHJKLM1"
    assert number_of(made(operator_id=whole)) == whole
    for rules in ({"category": "open"}, {"uas_class": 1}):
        with pytest.raises(ConfigError, match="by the EU's rules"):
            made(operator_id=whole, **rules)


@pytest.mark.parametrize(
    ("given", "kind", "good"),
    [
        (SERIAL, "serial", True),
        ("ABCD1X", "serial", True),
        ("ABCD2X", "serial", False),
        ("ABCD0", "serial", False),
        ("ABCDG0123456789012345", "serial", False),
        ("ABID1X", "serial", False),
        ("abcd1x", "serial", False),
        ("N12345", "serial", False),
        ("N12345", "registration", True),
        ("x" * 21, "registration", False),
        ("", "registration", False),
    ],
)
def test_serial_numbers_are_those_of_the_standard(given: str, kind: str, good: bool) -> None:  # noqa: FBT001
    """Manufacturer, a length that fits, no I and no O; what an authority gives out may be all."""
    if good:
        assert made(uas_id=given, uas_id_type=kind).uas_id == given
        return
    with pytest.raises(ConfigError, match="uas_id"):
        made(uas_id=given, uas_id_type=kind)


def test_no_document_of_an_environment_says_who_operates() -> None:
    """Neither a recording's, nor the catalogue, nor what a log would print."""
    content = {
        "operator_id": EXAMPLE,
        "uas_id": SERIAL,
        "description": "a survey",
        "operator": {"latitude": 47.123456, "longitude": 8.654321},
    }
    config = EnvironmentConfig.model_validate({"robots": [{"id": "drone", "remote_id": content}]})
    assert operator_of(config) is not None
    texts = [public_document(config), config.model_dump_json(), catalogue(config).model_dump_json()]
    for text in [*texts, repr(config)]:
        for secret in ("FIN87", "xyz", "47.123456", "8.654321"):
            assert secret not in text
    # It is a valid environment again.
    again = EnvironmentConfig.model_validate(json.loads(texts[0]))
    assert operator_of(again) is None
    # A copy for another process has all of it but the secret end.
    copy = EnvironmentConfig.model_validate(config.model_dump(by_alias=True))
    assert operator_of(copy) == operator_of(config)


def test_a_replay_reads_of_a_recording_neither_who_operates_nor_what_is_required() -> None:
    """Whoever flies again says so."""
    robot = {"id": "drone", "remote_id": {"uas_id": SERIAL}, "preflight": {"remote_id": "require"}}
    assert allowed_content({"robots": [robot]}) == {"robots": [{"id": "drone"}]}

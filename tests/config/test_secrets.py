"""A secret of the environment stays there: nothing that is recorded, shown or raised holds it."""

from __future__ import annotations

import io
import json
import pickle
import string
from pathlib import Path
from typing import Any

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from mcap.reader import make_reader
from pydantic import BaseModel, SecretStr, field_validator

from aerodaas.config.checked import checked
from aerodaas.config.model import EnvironmentConfig, RecordingConfig, validated
from aerodaas.config.overrides import parse_setting
from aerodaas.config.redaction import public_document
from aerodaas.config.secrets import SecretUrl, cleaned, is_secret_name, shown_text
from aerodaas.errors import ConfigError
from aerodaas.recording.provenance import Provenance
from aerodaas.recording.recorder import FlightRecorder

SECRETS = st.text(
    string.ascii_letters + string.digits + "/:@?&=+%-_~", min_size=16, max_size=40
).map("9Q{}".format)
"""No word of the configuration's own begins like that."""


class LampSettings(BaseModel):
    """A plug-in author's own settings."""

    pass_phrase: SecretStr
    code_word: SecretStr
    colour: str = "red"

    @field_validator("code_word")
    @classmethod
    def _talks(cls, value: SecretStr) -> SecretStr:
        if value.get_secret_value().startswith("bad"):
            message = f"{value.get_secret_value()} is bad"
            raise ValueError(message)
        return value


class Lamp:
    """A plug-in's camera, never opened here."""

    settings_model = LampSettings


def environment(secret: str) -> dict[str, Any]:
    """An environment file with the secret in every place that may bear one."""
    url = f"rtsp://me:{secret}@cam.local:554/live"
    sensors = [
        {"id": "a", "driver": "video", "settings": {"path": url}},
        {"id": "b", "driver": "video", "settings": {"path": f"http://cam.local/x?code={secret}"}},
        {"id": "c", "driver": "video", "settings": {"path": f"rtsp://cam.local/u=me&p={secret}"}},
        {"id": "d", "driver": "other:Cam", "settings": {"deep": [{"apiKey": secret}], "u": url}},
        {
            "id": "e",
            "driver": f"{__name__}:Lamp",
            "settings": {"pass_phrase": secret, "code_word": secret, "colour": "blue"},
        },
    ]
    robot = {
        "id": "drone",
        "driver": "mavlink",
        "settings": {"signing_key": secret},
        "sensors": sensors,
    }
    query = secret.replace("@", "")
    endpoint = {"url": f"https://fn.local/detect?code={query}"}
    packages = [f"x @ https://me:{secret.replace(' ', '')}@index.local/x.tar.gz"]
    return {
        "robots": [robot],
        "compute": [{"id": "fn", "kind": "http", "endpoint": endpoint}],
        "runtime_env": {"seen": {"env_vars": {"HUB": secret}, "packages": packages}},
        "remote": {"token": secret},
    }


def whole(path: Path) -> str:
    """All records of a recording, decompressed."""
    reader = make_reader(io.BytesIO(path.read_bytes()))
    parts = [str(one.metadata) for one in reader.iter_metadata()]
    parts += [one.data.decode("latin-1") for one in reader.iter_attachments()]
    parts += [message.data.decode("latin-1") for _, _, message in reader.iter_messages()]
    return "\n".join([*parts, path.read_bytes().decode("latin-1")])


@settings(max_examples=25)
@given(secret=SECRETS)
def test_a_secret_stays_in_the_configuration(
    secret: str, tmp_path_factory: pytest.TempPathFactory
) -> None:
    """Neither the recording nor `repr`, JSON or a pickle for other actors holds it."""
    folder = tmp_path_factory.mktemp("flight")
    app = folder / "app.py"
    app.write_text(f"TOKEN = {secret!r}\n")
    config = validated(environment(secret), "here")
    provenance = Provenance.collect(app=app, config=config)
    path = folder / "flight.mcap"
    FlightRecorder(path, config=RecordingConfig(), provenance=provenance).close()
    for text in (whole(path), repr(config), repr(provenance)):
        assert secret not in text
        assert secret.replace("@", "") not in text
    actors = pickle.dumps(config.for_actors().remote) + pickle.dumps(config.for_actors().compute)
    assert secret.encode() not in actors
    again = validated(json.loads(public_document(config)), "recorded")
    assert again.remote.token is None
    assert again.robots[0].sensors[4].settings["colour"] == "blue"


@settings(max_examples=25)
@given(secret=SECRETS, place=st.sampled_from(["token", "env", "lamp", "url", "package", "path"]))
def test_an_error_does_not_quote_a_secret(secret: str, place: str) -> None:
    """Whatever is wrong beside it, or with it."""
    places: dict[str, dict[str, Any]] = {
        "token": {"remote": {"token": secret[:10], "port": "x"}},
        "env": {"runtime_env": {"a": {"env_vars": {"RAY_X": secret, "HUB": [secret]}}}},
        "url": {
            "compute": [{"id": "f", "kind": "http", "endpoint": {"url": f"ftp://a:{secret}@b"}}]
        },
        "package": {"runtime_env": {"a": {"packages": [f"x @@ https://me:{secret}@h/x"]}}},
        "path": {"sensors": [{"id": "c", "settings": {"path": f"rtsp://a:{secret}@b"}, "rate": 0}]},
        "lamp": {},
    }
    wrong = places[place]
    lamp = {"pass_phrase": [1], "code_word": f"bad{secret}"}
    with pytest.raises(ConfigError) as refusal:
        checked(LampSettings, lamp, "lamp") if place == "lamp" else validated(
            {"robots": [{"id": "drone"}], **wrong}, "here"
        )
    assert secret[:10] not in str(refusal.value)


@pytest.mark.parametrize(
    ("text", "seen"),
    [
        ("rtsp://me:pa/ss@cam/live", "rtsp://cam/live"),
        ("https://fn/x?code=abc", "https://fn/x?***"),
        ("rtsp://1.2.3.4:554/user=me&password=abc", "rtsp://1.2.3.4:554/user?***"),
        ("x @ https://me:pw@host/x.whl", "x @ https://host/x.whl"),
        ("http://cam/x?code=abc@def", "http://***"),
        ("torch==2.4.1", "torch==2.4.1"),
        ("udpin:0.0.0.0:14540", "udpin:0.0.0.0:14540"),
        ("/videos/a=b.mp4", "/videos/a=b.mp4"),
    ],
)
def test_how_an_address_is_shown(text: str, seen: str) -> None:
    """Scheme, host and path; what holds no address is shown whole."""
    assert shown_text(text) == seen
    assert str(SecretUrl(text)) == seen
    assert seen in repr(SecretUrl(text))


def test_names_of_secrets() -> None:
    """By their words, not by their letters."""
    secret = ["password", "apiKey", "mqtt_token", "signing_key", "auth", "PIN"]
    plain = ["token_env", "token_header", "keyboard", "keypoints", "author", "mapping", "monkey"]
    assert all(map(is_secret_name, secret))
    assert not any(map(is_secret_name, plain))


def test_a_library_quotes_an_address() -> None:
    """Whole or in parts, the message is cleaned."""
    url = SecretUrl("rtsp://me:hidden@cam/live?k=query")
    text = cleaned("cannot open rtsp://me:hidden@cam/live?k=query (login me:hidden)", [url])
    assert "hidden" not in text
    assert "query" not in text


def test_a_setting_of_the_command_line_is_not_quoted() -> None:
    """It may be a secret."""
    with pytest.raises(ConfigError) as refusal:
        parse_setting("token=abcdefgh")
    assert "abcdefgh" not in str(refusal.value)
    assert EnvironmentConfig.model_validate({"robots": [{"id": "a"}]}).remote.token is None

"""Fuzz target: environment files, from their bytes to what a recording shows of them."""

from __future__ import annotations

import json
import tempfile
from collections.abc import Iterable
from pathlib import Path

from aerodaas.config.model import EnvironmentConfig
from aerodaas.config.overrides import located, overridden, parse_setting
from aerodaas.config.redaction import public_document
from aerodaas.errors import AeroDaaSError

__all__ = ["run", "seeds"]

_FILE = Path(tempfile.mkdtemp(prefix="aerodaas-fuzz-")) / "environment.json"


def seeds() -> Iterable[bytes]:
    """Valid files: a small one, and one with every section; an override may follow a zero byte."""
    camera = {"id": "cam", "driver": "video", "settings": {"path": "rtsp://me:pw@cam/live"}}
    robot = {
        "id": "drone",
        "limits": {"geofence": {"polygon": [[0, 0], [9, 0], [9, 9]], "no_fly": []}},
        "sensors": [camera],
        "settings": {"mass": 1.0},
    }
    endpoint = {"url": "https://fn.local/x?code=1", "token_env": "TOKEN"}
    full = {
        "robots": [robot],
        "home": {"latitude": 13.0, "longitude": 77.5},
        "compute": [{"id": "fn", "kind": "http", "endpoint": endpoint}],
        "runtime_env": {"seen": {"env_vars": {"A": "b"}, "packages": ["numpy>=1"]}},
        "remote": {"token": "x" * 20},
        "simulation": {"seed": 3, "wind": [1, 0, 0]},
    }
    yield json.dumps({"robots": [{"id": "drone"}]}).encode()
    yield json.dumps(full).encode() + b"\0cam.rate=5"
    yield json.dumps(full).encode() + b'\0drone.limits.geofence={"ceiling": 20}'


def run(data: bytes) -> None:
    """Load the file, lay the override over it, and write what a recording would hold."""
    content, _, setting = data.partition(b"\0")
    _FILE.write_bytes(content)
    try:
        config = EnvironmentConfig.load(_FILE)
        if setting:
            name, value = parse_setting(setting.decode("utf-8", "replace"))
            config = overridden(config, {name: value})
        config = located(config, _FILE.parent)
    except AeroDaaSError as error:
        str(error).encode()
        return
    repr(config).encode()
    EnvironmentConfig.model_validate(json.loads(public_document(config)))

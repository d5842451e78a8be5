"""The JSON schema of environment files."""

from __future__ import annotations

import json

from aerodaas.config.model import EnvironmentConfig

__all__ = ["environment_schema"]


def environment_schema() -> str:
    """The schema as JSON, by which editors complete settings and explain them."""
    return json.dumps(EnvironmentConfig.model_json_schema(by_alias=True), indent=2) + "\n"

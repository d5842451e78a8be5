"""Settings of the core in an environment file, and the tables that document settings."""

from __future__ import annotations

import json
import re
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from pydantic import BaseModel
from pydantic.fields import FieldInfo

from aerodaas.config.checked import Extensible
from aerodaas.config.extensions import section_models

__all__ = ["check_table", "core_fields", "documented"]

_PAGE = Path(__file__).parents[1] / "docs" / "environment-file.md"


def core_fields(model: type[BaseModel]) -> dict[str, FieldInfo]:
    """The fields of a model, without those of extensions."""
    section = model.section if issubclass(model, Extensible) else None
    models = section_models(section).values() if section else ()
    added = {name for one in models for name in one.model_fields}
    return {name: field for name, field in model.model_fields.items() if name not in added}


def documented() -> dict[str, dict[str, str]]:
    """Settings and defaults on the page of the environment file, by the mark before their table."""
    sections = re.split(r"<!-- (\w+) -->", _PAGE.read_text(encoding="utf-8"))[1:]
    return {
        name: dict(re.findall(r"^\| `([\w.$]+)` \| (.*?) \|", body, re.MULTILINE))
        for name, body in zip(sections[::2], sections[1::2], strict=True)
    }


def check_table(told: Mapping[str, str], fields: Mapping[str, FieldInfo]) -> None:
    """No setting is missing, none is invented, and the defaults are those of the code."""
    known: dict[str, Any] = {field.alias or key: field for key, field in fields.items()}
    assert set(told) == set(known)
    for key, default in told.items():
        if default == "required":
            assert known[key].is_required()
        elif default.startswith("`"):
            value = known[key].get_default(call_default_factory=True)
            assert json.loads(default.strip("`")) == json.loads(json.dumps(value))
        else:
            assert isinstance(known[key].get_default(call_default_factory=True), BaseModel)

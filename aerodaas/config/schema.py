"""The JSON schema of environment files."""

from __future__ import annotations

import ast
import inspect
import json
import sys
from typing import Any

from aerodaas.config import model
from aerodaas.config.checked import Extensible
from aerodaas.config.extensions import section_models
from aerodaas.config.model import EnvironmentConfig
from aerodaas.config.sections import compute, place, preflight, robot

__all__ = ["attribute_texts", "environment_schema"]


def environment_schema() -> str:
    """The schema as JSON, by which editors complete settings and explain them."""
    schema = EnvironmentConfig.model_json_schema(by_alias=True)
    docstrings = _docstrings()
    for name, part in ((EnvironmentConfig.__name__, schema), *schema["$defs"].items()):
        for field, text in docstrings.get(name, {}).items():
            part["properties"][field]["description"] = text
    return json.dumps(schema, indent=2) + "\n"


def _docstrings() -> dict[str, dict[str, str]]:
    """Docstrings of the settings, by name of their class.

    pydantic's `use_attribute_docstrings` would read them in each process of a flight, at a quarter
    of the time that its imports of the project take.
    """
    found: dict[str, dict[str, str]] = {}
    sections = Extensible.__subclasses__()
    added = [(one, it) for one in sections for it in section_models(one.section).values()]
    modules = [place, preflight, robot, compute, model]
    modules += [sys.modules[it.__module__] for _, it in added]
    sources = map(inspect.getsource, dict.fromkeys(modules))
    for node in (node for source in sources for node in ast.parse(source).body):
        if isinstance(node, ast.ClassDef):
            inherited: dict[str, Any] = {}
            for base in node.bases:
                inherited |= found.get(ast.unparse(base), {})
            found[node.name] = inherited | attribute_texts(node)
    for section, it in added:
        found[section.__name__] |= found[it.__name__]
    return found


def attribute_texts(node: ast.ClassDef) -> dict[str, str]:
    """Docstrings of the attributes of a class, by name."""
    return {
        setting.target.id: inspect.cleandoc(text.value.value)
        for setting, text in zip(node.body, node.body[1:], strict=False)
        if isinstance(setting, ast.AnnAssign)
        and isinstance(setting.target, ast.Name)
        and isinstance(text, ast.Expr)
        and isinstance(text.value, ast.Constant)
        and isinstance(text.value.value, str)
    }

"""Regular expressions meet long texts of strangers: each is linear in their length."""

from __future__ import annotations

import ast
import itertools
import re
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest

import aerodaas
from aerodaas.config.secrets import cleaned, is_secret_name, shown_text

ROOT = Path(aerodaas.__file__).parent
LONG = 20_000
SECONDS = 0.5
"""Processor's seconds for a text of so many letters; a quadratic expression takes three."""
ALPHABET = ["a", "A", "0", " ", "\n", "_", "-", ".", "/", ":", '"', "'", "<", "(", ";", "@", "\\"]
FUNCTIONS = {"compile", "search", "match", "fullmatch", "sub", "split", "findall", "finditer"}


def expressions() -> Iterator[tuple[str, Any, bool]]:
    """Where each constant expression of the project stands, what it is, and if it is searched."""
    for path in sorted(_files()):
        source = path.read_text(encoding="utf-8")
        tree = ast.parse(source)
        names = {
            id(one.value): one.targets[0].id
            for one in ast.walk(tree)
            if isinstance(one, ast.Assign) and isinstance(one.targets[0], ast.Name)
        }
        for node in ast.walk(tree):
            if not (isinstance(node, ast.Call) and isinstance(node.func, ast.Attribute)):
                continue
            owner, function = node.func.value, node.func.attr
            named = isinstance(owner, ast.Name) and owner.id == "re"
            if named and function in FUNCTIONS and isinstance(node.args[0], ast.Constant):
                uses = re.findall(rf"\b{names.get(id(node), '-')}\.(\w+)", source) or [function]
                place = f"{path.relative_to(ROOT.parent)}:{node.lineno}"
                yield place, node.args[0].value, not {*uses} <= {"match", "fullmatch"}


def _files() -> list[Path]:
    folders = [ROOT, ROOT / "actors", ROOT / "schedulers"]
    return [one for folder in folders for one in folder.rglob("*.py")]


def texts(expression: str | bytes) -> Iterator[str]:
    """Long texts of one or two letters, and of the expression's own, that end in another one."""
    own = set(re.findall(r"[A-Za-z0-9]", str(expression)))
    letters = [*ALPHABET, *sorted(own - set(ALPHABET))[:6]]
    for pair in (*zip(letters, strict=True), *itertools.permutations(letters, 2)):
        part = "".join(pair)
        yield part * (LONG // len(part)) + "\x7f"


@pytest.mark.slow
@pytest.mark.parametrize(("place", "expression", "searched"), list(expressions()))
def test_an_expression_is_linear(place: str, expression: str | bytes, *, searched: bool) -> None:
    """It is searched for, or matched, in texts that it nearly fits."""
    pattern: re.Pattern[Any] = re.compile(expression)
    for letters in texts(expression):
        text = letters.encode() if isinstance(expression, bytes) else letters
        began = time.thread_time()
        (pattern.search if searched else pattern.fullmatch)(text)
        assert time.thread_time() - began < SECONDS, (place, text[:8])


@pytest.mark.parametrize("part", ["a", "a_", "1:/", "a:", "a-", "?", "@", "token", "tokens_a"])
def test_a_long_text_is_cleaned_of_secrets_in_no_time(part: str) -> None:
    """It may be a setting of a stranger's recording."""
    text = part * (LONG * 4 // len(part))
    began = time.thread_time()
    shown_text(text)
    is_secret_name(text)
    cleaned(text, {"password": text, "url": text})
    assert time.thread_time() - began < SECONDS

"""JSON texts of strangers: bounded in size and depth, without what JSON does not know.

Python's own reader takes `NaN`, numbers of any length, half surrogates, and the last of two equal
keys; it raises RecursionError for deep nesting.
"""

from __future__ import annotations

import json
import math
from collections import Counter
from pathlib import Path
from typing import Any

from aerodaas.errors import ConfigError

__all__ = ["check_plain", "parse_json", "read_json", "read_text"]

_MOST_BYTES = 4 << 20
"""Largest file in bytes; an environment of 100 robots has a hundredth of that."""
_MOST_LEVELS = 40
_MOST_INTEGER = 2**63 - 1
_SHOWN = 60


class _OddityError(Exception):
    """Content that JSON does not permit, found while it is read."""


def read_json(path: str | Path, what: str) -> Any:  # noqa: ANN401 - any JSON
    """Read a JSON file.

    Args:
        path: The file.
        what: Kind of file, for the error, such as `the environment file`.

    Raises:
        ConfigError: Names file, place and remedy.
    """
    return parse_json(read_text(path, what, "JSON"), str(path))


def read_text(path: str | Path, what: str, encoded: str = "a text") -> str:
    """Read a file of at most 4 MiB of UTF-8.

    Args:
        path: The file.
        what: Kind of file, for the error, such as `the environment file`.
        encoded: What the content is, for the error, such as `JSON`.

    Raises:
        ConfigError: If it cannot be read, is larger, or is not UTF-8.
    """
    try:
        with Path(path).open("rb") as file:
            content = file.read(_MOST_BYTES + 1)
    except OSError as error:
        raise ConfigError(f"cannot read {what} {path}: {error.strerror}") from None
    except ValueError:
        raise ConfigError(f"cannot read {what} {str(path)!r}: it is no path") from None
    if len(content) > _MOST_BYTES:
        raise ConfigError(
            f"{path} is larger than {_MOST_BYTES >> 20} MiB, which {what} never is; "
            "was another file meant?"
        )
    try:
        return content.decode("utf-8")
    except UnicodeDecodeError as error:
        raise ConfigError(f"{path} is not {encoded}: byte {error.start} is not UTF-8") from None


def parse_json(text: str, place: str) -> Any:  # noqa: ANN401 - any JSON
    """Parse a JSON text.

    Args:
        text: The text.
        place: Names the text in errors, such as its file.

    Raises:
        ConfigError: If it is not JSON, or holds equal keys, numbers beyond 64 bits, half
            surrogates, or more than 40 levels.
    """
    try:
        content = json.loads(
            text,
            object_pairs_hook=_distinct,
            parse_int=_bounded,
        )
    except json.JSONDecodeError as error:
        raise ConfigError(f"{place} is not JSON: {error}{_remedy(text, error.pos)}") from None
    except _OddityError as error:
        raise ConfigError(f"{place} is not JSON: {error}") from None
    except RecursionError:
        raise ConfigError(f"{place}: {_too_deep('')}") from None
    check_plain(content, place)
    return content


def _remedy(text: str, at: int) -> str:
    """Remedy for content that other dialects of JSON permit; empty for anything else."""
    if text[at : at + 1] == "#" or text[at : at + 2] in {"//", "/*"}:
        return "; JSON has no comments: delete it"
    # Where it stops, at a comma, at the bracket behind it or between, depends on the Python.
    before, behind = text[:at].rstrip(), text[at:].lstrip()
    if behind[:1] == ",":
        before, behind = f"{before},", behind[1:].lstrip()
    if before[-1:] == "," and behind[:1] in {"]", "}"}:
        return "; JSON has no comma behind the last item: delete it"
    if text[at : at + 1] == "'":
        return "; JSON has double quotes"
    return ""


def check_plain(content: object, place: str, most: float = math.inf) -> None:
    """Raise ConfigError, with the setting's place, for values that a JSON file cannot hold.

    Args:
        content: Of any origin: a file, an application, or the command line.
        place: Names it in errors.
        most: Values that it may have, with those in lists and objects.
    """
    count = 0
    # Not by recursion, which is what too deep a nesting breaks.
    waiting: list[tuple[tuple[str, ...], object]] = [((), content)]
    while waiting:
        path, value = waiting.pop()
        count += 1
        if count + len(waiting) > most:
            raise ConfigError(f"{place} has more than {most:g} values")
        where = ".".join(path)
        if len(path) > _MOST_LEVELS:
            raise ConfigError(f"{place}: {_too_deep(where)}")
        if isinstance(value, dict):
            for key, inner in value.items():
                name = str(key)
                _check_text(name, place, where)
                waiting.append(((*path, name), inner))
        elif isinstance(value, list | tuple):
            waiting += [((*path, str(index)), inner) for index, inner in enumerate(value)]
        elif isinstance(value, str):
            _check_text(value, place, where)
        elif isinstance(value, int) and abs(value) > _MOST_INTEGER:
            raise ConfigError(f"{place}: {where}: a number has at most 64 bits")
        elif isinstance(value, float) and not math.isfinite(value):
            raise ConfigError(f"{place}: {where}: must be a finite number, not {value}")


def _check_text(text: str, place: str, where: str) -> None:
    if "\0" in text:
        raise ConfigError(f"{place}: {_shown(where)}: a text holds no zero character")
    try:
        text.encode("utf-8")
    except UnicodeEncodeError:
        raise ConfigError(
            f"{place}: {_shown(where)}: holds half of a surrogate pair, which is no character; "
            "write the character itself"
        ) from None


def _shown(where: str) -> str:
    return where[:_SHOWN] if where else "file"


def _too_deep(where: str) -> str:
    beginning = f" at {where[:_SHOWN]}…" if where else ""
    return f"is nested more than {_MOST_LEVELS} levels deep{beginning}; an environment needs 8"


def _distinct(pairs: list[tuple[str, Any]]) -> dict[str, Any]:
    content = dict(pairs)
    if len(content) < len(pairs):
        counts = Counter(key for key, _ in pairs)
        twice = next(key for key, count in counts.items() if count > 1)
        raise _OddityError(f"the key {twice[:_SHOWN]!r} stands twice in one object; keep one")
    return content


def _bounded(text: str) -> int:
    if len(text) > len(str(_MOST_INTEGER)) + 1 or abs(int(text)) > _MOST_INTEGER:
        raise _OddityError(f"the number {text[:_SHOWN]} has more than 64 bits")
    return int(text)

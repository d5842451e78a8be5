"""Files that break readers of JSON are refused with their place."""

from __future__ import annotations

from pathlib import Path

import pytest

from aerodaas.config.model import EnvironmentConfig, validated
from aerodaas.config.overrides import parse_setting
from aerodaas.errors import ConfigError

ROBOT = '{"robots": [{"id": "d", "settings": {"x": %s}}]}'


@pytest.mark.parametrize(
    ("text", "says"),
    [
        (ROBOT % ("[" * 100_000), "levels deep"),
        (ROBOT % ("[" * 60 + "]" * 60), "levels deep at robots"),
        (ROBOT % r'"\ud800"', r"robots.0.settings.x: holds half of a surrogate"),
        (ROBOT % r'{"\ud800": 1}', "half of a surrogate"),
        (ROBOT % r'"a\u0000b"', "zero character"),
        (ROBOT % ("9" * 5000), "64 bits"),
        (ROBOT % "1e999", "robots.0.settings.x: must be a finite number"),
        (ROBOT % "NaN", "robots.0.settings.x: must be a finite number, not nan"),
        (ROBOT % "-Infinity", "robots.0.settings.x: must be a finite number"),
        (ROBOT % '{"a": 1, "a": 2}', "'a' stands twice"),
        ("[", "is not JSON"),
        ('{"robots": [], // mine\n "name": "a"}', "JSON has no comments"),
        ('{"robots": [] /* mine */}', "JSON has no comments"),
        ('{ # mine\n"robots": []}', "JSON has no comments"),
        ('{"robots": [],\n}', "no comma behind the last item"),
        ('{"robots": [{"id": "d"}, ]}', "no comma behind the last item"),
        ("{'robots': []}", "double quotes"),
        ('"' + "x" * (5 << 20) + '"', "larger than 4 MiB"),
    ],
)
def test_an_odd_file_is_refused(tmp_path: Path, text: str, says: str) -> None:
    """By ConfigError, whatever Python's reader would do with it."""
    path = tmp_path / "environment.json"
    path.write_text(text, encoding="utf-8")
    with pytest.raises(ConfigError, match=says):
        EnvironmentConfig.load(path)


def test_bytes_that_are_no_text(tmp_path: Path) -> None:
    """Are told by their place."""
    path = tmp_path / "environment.json"
    path.write_bytes(b'{"a": "\xff"}')
    with pytest.raises(ConfigError, match="byte 7 is not UTF-8"):
        EnvironmentConfig.load(path)


@pytest.mark.parametrize("value", ["NaN", "9" * 5000, "[" * 100_000, '{"a":1,"a":2}'])
def test_overrides_are_bounded_too(value: str) -> None:
    """The same words for the command line; what is no JSON is a text."""
    try:
        _, parsed = parse_setting(f"d.x={value}")
    except ConfigError:
        return
    assert parsed == value


def test_content_that_no_file_gave() -> None:
    """An application's dict is checked by the same rules."""
    with pytest.raises(ConfigError, match=r"settings\.x: must be a finite number"):
        validated({"robots": [{"id": "d", "settings": {"x": float("nan")}}]}, "here")

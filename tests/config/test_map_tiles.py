"""Tiles of a map: an address that leads to one server, and nowhere else."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest

from aerodaas.config.model import EnvironmentConfig
from aerodaas.config.overrides import located
from aerodaas.config.redaction import catalogue

TEMPLATE = "https://tiles.example/osm/{z}/{x}/{y}.png?key=a1"
HOME = {"latitude": 50.0, "longitude": 8.0}


def config(url: str, **more: Any) -> EnvironmentConfig:  # noqa: ANN401 - JSON
    """An environment with tiles from there."""
    return EnvironmentConfig.model_validate(
        {"robots": [{"id": "one"}], "home": HOME, "map_tiles": {"url": url}, **more}
    )


@pytest.mark.parametrize(
    ("url", "origin"),
    [
        (TEMPLATE, "https://tiles.example"),
        ("http://127.0.0.1:8080/{z}/{y}/{x}", "http://127.0.0.1:8080"),
        ("http://localhost/{z}/{x}/{y}.jpg", "http://localhost"),
        ("http://[::1]:99/{z}/{x}/{y}.jpg", "http://[::1]:99"),
    ],
)
def test_the_origin_is_what_the_page_may_fetch_from(url: str, origin: str) -> None:
    """Scheme, host and port."""
    tiles = config(url).map_tiles
    assert tiles is not None
    assert tiles.origin == origin


def test_an_archive_is_one_file(tmp_path: Path) -> None:
    """Of an address, with a key or none, or a path, which is relative to the environment's file."""
    for url in ("https://maps.example/city.pmtiles", "http://localhost:8/city.pmtiles?key=a1"):
        tiles = config(url).map_tiles
        assert tiles is not None
        assert tiles.is_archive
        assert tiles.file is None
        assert tiles.origin == url.partition("/city")[0]
    (tmp_path / "city.pmtiles").touch()
    for url in ("city.pmtiles", str(tmp_path / "city.pmtiles")):
        tiles = located(config(url), tmp_path).map_tiles
        assert tiles is not None
        assert tiles.is_archive
        assert tiles.file == tmp_path / "city.pmtiles"
        assert not tiles.origin
    template = located(config(TEMPLATE), tmp_path).map_tiles
    assert template is not None
    assert (template.is_archive, template.file, template.url) == (False, None, TEMPLATE)


@pytest.mark.parametrize(
    "url",
    [
        "https://tiles.example/{z}/{x}.png",
        "https://tiles.example/{z}/{x}/{y}/{y}.png",
        "http://tiles.example/{z}/{x}/{y}.png",
        "ftp://tiles.example/{z}/{x}/{y}.png",
        "https:///{z}/{x}/{y}.png",
        "https://{z}.tiles.example/{x}/{y}.png",
        "https://user:secret@tiles.example/{z}/{x}/{y}.png",
        "https://tiles.example;script-src/{z}/{x}/{y}.png",
        "https://tiles.example *.evil.example/{z}/{x}/{y}.png",
        "https://tiles.example/{z}/{x}/{y}\n.png",
        "javascript:alert(1)//{z}/{x}/{y}",
        "http://maps.example/city.pmtiles",
        "https://user@maps.example/city.pmtiles",
        "https:///city.pmtiles",
        "ftp://maps.example/city.pmtiles",
        "https://maps.example/{z}/{x}/{y}.pmtiles",
        "file:///home/city.pmtiles",
        "https://maps.example/city.mbtiles",
        "city.mbtiles",
    ],
)
def test_others_are_refused(url: str) -> None:
    """What is no template, no https, or would say more in the page's policy than a host."""
    with pytest.raises(ValueError, match=r"tiles"):
        config(url)


def test_tiles_lie_around_home_and_are_told_to_no_stranger() -> None:
    """Their address may hold a key; the catalogue, against which others build, has none."""
    with pytest.raises(ValueError, match="map_tiles lie around home"):
        config(TEMPLATE, home=None)
    assert catalogue(config(TEMPLATE)).map_tiles is None

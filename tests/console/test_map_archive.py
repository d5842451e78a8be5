"""A map in one file: what is no archive of pictures is refused before the first page is served."""

from __future__ import annotations

from pathlib import Path

import pytest
from hovering import ask, console
from map_archives import archive_bytes, tiles_around, write_archive

from aerodaas.errors import ConfigError
from aerodaas.service.http.map_archive import require_pictures

HOME = {"latitude": 50.1, "longitude": 8.6}
TILES = tiles_around(50.1, 8.6, 2)
WHOLE = archive_bytes(TILES)


@pytest.mark.parametrize(
    ("content", "said"),
    [
        (b"", "is no PMTiles archive"),
        (b"SQLite format 3\0" * 20, "is no PMTiles archive"),
        (WHOLE[:100], "is no PMTiles archive"),
        (WHOLE[:7] + b"\2" + WHOLE[8:], "is no PMTiles archive of version 3"),
        (archive_bytes(TILES, 1), "holds no pictures"),
    ],
)
def test_what_is_none_is_refused_with_the_reason(tmp_path: Path, content: bytes, said: str) -> None:
    """And named, before anything flies."""
    path = tmp_path / "map.pmtiles"
    path.write_bytes(content)
    with pytest.raises(ConfigError, match=said) as refusal:
        require_pictures(path)
    assert str(path) in str(refusal.value)
    with pytest.raises(ConfigError, match=said), console(home=HOME, map_tiles={"url": str(path)}):
        pass


def test_a_missing_one_is_named(tmp_path: Path) -> None:
    """With the setting that names it."""
    with pytest.raises(ConfigError, match=r"No such file.*map_tiles\.url"):
        require_pictures(tmp_path / "none.pmtiles")


def test_it_is_read_by_parts_by_whom_has_a_token(tmp_path: Path) -> None:
    """Its path is told to nobody."""
    path = write_archive(tmp_path / "map.pmtiles", TILES)
    tiles = {"url": str(path), "attribution": "© nobody"}
    with console(map_tiles=tiles, home=HOME) as (server, _):
        address = server.address(viewer=True)
        policy = ask(address, "/", token="")[1]["content-security-policy"]
        assert "connect-src 'self'; " in policy
        assert "img-src 'self' blob:; " in policy
        _, _, scenery = ask(address, "/v1/missions/own/scenery")
        assert scenery["tiles"] == {
            **HOME, "url": "v1/map.pmtiles", "archive": True, "attribution": "© nobody",
            "max_zoom": 19,
        }  # fmt: skip
        assert str(tmp_path) not in str(scenery)
        status, _, part = ask(address, "/v1/map.pmtiles", Range="bytes=0-126")
        assert (status, part) == (206, WHOLE[:127])
        assert ask(address, "/v1/map.pmtiles", token="")[0] == 401
    with console(home=HOME) as (server, _):
        assert ask(server.address(), "/v1/map.pmtiles")[0] == 404


def test_the_page_may_read_an_archive_elsewhere_and_no_pictures() -> None:
    """By its policy: parts of it are fetched, pictures are made of them here."""
    url = "https://maps.example/city.pmtiles"
    with console(map_tiles={"url": url}, home=HOME) as (server, _):
        policy = ask(server.address(), "/", token="")[1]["content-security-policy"]
        assert "connect-src 'self' https://maps.example; " in policy
        assert policy.count("maps.example") == 1
        scenery = ask(server.address(), "/v1/missions/own/scenery")[2]
        assert (scenery["tiles"]["url"], scenery["tiles"]["archive"]) == (url, True)

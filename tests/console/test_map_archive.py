"""A map in one file: what is no archive of pictures is refused before the first page is served."""

from __future__ import annotations

import struct
from pathlib import Path

import pytest
from hovering import ask, console
from hypothesis import given
from hypothesis import strategies as st
from map_archives import archive_bytes, tiles_around, write_archive

from aerodaas.errors import ConfigError
from aerodaas.service.http.map_archive import require_pictures

HOME = {"latitude": 50.1, "longitude": 8.6}
TILES = tiles_around(50.1, 8.6, 2)
WHOLE = archive_bytes(TILES)


def changed(place: int, value: bytes) -> bytes:
    """The archive with other bytes at a place."""
    return WHOLE[:place] + value + WHOLE[place + len(value) :]


@pytest.mark.parametrize(
    ("content", "said"),
    [
        (b"", "is no PMTiles archive"),
        (b"SQLite format 3\0" * 20, "is no PMTiles archive"),
        (WHOLE[:100], "is no PMTiles archive"),
        (WHOLE[:-1], "is cut off"),
        (WHOLE[:400], "is cut off"),
        (changed(40, struct.pack("<Q", 2**63)), "is cut off"),
        (changed(7, b"\2"), "version 2, not 3"),
        (changed(97, b"\4"), "packed by something else"),
        (changed(130, b"\xff" * 12), "is damaged"),
        (archive_bytes(TILES, 1), "holds vectors"),
        (archive_bytes(TILES, 6), "holds vectors"),
        (archive_bytes(TILES, 0), "holds unknown tiles"),
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


@given(content=st.binary(max_size=400), whole=st.booleans())
def test_any_bytes_are_refused_or_read(
    tmp_path_factory: pytest.TempPathFactory, content: bytes, *, whole: bool
) -> None:
    """By no other error."""
    path = tmp_path_factory.mktemp("any") / "map.pmtiles"
    path.write_bytes(WHOLE[:8] + content if whole else content)
    with pytest.raises(ConfigError):
        require_pictures(path)


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

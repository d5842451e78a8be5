"""Folders of the user follow the XDG base directory specification."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import pytest

from aerodaas.files.user_folders import cache_folder, config_folder, state_folder


@pytest.mark.parametrize(
    ("folder", "variable", "otherwise"),
    [
        (cache_folder, "XDG_CACHE_HOME", ".cache/aerodaas"),
        (config_folder, "XDG_CONFIG_HOME", ".config/aerodaas"),
        (state_folder, "XDG_STATE_HOME", ".local/state/aerodaas"),
    ],
)
def test_a_named_folder_is_taken_if_it_is_absolute(
    folder: Callable[[], Path],
    variable: str,
    otherwise: str,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """One that is relative would be another in each working directory."""
    monkeypatch.setenv("HOME", str(tmp_path))
    monkeypatch.setenv(variable, "/of/mine")
    assert folder() == Path("/of/mine/aerodaas")
    for unusable in ("", "of/mine"):
        monkeypatch.setenv(variable, unusable)
        assert folder() == tmp_path / otherwise
    monkeypatch.delenv(variable)
    assert folder() == tmp_path / otherwise

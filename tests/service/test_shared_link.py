"""A service and drones on one link."""

from __future__ import annotations

from pathlib import Path

import pytest

from aerodaas.config.model import EnvironmentConfig
from aerodaas.errors import ConfigError
from aerodaas.service.serve import serve
from aerodaas.service.settings import ServiceSettings


def test_drones_on_one_link_are_not_leased_one_by_one(tmp_path: Path) -> None:
    """The flight of one would open the link of the other's: refused before anything is served."""
    robots = [
        {"id": name, "driver": "mavlink", "settings": {"system": number}}
        for number, name in enumerate(("west", "east"), 1)
    ]
    config = EnvironmentConfig.model_validate({"robots": robots})
    settings = ServiceSettings(fleet=tmp_path / "fleet.json", config=config, state=tmp_path / "s")
    with pytest.raises(ConfigError, match=r"robots west and east share a link.*MAVLink router"):
        serve(settings)
    assert not (tmp_path / "s").exists()

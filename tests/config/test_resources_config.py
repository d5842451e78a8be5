"""What an environment file may say of compute resources and of an analysis' own environment."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest

from aerodaas.config.model import ComputeConfig, validated
from aerodaas.config.overrides import located, overridden
from aerodaas.errors import ConfigError

FN = {"id": "fn", "kind": "http", "endpoint": {"url": "https://example.org/detect"}}


def file(**sections: Any) -> dict[str, Any]:  # noqa: ANN401
    """An environment file with these sections."""
    return {"robots": [{"id": "drone"}], **sections}


@pytest.mark.parametrize(
    ("sections", "says"),
    [
        ({"compute": [{"id": "fn", "kind": "http"}]}, "needs an endpoint"),
        ({"compute": [{**FN, "kind": "cloud"}]}, "needs an endpoint, and no other kind has one"),
        ({"compute": [{**FN, "node": "10.0.0.1"}]}, r"its address is endpoint\.url"),
        ({"compute": [{**FN, "endpoint": {"url": "https://me:secret@x"}}]}, "endpoint.url"),
        ({"compute": [{**FN, "endpoint": {"url": "ftp://x"}}]}, "endpoint.url"),
        ({"compute": [{**FN, "endpoint": {**FN["endpoint"], "timeout": 0}}]}, "timeout"),  # type: ignore[dict-item]
        ({"runtime_env": {"a": {"packages": ["--index-url x"]}}}, "neither a requirement"),
        ({"runtime_env": {"a": {"image_uri": "x", "packages": ["y"]}}}, "its own packages"),
        ({"runtime_env": {"a": {"env_vars": {"RAY_X": "1"}}}}, "cannot be set"),
        (
            {"compute": [{"id": "far", "compression": "auto"}]},
            "'jpeg', 'png' or 'none', not 'auto'",
        ),
        ({"robots": [{"id": "drone", "edge": "fn"}], "compute": [FN]}, "no edge under compute"),
    ],
)
def test_nonsense_is_refused_with_its_place(sections: dict[str, Any], says: str) -> None:
    """Each message tells what is wrong; none repeats a password."""
    with pytest.raises(ConfigError, match=says) as refusal:
        validated(file(**sections), "environment.json")
    assert "secret" not in str(refusal.value)


def test_an_endpoint_may_be_changed_from_the_command_line() -> None:
    """As any other setting."""
    config = validated(file(compute=[FN]), "environment.json")
    changed = overridden(config, {"fn.endpoint.timeout": 0.5, "fn.executors": 9})
    resource = changed.compute[0]
    assert isinstance(resource, ComputeConfig)
    assert resource.endpoint is not None
    assert (resource.endpoint.timeout, resource.executors) == (0.5, 9)


def test_wheels_are_looked_for_beside_the_file(tmp_path: Path) -> None:
    """Actors have other working directories than the application."""
    wheel = tmp_path / "mine-1.0-py3-none-any.whl"
    wheel.touch()
    env = {"a": {"packages": [wheel.name, "other==1.0"]}}
    config = located(validated(file(runtime_env=env), "environment.json"), tmp_path)
    assert config.runtime_env["a"].packages == [str(wheel), "other==1.0"]


@pytest.mark.parametrize("wrong", [{"kind": "edge"}, {"kind": "cloud", "node": "10.0.0.1"}])
def test_only_a_cloud_without_a_node_is_simulated(wrong: dict[str, Any]) -> None:
    """An edge is where the drone is, and a node is real."""
    with pytest.raises(ConfigError, match='simulated is of the kind "cloud"'):
        validated(file(compute=[{"id": "a", "simulated": True, **wrong}]), "environment.json")


def test_a_network_may_name_files_beside_the_environment(tmp_path: Path) -> None:
    """Relative to the environment file, as all its paths."""
    (tmp_path / "link.csv").write_text("0,10\n")
    simulation = {"network": "outage:3-4+trace:link.csv"}
    config = located(validated(file(simulation=simulation), "environment.json"), tmp_path)
    assert config.simulation.network == f"outage:3-4+trace:{tmp_path / 'link.csv'}"

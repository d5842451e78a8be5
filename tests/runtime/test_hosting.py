"""Which robots share an actor."""

from __future__ import annotations

from typing import Any

import pytest
from drone_nodes import robot_spec

from aerodaas.config.model import EnvironmentConfig, RobotConfig
from aerodaas.errors import ConfigError
from aerodaas.runtime.hosting import MOST_ALONE, by_actor
from aerodaas.runtime.placement import Placement
from aerodaas.runtime.session import Session

LINK = "udpin:127.0.0.1:14550"


def _robots(*links: str | None) -> list[RobotConfig]:
    """A robot for each link; None is a simulated one."""
    robots = []
    for number, link in enumerate(links, 1):
        content: dict[str, Any] = {"id": f"r{number}"}
        if link is not None:
            content |= {"driver": "mavlink", "settings": {"url": link, "system": number}}
        robots.append(RobotConfig.model_validate(content))
    return robots


def _groups(
    robots: list[RobotConfig], edges: list[Placement] | None = None
) -> tuple[tuple[str, ...], ...]:
    session = Session(EnvironmentConfig(robots=robots), 1.0)
    specs = [robot_spec(one) for one in robots]
    groups = by_actor(specs, edges or [Placement()] * len(robots), session)
    return tuple(tuple(spec.robot.id for spec in group) for group in groups)


def test_robots_on_one_link_share_an_actor() -> None:
    """A port is opened once; all others have an actor of their own."""
    robots = _robots(LINK, None, "udpin:127.0.0.1:14551", LINK, None)
    assert _groups(robots) == (("r1", "r4"), ("r2",), ("r3",), ("r5",))


def test_beside_many_simulated_ones_they_still_do() -> None:
    """Those of a link together, and with no simulated one."""
    robots = _robots(*[None] * (MOST_ALONE + 1), LINK, LINK)
    first, *_ = _groups(robots)
    assert first == (f"r{MOST_ALONE + 2}", f"r{MOST_ALONE + 3}")


def test_a_link_is_in_one_place() -> None:
    """Two machines cannot open it."""
    places = [Placement(), Placement("edge", "10.0.0.7")]
    with pytest.raises(ConfigError, match=r'robots r1 and r2 share a link.*the same "edge"'):
        _groups(_robots(LINK, LINK), places)

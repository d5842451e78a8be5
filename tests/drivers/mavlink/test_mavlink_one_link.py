"""Which robots share a link, and what keeps them from it."""

from __future__ import annotations

from typing import Any

import pytest

from aerodaas.config.model import RobotConfig
from aerodaas.drivers.loading import check_links, link_of
from aerodaas.errors import ConfigError


def robot(name: str, **settings: Any) -> RobotConfig:  # noqa: ANN401
    """A robot with these settings of its driver."""
    return RobotConfig(id=name, driver="mavlink", settings=settings)


RADIO = "serial:/dev/ttyUSB0:57600"


def test_a_link_is_its_address() -> None:
    """A device is one link at whatever speed; who has no such driver has none."""
    assert link_of(robot("a", url=RADIO)) == link_of(robot("b", url=RADIO, system=2))
    assert link_of(robot("a", url=RADIO)) == link_of(robot("b", url="serial:/dev/ttyUSB0:115200"))
    assert link_of(robot("a", url=RADIO)) != link_of(robot("b", url="serial:/dev/ttyUSB1:57600"))
    assert link_of(robot("a")) != link_of(robot("b", url="udpin:127.0.0.1:14541"))
    assert link_of(RobotConfig(id="c")) is None


@pytest.mark.parametrize(
    ("one", "other", "words"),
    [
        ({"system": 1}, {}, 'robot b needs the "system" id'),
        ({}, {"system": 1}, 'robot a needs the "system" id'),
        ({"system": 3}, {"system": 3}, 'the "system" id 3: give each vehicle one of its own'),
        (
            {"system": 1, "fallback": "set"},
            {"system": 2},
            'each needs an "own_system" of its own, such as 245 and 242',
        ),
        (
            {"system": 1, "forward": "udpout:127.0.0.1:14550"},
            {"system": 2, "forward": "udpout:127.0.0.1:14550"},
            '"forward" of one of them passes on what all say there; take it from b',
        ),
        (
            {"system": 1, "corrections": "tcp:127.0.0.1:2101"},
            {"system": 2, "corrections": "tcp:127.0.0.1:2102"},
            '"corrections" of one of them are passed on to all; take them from b',
        ),
        ({"system": 1}, {"system": 2, "url": "serial:/dev/ttyUSB0:115200"}, "has one speed"),
    ],
)
def test_vehicles_that_cannot_share_a_link(
    one: dict[str, Any], other: dict[str, Any], words: str
) -> None:
    """The line names both robots, the link and the remedy."""
    robots = [robot("a", **{"url": RADIO, **one}), robot("b", **{"url": RADIO, **other})]
    with pytest.raises(ConfigError, match=f"robots a and b share the link {RADIO}.*{words}"):
        check_links(robots)


def test_vehicles_that_can() -> None:
    """Each by its own system id; others may be anywhere."""
    check_links(
        [
            robot("a", url=RADIO, system=1, fallback="set", forward="udpout:127.0.0.1:14550"),
            robot("b", url=RADIO, system=2, own_system=242),
            robot("c", url="udpin:127.0.0.1:14541"),
            RobotConfig(id="d"),
        ]
    )

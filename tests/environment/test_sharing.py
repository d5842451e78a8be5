"""Two applications on one drone: both see its data, one flies it, the other cannot."""

from __future__ import annotations

from pathlib import Path

import pytest
from flying import FLAT, Flyer, hop, recorded

from aerodaas import Environment
from aerodaas.types.errors import ConfigError, GraphError, UnknownIdError

pytestmark = pytest.mark.wall_clock

GUEST = '''
from aerodaas import Analytics, Environment, Odometry
from aerodaas.types.data import Readings

class HighWater(Analytics[Readings]):
    """The greatest height so far; a class of the guest's own file."""

    accepts = (Odometry,)
    produces = Readings
    highest = 0.0

    def process(self, item, context):
        self.highest = max(self.highest, item.height)
        return Readings(context.now(), {"highest": self.highest})

env = Environment("environment.json")
drone = env.get_robot_by_id("drone")
edge = env.get_compute_resource_by_id("edge")
odometry = drone.get_sensor_by_id("odom_drone").get_data_stream()
watch = HighWater().deploy(edge)
watch.analyse(odometry)
'''
READY = "drone.start_mission()\n"


@pytest.fixture
def guest(tmp_path: Path) -> Path:
    """Where a guest's file goes, beside the environment's."""
    return tmp_path / "high_water.py"


def owner(env: Environment) -> None:
    """Two waypoints."""
    env.get_robot_by_id("drone").navigate(hop((6, 0), (6, 6)))


def test_a_guest_sees_what_the_owner_flies(flyer: Flyer, guest: Path) -> None:
    """Its analysis runs on the owner's sensor, beside one of the owner's of the same name."""
    guest.write_text(GUEST + READY)
    content = {**FLAT, "schedulers": {"trajectory": "ordered"}}
    run = flyer.fly(owner, content, guests=(guest,))
    assert run.state is not None
    assert run.state.robots["drone"].status.visited == ("wp0", "wp1")
    assert "drone/high_water_high_water" in recorded(run).latencies


@pytest.mark.parametrize(
    ("line", "named"),
    [
        ("drone.navigate(AeroNavigation(data=[Waypoint('mine', 1, 1, 2)]))", "drone"),
        ("watch.trigger(drone.end_mission)", "end_mission"),
        ("RemoteAnalytics().deploy(edge).analyse(odometry)", "remote"),
    ],
)
def test_a_guest_cannot_fly(flyer: Flyer, guest: Path, line: str, named: str) -> None:
    """Neither by waypoints, nor by a trigger, nor by somebody far away; nothing starts."""
    imports = "from aerodaas import AeroNavigation, Waypoint\n"
    imports += "from aerodaas.analytics import RemoteAnalytics\n"
    guest.write_text(imports + GUEST + line + "\n" + READY)
    with pytest.raises(GraphError, match=f"(?s)high_water.py is a guest.*{named}"):
        flyer.fly(owner, guests=(guest,))


def test_a_guest_has_what_the_owner_has(flyer: Flyer, guest: Path) -> None:
    """A sensor that is not there, a file that is not there, and one that never starts."""
    other = flyer.write(
        {**FLAT, "robots": [{"id": "drone", "sensors": [{"id": "cam"}]}]}, "other.json"
    )
    text = GUEST.replace("environment.json", other.name).replace("odom_drone", "cam")
    guest.write_text(text.replace("accepts = (Odometry,)", "accepts = (object,)") + READY)
    with pytest.raises(UnknownIdError, match="odom_drone"):
        flyer.fly(owner, guests=(guest,))
    with pytest.raises(ConfigError, match="no application"):
        flyer.fly(owner, guests=(guest.with_name("nobody.py"),))
    guest.write_text(GUEST)
    with pytest.raises(ConfigError, match="never called start_mission"):
        flyer.fly(owner, guests=(guest,))

"""Values of a runtime_env's variables reach the analysis, and none of Ray's files."""

from __future__ import annotations

import os
import pickle
from pathlib import Path
from typing import Any, ClassVar

import pytest
from flying import FLAT, Flyer, hop
from pydantic import SecretStr

from aerodaas import Analytics, Environment, Odometry
from aerodaas.actors.cluster.local_ray import _inherited
from aerodaas.actors.process_variables import (
    private_variables,
    ray_variables,
    vehicle_variables,
)
from aerodaas.analytics.base import Context
from aerodaas.config.model import RuntimeEnvConfig

SECRET = "h4nd-m3-0ver-n0where"  # noqa: S105 - a test's
EARLY = "5et-at-the-5tart"
"""Value of a variable that the interpreter reads as it starts, which Ray itself hands over."""


class Curious(Analytics[str]):
    """Says what its environment holds when it arrives, and where Ray's own files are."""

    accepts: ClassVar[tuple[type, ...]] = (Odometry,)
    produces: ClassVar[type] = str

    def __init__(self) -> None:
        self.name = "curious"
        self.arrived = ""

    def __setstate__(self, state: dict[str, Any]) -> None:
        """Look, as a module that is imported with it would."""
        vars(self).update(state)
        self.arrived = os.environ.get("HUB_KEY", "-")

    def process(self, item: Odometry, context: Context) -> str:  # noqa: ARG002
        """Tell."""
        early = os.environ.get("PYTHON_LABEL", "-")
        return f"{self.arrived} {early} {Path('/proc/self/fd/1').readlink()}"


class Noted:
    """A trigger's condition that writes what it is asked about to a file, and never holds."""

    def __init__(self, path: Path) -> None:
        self._path = path

    def __call__(self, result: str) -> bool:
        """Note the result."""
        self._path.write_text(result)
        return False


@pytest.mark.slow
def test_a_secret_is_in_the_environment_and_in_no_file(flyer: Flyer) -> None:
    """It is there before the analysis itself; what an interpreter needs at its start is known."""
    said = flyer.folder / "said"

    def build(env: Environment) -> None:
        drone = env.get_robot_by_id("drone")
        drone.navigate(hop((1, 0)))
        odometry = drone.get_sensor_by_id("odom_drone").get_data_stream()
        curious = Curious().deploy(env.get_compute_resource_by_id("edge"))
        curious.analyse(odometry)
        curious.trigger(drone.end_mission, Noted(said))

    variables = {"HUB_KEY": SECRET, "PYTHON_LABEL": EARLY}
    flyer.fly(build, {**FLAT, "runtime_env": {"curious": {"env_vars": variables}}}, speed=5.0)
    arrived, early, output = said.read_text().split(" ", 2)
    assert (arrived, early) == (SECRET, EARLY)
    session = Path(output).parents[1]
    files = [path for path in session.rglob("*") if path.is_file()]
    assert any(EARLY.encode() in path.read_bytes() for path in files)
    assert [path.name for path in files if SECRET.encode() in path.read_bytes()] == []


def test_the_key_of_a_vehicle_goes_to_who_flies_it(monkeypatch: pytest.MonkeyPatch) -> None:
    """With the call that has it connect; a local Ray is started without it."""
    monkeypatch.setenv("AERODAAS_MAVLINK_KEY", SECRET)
    handed = vehicle_variables()
    assert SECRET not in repr(handed)
    assert SECRET not in _inherited().values()
    assert _inherited()["PATH"] == os.environ["PATH"]
    sent = pickle.dumps(handed)
    monkeypatch.delenv("AERODAAS_MAVLINK_KEY")
    pickle.loads(pickle.dumps(vehicle_variables()))  # noqa: S301 - our own
    assert "AERODAAS_MAVLINK_KEY" not in os.environ
    pickle.loads(sent)  # noqa: S301 - as above
    assert os.environ["AERODAAS_MAVLINK_KEY"] == SECRET


@pytest.mark.parametrize(
    ("name", "public"),
    [
        ("OMP_NUM_THREADS", True),
        ("LD_LIBRARY_PATH", True),
        ("PYTHONHASHSEED", True),
        ("PYTHON_TOKEN", False),
        ("MKL_API_KEY", False),
        ("HUB", False),
        ("PATH", False),
    ],
)
def test_ray_gets_only_what_is_read_at_the_start(name: str, public: bool) -> None:  # noqa: FBT001
    """And never what a secret is called."""
    env = RuntimeEnvConfig(env_vars={name: SecretStr("x")})
    assert ray_variables(env) == ({name: "x"} if public else {})
    assert private_variables(env) == ({} if public else env.env_vars)

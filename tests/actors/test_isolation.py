"""Analyses with packages of their own, in conflict with each other's."""

from __future__ import annotations

import zipfile
from pathlib import Path
from typing import Any, ClassVar

import pytest
from flying import FLAT, Flyer, hop

from aerodaas import Analytics, Environment, Odometry
from aerodaas.analytics.base import Context
from aerodaas.errors import ConfigError, UnknownIdError

DISTRIBUTION = "aerodaas_conflicting"


class Versions(Analytics[str]):
    """Says which version of a package it imports, and what its environment says."""

    accepts: ClassVar[tuple[type, ...]] = (Odometry,)
    produces: ClassVar[type] = str

    def __init__(self, name: str) -> None:
        self.name = name

    def open(self) -> None:
        """Import."""
        import os  # noqa: PLC0415

        try:
            import aerodaas_conflicting  # type: ignore[import-not-found] # noqa: PLC0415
        except ImportError:
            found = "none"
        else:
            found = aerodaas_conflicting.VERSION
        self._said = f"{found} {os.environ.get('MARK', '-')}"

    def process(self, item: Odometry, context: Context) -> str:  # noqa: ARG002
        """Tell."""
        return self._said


def wheel(folder: Path, version: str) -> str:
    """Write a pure-Python wheel."""
    path = folder / f"{DISTRIBUTION}-{version}-py3-none-any.whl"
    info = f"{DISTRIBUTION}-{version}.dist-info"
    files = {
        f"{DISTRIBUTION}.py": f"VERSION = {version!r}\n",
        f"{info}/METADATA": f"Metadata-Version: 2.1\nName: {DISTRIBUTION}\nVersion: {version}\n",
        f"{info}/WHEEL": "Wheel-Version: 1.0\nRoot-Is-Purelib: true\nTag: py3-none-any\n",
    }
    record = "".join(f"{name},,\n" for name in [*files, f"{info}/RECORD"])
    with zipfile.ZipFile(path, "w") as archive:
        for name, text in {**files, f"{info}/RECORD": record}.items():
            archive.writestr(name, text)
    return str(path)


@pytest.mark.slow
def test_two_versions_of_a_package_fly_side_by_side(flyer: Flyer) -> None:
    """From the application and from the environment file; the others see neither."""
    one, two = wheel(flyer.folder, "1.0"), wheel(flyer.folder, "2.0")
    fresh = {"packages": [two], "env_vars": {"MARK": "second"}}
    said: dict[str, str] = {}

    def build(env: Environment) -> None:
        drone = env.get_robot_by_id("drone")
        drone.navigate(hop((3, 0)))
        odometry = drone.get_sensor_by_id("odom_drone").get_data_stream()
        edge = env.get_compute_resource_by_id("edge")
        Versions("old").deploy(edge, runtime_env={"packages": [one]}).analyse(odometry)
        Versions("new").deploy(edge, runtime_env={"packages": [one]}).analyse(odometry)
        Versions("plain").deploy(edge).analyse(odometry)
        for name in ("old", "new", "plain"):
            env.graph.nodes[f"drone/{name}"].work.trigger(drone.end_mission, Is(flyer.folder, name))

    flyer.fly(build, {**FLAT, "runtime_env": {"new": fresh}}, speed=5.0)
    for name in ("old", "new", "plain"):
        said[name] = (flyer.folder / name).read_text()
    assert said == {"old": "1.0 -", "new": "2.0 second", "plain": "none -"}


class Is:
    """A trigger's condition that notes what it is asked and never holds."""

    def __init__(self, folder: Path, name: str) -> None:
        self._path = folder / name

    def __call__(self, result: str) -> bool:
        """Note the result."""
        self._path.write_text(result)
        return False


def refused(
    flyer: Flyer, told: dict[str, Any], in_file: dict[str, dict[str, Any]] | None = None
) -> None:
    """Fly with one analysis in such an environment."""

    def build(env: Environment) -> None:
        drone = env.get_robot_by_id("drone")
        drone.navigate(hop((3, 0)))
        odometry = drone.get_sensor_by_id("odom_drone").get_data_stream()
        edge = env.get_compute_resource_by_id("edge")
        Versions("old").deploy(edge, runtime_env=told).analyse(odometry)

    flyer.fly(build, {**FLAT, "runtime_env": in_file or {}}, speed=5.0)


@pytest.mark.slow
def test_what_cannot_be_provided_is_refused_before_take_off(
    flyer: Flyer, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A wheel that is missing, an engine that is missing, in the node's own words."""
    gone = str(flyer.folder / f"{DISTRIBUTION}-9.0-py3-none-any.whl")
    with pytest.raises(ConfigError, match=r"runtime_env of analytics/drone/old: on node .*9\.0"):
        refused(flyer, {"packages": [gone]})
    monkeypatch.setenv("PATH", "/nowhere")
    import shutil  # noqa: PLC0415

    if shutil.which("podman", path="/usr/bin:/usr/local/bin:/bin") is None:
        with pytest.raises(ConfigError, match="podman is missing"):
            refused(flyer, {"image_uri": "example/detector:1"})


@pytest.mark.parametrize(
    ("runtime_env", "says"),
    [
        ({"packages": ["--pre x"]}, "neither a requirement"),
        ({"packages": ["x==1"], "image_uri": "y"}, "brings its own packages"),
        ({"env_vars": {"RAY_ADDRESS": "x"}}, "cannot be set"),
        ({"pip": ["x"]}, "pip: there is no such setting"),
        ({"env_vars": {"A": 1}}, "valid string"),
    ],
)
def test_nonsense_is_refused_where_it_is_said(
    flyer: Flyer, runtime_env: dict[str, Any], says: str
) -> None:
    """At once, with the name of the call."""
    with pytest.raises(ConfigError, match=rf"Versions\.deploy: runtime_env: .*{says}"):
        refused(flyer, runtime_env)


def test_a_runtime_env_for_nobody_is_refused(flyer: Flyer) -> None:
    """A name in the file that the application does not know is a mistake."""
    with pytest.raises(UnknownIdError, match=r"'oldd'; known: drone/old"):
        refused(flyer, {}, {"oldd": {"env_vars": {"A": "1"}}})

"""`aerodaas check`: everything that a flight needs, tried without flying."""

from __future__ import annotations

import json
import math
import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import ExitStack, suppress
from dataclasses import asdict
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Literal

import typer

from aerodaas.cli.flying.application import build_application
from aerodaas.cli.flying.preflight import settled_items, show_health
from aerodaas.cli.options import OtherEnvironment, Overrides
from aerodaas.cli.shipped import find_application
from aerodaas.config.options import RunOptions, current_options
from aerodaas.errors import (
    AeroDaaSError,
    ConfigError,
    GraphError,
    SourceError,
    VehicleError,
    failure_line,
)
from aerodaas.findings import Finding

if TYPE_CHECKING:
    from aerodaas.cameras.base import Camera
    from aerodaas.config.model import RobotConfig, SensorConfig
    from aerodaas.dataflow.graph import Node
    from aerodaas.environment.environment import Environment
    from aerodaas.messages.vehicle import Vehicle

__all__ = ["check", "examine_application"]

_CONNECTING = 5.0
"""Wall seconds for a vehicle to answer."""
_FIRST_PICTURE = 5.0
"""Wall seconds for a camera's first picture."""


def check(
    context: typer.Context,
    application: Annotated[
        Path,
        typer.Argument(
            help="The application, as for `aerodaas run`; a mission document; or an environment "
            "file alone."
        ),
    ],
    env: OtherEnvironment = None,
    setting: Overrides = None,
    connect: Annotated[  # noqa: FBT002
        bool,
        typer.Option(
            "--connect/--no-connect",
            help="Connect to vehicles and cameras; they do not move, and nothing is set there.",
        ),
    ] = True,
    robot: Annotated[
        str | None,
        typer.Option(metavar="ID", help="Print this robot's health before take-off, as one list."),
    ] = None,
    as_json: Annotated[bool, typer.Option("--json", help="For programs.")] = False,  # noqa: FBT002
) -> None:
    """Try everything that a flight needs, without flying.

    The graph is built and planned, models are loaded, vehicles and cameras are connected and asked.
    The exit code is 1 if something is to be mended. Words after `--` are the application's own.
    Of an environment file alone, all vehicles and cameras are asked.

    Of a mission document, each place, height, speed, name, setting, length of way, charge and
    distance from what stands in the simulated world is checked, and nothing is connected. Each
    finding has its figures and a remedy; a forecast tells way, time and charge of each robot.

    With `--robot`, each item of one robot's health has its value, what it should be, what that
    means, and a remedy. The robot's section `preflight` in the environment file says what refuses a
    take-off and what only warns. What the vehicle does not tell is unknown, never good. The exit
    code is 1 if a take-off would be refused.

        aerodaas check environment.json
        aerodaas check environment.json --robot drone --json
        aerodaas check my_app.py
        aerodaas check mission.json --env environment.json
        aerodaas check mission.json --env environment.json --json
        aerodaas check my_app.py --set drone.driver=mavlink --set drone.url=udpin:127.0.0.1:14540
    """
    from aerodaas.cli.doctor import show_findings  # noqa: PLC0415 - slow to load
    from aerodaas.config.overrides import parse_setting  # noqa: PLC0415 - as above
    from aerodaas.environment.environment import Environment  # noqa: PLC0415 - as above

    application = find_application(application)
    options = RunOptions(
        application=application.resolve(),
        environment=env,
        overrides=dict(parse_setting(text) for text in setting or ()),
        view=False,
    )
    kind = _kind_of(application)
    if kind == "document" and robot is None:
        from aerodaas.cli.flying.document_check import check_file  # noqa: PLC0415 - as above

        raise typer.Exit(0 if check_file(application, options, as_json=as_json) else 1)
    alone = kind == "environment"
    if alone:
        current_options.set(options)
        environment = Environment(application.resolve())
    else:
        environment = build_application(application, context.args, options)
    if robot is not None:
        if environment.provider is not None:
            raise ConfigError(f"{robot} is a provider's: `aerodaas fleet` tells its health")
        raise typer.Exit(0 if show_health(robot, environment.config, as_json=as_json) else 1)
    findings = (
        _environment_alone(environment, connect=connect)
        if alone
        else examine_application(environment, application.stem, connect=connect)
    )
    if as_json:
        told = list(findings)
        typer.echo(json.dumps([asdict(one) for one in told]))
        raise typer.Exit(0 if all(one.ok for one in told) else 1)
    raise typer.Exit(0 if show_findings(f"aerodaas check {application.name}", findings) else 1)


def examine_application(
    environment: Environment, name: str, *, connect: bool = True
) -> Iterator[Finding]:
    """Examine an application that was built up to `start_mission()`.

    Args:
        environment: What it built.
        name: Of the application.
        connect: Whether vehicles and cameras are connected; never those of a provider.

    Yields:
        One finding for each part, as soon as it is known.

    Raises:
        AeroDaaSError: If the graph cannot be planned, so that no part needs looking at.
    """
    from aerodaas.environment.run import Run  # noqa: PLC0415 - slow to load

    graph = environment.graph
    provided = environment.provider is not None
    if not provided:
        Run(environment).plan()
    flying = ", ".join(dict.fromkeys(edge.robot for edge in graph.navigation))
    analyses = [node for node in graph.nodes.values() if node.kind != "sensor"]
    yield Finding("graph", f"analyses: {len(analyses)}; navigated: {flying}")
    yield _portable(environment, name)
    for text in graph.unused:
        yield Finding("graph", text, ok=False)
    for node in analyses:
        yield _tried(node.id, partial(_analysis, node))
    if connect and not provided:
        robots = {edge.robot for edge in graph.navigation}
        cameras = [one for one in environment.config.all_sensors() if one.full_id in graph.nodes]
        yield from _hardware(environment, robots, cameras)


def _kind_of(file: Path) -> Literal["application", "document", "environment"]:
    """Kind of a file: an environment's, a mission document, or an application's."""
    from aerodaas.text.json_text import read_json  # noqa: PLC0415 - only for JSON

    if file.suffix != ".json":
        return "application"
    content = read_json(file, "the file")
    return "environment" if isinstance(content, dict) and "robots" in content else "document"


def _environment_alone(environment: Environment, *, connect: bool) -> Iterator[Finding]:
    """Findings of an environment that no application uses yet."""
    from aerodaas.runtime.checks import check_plugins  # noqa: PLC0415 - slow to load

    config = environment.config
    cameras = [one for one in config.all_sensors() if config.has_pictures(one)]
    compute = "auto" if config.compute == "auto" else ", ".join(one.id for one in config.compute)
    counts = f"robots: {len(config.robots)}; sensors: {len(config.all_sensors())}"
    yield Finding("environment", f"{counts}; compute: {compute}")
    check_plugins(
        config, config.robots, [one for one in cameras if one.type == "camera"], here=True
    )
    if connect:
        yield from _hardware(environment, {one.id for one in config.robots}, cameras)


def _hardware(
    environment: Environment, flying: set[str], sensors: Sequence[SensorConfig]
) -> Iterator[Finding]:
    """Ask the vehicles of the robots `flying`, then those of the `sensors` that are cameras."""
    config = environment.config
    # A vehicle's camera may need the vehicle, so all stay connected until the last was asked.
    vehicles: dict[str, Vehicle] = {}
    with ExitStack() as connected:
        for robot in config.robots:
            if robot.id in flying:
                yield _tried(robot.id, partial(_vehicle, environment, robot, vehicles, connected))
        for sensor in sensors:
            if sensor.type == "camera":
                yield _tried(sensor.full_id, partial(_camera, environment, sensor, vehicles))


def _tried(subject: str, look: Callable[[], str]) -> Finding:
    try:
        return Finding(subject, look())
    except AeroDaaSError as error:
        return Finding(subject, str(error), ok=False)
    except Exception as error:  # noqa: BLE001 - a user's class may raise anything
        return Finding(subject, failure_line(error), ok=False)


def _portable(environment: Environment, name: str) -> Finding:
    from aerodaas.environment.document.compiling import write_mission  # noqa: PLC0415

    try:
        write_mission(environment, name)
    except GraphError as error:
        return Finding("document", f"flies here alone: {error}")
    return Finding("document", "can be written as a mission document, which any provider can fly")


def _analysis(node: Node) -> str:
    began = time.perf_counter()
    node.work.open()
    with suppress(Exception):
        node.work.close()
    where = f" on {node.compute}" if node.compute else ""
    return f"{type(node.work).__name__}{where} opens in {time.perf_counter() - began:.1f} s"


def _vehicle(
    environment: Environment,
    robot: RobotConfig,
    vehicles: dict[str, Vehicle],
    connected: ExitStack,
) -> str:
    from aerodaas.drivers.loading import load_vehicle  # noqa: PLC0415 - slow to load
    from aerodaas.messages.health import Verdict  # noqa: PLC0415 - as above

    vehicle = load_vehicle(robot, environment.config, observing=True)
    connected.callback(vehicle.close)
    vehicle.connect(_CONNECTING)
    vehicles[robot.id] = vehicle
    items = settled_items(vehicle, robot)
    refused = [one.text for one in items if one.verdict is Verdict.REFUSED]
    if refused:
        raise VehicleError(f"{robot.driver} would not take off: {'; '.join(refused)}")
    warned = "".join(f"; {one.text}" for one in items if one.verdict is Verdict.WARNING)
    state = vehicle.read()
    charge = 100 * state.battery.fraction
    battery = "battery unknown" if math.isnan(charge) else f"battery {charge:.0f} %"
    return f"{robot.driver} answers: {state.mode.value}, {battery}{warned}"


def _camera(environment: Environment, sensor: SensorConfig, vehicles: dict[str, Vehicle]) -> str:
    from aerodaas.config.plugins import load_plugin  # noqa: PLC0415 - slow to load

    driver = environment.config.camera_driver(sensor)
    camera: Camera = load_plugin("cameras", driver)(sensor, environment.config)
    carrier = vehicles.get(sensor.robot or "")
    truth = carrier.read().truth if carrier is not None else None
    camera.open()
    try:
        until = time.monotonic() + _FIRST_PICTURE
        while (picture := camera.capture(0, truth)) is None:
            if camera.finished or time.monotonic() > until:
                raise SourceError(f"{driver} gives no picture within {_FIRST_PICTURE:.0f} s")
            time.sleep(1.0 / sensor.rate)
    finally:
        camera.close()
    height, width, _ = picture.image.shape
    return f"{driver} gives pictures of {width} x {height}"

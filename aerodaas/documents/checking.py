"""Check of a mission document without flying: everything against it, with figures and remedies."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from itertools import islice

from aerodaas.config.model import EnvironmentConfig, RobotConfig
from aerodaas.config.plugins import load_plugin
from aerodaas.dataflow.mission_document import MissionDocument
from aerodaas.documents.arguments import check_arguments
from aerodaas.documents.graph import GraphCheck
from aerodaas.documents.route import RouteCheck
from aerodaas.errors import AeroDaaSError
from aerodaas.protocol.proposals import CheckReport, Finding, RobotForecast
from aerodaas.schedulers.trajectory.base import TrajectoryScheduler
from aerodaas.schedulers.trajectory.nearest_neighbor import NearestNeighborScheduler
from aerodaas.schedulers.trajectory.ordered import OrderedScheduler

__all__ = ["check_document"]

_MOST = 100
"""Findings of a report; whoever mends those may ask again."""
_UNKNOWN: Mapping[str, float] = {}


def check_document(
    document: MissionDocument,
    config: EnvironmentConfig,
    *,
    battery: Mapping[str, float] = _UNKNOWN,
    minutes: float | None = None,
) -> CheckReport:
    """Check a mission document without flying, and forecast the way of each robot.

    No analysis is made and no model is loaded. What only a flight shows, a rehearsal finds.

    Args:
        document: The mission document.
        config: Environment in which it would fly, narrowed to what the flight may do.
        battery: Charge by robot, 0 to 1; a robot that is not named begins with that of its
            simulated battery, or full.
        minutes: Time within which every robot has to have landed; None for no limit.

    Returns:
        The findings, at most 100, and the forecasts; passed if nothing was found.
    """
    checks = []
    for robot in _navigated(document, config):
        scheduler, certain = _planning_scheduler(document, config)
        charge = battery.get(robot.id, _simulated_charge(robot))
        entries = [entry for entry in document.navigation if entry.robot == robot.id]
        checks.append(RouteCheck(robot, config, entries, scheduler, certain, charge, minutes))
    findings = list(islice(_findings(document, config, checks), _MOST))
    forecasts: list[RobotForecast] = [check.forecast for check in checks]
    return CheckReport(passed=not findings, findings=findings, forecasts=forecasts)


def _findings(
    document: MissionDocument, config: EnvironmentConfig, checks: list[RouteCheck]
) -> Iterator[Finding]:
    yield from GraphCheck(document, config).run()
    for check in checks:
        yield from check.run()


def _navigated(document: MissionDocument, config: EnvironmentConfig) -> list[RobotConfig]:
    known = {robot.id: robot for robot in config.robots}
    names = dict.fromkeys(entry.robot for entry in document.navigation)
    return [known[name] for name in names if name in known]


def _simulated_charge(robot: RobotConfig) -> float | None:
    charge = robot.settings.get("battery") if robot.driver == "simulated" else None
    return float(charge) if isinstance(charge, int | float) else None


def _planning_scheduler(
    document: MissionDocument, config: EnvironmentConfig
) -> tuple[TrajectoryScheduler, bool]:
    """The scheduler by which the way is forecast, and whether the flight has the same.

    A search for the best way takes seconds; the nearest waypoint first stands for it.
    """
    wanted = document.trajectory_scheduler
    name = config.schedulers.trajectory if wanted is None else wanted.name
    settings = {} if wanted is None else wanted.settings
    if name == "optimal":
        return NearestNeighborScheduler(), False
    try:
        check_arguments("trajectory_schedulers", name, settings)
        made = load_plugin("trajectory_schedulers", name)(None, **settings)
    except AeroDaaSError:
        return OrderedScheduler(), False
    known = isinstance(made, TrajectoryScheduler)
    return (made if known else OrderedScheduler()), known

"""Track error and time of a 2 km survey: our setpoints beside the autopilot's own mission mode.

python benchmarks/track.py --from ~/ardupilot --speed 10 --wind 8
python benchmarks/track.py --autopilot px4 --from ~/PX4-Autopilot --speed 10 --wind 0

An ArduCopter or a PX4 (with SIH) in simulation flies the same plan twice, once by our setpoints and
once handed over to its own mission mode: five lines of 360 m, 45 m apart, and the ways between
them, without a stop.
Errors are metres from the plan's lines over ground and in height, by the autopilot's own position,
from the first waypoint to the last; in the middle of lines, 30 m and more from a corner, and near
corners. Times are the autopilot's. It runs by the wall clock, some three to eight minutes a flight.
"""

from __future__ import annotations

import tempfile
import time
from pathlib import Path
from typing import Annotated

import numpy as np
import typer
from _report import Report
from numpy.typing import NDArray

from aerodaas.clock import ScaledClock
from aerodaas.config.model import EnvironmentConfig, RobotConfig
from aerodaas.dataflow.navigation import AeroNavigation
from aerodaas.drivers.mavlink.vehicle import MavlinkVehicle
from aerodaas.extensions.sitl.process import Family, SitlOptions, SitlProcess
from aerodaas.messages.mission import MissionState
from aerodaas.messages.waypoints import NavigationType, SchedulingType, Waypoint
from aerodaas.mission.commands import AddNavigation, HandOver, Start
from aerodaas.mission.loop import SetpointLoop
from aerodaas.mission.mission import Mission
from aerodaas.mission.navigation.planner import InlinePlanner
from aerodaas.schedulers.trajectory.ordered import OrderedScheduler

UNITS = {
    "time": "s",
    "across, median": "m",
    "across, p95": "m",
    "on lines, p95": "m",
    "at corners, p95": "m",
    "height, p95": "m",
}
_PERIOD = 0.05
_HEIGHT, _LINE, _GAP, _LINES = 30.0, 360.0, 45.0, 5
_CORNER = 30.0
"""Metres from a corner within which a place counts as near it."""
_BATTERY = {
    "ardupilot": {"BATT_CAPACITY": 60000.0, "SIM_BATT_CAP_AH": 60.0},
    "px4": {"SIM_BAT_DRAIN": 7200.0},
}
"""One that lasts for the longest flight."""
_LONGEST = 1200.0
"""Seconds of a flight."""


def survey(speed: float) -> list[Waypoint]:
    """The corners, the first of them 20 m from home."""
    stops = [Waypoint("entry", 0.0, 20.0, _HEIGHT, speed=speed)]
    for line in range(_LINES):
        north = 20.0 + line * _GAP
        ends = (0.0, _LINE) if line % 2 == 0 else (_LINE, 0.0)
        stops += [
            Waypoint(f"{line}{end:g}", end, north, _HEIGHT, speed=speed)
            for end in ends
            if (line, end) != (0, 0.0)
        ]
    return stops


def fly(
    autopilot: Family, url: str, speed: float, wind: float, radius: float, *, own: bool
) -> dict[str, float]:
    """Figures of one flight; `own`: by the autopilot's own mission mode."""
    limits = {
        "cruise_speed": speed,
        "max_speed": max(speed, 10.0),
        "max_range": 2000.0,
        "arrival_radius": radius,
        "takeoff_height": _HEIGHT,
        "takeoff_timeout": 90.0,
        "preflight_timeout": 90.0,
        "battery_return": 0.02,
        "battery_land": 0.01,
        "endurance": 36000.0,
    }
    settings = {"url": url, "ready_timeout": 120.0, "max_speed": max(speed, 10.0)}
    settings |= {"failsafes": "ignore", "fallback": "ignore"}
    robot = RobotConfig.model_validate(
        {"id": "drone", "driver": "mavlink", "settings": settings, "limits": limits}
    )
    vehicle = MavlinkVehicle(robot, EnvironmentConfig(robots=[robot]))
    vehicle.connect(60.0)
    try:
        air = {"SIM_WIND_SPD": wind, "SIM_WIND_DIR": 60.0} if autopilot == "ardupilot" else {}
        for name, value in {**_BATTERY[autopilot], **air}.items():
            vehicle.parameters.set(name, value)
        return _figures(*_flown(vehicle, robot, survey(speed), own=own), survey(speed))
    finally:
        vehicle.close()


def _flown(
    vehicle: MavlinkVehicle, robot: RobotConfig, stops: list[Waypoint], *, own: bool
) -> tuple[NDArray[np.float64], float]:
    """Places between the first waypoint and the last, ENU metres, and the seconds between them."""
    clock = ScaledClock()
    takeoff = vehicle.read().odometry.position
    mission = Mission(robot, InlinePlanner(OrderedScheduler()), takeoff=takeoff, vehicle=vehicle)
    loop = SetpointLoop(vehicle, mission)
    vehicle.use_clock(clock)
    order = AeroNavigation(NavigationType.DISTANCE_DRIVEN, stops, SchedulingType.ORDERED)
    mission.handle(AddNavigation(order), clock.now())
    mission.handle(Start(), clock.now())
    places: list[NDArray[np.float64]] = []
    times: list[float] = []
    due = began = time.monotonic()
    while mission.status.visits < len(stops):
        time.sleep(max(0.0, due - time.monotonic()))
        due = max(due + _PERIOD, time.monotonic())
        loop.step(clock.now())
        state, status = loop.state, mission.status
        assert state is not None  # noqa: S101 - the loop has turned
        if mission.finished or time.monotonic() - began > _LONGEST:
            raise typer.BadParameter(f"the flight ended {status.state.value}: {status.reason}")
        if own and status.state is MissionState.ENROUTE and not mission.handover.active:
            answer = mission.handle(HandOver(), clock.now())
            if not answer.accepted or len(mission.alerts) > 1:
                told = [alert.text for alert in mission.alerts]
                raise typer.BadParameter(f"not handed over: {answer.text} {told}")
        if 0 < status.visits < len(stops):
            places.append(state.odometry.position - takeoff)
            times.append(state.extra["autopilot_time"])
    return np.array(places), times[-1] - times[0]


def _figures(
    places: NDArray[np.float64], duration: float, stops: list[Waypoint]
) -> dict[str, float]:
    corners = np.array([stop.position for stop in stops])
    starts, ways = corners[:-1, :2], np.diff(corners[:, :2], axis=0)
    offsets = places[:, None, :2] - starts[None]
    shares = np.clip(np.sum(offsets * ways, axis=2) / np.sum(ways * ways, axis=1), 0.0, 1.0)
    across = np.linalg.norm(offsets - shares[..., None] * ways, axis=2).min(axis=1)
    from_corner = np.linalg.norm(places[:, None, :2] - corners[None, :, :2], axis=2).min(axis=1)
    near = from_corner < _CORNER
    return {
        "time": duration,
        "across, median": float(np.median(across)),
        "across, p95": float(np.percentile(across, 95)),
        "on lines, p95": float(np.percentile(across[~near], 95)),
        "at corners, p95": float(np.percentile(across[near], 95)),
        "height, p95": float(np.percentile(np.abs(places[:, 2] - _HEIGHT), 95)),
    }


def main(
    source: Annotated[
        Path | None, typer.Option("--from", help="Its source tree or program.")
    ] = None,
    speed: Annotated[list[float], typer.Option(help="m/s; may be repeated.")] = [5.0, 10.0, 15.0],  # noqa: B006
    wind: Annotated[list[float], typer.Option(help="m/s; may be repeated.")] = [0.0, 8.0],  # noqa: B006
    autopilot: Annotated[Family, typer.Option(help="Whose simulation flies.")] = "ardupilot",
    who: Annotated[list[str], typer.Option(help="setpoints, mission")] = ["setpoints", "mission"],  # noqa: B006
    radius: Annotated[float, typer.Option(help="arrival_radius; an ArduCopter's is 2 m.")] = 2.0,
    instance: Annotated[int, typer.Option(help="Number of the simulator among several.")] = 0,
    out: Annotated[Path | None, typer.Option(help="File for the figures as JSON.")] = None,
) -> None:
    """Fly each speed in each wind, by our setpoints and by the autopilot's own mission mode."""
    if autopilot == "px4" and any(wind):
        raise typer.BadParameter("PX4's SIH is flown without wind here: give --wind 0")
    report = Report("track", UNITS, packages=["pymavlink"])
    report.note(
        "across: metres from the plan's lines over ground, by the autopilot's own position; at "
        f"corners: within {_CORNER:g} m of one. time: from the first waypoint to the last."
    )
    for one in speed:
        for air in wind:
            for flown in who:
                with tempfile.TemporaryDirectory() as state:
                    options = SitlOptions(Path(state), source=source, instance=instance)
                    with SitlProcess(autopilot, options):
                        host, port = options.heard_at
                        url = f"udpin:{host}:{port}"
                        figures = fly(autopilot, url, one, air, radius, own=flown == "mission")
                report.row(f"{one:g} m/s, wind {air:g} m/s, {flown}", figures)
                report.show()
    if out is not None:
        report.write(out)


if __name__ == "__main__":
    typer.run(main)

"""The paper's listings 3, 4 and 5, as printed; what stands for their ellipses is marked.

A scripted detector stands where a model would, and the printed distances are shortened by the
environments' fast drones, not by the code.
"""

# The paper's own lines, and its spellings, which exist at run time only.
# mypy: disable-error-code="attr-defined,type-arg,no-redef,assignment,arg-type"
# pyright: reportAttributeAccessIssue=false, reportAssignmentType=false, reportRedeclaration=false
# pyright: reportArgumentType=false

from __future__ import annotations

from itertools import groupby
from typing import Any

import numpy as np
import pytest
from flying import FLAT, Flyer, recorded, robot
from scripted import RemoteUser, ScriptedDetector, free_port

from aerodaas import (
    AeroListData,
    AeroNavigation,
    AeroStreamData,
    Bbox,
    Environment,
    IAeroData,
    IAnalyse,
    ICompute,
    IEnvironment,
    Image,
    INavigableAnalyse,
    IPushSensor,
    IRobot,
    MonitoringAnalytics,
    NavigationType,
    NearestNeighborScheduler,
    Odom,
    PriorityQueue,
    SchedulingType,
    Waypoint,
)
from aerodaas.analytics import CarFollowAnalytics, RemoteAnalytics, VipFollowAnalytics
from aerodaas.environment.run import Run
from aerodaas.recording.report.flight import RobotFlight

pytestmark = pytest.mark.slow

_QUICK = {"cruise_speed": 8.0, "max_speed": 10.0, "max_climb": 4.0, "max_acceleration": 6.0}


def environment(name: str, camera: str, **more: Any) -> dict[str, Any]:  # noqa: ANN401
    """A quick drone over flat ground, with the names that the listing uses."""
    sensors = [
        {
            "id": camera,
            "type": "camera",
            "rate": 4,
            "settings": {"width": 96, "height": 54, "horizontal_fov": 80},
        },
        {"id": "odom", "type": "odometry", "rate": 10},
    ]
    limits = {**_QUICK, "takeoff_height": 4.0, "silence_return": 4.0}
    return {**FLAT, "robots": [robot(name, limits=limits, sensors=sensors)], **more}


def mission_of(run: Run, name: str) -> RobotFlight:
    """The drone's part of the recording."""
    return recorded(run).robots[name]


def states(mission: RobotFlight) -> list[str]:
    """The states that the mission went through."""
    return [state for state, _ in groupby(band.state for band in mission.bands)]


def farm_waypoints(scheduler: NearestNeighborScheduler) -> AeroNavigation:
    """The lines of listing 2 that listings 3 and 5 refer to."""
    wp1: Waypoint = Waypoint(id="wp1", x=20, y=20, z=10, hover_duration=5, waypoint_type="relative")
    wp2: Waypoint = Waypoint(
        id="wp2", x=20, y=100, z=10, hover_duration=5, waypoint_type="relative"
    )
    wp3: Waypoint = Waypoint(
        id="wp3", x=60, y=100, z=10, hover_duration=5, waypoint_type="relative"
    )
    wp4: Waypoint = Waypoint(id="wp4", x=60, y=20, z=10, hover_duration=5, waypoint_type="relative")
    waypoints_list: AeroNavigation = AeroNavigation(
        NavigationType.DISTANCE_DRIVEN, [wp1, wp2, wp3, wp4], SchedulingType.UNORDERED
    )
    drone_nav_data: AeroNavigation = scheduler.generateNavigation(waypoints_list)
    return drone_nav_data


def test_listing_3_disaster_zone_survey(flyer: Flyer) -> None:
    """Human in the loop: a remote user adds a waypoint to the survey that is being flown."""
    port = free_port()

    def build(env: Environment) -> None:
        # Initialize env, edge resource, PX4-based drone
        edge_compute: ICompute = env.getComputeResourceById("edge")
        drone: IRobot = env.getRobotById("quadrotor_base")
        scheduler = NearestNeighborScheduler(env)
        env.setTrajectoryScheduler(scheduler)
        camera: IPushSensor = drone.getSensorById("cam1")
        cam_data_stream: AeroStreamData[Image] = camera.getDataStream()
        odometry: IPushSensor = drone.getSensorById("odom")
        odometry_data_stream: AeroStreamData[Odom] = odometry.getDataStream()
        # Drone odometry monitoring
        odometry_analytics: IAnalyse = MonitoringAnalytics(["battery", "height", "gps", "camera"])
        odometry_analytics.deploy(edge_compute)
        _: AeroStreamData[Odom] = odometry_analytics.analyse(odometry_data_stream)
        drone_nav_data = farm_waypoints(scheduler)
        remote_analytics: IAnalyse = RemoteAnalytics(env.env_data)
        remote_analytics.deploy(edge_compute)
        remote_nav_data: AeroStreamData = remote_analytics.analyse(cam_data_stream)
        remote_nav_data: AeroNavigation = AeroNavigation(
            NavigationType.ANALYTICS_DRIVEN, remote_nav_data.data, SchedulingType.ORDERED
        )
        scheduler.addNavigation(remote_nav_data)
        drone.navigate(drone_nav_data)

    pictures: list[bytes] = []

    def look_closer(user: RemoteUser) -> None:
        user.until(lambda status: "wp1" in status.mission.visited)
        user.client.add_waypoints([{"id": "closer", "x": 30, "y": 60, "z": 5}])
        pictures.append(user.client.frame())

    content = environment("quadrotor_base", "cam1", remote={"port": port})
    with RemoteUser(port, look_closer):
        mission = mission_of(flyer.fly(build, content), "quadrotor_base")
    assert set(mission.visited) == {"wp1", "wp2", "wp3", "wp4", "closer"}
    assert mission.visited[0] == "wp1"
    assert states(mission)[-1] == "landed"
    assert pictures[0].startswith(b"\xff\xd8")


def test_listing_4_surveillance_and_tracking(flyer: Flyer) -> None:
    """Seeing the car preempts the survey; once it has gone, the survey goes on where it was."""

    def build(env: Environment) -> None:
        # Initialize env, edge resource, tello drone; the camera's stream through a stand-in model
        edge_compute: ICompute = env.getComputeResourceById("edge_cloud")
        drone: IRobot = env.getRobotById("tello")
        scheduler = NearestNeighborScheduler(env)
        env.setTrajectoryScheduler(scheduler)
        camera: IPushSensor[Image] = drone.getSensorById("tello_cam1")
        # Low in the picture: from 10 m up, a car on the ground is nowhere else.
        seen = ScriptedDetector("car", 6.0, 11.0, (0.8, 0.88, 0.9, 0.95))
        camera_data_stream = seen.analyse(camera.getDataStream())
        # As printed
        wp1: Waypoint = Waypoint(id="wp1", waypoint_type="relative", x=20, y=20, z=10)
        wp2: Waypoint = Waypoint(id="wp2", waypoint_type="relative", x=40, y=20, z=10)
        wp3: Waypoint = Waypoint(id="wp3", waypoint_type="relative", x=60, y=20, z=10)
        waypoints_list: AeroListData = AeroListData([wp1, wp2, wp3])
        low_priority_queue: PriorityQueue[AeroListData] = PriorityQueue(waypoints_list, priority=2)
        drone_nav_data: IAeroData[AeroNavigation] = scheduler.generateNavigation(low_priority_queue)
        car_analytics: IAnalyse = CarFollowAnalytics(env)
        car_analytics.deploy(edge_compute)
        car_nav_data: IAeroData[AeroNavigation] = car_analytics.analyse(camera_data_stream)
        car_nav_queue: PriorityQueue[AeroNavigation] = PriorityQueue(car_nav_data, priority=1)
        scheduler.addNavigation(car_nav_queue)
        drone.navigate(drone_nav_data)

    content = environment("tello", "tello_cam1", compute=[{"id": "edge_cloud", "kind": "edge"}])
    mission = mission_of(flyer.fly(build, content), "tello")
    assert mission.visited == ("wp1", "wp2", "wp3")
    way = states(mission)
    first = way.index("diverted")
    assert way[first - 1] == "enroute"
    assert "enroute" in way[first:]
    assert way[-1] == "landed"


def test_listing_5_search_and_rescue(flyer: Flyer) -> None:
    """Seeing the vest aborts the search for good, and the drone follows the person."""

    def build(env: IEnvironment) -> None:
        # Initialize env, edge resource, tello drone
        edge_compute: ICompute = env.getComputeResourceById("edge_cloud")
        drone: IRobot = env.getRobotById("tello")
        scheduler = NearestNeighborScheduler(env)
        env.setTrajectoryScheduler(scheduler)
        camera: IPushSensor[Image] = drone.getSensorById("tello_cam1")
        camera_data_stream: AeroStreamData[Image] = camera.getDataStream()
        drone_nav_data = farm_waypoints(scheduler)
        # Detect vip in the area, by a stand-in for the model
        vip_detect_analytics: IAnalyse = ScriptedDetector("vest", 8.0, 14.0, (0.55, 0.4, 0.65, 0.7))
        vip_detect_analytics.deploy(edge_compute)
        vip_detect_data_stream: AeroStreamData[Bbox] = vip_detect_analytics.analyse(
            camera_data_stream
        )
        # Follow VIP based on bounding box
        vip_follow_analytics: INavigableAnalyse = VipFollowAnalytics()
        vip_follow_analytics.deploy(edge_compute)
        vip_nav_data: IAeroData[AeroNavigation] = vip_follow_analytics.analyse(
            vip_detect_data_stream
        )
        # On detecting vip, reset the queue and start vip following mission
        scheduler.clearNavigation()  # Reset the queue
        scheduler.addNavigation(vip_nav_data)
        drone.navigate(drone_nav_data)

    content = environment("tello", "tello_cam1", compute=[{"id": "edge_cloud", "kind": "edge"}])
    mission = mission_of(flyer.fly(build, content), "tello")
    assert set(mission.plan) >= {"wp1"}
    assert mission.visited in {(), ("wp1",)}
    way = states(mission)
    following = way.index("following")
    assert way[following - 1] in {"enroute", "loitering"}
    assert {"enroute", "loitering", "diverted"}.isdisjoint(way[following:])
    assert way[-1] == "landed"
    assert np.linalg.norm(mission.position[-1, :2]) < 2.0

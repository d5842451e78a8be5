"""Farm Survey: visit four waypoints of a field, hover at each, come back (paper, section 6)."""

from aerodaas import (
    AeroNavigation,
    Environment,
    MonitoringAnalytics,
    NavigationType,
    NearestNeighborScheduler,
    SchedulingType,
    Waypoint,
)


def main() -> None:
    """Build the dataflow and fly it."""
    env = Environment("environments/farm.json")
    edge = env.get_compute_resource_by_id("edge")
    drone = env.get_robot_by_id("quadrotor_base")
    scheduler = NearestNeighborScheduler(env)
    env.set_trajectory_scheduler(scheduler)

    odometry = drone.get_sensor_by_id("odom").get_data_stream()
    MonitoringAnalytics(["battery", "height", "gps"]).deploy(edge).analyse(odometry)

    corners = [(0, 0), (0, 10), (10, 10), (10, 0)]
    survey = [
        Waypoint(f"wp{i}", x, y, 1.5, hover_duration=5) for i, (x, y) in enumerate(corners, 1)
    ]
    waypoints = AeroNavigation(NavigationType.DISTANCE_DRIVEN, survey, SchedulingType.UNORDERED)
    drone.navigate(scheduler.generate_navigation(waypoints))
    drone.start_mission()


if __name__ == "__main__":
    main()

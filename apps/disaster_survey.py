"""Disaster Survey: survey an area to which a remote user adds in flight (paper, section 6).

aerodaas remote add-waypoint 10 30 1.5
"""

from aerodaas import AeroNavigation, Environment, NavigationType, SchedulingType, Waypoint
from aerodaas.analytics import MonitoringAnalytics, RemoteAnalytics


def main() -> None:
    """Build the dataflow and fly it."""
    env = Environment("environments/disaster.json")
    edge = env.get_compute_resource_by_id("edge")
    drone = env.get_robot_by_id("quadrotor_base")
    scheduler = env.trajectory_scheduler()

    camera = drone.get_sensor_by_id("cam1").get_data_stream()
    odometry = drone.get_sensor_by_id("odom").get_data_stream()
    watch = MonitoringAnalytics(["battery", "height", "gps", "camera"]).deploy(edge)
    watch.analyse(odometry)
    watch.analyse(camera)

    corners = [(0, 0), (10, 0), (10, 10), (0, 10)]
    survey = [
        Waypoint(f"wp{i}", x, y, 1.5, hover_duration=3) for i, (x, y) in enumerate(corners, 1)
    ]
    planned = AeroNavigation(NavigationType.DISTANCE_DRIVEN, survey, SchedulingType.UNORDERED)
    remote = RemoteAnalytics(env.env_data).deploy(edge).analyse(camera)
    added = AeroNavigation(NavigationType.ANALYTICS_DRIVEN, remote, SchedulingType.UNORDERED)
    scheduler.add_navigation(added)
    drone.navigate(scheduler.generate_navigation(planned))
    drone.start_mission()


if __name__ == "__main__":
    main()

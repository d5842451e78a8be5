"""Survey: visit the places of a field in a short order, look around at each, come home."""

from aerodaas import AeroNavigation, Environment, MonitoringAnalytics, Waypoint

PLACES = [(0, 8), (8, 8), (8, 0)]
"""Metres east and north of the take-off."""


def main() -> None:
    """Build the dataflow and fly it."""
    env = Environment("environment.json")
    edge = env.get_compute_resource_by_id("edge")
    drone = env.get_robot_by_id("drone")

    odometry = drone.get_sensor_by_id("odometry").get_data_stream()
    watch = MonitoringAnalytics(["battery", "height"], max_height=6.0)
    watch.deploy(edge).analyse(odometry)

    stops = [Waypoint(f"stop{i}", x, y, 3, hover_duration=2) for i, (x, y) in enumerate(PLACES, 1)]
    drone.navigate(env.trajectory_scheduler().generate_navigation(AeroNavigation(data=stops)))
    drone.start_mission()


if __name__ == "__main__":
    main()

"""Driver: fly a drone of your own kind."""

from aerodaas import AeroNavigation, Environment, MonitoringAnalytics, Waypoint


def main() -> None:
    """Build the dataflow and fly it."""
    env = Environment("environment.json")
    edge = env.get_compute_resource_by_id("edge")
    drone = env.get_robot_by_id("drone")

    odometry = drone.get_sensor_by_id("odometry").get_data_stream()
    MonitoringAnalytics(["battery", "height"]).deploy(edge).analyse(odometry)

    stops = [Waypoint("first", 3, 0, 2), Waypoint("second", 3, 3, 2)]
    drone.navigate(AeroNavigation(data=stops))
    drone.start_mission()


if __name__ == "__main__":
    main()

"""Detector: fly over a field and find what is green, by a detector of your own."""

from greenness import Greenness

from aerodaas import AeroNavigation, Environment, Waypoint


def main() -> None:
    """Build the dataflow and fly it."""
    env = Environment("environment.json")
    edge = env.get_compute_resource_by_id("edge")
    drone = env.get_robot_by_id("drone")

    camera = drone.get_sensor_by_id("camera").get_data_stream()
    Greenness(least_share=0.02).deploy(edge).analyse(camera)

    drone.navigate(AeroNavigation(data=[Waypoint("there", 6, 6, 3, hover_duration=2)]))
    drone.start_mission()


if __name__ == "__main__":
    main()

"""Camera: fly with pictures from a camera of your own, and tell when they get dark."""

from darkness import Darkness

from aerodaas import AeroNavigation, Environment, Waypoint


def main() -> None:
    """Build the dataflow and fly it."""
    env = Environment("environment.json")
    edge = env.get_compute_resource_by_id("edge")
    drone = env.get_robot_by_id("drone")

    board = drone.get_sensor_by_id("board").get_data_stream()
    Darkness(below=100).deploy(edge).analyse(board)

    drone.navigate(AeroNavigation(data=[Waypoint("there", 3, 3, 2, hover_duration=2)]))
    drone.start_mission()


if __name__ == "__main__":
    main()

"""Extension: a flight planned by a scheduler that an extension of your own adds."""

from aerodaas import AeroNavigation, Environment, Waypoint


def main() -> None:
    """Build the dataflow and fly it."""
    env = Environment("environment.json")
    drone = env.get_robot_by_id("drone")

    stops = [Waypoint("near", 2, 0, 2), Waypoint("far", 6, 4, 2), Waypoint("middle", 4, 0, 2)]
    drone.navigate(AeroNavigation(data=stops))
    drone.start_mission()


if __name__ == "__main__":
    main()

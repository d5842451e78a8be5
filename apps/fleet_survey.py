"""Fleet Survey: one application flies three drones, which share out an area."""

from aerodaas import AeroNavigation, Environment, Waypoint


def main() -> None:
    """Share the waypoints out and fly them all at once."""
    env = Environment("environments/fleet.json")
    places = [(x, y) for x in range(-20, 21, 10) for y in range(10, 41, 10)]
    field = [Waypoint(f"{x},{y}", x, y, 3, waypoint_type="local") for x, y in places]

    for name, share in env.share_out(field, objective="time").items():
        env.get_robot_by_id(name).navigate(AeroNavigation(data=share))
    env.start_mission()


if __name__ == "__main__":
    main()

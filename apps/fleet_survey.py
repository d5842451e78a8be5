"""Fleet Survey: one application flies three drones, which share out an area."""

import numpy as np

from aerodaas import AeroNavigation, Environment, Waypoint
from aerodaas.schedulers.trajectory.base import PlanningContext
from aerodaas.schedulers.trajectory.fleet import share_out


def main() -> None:
    """Share the waypoints out and fly them all at once."""
    env = Environment("environments/fleet.json")
    drones = [env.get_robot_by_id(name) for name in ("left", "middle", "right")]
    places = [(x, y) for x in range(-20, 21, 10) for y in range(10, 41, 10)]
    field = [Waypoint(f"{x},{y}", x, y, 3, waypoint_type="local") for x, y in places]

    starts = {drone.robot_id: np.array(drone.config.start) for drone in drones}
    fleet = {name: PlanningContext(0.0, start, start) for name, start in starts.items()}
    shares = share_out(field, fleet, objective="time")
    for drone in drones:
        drone.navigate(AeroNavigation(data=shares[drone.robot_id]))
    drones[0].start_mission()


if __name__ == "__main__":
    main()

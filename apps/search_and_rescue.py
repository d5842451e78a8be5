"""Search and Rescue: search an area; the person found is escorted to safety (paper, section 6)."""

from aerodaas import AeroNavigation, Environment, MonitoringAnalytics, Waypoint
from aerodaas.analytics import Near, VipDetectionAnalytics, VipFollowAnalytics

SAFE = (57, 6)


def main() -> None:
    """Build the dataflow and fly it."""
    env = Environment("environments/rescue.json")
    edge = env.get_compute_resource_by_id("edge")
    drone = env.get_robot_by_id("tello")
    scheduler = env.trajectory_scheduler()

    camera = drone.get_sensor_by_id("cam1").get_data_stream()
    vests = VipDetectionAnalytics().deploy(edge).analyse(camera)
    follow = VipFollowAnalytics(distance=2).deploy(edge).analyse(vests)
    odometry = drone.get_sensor_by_id("odom").get_data_stream()
    watch = MonitoringAnalytics(["position"]).deploy(edge)
    watch.trigger(drone.end_mission, when=Near(SAFE, metres=3)).analyse(odometry)

    places = [(0, 12), (14, 13), (24, 26), (0, 26)]
    search = [Waypoint(f"wp{i}", x, y, 1.5, hover_duration=3) for i, (x, y) in enumerate(places, 1)]
    drone.navigate(AeroNavigation(data=search))
    scheduler.clear_navigation()
    scheduler.add_navigation(follow)
    drone.start_mission()


if __name__ == "__main__":
    main()

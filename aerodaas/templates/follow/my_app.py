"""Follow: keep two metres from a person in a hazard vest, until both have come to a place."""

from aerodaas import Environment, MonitoringAnalytics
from aerodaas.analytics import Near, VipDetectionAnalytics, VipFollowAnalytics

PLACE = (10.0, 0.0)
"""Metres east and north of the take-off."""


def main() -> None:
    """Build the dataflow and fly it."""
    env = Environment("environment.json")
    edge = env.get_compute_resource_by_id("edge")
    drone = env.get_robot_by_id("drone")

    camera = drone.get_sensor_by_id("camera").get_data_stream()
    vests = VipDetectionAnalytics().deploy(edge).analyse(camera)
    follow = VipFollowAnalytics(distance=2).deploy(edge).analyse(vests)

    odometry = drone.get_sensor_by_id("odometry").get_data_stream()
    watch = MonitoringAnalytics(["position"]).deploy(edge)
    watch.trigger(drone.end_mission, when=Near(PLACE, metres=3)).analyse(odometry)

    drone.navigate(follow)
    drone.start_mission()


if __name__ == "__main__":
    main()

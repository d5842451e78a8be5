"""Situation Awareness: follow a person in a hazard vest and watch over them (paper, section 6).

A raised hand lands the drone, a fall alerts people.
"""

from aerodaas import Environment
from aerodaas.analytics import (
    BodyPoseEmergencyAnalytics,
    GpsLoggerAnalytics,
    VipDetectionAnalytics,
    VipFollowAnalytics,
)


def main() -> None:
    """Build the dataflow and fly it."""
    env = Environment("environments/campus.json")
    edge = env.get_compute_resource_by_id("edge")
    drone = env.get_robot_by_id("tello")
    env.set_analytics_scheduler("dems")

    camera = drone.get_sensor_by_id("cam1").get_data_stream()
    vests = VipDetectionAnalytics().deploy(edge).analyse(camera)
    follow = VipFollowAnalytics(distance=2).deploy(edge).analyse(vests)
    BodyPoseEmergencyAnalytics().deploy(edge).analyse(camera)

    phone = env.get_env_sensor_by_id("phone").get_sensor_property("path")
    GpsLoggerAnalytics(phone).deploy(edge).instantiate()

    drone.navigate(follow)
    drone.start_mission()


if __name__ == "__main__":
    main()

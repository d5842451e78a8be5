"""Scheduler: a flight whose detections are scheduled by a scheduler of your own."""

from aerodaas import AeroNavigation, Environment, Waypoint
from aerodaas.analytics import OnnxDetector, PoseAnalytics


def main() -> None:
    """Build the dataflow and fly it."""
    env = Environment("environment.json")
    edge = env.get_compute_resource_by_id("edge")
    drone = env.get_robot_by_id("drone")
    env.set_analytics_scheduler("my_scheduler.py:MyScheduler")

    camera = drone.get_sensor_by_id("camera").get_data_stream()
    OnnxDetector(classes=["person"]).deploy(edge).analyse(camera)
    PoseAnalytics().deploy(edge).analyse(camera)

    drone.navigate(AeroNavigation(data=[Waypoint("there", 4, 2, 2, hover_duration=2)]))
    drone.start_mission()


if __name__ == "__main__":
    main()

"""Crowd Watch: how many people are where another application's drone flies.

It navigates no drone. It senses by the cameras of a flight at a provider, by that mission's id:

aerodaas submit apps/crowd_watch.py --attach MISSION
"""

from aerodaas import Environment
from aerodaas.analytics import CrowdDensityAnalytics, OnnxDetector


def main() -> None:
    """Build the dataflow, and sense beside the application that flies the drone."""
    env = Environment("environments/disaster.json")
    edge = env.get_compute_resource_by_id("edge")
    drone = env.get_robot_by_id("quadrotor_base")

    camera = drone.get_sensor_by_id("cam1").get_data_stream()
    people = OnnxDetector(classes=["person"]).deploy(edge).analyse(camera)
    CrowdDensityAnalytics().deploy(edge).analyse(people)
    drone.start_mission()


if __name__ == "__main__":
    main()

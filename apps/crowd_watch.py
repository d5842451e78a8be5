"""Crowd Watch: how many people are where a drone flies; a guest of the application that flies it.

aerodaas run apps/disaster_survey.py --guest apps/crowd_watch.py --grant crowd_watch=sense,compute
"""

from aerodaas import Environment
from aerodaas.analytics import CrowdDensityAnalytics, OnnxDetector


def main() -> None:
    """Build the dataflow and join the owner's flight."""
    env = Environment("environments/disaster.json")
    edge = env.get_compute_resource_by_id("edge")
    drone = env.get_robot_by_id("quadrotor_base")

    camera = drone.get_sensor_by_id("cam1").get_data_stream()
    people = OnnxDetector(classes=["person"]).deploy(edge).analyse(camera)
    CrowdDensityAnalytics().deploy(edge).analyse(people)
    drone.start_mission()


if __name__ == "__main__":
    main()

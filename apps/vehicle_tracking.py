"""Vehicle Tracking: a survey that follows a car it meets, and then resumes (paper, section 6)."""

from aerodaas import AeroNavigation, Environment, PriorityQueue, Waypoint
from aerodaas.analytics import CarFollowAnalytics, OnnxDetector

AREA = [(-8, -13), (50, -13), (50, 18), (-8, 18)]


def main() -> None:
    """Build the dataflow and fly it."""
    env = Environment("environments/vehicle.json")
    edge = env.get_compute_resource_by_id("edge")
    drone = env.get_robot_by_id("quadrotor_base")
    scheduler = env.trajectory_scheduler()

    camera = drone.get_sensor_by_id("cam1").get_data_stream()
    cars = OnnxDetector(classes=["car"], min_score=0.15).deploy(edge).analyse(camera)
    follow = CarFollowAnalytics(distance=6, height=2.5, area=AREA).deploy(edge).analyse(cars)

    places = [(0, 12), (12, 0), (30, 8)]
    survey = [Waypoint(f"wp{i}", x, y, 4, hover_duration=5) for i, (x, y) in enumerate(places, 1)]
    drone.navigate(PriorityQueue(AeroNavigation(data=survey), priority=2))
    scheduler.add_navigation(PriorityQueue(follow, priority=1))
    drone.start_mission()


if __name__ == "__main__":
    main()

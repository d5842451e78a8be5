"""Tower Inspection: a search that ends at a radio tower, which is inspected (paper, section 6)."""

from aerodaas import AeroNavigation, Environment, Waypoint
from aerodaas.analytics import OnnxDetector, TowerInspectionAnalytics


def main() -> None:
    """Build the dataflow and fly it."""
    env = Environment("environments/tower.json")
    edge = env.get_compute_resource_by_id("edge")
    drone = env.get_robot_by_id("quadrotor_base")
    scheduler = env.trajectory_scheduler()

    camera = drone.get_sensor_by_id("cam1").get_data_stream()
    inspection = TowerInspectionAnalytics(
        base=2, top=35, pictures="runs/tower_pictures", detector=OnnxDetector(classes=["tower"])
    )

    places = [(-12, 0), (-12, 16), (12, 16), (12, 0)]
    search = [Waypoint(f"wp{i}", x, y, 3, hover_duration=3) for i, (x, y) in enumerate(places, 1)]
    drone.navigate(AeroNavigation(data=search))
    scheduler.clear_navigation()
    scheduler.add_navigation(inspection.deploy(edge).analyse(camera))
    drone.start_mission()


if __name__ == "__main__":
    main()

"""Follow the person seen in recorded pictures: real frames, a real detector, a simulated drone."""

import argparse
from pathlib import Path

from aerodaas import Environment
from aerodaas.analytics import OnnxDetector, PersonFollowAnalytics


def main() -> None:
    """Build the dataflow and fly it."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("source", type=Path, help="folder of pictures, or a video file")
    parser.add_argument("model", help="detector: an ONNX file, or a fetched model's name")
    parser.add_argument("--rate", type=float, default=5.0, help="pictures per second")
    parser.add_argument("--distance", type=float, default=2.0, help="metres to keep to the person")
    words = parser.parse_args()

    env = Environment(
        "environments/watch_frames.json",
        overrides={"camera.path": str(words.source.resolve()), "camera.rate": words.rate},
    )
    edge = env.get_compute_resource_by_id("edge")
    drone = env.get_robot_by_id("drone")

    pictures = drone.get_sensor_by_id("camera").get_data_stream()
    people = OnnxDetector(words.model, classes=["person"]).deploy(edge).analyse(pictures)
    follow = PersonFollowAnalytics(distance=words.distance).deploy(edge).analyse(people)
    drone.navigate(follow)
    drone.start_mission()


if __name__ == "__main__":
    main()

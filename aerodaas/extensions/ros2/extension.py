"""What ROS 2 adds to the core: a driver, a camera, a live view, and bags read and written."""

from aerodaas.config.extensions import Command, Extension, LiveView

_COMMANDS = "aerodaas.extensions.ros2.bags.command"

EXTENSION = Extension(
    name="ros2",
    summary="Drones, cameras and flights on ROS 2 topics, and ROS 2 bags.",
    plugins={
        "drivers": {"ros2": "aerodaas.extensions.ros2.driver.vehicle:Ros2Vehicle"},
        "cameras": {"ros2": "aerodaas.extensions.ros2.driver.camera:Ros2Camera"},
    },
    commands=(
        Command(
            "import",
            f"{_COMMANDS}:import_bag",
            "Write topics of a ROS 2 bag as a recording, to replay, view and report on.",
        ),
    ),
    exports=(
        Command("ros2", f"{_COMMANDS}:ros2", "Write states, pictures and detections as a bag."),
    ),
    views=(
        LiveView(
            "ros2",
            "ROS 2 topics of the domain ROS_DOMAIN_ID, or 0",
            prepare="aerodaas.extensions.ros2.bags.live:prepare",
            open="aerodaas.extensions.ros2.bags.live:RosGraph",
        ),
    ),
    decoders={"cdr": "aerodaas.extensions.ros2.topics.types:decoder_of"},
)

"""What Remote ID adds to the core: settings, an item before take-off, MAVLink messages."""

from aerodaas.config.extensions import Extension

EXTENSION = Extension(
    name="remote_id",
    summary="Remote ID by Open Drone ID: a MAVLink vehicle's transmitter is told who operates it.",
    settings={
        "robot": "aerodaas.extensions.remote_id.settings:RobotRemoteId",
        "preflight": "aerodaas.extensions.remote_id.settings:RemoteIdLevel",
    },
    mavlink_components=("aerodaas.extensions.remote_id.component:RemoteIdComponent",),
    preflight_checks=("aerodaas.extensions.remote_id.component:preflight_check",),
)

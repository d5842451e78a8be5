"""What adds the autopilot's mission mode to the core: the handover of a mission's waypoints."""

from aerodaas.config.extensions import Extension

EXTENSION = Extension(
    name="handover",
    summary="Waypoints handed over to the autopilot's own mission mode, and taken back.",
    mavlink_components=("aerodaas.extensions.handover.mavlink:MavlinkMissionMode",),
    handovers=("aerodaas.extensions.handover.handover:AutopilotHandover",),
)

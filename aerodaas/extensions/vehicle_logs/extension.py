"""What vehicles' own logs add to the core: two commands, and a section of the report."""

from aerodaas.config.extensions import Command, Extension

EXTENSION = Extension(
    name="vehicle_logs",
    summary="Autopilots' own logs: fetched, attached to recordings, and shown in reports.",
    commands=(
        Command(
            "logs",
            "aerodaas.extensions.vehicle_logs.commands:app",
            "List, fetch and attach the logs that a robot's autopilot keeps.",
        ),
    ),
    report_sections=("aerodaas.extensions.vehicle_logs.plots:log_sections",),
)

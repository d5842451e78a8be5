"""What plans add to the core: navigation from and to files of ground stations."""

from aerodaas.config.extensions import Command, Extension

EXTENSION = Extension(
    name="plans",
    summary="Plans of QGroundControl and Mission Planner, and areas from KML and GeoJSON.",
    requires=("actuators", "payload"),
    commands=(
        Command(
            "plan",
            "aerodaas.extensions.plans.command_line:app",
            "Read the plans of QGroundControl and Mission Planner.",
        ),
    ),
    services={
        "plans.read": "aerodaas.extensions.plans.navigation:read_waypoints",
        "plans.write": "aerodaas.extensions.plans.navigation:write_waypoints",
    },
)

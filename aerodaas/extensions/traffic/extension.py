"""What traffic adds to the core: limits, a safety rule, an item before take-off, messages."""

from aerodaas.config.extensions import Extension

EXTENSION = Extension(
    name="traffic",
    summary="Other aircraft that a MAVLink vehicle hears of (ADS-B): a drone keeps away from them.",
    settings={"limits": "aerodaas.extensions.traffic.settings:TrafficLimits"},
    recorded_settings=(
        "robots[].limits.traffic.action",
        "robots[].limits.traffic.distance",
        "robots[].limits.traffic.height",
        "robots[].limits.traffic.lookahead",
    ),
    mavlink_components=("aerodaas.extensions.traffic.component:TrafficComponent",),
    safety_rules=("aerodaas.extensions.traffic.encounters:TrafficWatch",),
    preflight_checks=("aerodaas.extensions.traffic.encounters:preflight_check",),
)

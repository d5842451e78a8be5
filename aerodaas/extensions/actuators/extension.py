"""What actuators add to the core: themselves, an action, what performs it and commands."""

from aerodaas.config.extensions import Extension

EXTENSION = Extension(
    name="actuators",
    summary="Grippers, relays, servos and parachutes in a mission.",
    settings={"mission": "aerodaas.extensions.actuators.settings:ActuatorMission"},
    recorded_settings=(
        "robots[].mission.actuator_timeout",
        "robots[].mission.on_actuator_failure",
    ),
    mavlink_components=("aerodaas.extensions.actuators.mavlink:MavlinkActuators",),
    simulated_equipment=("aerodaas.extensions.actuators.simulated:SimulatedActuators",),
    actions=("aerodaas.extensions.actuators.actions:MoveActuator",),
    action_executors=("aerodaas.extensions.actuators.actuation:Actuation",),
    services={"actuators.objection": "aerodaas.extensions.actuators.objections:command_objection"},
)

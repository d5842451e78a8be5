"""What autopilots in simulation add to the core: the command `aerodaas sim`."""

from aerodaas.config.extensions import Command, Extension

EXTENSION = Extension(
    name="sitl",
    summary="PX4 and ArduCopter in simulation, software in the loop.",
    commands=(
        Command(
            "sim",
            "aerodaas.extensions.sitl.command_line:app",
            "Start PX4 or ArduCopter in simulation, which has to be installed already.",
        ),
    ),
)

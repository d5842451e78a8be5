"""What the extension adds; it names code as text, so that it imports nothing slow."""

from aerodaas.config.extensions import Command, Extension

EXTENSION = Extension(
    name="my_app",
    summary="A trajectory scheduler and a format of aerodaas export.",
    plugins={"trajectory_schedulers": {"farthest": "my_app_farthest:Farthest"}},
    exports=(
        Command(
            "heights",
            "my_app_heights:heights",
            "Write the greatest height of each drone, in metres.",
        ),
    ),
)

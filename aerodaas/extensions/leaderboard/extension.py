"""What the leaderboard adds to the core: its command."""

from aerodaas.config.extensions import Command, Extension

EXTENSION = Extension(
    name="leaderboard",
    summary="Analytics schedulers ranked on one fixed set of cases.",
    lab=(
        Command(
            "leaderboard",
            "aerodaas.extensions.leaderboard.command:leaderboard",
            "Rank all schedulers, and yours, on one fixed set of workloads, networks and seeds.",
        ),
    ),
)

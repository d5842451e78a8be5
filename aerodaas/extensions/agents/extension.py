"""What agents add to the core: a command, and an endpoint of the service."""

from aerodaas.config.extensions import Command, Extension

EXTENSION = Extension(
    name="agents",
    summary="Agents that propose missions over the Model Context Protocol, and never fly.",
    commands=(
        Command(
            "agent",
            "aerodaas.extensions.agents.command:agent",
            "Let an agent propose missions (MCP over standard input and output).",
            panel="At a provider",
        ),
    ),
    services={"agents.endpoint": "aerodaas.extensions.agents.endpoint:endpoint"},
)
